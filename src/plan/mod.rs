//! Which frames are traced, and from which neighbour each other frame is inferred.
//!
//! A plan is made from the whole camera path and from a coarse probe of what the camera sees, in counted costs, never
//! from a clock: every machine of a farm makes the same one, and the bytes of a frame do not depend on which frames
//! are asked for.

mod motion;
mod segments;

pub use motion::{PathFrame, ProbePoint, Step};

use crate::frame::{FrameKind, Quality};
use motion::find_cuts;
use segments::{Chain, divide};

/// Longest segment where the user gives none. The cost model ends segments long before, unless the camera rests.
pub const LONGEST_SEGMENT: u32 = 129;

/// Why a key frame is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// Its segment begins the sequence.
    First,
    /// Its segment begins after a cut.
    Cut,
    /// Inference from the segment before would have cost more than tracing: the camera moves too fast, or something
    /// in the scene changed.
    Cost,
    /// The segment before had its longest useful length: samples lose their place as they are carried on.
    Length,
    /// There is no other frame.
    Only,
}

impl Reason {
    /// The word in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Cut => "cut",
            Self::Cost => "cost",
            Self::Length => "length",
            Self::Only => "only",
        }
    }
}

/// A key frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KeyFrame {
    /// Frame number.
    pub frame: i64,
    /// Why it is there.
    pub reason: Reason,
}

/// Frames inferred outward, in both directions, from one key frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// The key frame's number.
    pub key: i64,
    /// First frame.
    pub first: i64,
    /// Last frame, included.
    pub last: i64,
}

impl Segment {
    /// How `frame` is made.
    pub fn kind(&self, frame: i64) -> FrameKind {
        match frame.cmp(&self.key) {
            std::cmp::Ordering::Less => FrameKind::Inferred { from: frame + 1 },
            std::cmp::Ordering::Equal => FrameKind::Traced,
            std::cmp::Ordering::Greater => FrameKind::Inferred { from: frame - 1 },
        }
    }
}

/// How one frame is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedFrame {
    /// Frame number.
    pub frame: i64,
    /// Traced, or inferred from which neighbour.
    pub kind: FrameKind,
    /// Share of its pixels that are predicted to be traced.
    pub predicted_traced: f64,
}

/// The plan of a sequence.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// Every frame, in order.
    pub frames: Vec<PlannedFrame>,
    /// Key frames, in order; one for each segment.
    pub keyframes: Vec<KeyFrame>,
    /// Segments, in order, without gaps.
    pub segments: Vec<Segment>,
    /// First frames after a cut.
    pub cuts: Vec<i64>,
}

/// What a plan may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanOptions {
    /// How frames are inferred, if they are.
    pub quality: Quality,
    /// Longest segment in frames, at least 1.
    pub longest_segment: u32,
}

/// Plans a sequence from its path (consecutive frames; at least one).
///
/// `cuts` are frames from which on the scene says that another camera, or another shot, is seen. Jumps of the camera
/// are found and added.
pub fn plan(path: &[PathFrame], cuts: &[i64], options: PlanOptions) -> Plan {
    let steps = motion::steps(path);
    let all_cuts = find_cuts(path, &steps, cuts);
    let mut plan = Plan { cuts: all_cuts, ..Plan::default() };
    let mut first = 0;
    while first < path.len() {
        let end = (first + 1..path.len()).find(|&i| plan.cuts.contains(&path[i].frame)).unwrap_or(path.len());
        let full = options.quality == Quality::Full;
        let half = if full { 0 } else { options.longest_segment.saturating_sub(1) as usize };
        let shot = &steps[first..end.max(first + 1) - 1];
        let chains = Chain::of_shot(shot, half, options.quality.is_centred());
        for range in divide(&chains, end - first) {
            let segment = Segment {
                key: path[first + range.key].frame,
                first: path[first + range.first].frame,
                last: path[first + range.last].frame,
            };
            let reason = match range.first {
                _ if path.len() == 1 => Reason::Only,
                0 if first == 0 => Reason::First,
                0 => Reason::Cut,
                i if full || steps[first + i - 1].is_dear() => Reason::Cost,
                _ => Reason::Length,
            };
            plan.keyframes.push(KeyFrame { frame: segment.key, reason });
            plan.segments.push(segment);
            for i in range.first..=range.last {
                let frame = path[first + i].frame;
                let predicted_traced = chains[range.key].predicted(i as isize - range.key as isize);
                plan.frames.push(PlannedFrame { frame, kind: segment.kind(frame), predicted_traced });
            }
        }
        first = end;
    }
    plan
}

impl Plan {
    /// The segment that holds `frame`.
    pub fn segment_of(&self, frame: i64) -> Option<&Segment> {
        let i = self.segments.partition_point(|s| s.last < frame);
        self.segments.get(i).filter(|s| s.first <= frame)
    }
}
