//! `--memory`: what rendering will take, found out before it begins.

use super::job::Job;
use anyhow::Result;
use buzz::error::Error;
use buzz::infer::Inference;
use buzz::output::{ExrSink, peak_bytes};
use buzz::scene::{Requirements, Scene};
use buzz::sequence::{Quality, Settings, render_bytes_per_pixel};
use buzz::trace::lit_words;

/// Stacks, and what each thread encodes at a time.
const BYTES_PER_THREAD: u64 = 2 << 20;

/// An error if rendering is estimated to take more than `limit` bytes. To be asked once the scene is read and planned.
pub fn refuse_over(limit: u64, job: &Job) -> Result<()> {
    let held = peak_bytes();
    if held == 0 {
        let message = "--memory: this system does not say how much memory a process holds; leave it out";
        return Err(Error::Usage(message.into()).into());
    }
    let estimate = held + rendering(job);
    if estimate <= limit {
        return Ok(());
    }
    let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
    let message = format!(
        "--memory: rendering is estimated to take {} MiB ({} MiB of them for the scene), over the {} MiB allowed; allow more, or lower --resolution, --aa, --aov or --threads",
        mebibytes(estimate),
        mebibytes(held),
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
    let frame = settings.aovs.bytes_per_pixel(lights);
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
