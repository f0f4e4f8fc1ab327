//! Which frames are traced, and from which neighbour each other frame is inferred.
//!
//! A plan is made from the whole camera path and from a coarse probe of what the camera sees, in counted costs, never
//! from a clock: every machine of a farm makes the same one, and the bytes of a frame do not depend on which frames
//! are asked for.

mod motion;
mod segments;
mod weights;

pub use motion::{Change, PathFrame, ProbePoint, Step, steps};
pub use weights::{SHADOW_RAY, Weights};

use crate::frame::{FrameKind, Quality};
use motion::find_cuts;
use segments::{Chain, Range, divide};
use std::collections::{BTreeSet, HashMap};

/// Longest segment where the user gives none. The cost model ends segments long before, unless the camera rests.
pub const LONGEST_SEGMENT: u32 = 129;

/// Why a key frame is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// Its segment begins the sequence.
    First,
    /// Its segment begins after a cut.
    Cut,
    /// Inference from the segment before would have cost more than tracing: the camera moves too fast, or too much of
    /// what it sees does.
    Cost,
    /// The segment before had its longest useful length: samples lose their place as they are carried on, or another
    /// worker's share begins.
    Length,
    /// There is no other frame.
    Only,
}

impl Reason {
    /// The reason of that [`Reason::name`].
    pub fn named(name: &str) -> Option<Self> {
        [Self::First, Self::Cut, Self::Cost, Self::Length, Self::Only].into_iter().find(|r| r.name() == name)
    }

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

/// What one of several workers renders: consecutive segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// First frame.
    pub first: i64,
    /// Last frame, included.
    pub last: i64,
    /// Predicted cost in frames traced in full.
    pub cost: f64,
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
    /// The workers' shares, in order: at most as many as there are workers. A plan that is replayed has none.
    pub shares: Vec<Share>,
}

/// What a plan may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanOptions {
    /// How frames are inferred, if they are.
    pub quality: Quality,
    /// Longest segment in frames, at least 1.
    pub longest_segment: u32,
    /// How many machines render at the same time, at least 1: the plan is for the one that takes longest to be done as
    /// soon as possible.
    pub workers: usize,
}

impl Plan {
    /// How many frames beside those that are `wanted` have to be made so that these can be: the key frames of their segments,
    /// and all between.
    pub fn on_the_way(&self, wanted: &BTreeSet<i64>) -> usize {
        let of_segment = |&Segment { key, first, last }: &Segment| {
            let wanted: Vec<i64> = wanted.range(first..=last).copied().collect();
            let (Some(&from), Some(&to)) = (wanted.first(), wanted.last()) else { return 0 };
            (to.max(key) - from.min(key) + 1) as usize - wanted.len()
        };
        self.segments.iter().map(of_segment).sum()
    }

    /// The segment that holds `frame`.
    pub fn segment_of(&self, frame: i64) -> Option<&Segment> {
        let i = self.segments.partition_point(|s| s.last < frame);
        self.segments.get(i).filter(|s| s.first <= frame)
    }
}

/// Plans a sequence from its path (consecutive frames; at least one).
///
/// `cuts` are frames from which on the scene says that another camera, or another shot, is seen. Jumps of the camera
/// are found and added.
pub fn plan(path: &[PathFrame], cuts: &[i64], options: PlanOptions) -> Plan {
    let full = options.quality == Quality::Full;
    let longest = if full { 1 } else { options.longest_segment.max(1) };
    // At most half of a segment is before its key frame, so that together they keep to the length.
    let others = longest as usize - 1;
    let survey = Survey::of(path, cuts, options.quality, |_| [others / 2, others - others / 2]);
    let mut plan = Plan { cuts: survey.cuts.clone(), ..Plan::default() };
    for segments::Workload { ranges, cost } in divide(&survey.chains, options.workers) {
        for &range in &ranges {
            survey.add(&mut plan, range, survey.reason(range.first, full, longest));
        }
        if let (Some(first), Some(last)) = (ranges.first(), ranges.last()) {
            plan.shares.push(Share { first: path[first.first].frame, last: path[last.last].frame, cost });
        }
    }
    plan
}

