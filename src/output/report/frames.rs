//! What each frame took, and all of them together.

use super::{FrameRecord, ReportInput, RunSeconds};
use crate::frame::{
    FrameId, FrameKind, FrameStats, PixelClass, RayCounts, StageSeconds, StereoEye, SubPixelCounts,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Sums over all frames, and over all runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Frames.
    pub frames: usize,
    /// Key frames.
    pub traced_frames: usize,
    /// Frames made from others.
    pub inferred_frames: usize,
    /// Pixels of each class, by its name.
    pub pixels: Map<String, Value>,
    /// Sub-pixels beside the pixels' centres.
    #[serde(default)]
    pub subpixels: SubPixelCounts,
    /// Rays cast.
    pub rays: RayCounts,
    /// Wall seconds.
    pub seconds: TotalSeconds,
    /// Reused samples that something hides from the eye; `None` unless all inferred frames were made with `--audit`.
    pub hidden: Option<u64>,
    /// Most memory that any run held, bytes.
    pub peak_bytes: u64,
}

/// Wall seconds of all runs, added up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TotalSeconds {
    /// Reading the scene.
    pub import: f64,
    /// Building what rays are traced through.
    pub accel: f64,
    /// Choosing key frames.
    pub plan: f64,
    /// Frames that were not asked for, but from which others are inferred: their rays and inference.
    #[serde(default)]
    pub on_the_way: f64,
    /// Work that replaces tracing.
    pub infer: f64,
    /// Camera and shadow rays.
    pub trace: f64,
    /// What depends on the eye.
    pub enhance: f64,
    /// Encoding and writing, beside the rest.
    pub write: f64,
    /// From start to end.
    pub wall: f64,
}

/// One frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// Frame number.
    pub frame: i64,
    /// Whose it is; only in stereo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eye: Option<StereoEye>,
    /// `traced` or `inferred`.
    pub kind: String,
    /// The neighbour that an inferred frame was made from; of a right eye, its own number.
    pub from: Option<i64>,
    /// Pixels of each class, by its name.
    pub pixels: Map<String, Value>,
    /// Share of pixels that the plan predicted to be traced; `None` outside the plan and for a right eye.
    #[serde(default)]
    pub predicted_traced: Option<f64>,
    /// Share of pixels that were: all that are not reused.
    #[serde(default)]
    pub traced: f64,
    /// Sub-pixels beside the pixels' centres.
    #[serde(default)]
    pub subpixels: SubPixelCounts,
    /// Rays cast.
    pub rays: RayCounts,
    /// Wall seconds; those of a skipped frame stand in an earlier run's report, and are 0 if there is none.
    pub seconds: StageSeconds,
    /// Reused samples that something hides from the eye; `None` without `--audit`.
    pub hidden: Option<u64>,
    /// True if the frame was there already.
    pub skipped: bool,
}

impl Totals {
    pub(super) fn of(input: &ReportInput) -> Self {
        let mut sum = FrameStats::default();
        let mut traced_frames = 0;
        for FrameRecord { kind, stats, .. } in &input.frames {
            traced_frames += usize::from(*kind == FrameKind::Traced);
            sum.rays += stats.rays;
            sum.subpixels += stats.subpixels;
            for (total, pixels) in sum.pixels.iter_mut().zip(stats.pixels) {
                *total += pixels;
            }
            for (total, seconds) in [
                (&mut sum.seconds.infer, stats.seconds.infer),
                (&mut sum.seconds.trace, stats.seconds.trace),
                (&mut sum.seconds.enhance, stats.seconds.enhance),
                (&mut sum.seconds.write, stats.seconds.write),
            ] {
                *total += seconds;
            }
            if let Some(hidden) = stats.hidden {
                *sum.hidden.get_or_insert(0) += hidden;
            }
        }
        // The sum over some of them would be taken for that over all.
        let is_audited = |f: &FrameRecord| f.kind == FrameKind::Traced || f.stats.hidden.is_some();
        sum.hidden = sum.hidden.filter(|_| input.frames.iter().all(is_audited));
        let of_runs =
            |part: fn(&RunSeconds) -> f64| millionths(input.runs.iter().map(|r| part(&r.seconds)).sum());
        let StageSeconds { infer, trace, enhance, write } = rounded(sum.seconds);
        Self {
            frames: input.frames.len(),
            traced_frames,
            inferred_frames: input.frames.len() - traced_frames,
            pixels: pixels_by_name(&sum.pixels),
            subpixels: sum.subpixels,
            rays: sum.rays,
            seconds: TotalSeconds {
                import: of_runs(|s| s.import),
                accel: of_runs(|s| s.accel),
                plan: of_runs(|s| s.plan),
                on_the_way: of_runs(|s| s.on_the_way),
                infer,
                trace,
                enhance,
                write,
                wall: of_runs(|s| s.wall),
            },
            hidden: sum.hidden,
            peak_bytes: input.runs.iter().map(|r| r.peak_bytes).max().unwrap_or(0),
        }
    }
}

impl FrameReport {
    /// Its number and eye.
    pub fn id(&self) -> FrameId {
        FrameId { number: self.frame, eye: self.eye }
    }

    pub(super) fn new(record: &FrameRecord, predicted: &BTreeMap<i64, f64>) -> Self {
        let (kind, from) = match record.kind {
            FrameKind::Traced => ("traced", None),
            FrameKind::Inferred { from } => ("inferred", Some(from)),
        };
        Self {
            frame: record.id.number,
            eye: record.id.eye,
            kind: kind.into(),
            from,
            pixels: pixels_by_name(&record.stats.pixels),
            predicted_traced: predicted
                .get(&record.id.number)
                .filter(|_| record.id.eye != Some(StereoEye::Right))
                .map(|&share| millionths(share)),
            traced: millionths(record.stats.traced_share()),
            subpixels: record.stats.subpixels,
            rays: record.stats.rays,
            seconds: rounded(record.stats.seconds),
            hidden: record.stats.hidden,
            skipped: record.skipped,
        }
    }
}

/// All classes by name, in the order of the contract: traced pixels last.
fn pixels_by_name(pixels: &[u64; PixelClass::COUNT]) -> Map<String, Value> {
    let traced_last = PixelClass::ALL.iter().skip(1).chain(&PixelClass::ALL[..1]);
    traced_last.map(|&class| (class.name().to_string(), pixels[class as usize].into())).collect()
}

fn rounded(seconds: StageSeconds) -> StageSeconds {
    StageSeconds {
        infer: millionths(seconds.infer),
        trace: millionths(seconds.trace),
        enhance: millionths(seconds.enhance),
        write: millionths(seconds.write),
    }
}

/// Clocks tell no more, and seventeen digits are hard to read. What is not finite is 0: JSON has no word for it.
pub(super) fn millionths(value: f64) -> f64 {
    if value.is_finite() { (value * 1e6).round() / 1e6 } else { 0.0 }
}
