//! Segments by dynamic programming over predicted cost.

use super::{Change, Step, Weights};

/// Predictions for the frames inferred outward from one key frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chain {
    /// Cost of the key frame. Costs are in the mean cost of a frame of the sequence that is traced in full.
    key: f64,
    /// The 1st, 2nd, ... frame after the key, up to where inference becomes dearer than tracing.
    forward: Vec<Inferred>,
    /// The same before the key.
    backward: Vec<Inferred>,
}

/// Prediction for an inferred frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Inferred {
    /// Share of its pixels that are traced.
    traced: f64,
    cost: f64,
}

/// A segment by its frames' positions in the shot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Range {
    /// The key frame.
    pub key: usize,
    /// First frame.
    pub first: usize,
    /// Last frame, included.
    pub last: usize,
}

impl Chain {
    /// The chains of every possible key frame of a shot with these steps, whose traced pixels take so many shadow rays,
    /// frame by frame. `reach` says for each frame how many before and after it are of interest if it is a key frame.
    /// `unit` camera rays a pixel are a cost of 1.
    pub fn of_shot(
        steps: &[Step],
        shadow_rays: &[f64],
        reach: impl Fn(usize) -> [usize; 2],
        weights: &Weights,
        unit: f64,
    ) -> Vec<Self> {
        let full = |frame: usize| Weights::traced_cost(shadow_rays[frame]);
        let predict = |chain: &mut dyn Iterator<Item = (usize, Change)>| {
            let (frames, changes): (Vec<usize>, Vec<Change>) = chain.unzip();
            let each = frames.into_iter().zip(weights.traced(changes));
            let priced = each.map(|(frame, traced)| {
                (weights.predicted_cost(traced, shadow_rays[frame]), traced, full(frame))
            });
            let worth = priced.take_while(|(cost, _, full)| cost < full);
            worth.map(|(cost, traced, _)| Inferred { traced, cost: cost / unit }).collect()
        };
        let chain = |key: usize| {
            let after = steps[key..].iter().map(|s| s.forward);
            let before = steps[..key].iter().rev().map(|s| s.backward);
            let [backward, forward] = reach(key);
            Self {
                key: full(key) / unit,
                forward: predict(&mut (key + 1..).zip(after).take(forward)),
                backward: predict(&mut (0..key).rev().zip(before).take(backward)),
            }
        };
        (0..shadow_rays.len()).map(chain).collect()
    }

    /// True if the frame after the key may be inferred from it.
    pub fn goes_on(&self) -> bool {
        !self.forward.is_empty()
    }

    /// Share of pixels predicted to be traced in the frame at `offset` from the key.
    pub fn predicted(&self, offset: isize) -> f64 {
        let of = |chain: &[Inferred]| chain.get(offset.unsigned_abs() - 1).map_or(1.0, |i| i.traced);
        match offset {
            0 => 1.0,
            1.. => of(&self.forward),
            _ => of(&self.backward),
        }
    }
}

/// The least costs of dividing a sequence's first 0, 1, 2, ... frames into segments, each with its last segment.
///
/// Dynamic programming: `cost[j]` is the least cost of the first j frames; a key frame k opens a segment that begins at
/// or before it, at the least cost of all beginnings, and closes it at each of the ends that its samples reach.
struct Division {
    cost: Vec<f64>,
    last: Vec<Range>,
}

impl Division {
    /// Goes on until the cost is over `budget`.
    fn of(chains: &[Chain], budget: f64) -> Self {
        let (mut cost, mut last) = (vec![0.0], vec![Range { key: 0, first: 0, last: 0 }]);
        for (key, chain) in chains.iter().enumerate() {
            if cost[key] > budget {
                break;
            }
            let (mut open, mut first, mut spent) = (cost[key] + chain.key, key, chain.key);
            for (back, inferred) in chain.backward.iter().take(key).enumerate() {
                spent += inferred.cost;
                let start = key - back - 1;
                if cost[start] + spent < open {
                    (open, first) = (cost[start] + spent, start);
                }
            }
            let forward = chain.forward.iter().take(chains.len() - key - 1).map(|i| i.cost);
            let mut total = open;
            for (ahead, step) in std::iter::once(0.0).chain(forward).enumerate() {
                total += step;
                let end = key + ahead + 1;
                if end == cost.len() {
                    cost.push(f64::INFINITY);
                    last.push(Range { key, first, last: end - 1 });
                }
                if total < cost[end] {
                    cost[end] = total;
                    last[end] = Range { key, first, last: end - 1 };
                }
            }
        }
        Self { cost, last }
    }

    /// How many of the first frames `budget` is enough for.
    fn reach(&self, budget: f64) -> usize {
        self.cost.iter().rposition(|&cost| cost <= budget).unwrap_or(0)
    }

    /// The segments of the first `frames` frames.
    fn segments(&self, frames: usize) -> Vec<Range> {
        let mut found = Vec::new();
        let mut end = frames;
        while end > 0 {
            found.push(self.last[end]);
            end = self.last[end].first;
        }
        found.reverse();
        found
    }
}

