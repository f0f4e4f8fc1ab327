//! What each quality costs and what it gets wrong: all of them on the same frames, in one run.
//!
//! Whole segments are sampled ([`sample()`]), so that samples are carried on as far as they are in a whole run. Each segment is
//! rendered by every quality in turn before the next segment is begun ([`trade`]), so that whatever else the machine does
//! meets all of them alike. The first to be given is the truth.

mod run;
mod sample;
mod summary;
mod text;

pub use run::{ROUNDS, TRUTH_BYTES_PER_PIXEL, Watch, trade};
pub use sample::{SAMPLED_FRAMES, sample};
pub use summary::{ChainStep, Spread, Summary};
pub(crate) use text::{TITLES, notes, row};

use super::{ImageError, Place};
use crate::frame::{FrameKind, RayCounts, StageSeconds};
use crate::plan::{Plan, Segment};
use crate::sequence::Settings;
use image::RgbImage;
use serde::Serialize;

/// A quality to be measured: how it renders, and its plan of the whole sequence.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// How to render with it.
    pub settings: Settings,
    /// Its plan of the whole sequence.
    pub plan: Plan,
}

/// All qualities, measured.
#[derive(Debug, Clone, Serialize)]
pub struct Trade {
    /// [`Trade::SCHEMA`].
    pub schema: &'static str,
    /// The program's version.
    pub version: &'static str,
    /// The input as the user named it.
    pub input: String,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Threads that rendered.
    pub threads: usize,
    /// Times that every frame was rendered.
    pub rounds: usize,
    /// Factor of the exposure that pictures were compared at.
    pub exposure: f32,
    /// First and last frames of the segments that were sampled.
    pub spans: Vec<[i64; 2]>,
    /// Each quality; the first is the truth.
    pub qualities: Vec<Measured>,
}

impl Trade {
    /// Name and version of the format.
    pub const SCHEMA: &str = "buzz-trade/1";
}

/// One quality, measured.
#[derive(Debug, Clone, Serialize)]
pub struct Measured {
    /// [`crate::frame::Quality::name`].
    pub quality: &'static str,
    /// Over all frames.
    pub summary: Summary,
    /// By the distance from the key frame.
    pub chain: Vec<ChainStep>,
    /// Where it is most wrong, the worst first; no two of one frame.
    pub worst: Vec<WorstPlace>,
    /// Every frame that was rendered: those of the spans, and the rest of the quality's own segments that they belong to.
    pub frames: Vec<MeasuredFrame>,
}

/// One frame by one quality.
#[derive(Debug, Clone, Serialize)]
pub struct MeasuredFrame {
    /// Frame number.
    pub frame: i64,
    /// The neighbour it was inferred from; none if it was traced.
    pub from: Option<i64>,
    /// Frames between it and its key frame, itself included.
    pub distance: u64,
    /// Wall seconds of the faster round; nothing is written.
    pub seconds: StageSeconds,
    /// Wall seconds of all stages in each round.
    pub rounds: Vec<f64>,
    /// Rays cast.
    pub rays: RayCounts,
    /// Pixels that show a stored sample.
    pub reused: u64,
    /// Of those, the ones that something hides from the eye.
    pub hidden: Option<u64>,
    /// Difference from the truth; none where it was not sampled.
    pub error: Option<ImageError>,
}

impl MeasuredFrame {
    /// Wall seconds of all stages, in the faster round.
    pub fn total_seconds(&self) -> f64 {
        total(&self.seconds)
    }

    /// How the frame was made.
    pub fn kind(&self) -> FrameKind {
        self.from.map_or(FrameKind::Traced, |from| FrameKind::Inferred { from })
    }
}

/// A place where a quality is most wrong, and what it looks like.
#[derive(Debug, Clone, Serialize)]
pub struct WorstPlace {
    /// Frame number.
    pub frame: i64,
    /// Where in the frame, and how wrong.
    #[serde(flatten)]
    pub place: Place,
    /// What is right.
    #[serde(skip)]
    pub truth: RgbImage,
    /// What the quality shows.
    #[serde(skip)]
    pub shown: RgbImage,
    /// The absolute difference, times [`super::ENHANCED`].
    #[serde(skip)]
    pub difference: RgbImage,
}

/// Wall seconds of the stages that make a frame; writing goes on beside them.
fn total(seconds: &StageSeconds) -> f64 {
    seconds.infer + seconds.trace + seconds.enhance
}

/// The key frame of `frame` is so many frames away.
fn distance(plan: &Plan, frame: i64) -> u64 {
    plan.segment_of(frame).map_or(0, |s: &Segment| s.key.abs_diff(frame))
}
