//! What rendering will take in memory, found out before it begins.

use super::job::Job;
use anyhow::Result;
use buzz::error::Error;
use buzz::infer::{Inference, SubPixels};
use buzz::output::{ExrSink, most_bytes, peak_bytes};
use buzz::plan::{PathFrame, ProbePoint};
use buzz::scene::{Requirements, Scene};
use buzz::sequence::{Quality, Settings, render_bytes_per_pixel};
use buzz::trace::lit_words;

/// What the planner holds for each frame that another could be inferred from.
const BYTES_PER_STEP: u64 = 16;

/// Planning that takes less is left to the estimate of rendering, which is more.
const WORTH_A_WORD: u64 = 256 << 20;

/// Stacks, and what each thread encodes at a time.
const BYTES_PER_THREAD: u64 = 2 << 20;

/// An error if rendering is estimated to take more than `allowed` bytes, or where nothing is said more than the machine has.
/// To be asked once the scene is read and planned. The run holds so many bytes `besides`.
pub fn refuse_over(allowed: Option<u64>, job: &Job, besides: u64) -> Result<()> {
    let held = peak_bytes();
    if allowed.is_some() && held == 0 {
        let message = "--memory: this system does not say how much memory a process holds; leave it out";
        return Err(Error::Usage(message.into()).into());
    }
    let Some(limit) = allowed.or_else(most_bytes) else { return Ok(()) };
    let estimate = held + rendering(job) + besides;
    if estimate <= limit {
        return Ok(());
    }
    let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
    let limit = if limit < 1 << 20 { format!("{limit} bytes") } else { format!("{} MiB", limit >> 20) };
    let (whose, more) = match allowed {
        Some(_) => ("allowed", "allow more, or"),
        None => ("that there are", "give --memory to try all the same, or"),
    };
    let message = format!(
        "--memory: rendering is estimated to take {} MiB ({} MiB of them for the scene), over the {limit} {whose}; {more} lower --resolution, --aa, --aov or --threads",
        mebibytes(estimate),
        mebibytes(held)
    );
    Err(Error::Usage(message).into())
}

/// An error if there are too many samples: they are numbered, old pixels in 30 bits and with sub-pixels in 31.
pub fn refuse_uncountable(settings: &Settings) -> Result<()> {
    let pixels = settings.window.pixels();
    let samples = pixels.saturating_mul(1 + SubPixels::most_per_pixel(settings.aa));
    if pixels < (1 << 30) - 1 && samples < 1 << 31 {
        return Ok(());
    }
    let message = format!(
        "--resolution, --aa: {pixels} pixels have {samples} samples; fewer than 2^30 pixels and 2^31 samples are rendered at once, larger images in parts (--crop)"
    );
    Err(Error::Usage(message).into())
}

/// An error if planning the whole range is estimated to take more than is `allowed`, or than the machine has.
pub fn refuse_planning_over(allowed: Option<u64>, job: &Job) -> Result<()> {
    let Some(limit) = allowed.or_else(most_bytes) else { return Ok(()) };
    let timing = &job.scene.timing;
    let frames = (timing.last - timing.first + 1) as u64;
    let (columns, rows) = PathFrame::PROBE;
    let probe = columns as u64 * rows as u64 * size_of::<ProbePoint>() as u64;
    let chain = u64::from(job.longest_segment).min(frames) * BYTES_PER_STEP;
    let planning = frames * (probe + chain);
    let estimate = peak_bytes() + planning;
    if planning < WORTH_A_WORD || estimate <= limit {
        return Ok(());
    }
    let message = format!(
        "to plan {frames} frames is estimated to take {} MiB, over the {} MiB that there are or that --memory allows; render the shot in parts (extras.buzz frame_start and frame_end), or give a lower --fps or --segment",
        estimate.div_ceil(1 << 20),
        limit >> 20
    );
    Err(Error::Usage(message).into())
}

/// What rendering takes besides what is held once the scene has been read, its trees built, and every frame posed and
/// probed by the planner: the buffers of inference, the frames under way, and those that are encoded.
fn rendering(job: &Job) -> u64 {
    let (settings, scene) = (&job.settings, &job.scene);
    let lights = scene.lights.len();
    let inference = held_per_pixel(scene, settings);
    // One frame is filled while others are encoded; a file is at most as large as the layers that it is made of.
    let frame = settings.aovs.bytes_per_pixel(lights, settings.aa);
    let frames = (ExrSink::IN_FLIGHT + 1) * frame + ExrSink::IN_FLIGHT * frame;
    (settings.window.pixels() * (inference + frames)) as u64 + job.threads as u64 * BYTES_PER_THREAD
}

/// Bytes that samples and inference take for each pixel of the window, frames and files apart.
pub fn held_per_pixel(scene: &Scene, settings: &Settings) -> usize {
    let words = lit_words(scene, settings.trace_options());
    let infers = settings.quality != Quality::Full;
    let moves = Requirements::of(scene).moving_objects;
    // Super-sampling keeps its book in what infers, in full frames too.
    let works = infers || settings.aa > 1;
    let inference = if works { Inference::bytes_per_pixel(settings.aa, words, moves) } else { 0 };
    render_bytes_per_pixel(settings, infers, words) + inference
}
