//! The driver: the only place that knows planning, tracing and inference. Pushes finished frames into a [`FrameSink`].
//!
//! [`camera_path`] gives the planner what it asks for, [`crate::plan::plan`] decides, [`render_sequence`] renders.

mod antialias;
mod caster;
mod mattes;
mod motion;
mod outward;
mod path;
mod resolve;
mod segment;
mod shot;
mod stereo;

pub use crate::frame::Quality;
pub use path::camera_path;

use crate::accel::Accel;
use crate::error::{Error, Result};
use crate::frame::{Aov, AovSet, Frame, FrameId, FrameKind, FrameStats, StageSeconds, StereoEye, Window};
use crate::infer::{BuzzBuffer, Inference, SubPixels};
use crate::plan::{Plan, Segment};
use crate::scene::{Requirements, Scene, Stereo};
use crate::trace::{TraceOptions, Tracer, lit_words};
use antialias::Antialias;
use mattes::MatteNames;
use outward::Stage;
use segment::SegmentRenderer;
use shot::Shot;
use std::collections::BTreeSet;

/// Where finished frames go: EXR files, memory, or nowhere.
pub trait FrameSink {
    /// A frame whose buffers may be filled: one that has been written already, or none.
    fn blank(&mut self) -> Option<Frame>;

    /// Takes a finished frame. May return before it is written: encoding runs beside the next frame's rendering.
    ///
    /// # Errors
    /// [`Error::Output`] if it, or an earlier one, cannot be written; [`Error::Frame`] if it cannot be encoded.
    fn put(&mut self, frame: Frame) -> Result<()>;

    /// Waits until all frames are written. Returns the seconds that each frame's encoding and writing took.
    ///
    /// # Errors
    /// As those of [`FrameSink::put`], for frames that were still under way.
    fn finish(&mut self) -> Result<Vec<(FrameId, StageSeconds)>>;
}

/// How to render a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How frames are inferred; which, the plan says.
    pub quality: Quality,
    /// Full image, pixels.
    pub width: u32,
    /// Full image, pixels.
    pub height: u32,
    /// The part that is rendered.
    pub window: Window,
    /// Layers beside the beauty.
    pub aovs: AovSet,
    /// Colour and alpha are 0 where only the world is seen, and less than 1 where it is seen through something.
    pub transparent: bool,
    /// Stops.
    pub exposure: f32,
    /// Depth of reflection and refraction.
    pub bounces: u32,
    /// Levels of super-sampling, 1 to [`Settings::MOST_LEVELS`]; 1 is one sample a pixel.
    pub aa: u32,
    /// Shadow rays to each light that has a size.
    pub light_samples: u32,
    /// Rays to the world from each point, where there is one.
    pub ambient_samples: u32,
    /// Cast a ray to every reused sample and count those that something hides.
    pub audit: bool,
    /// The camera to use throughout, instead of the scene's cuts.
    pub camera: Option<usize>,
    /// Render a pair of eyes about each camera, instead of what it sees itself. The cameras must be perspective.
    pub stereo: Option<Stereo>,
    /// Cast each camera ray at random inside its pixel, by this seed, instead of through the centre. A full trace made so
    /// has the half-pixel guarantee's own error: what inferred frames are measured against.
    pub jitter: Option<u64>,
}

impl Settings {
    /// Most levels of super-sampling.
    pub const MOST_LEVELS: u32 = 3;

    /// The whole image, beauty only.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            quality: Quality::default(),
            width,
            height,
            window: Window { x: 0, y: 0, width, height },
            aovs: AovSet::default(),
            transparent: false,
            exposure: 0.0,
            bounces: 4,
            aa: 1,
            light_samples: 1,
            ambient_samples: 0,
            audit: false,
            camera: None,
            stereo: None,
            jitter: None,
        }
    }

    /// What of this the tracer wants to know.
    pub fn trace_options(&self) -> TraceOptions {
        let &Self { bounces, light_samples, ambient_samples, transparent, .. } = self;
        TraceOptions { bounces, light_samples, ambient_samples, transparent }
    }

    /// The pictures of a frame: one, or the eyes'.
    pub fn pictures_of(&self, frame: i64) -> impl Iterator<Item = FrameId> + use<> {
        let eyes: &[Option<StereoEye>] = match self.stereo {
            Some(_) => &[Some(StereoEye::Left), Some(StereoEye::Right)],
            None => &[None],
        };
        eyes.iter().map(move |&eye| FrameId { number: frame, eye })
    }
}

/// Told what happens, and asked whether to go on: by all threads, at every row of pixels.
pub trait Observer: Sync {
    /// A frame, of one eye in stereo, is finished; if it was `wanted` it has been given to the sink, otherwise others hang on it.
    fn frame_done(&mut self, frame: FrameId, kind: FrameKind, stats: &FrameStats, wanted: bool);

    /// The signal by which the user asked to stop, if so; once there is one, there is always one.
    fn stop_requested(&self) -> Option<i32> {
        None
    }
}

/// For those who need to know nothing and never stop.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwatched;

impl Observer for Unwatched {
    fn frame_done(&mut self, _: FrameId, _: FrameKind, _: &FrameStats, _: bool) {}
}

/// An error if the user asked to stop.
fn go_on(observer: &dyn Observer) -> Result<()> {
    match observer.stop_requested() {
        Some(signal) => Err(Error::Interrupted { signal }),
        None => Ok(()),
    }
}

