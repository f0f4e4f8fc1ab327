//! Which segments to measure.

use crate::plan::{Plan, Segment};
use std::collections::BTreeSet;

/// Frames that are enough where the user names none: some minutes of rendering.
pub const SAMPLED_FRAMES: usize = 48;

/// The segments that hold the frames `wanted`; without any, segments from all over the plan until they hold
/// [`SAMPLED_FRAMES`] frames.
///
/// The places follow van der Corput's sequence: however early it ends, they are spread evenly.
pub fn sample(plan: &Plan, wanted: Option<&BTreeSet<i64>>) -> Vec<Segment> {
    let mut chosen = BTreeSet::new();
    if let Some(wanted) = wanted {
        let has = |s: &&Segment| wanted.range(s.first..=s.last).next().is_some();
        return plan.segments.iter().filter(has).copied().collect();
    }
    let length = |i: &usize| (plan.segments[*i].last - plan.segments[*i].first + 1) as usize;
    for n in 1..=4 * plan.frames.len() as u32 {
        let place = f64::from(n.reverse_bits()) / (f64::from(u32::MAX) + 1.0);
        let frame = plan.frames[(place * plan.frames.len() as f64) as usize].frame;
        chosen.insert(plan.segments.partition_point(|s| s.last < frame));
        if chosen.iter().map(length).sum::<usize>() >= SAMPLED_FRAMES {
            break;
        }
    }
    chosen.into_iter().map(|i| plan.segments[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameKind;
    use crate::plan::PlannedFrame;

    fn plan(lengths: &[i64]) -> Plan {
        let mut plan = Plan::default();
        let mut first = 10;
        for length in lengths {
            plan.segments.push(Segment { key: first, first, last: first + length - 1 });
            first += length;
        }
        let planned = |frame| PlannedFrame { frame, kind: FrameKind::Traced, predicted_traced: 1.0 };
        plan.frames = (10..first).map(planned).collect();
        plan
    }

    #[test]
    fn the_segments_of_the_frames_that_are_asked_for_are_whole() {
        let plan = plan(&[3, 4, 5]);
        let firsts = |frames: &[i64]| {
            sample(&plan, Some(&frames.iter().copied().collect())).iter().map(|s| s.first).collect::<Vec<_>>()
        };
        assert_eq!(firsts(&[12, 14]), [10, 13]);
        assert_eq!(firsts(&[21]), [17]);
        assert_eq!(firsts(&[22]), [0; 0]);
    }

    #[test]
    fn short_sequences_are_measured_whole_and_long_ones_all_over() {
        assert_eq!(sample(&plan(&[3, 4, 5]), None).len(), 3);
        assert_eq!(sample(&plan(&[200]), None).len(), 1);
        let chosen = sample(&plan(&[8; 100]), None);
        assert_eq!(chosen.len(), SAMPLED_FRAMES.div_ceil(8));
        // One in each sixth of the plan, or nearly.
        let gaps: Vec<i64> = chosen.windows(2).map(|w| w[1].first - w[0].first).collect();
        assert!(gaps.iter().all(|gap| (60..=260).contains(gap)), "{gaps:?}");
        assert!(sample(&Plan::default(), None).is_empty());
    }
}