/// Consecutive segments that one worker renders, and their predicted cost in frames traced in full.
#[derive(Debug, Clone, PartialEq)]
pub struct Share {
    /// The segments.
    pub ranges: Vec<Range>,
    /// What they cost.
    pub cost: f64,
}

/// How exactly the cost of the dearest share is found, in frames traced in full.
const SHARE_PRECISION: f64 = 0.01;

/// Divides a sequence into segments and these into at most `workers` shares, so that the dearest share costs as little
/// as possible; of one worker's work that is the least in all.
///
/// A share may end within what would be one segment: the next one then pays for a key frame of its own, and both are
/// done sooner. Given what a share may cost, filling one after the other is best, since fewer frames never cost more;
/// so the least such cost is found by bisection.
pub fn divide(chains: &[Chain], workers: usize) -> Vec<Share> {
    let whole = Division::of(chains, f64::INFINITY);
    let mut enough = whole.cost[chains.len()];
    let mut best = vec![Share { ranges: whole.segments(chains.len()), cost: enough }];
    let mut too_little = enough / workers as f64 - SHARE_PRECISION;
    while workers > 1 && enough - too_little > SHARE_PRECISION {
        let budget = 0.5 * (too_little + enough);
        match fill(chains, workers, budget) {
            Some(shares) => {
                enough = shares.iter().map(|s| s.cost).fold(0.0, f64::max);
                best = shares;
            }
            None => too_little = budget,
        }
    }
    best
}

/// Shares that cost at most `budget` each; `None` if so many workers are not enough.
fn fill(chains: &[Chain], workers: usize, budget: f64) -> Option<Vec<Share>> {
    let mut shares = Vec::new();
    let mut start = 0;
    while start < chains.len() && shares.len() < workers {
        let division = Division::of(&chains[start..], budget);
        let frames = division.reach(budget);
        let moved = |r: Range| Range { key: r.key + start, first: r.first + start, last: r.last + start };
        let ranges = division.segments(frames).into_iter().map(moved).collect();
        shares.push(Share { ranges, cost: division.cost[frames] });
        start += frames;
    }
    (start == chains.len()).then_some(shares)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that moves alike in every step, seeing so much of each frame anew.
    fn steady(frames: usize, new: f64) -> Vec<Chain> {
        let change = Change { outside: new, pixels: 3.0, ..Change::default() };
        let step = Step { forward: change, backward: change };
        let unit = Weights::traced_cost(2.0);
        Chain::of_shot(&vec![step; frames - 1], &vec![2.0; frames], |_| [32, 32], &Weights::HALF_PIXEL, unit)
    }

    fn cost(chains: &[Chain], range: &Range) -> f64 {
        let chain = &chains[range.key];
        let before = chain.backward[..range.key - range.first].iter();
        let after = chain.forward[..range.last - range.key].iter();
        chain.key + before.chain(after).map(|i| i.cost).sum::<f64>()
    }

    #[test]
    fn shares_follow_on_one_another_and_cost_what_is_said() {
        for (frames, workers, new) in
            [(1, 1, 0.1), (96, 1, 0.02), (96, 2, 0.02), (97, 7, 0.3), (3, 9, 0.05), (50, 4, 0.9)]
        {
            let chains = steady(frames, new);
            let shares = divide(&chains, workers);
            assert!(shares.len() <= workers);
            let mut next = 0;
            for share in &shares {
                for range in &share.ranges {
                    assert_eq!(range.first, next);
                    assert!((range.first..=range.last).contains(&range.key));
                    next = range.last + 1;
                }
                let sum: f64 = share.ranges.iter().map(|r| cost(&chains, r)).sum();
                assert!((sum - share.cost).abs() < 1e-9, "{sum} {}", share.cost);
            }
            assert_eq!(next, frames);
        }
    }

    /// The least that the dearest share can cost, by trying every end of every share.
    fn by_trial(chains: &[Chain], workers: usize) -> f64 {
        let whole = Division::of(chains, f64::INFINITY);
        if workers == 1 {
            return whole.cost[chains.len()];
        }
        let ends = 1..chains.len();
        ends.map(|end| whole.cost[end].max(by_trial(&chains[end..], workers - 1)))
            .fold(whole.cost[chains.len()], f64::min)
    }

    #[test]
    fn no_other_shares_are_done_sooner() {
        for new in [0.0, 0.05, 0.4] {
            let chains = steady(24, new);
            for workers in 1..=3 {
                let dearest = divide(&chains, workers).iter().map(|s| s.cost).fold(0.0, f64::max);
                let best = by_trial(&chains, workers);
                assert!(dearest <= best + SHARE_PRECISION, "{workers} workers: {dearest} {best}");
            }
        }
    }

    #[test]
    fn two_workers_need_little_more_than_half_the_time_of_one() {
        let chains = steady(96, 0.01);
        let dearest = |workers| divide(&chains, workers).iter().map(|s| s.cost).fold(0.0, f64::max);
        let ratio = dearest(2) / dearest(1);
        assert!((0.5..0.6).contains(&ratio), "{ratio}");
    }
}