/// Renders `frames` as `plan` says and gives each to `sink`, in the plan's order: a segment's key frame, what is before
/// it, then what is after it.
///
/// Frames that are not asked for are still inferred where a wanted one hangs on them, but neither shaded nor written.
///
/// # Errors
/// Those of the sink, and [`Error::Interrupted`] if the observer asks to stop.
pub fn render_sequence(
    scene: &Scene,
    accel: &mut Accel,
    settings: &Settings,
    plan: &Plan,
    frames: &BTreeSet<i64>,
    sink: &mut dyn FrameSink,
    observer: &mut dyn Observer,
) -> Result<()> {
    let mut buffers = Buffers::default();
    let beyond: Vec<Segment> = frames
        .iter()
        .filter(|&&f| plan.segment_of(f).is_none())
        .map(|&f| Segment { key: f, first: f, last: f })
        .collect();
    for segment in plan.segments.iter().chain(&beyond) {
        let wanted: BTreeSet<i64> = frames.range(segment.first..=segment.last).copied().collect();
        if !wanted.is_empty() {
            render_segment(
                scene,
                accel,
                settings,
                segment,
                &plan.cuts,
                &wanted,
                &mut buffers,
                sink,
                observer,
            )?;
        }
    }
    Ok(())
}

/// The most bytes that [`render_sequence`] holds for each pixel, beside what [`Inference`] and frames take, where a sample has
/// so many words of shadow bits.
pub fn render_bytes_per_pixel(settings: &Settings, infers: bool, words: usize) -> usize {
    let buffer = BuzzBuffer::bytes_per_pixel(words) + SubPixels::bytes_per_pixel(settings.aa, words);
    render_buffers(settings, infers) * buffer + Antialias::bytes_per_pixel(settings.aa, words)
}

/// The key frame's buffer; if other frames are inferred from it, the neighbour's and the frame's own; and the right eye's
/// in stereo.
fn render_buffers(settings: &Settings, infers: bool) -> usize {
    let carried = if infers { 3 } else { 1 };
    carried + usize::from(settings.stereo.is_some())
}

/// What inference needs between frames; swapped, never made anew.
#[derive(Default)]
struct Buffers {
    carried: InferenceBuffers,
    antialias: Antialias,
}

/// Samples, and what they are inferred with.
#[derive(Default)]
struct InferenceBuffers {
    key: BuzzBuffer,
    old: BuzzBuffer,
    new: BuzzBuffer,
    /// The right eye's, in stereo.
    right: BuzzBuffer,
    inference: Inference,
}

impl Buffers {
    /// Makes room for the buffers that [`render_buffers`] counts.
    fn fit(&mut self, settings: &Settings, infers: bool, lit_words: usize) {
        let (width, height) = (settings.window.width as usize, settings.window.height as usize);
        let InferenceBuffers { key, old, new, right, .. } = &mut self.carried;
        let right = settings.stereo.map(|_| right);
        let carried = [key, old, new];
        for buffer in right.into_iter().chain(carried).take(render_buffers(settings, infers)) {
            if (buffer.width(), buffer.height(), buffer.lit_words()) != (width, height, lit_words) {
                *buffer = BuzzBuffer::new(width, height, lit_words).with_levels(settings.aa);
            }
        }
    }
}

#[allow(clippy::too_many_arguments)] // Private, called once: the arguments are the function's whole world.
fn render_segment(
    scene: &Scene,
    accel: &mut Accel,
    settings: &Settings,
    segment: &Segment,
    cuts: &[i64],
    wanted: &BTreeSet<i64>,
    buffers: &mut Buffers,
    sink: &mut dyn FrameSink,
    observer: &mut dyn Observer,
) -> Result<()> {
    let key_shot = Shot::new(scene, settings, segment.key);
    let origin = key_shot.view.eye;
    let right_eye = settings.stereo.map(|_| StereoEye::Right);
    let key_views = [key_shot.full_view, Shot::of_eye(right_eye, scene, settings, segment.key).full_view];
    let infers = segment.first < segment.last;
    buffers.fit(settings, infers, lit_words(scene, settings.trace_options()));
    let names = settings.aovs.contains(Aov::Crypto).then(|| MatteNames::of(scene));
    let Buffers { carried, antialias } = buffers;
    let mut renderer = SegmentRenderer {
        scene,
        settings,
        segment,
        origin,
        key_views,
        cuts,
        wanted,
        names,
        antialias,
        sink,
        observer,
    };

    accel.place(scene, &key_shot.pose, origin);
    let tracer = Tracer::new(scene, accel, &key_shot.pose, settings.trace_options());
    let stats = renderer.trace(&tracer, &key_shot, &mut carried.key, &mut carried.inference);
    renderer.emit((accel, &tracer), &key_shot, &carried.key, stats)?;
    renderer.emit_right(
        (accel, &tracer),
        (&carried.key, &key_shot),
        &mut carried.right,
        &mut carried.inference,
    )?;
    let stage = if Requirements::of(scene).motion() {
        Stage::Moving { accel, placed: key_shot.pose.clone() }
    } else {
        Stage::Still { accel, tracer: &tracer }
    };
    renderer.infer_outward(stage, key_shot, carried)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_buffers_are_made_as_are_counted() {
        let mut settings = Settings::new(3, 2);
        for stereo in [None, Some(Stereo { interocular: 0.1, convergence: 2.0 })] {
            settings.stereo = stereo;
            for infers in [false, true] {
                let mut buffers = Buffers::default();
                buffers.fit(&settings, infers, 1);
                let InferenceBuffers { key, old, new, right, .. } = &buffers.carried;
                let made = [key, old, new, right].into_iter().filter(|b| b.width() > 0).count();
                assert_eq!(made, render_buffers(&settings, infers));
                assert_eq!((key.width(), right.width() > 0), (3, stereo.is_some()));
            }
        }
    }
}