/// Makes a plan of `segments` and `cuts` that were chosen before, and predicts what they take; `named` are the cuts that
/// the scene says.
///
/// # Errors
/// What does not fit, in words: if the segments do not hold every frame of the path once and in order, or if one goes on
/// after a cut.
pub fn replay(
    path: &[PathFrame],
    named: &[i64],
    quality: Quality,
    segments: &[(Segment, Reason)],
    cuts: &[i64],
) -> Result<Plan, String> {
    let frames = |from: i64, to: i64| usize::try_from(to.saturating_sub(from)).unwrap_or(0);
    let reach_of = |s: &Segment| [frames(s.first, s.key), frames(s.key, s.last)];
    let reaches: HashMap<i64, [usize; 2]> = segments.iter().map(|(s, _)| (s.key, reach_of(s))).collect();
    let reach = |place: usize| reaches.get(&path[place].frame).copied().unwrap_or_default();
    let survey = Survey::of(path, cuts, quality, reach);
    let mut plan = Plan { cuts: cuts.to_vec(), ..Plan::default() };
    for &(segment, reason) in segments {
        let range = survey.range_of(segment, plan.frames.len(), &[cuts, named]).map_err(|what| {
            let Segment { key, first, last } = segment;
            format!("segment {first}-{last} of key frame {key} {what}")
        })?;
        survey.add(&mut plan, range, reason);
    }
    match path.get(plan.frames.len()) {
        Some(missing) => Err(format!("no segment holds frame {}", missing.frame)),
        None => Ok(plan),
    }
}

/// What is known about a path before it is divided.
struct Survey<'a> {
    path: &'a [PathFrame],
    /// Named and found.
    cuts: Vec<i64>,
    /// Of each frame as a key frame; none reaches across a cut.
    chains: Vec<Chain>,
}

impl<'a> Survey<'a> {
    /// `reach` says how many frames before and after each place may be inferred from it.
    fn of(
        path: &'a [PathFrame],
        cuts: &[i64],
        quality: Quality,
        reach: impl Fn(usize) -> [usize; 2],
    ) -> Self {
        let steps = motion::steps(path);
        let cuts = find_cuts(path, &steps, cuts);
        let shadow_rays: Vec<f64> = path.iter().map(|f| f.shadow_rays).collect();
        let total: f64 = shadow_rays.iter().map(|&rays| Weights::traced_cost(rays)).sum();
        let (weights, unit) = (Weights::of(quality), total / path.len().max(1) as f64);
        let mut chains = Vec::with_capacity(path.len());
        while chains.len() < path.len() {
            let first = chains.len();
            let end = (first + 1..path.len()).find(|&i| cuts.contains(&path[i].frame)).unwrap_or(path.len());
            let (shot, rays) = (&steps[first..end - 1], &shadow_rays[first..end]);
            chains.extend(Chain::of_shot(shot, rays, |key| reach(first + key), &weights, unit));
        }
        Self { path, cuts, chains }
    }

    /// The place of a frame in the path, whose frames follow on one another; beyond it for frames that it has not.
    fn place(&self, frame: i64) -> usize {
        let first = self.path.first().map_or(0, |f| f.frame);
        usize::try_from(frame.saturating_sub(first)).unwrap_or(self.path.len()).min(self.path.len())
    }

    /// The places of `segment`, which is to begin at place `next`; if it does not fit there, why not.
    fn range_of(&self, segment: Segment, next: usize, cuts: &[&[i64]; 2]) -> Result<Range, String> {
        let Segment { key, first, last } = segment;
        let range = Range { key: self.place(key), first: next, last: self.place(last) };
        let begins = self.path.get(next).is_some_and(|f| f.frame == first);
        if !begins || !(next..self.path.len()).contains(&range.last) {
            let next = self.path.get(next).map_or("the end".into(), |f| format!("frame {}", f.frame));
            return Err(format!("must begin with {next}, which is next, and end within the sequence"));
        }
        if !(first..=last).contains(&key) {
            return Err("does not hold it".into());
        }
        let is_after_cut = |f: &&PathFrame| cuts.iter().any(|cuts| cuts.contains(&f.frame));
        match self.path[next + 1..=range.last].iter().find(is_after_cut) {
            Some(PathFrame { frame, .. }) => Err(format!("goes on at frame {frame}, after a cut")),
            None => Ok(range),
        }
    }

    /// Why a segment begins at place `first`, where segments are at most so long.
    fn reason(&self, first: usize, full: bool, longest: u32) -> Reason {
        match first {
            _ if self.path.len() == 1 => Reason::Only,
            0 => Reason::First,
            _ if self.cuts.contains(&self.path[first].frame) => Reason::Cut,
            _ if full || (longest > 1 && !self.chains[first - 1].goes_on()) => Reason::Cost,
            _ => Reason::Length,
        }
    }

    fn add(&self, plan: &mut Plan, range: Range, reason: Reason) {
        let number = |place: usize| self.path[place].frame;
        let segment =
            Segment { key: number(range.key), first: number(range.first), last: number(range.last) };
        plan.keyframes.push(KeyFrame { frame: segment.key, reason });
        plan.segments.push(segment);
        for place in range.first..=range.last {
            let predicted_traced = self.chains[range.key].predicted(place as isize - range.key as isize);
            let frame = number(place);
            plan.frames.push(PlannedFrame { frame, kind: segment.kind(frame), predicted_traced });
        }
    }
}
