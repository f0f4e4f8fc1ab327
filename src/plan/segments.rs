//! Segments by dynamic programming over predicted cost.

use super::{Change, Step, Weights};

/// Predictions for the frames inferred outward from one key frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chain {
    /// Cost of the key frame, less what it is worth where the image rests. Costs are in the mean cost of a frame of the sequence that is
    /// traced in full.
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

/// What a key frame is worth for each other frame of the rest that it is in, and at most, in what it costs more than to infer it would. While the
/// image rests nothing is cast, so what no sample has met in the move before stays missing; from a key frame all of it is right.
const REST: f64 = 0.01;
const MOST_REST: f64 = 0.25;

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
        let rests = rests(steps);
        let worth = |frame: usize| {
            let more = full(frame) - weights.predicted_cost(0.0, shadow_rays[frame]);
            (REST * rests[frame] as f64).min(MOST_REST) * more.max(0.0)
        };
        let chain = |key: usize| {
            let after = steps[key..].iter().map(|s| s.forward);
            let before = steps[..key].iter().rev().map(|s| s.backward);
            let [backward, forward] = reach(key);
            Self {
                key: (full(key) - worth(key)) / unit,
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

/// For each frame of a shot: how many others there are that show the same, one after the other.
fn rests(steps: &[Step]) -> Vec<usize> {
    let mut rests = Vec::new();
    let mut first = 0;
    for frame in 0..=steps.len() {
        if steps.get(frame).is_none_or(|step| !step.is_rest()) {
            rests.resize(frame + 1, frame - first);
            first = frame + 1;
        }
    }
    rests
}

/// How a sequence's first 0, 1, 2, ... frames are best divided into segments and these into shares that cost no more than a budget:
/// in as few shares as possible, the last of which costs as little as possible.
///
/// Dynamic programming: a key frame opens a segment that begins at or before it, at the least cost of all beginnings, and
/// closes it at each of the ends that its samples reach. Fewer shares are always better, whatever the last of them has cost: one more
/// can be begun anywhere.
struct Division {
    best: Vec<Option<Best>>,
}

/// The best way to divide so many frames.
#[derive(Debug, Clone, Copy)]
struct Best {
    shares: usize,
    /// Of the last share.
    cost: f64,
    /// The last segment, and whether a share begins with it.
    last: Range,
    opens: bool,
}

/// A way to open a segment.
struct Opening {
    shares: usize,
    /// Of the share until the key frame, which counts.
    cost: f64,
    first: usize,
    opens: bool,
}

impl Division {
    fn of(chains: &[Chain], budget: f64) -> Self {
        let nothing = Best { shares: 1, cost: 0.0, last: Range { key: 0, first: 0, last: 0 }, opens: true };
        let mut best = vec![Some(nothing)];
        best.resize(chains.len() + 1, None);
        for (key, chain) in chains.iter().enumerate() {
            let openings = Self::openings(&best, key, chain, budget);
            let forward = chain.forward.iter().take(chains.len() - key - 1).map(|i| i.cost);
            let mut spent = 0.0;
            for (ahead, step) in std::iter::once(0.0).chain(forward).enumerate() {
                spent += step;
                // They come by the number of shares.
                let Some(open) = openings.iter().find(|open| open.cost + spent <= budget) else { break };
                let (end, cost) = (key + ahead + 1, open.cost + spent);
                if best[end].is_none_or(|b| (open.shares, cost) < (b.shares, b.cost)) {
                    let last = Range { key, first: open.first, last: end - 1 };
                    best[end] = Some(Best { shares: open.shares, cost, last, opens: open.opens });
                }
            }
        }
        Self { best }
    }

    /// The cheapest way to open the segment of a key frame with each number of shares, the fewest first.
    fn openings(best: &[Option<Best>], key: usize, chain: &Chain, budget: f64) -> Vec<Opening> {
        let mut found: Vec<Opening> = Vec::new();
        let mut spent = chain.key;
        let backward = chain.backward.iter().take(key).map(|i| i.cost);
        for (back, step) in std::iter::once(0.0).chain(backward).enumerate() {
            spent += step;
            let first = key - back;
            let Some(before) = best[first] else { continue };
            for (shares, cost, opens) in
                [(before.shares, before.cost + spent, first == 0), (before.shares + 1, spent, true)]
            {
                let opening = Opening { shares, cost, first, opens };
                match found.iter_mut().find(|o| o.shares == shares) {
                    Some(known) if cost < known.cost => *known = opening,
                    None if cost <= budget => found.push(opening),
                    _ => {}
                }
            }
        }
        found.sort_by_key(|opening| opening.shares);
        found
    }

    /// The shares of all frames; none if no share may cost so little.
    fn shares(&self) -> Option<Vec<Workload>> {
        let mut end = self.best.len() - 1;
        let mut found = Vec::new();
        let mut share = Workload { ranges: Vec::new(), cost: self.best[end]?.cost };
        while end > 0 {
            let best = self.best[end]?;
            share.ranges.insert(0, best.last);
            end = best.last.first;
            if best.opens {
                let cost = self.best[end]?.cost;
                found.push(std::mem::replace(&mut share, Workload { ranges: Vec::new(), cost }));
            }
        }
        found.reverse();
        Some(found)
    }
}

/// Consecutive segments that one worker renders, and their predicted cost in frames traced in full.
#[derive(Debug, Clone, PartialEq)]
pub struct Workload {
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
/// done sooner. What the dearest must cost is found by bisection.
pub fn divide(chains: &[Chain], workers: usize) -> Vec<Workload> {
    let dearest = |shares: &[Workload]| shares.iter().map(|s| s.cost).fold(0.0, f64::max);
    let mut best = Division::of(chains, f64::INFINITY).shares().unwrap_or_default();
    let mut enough = dearest(&best);
    let mut too_little = enough / workers as f64 - SHARE_PRECISION;
    while workers > 1 && enough - too_little > SHARE_PRECISION {
        let budget = 0.5 * (too_little + enough);
        match Division::of(chains, budget).shares().filter(|shares| shares.len() <= workers) {
            Some(shares) => {
                enough = dearest(&shares);
                best = shares;
            }
            None => too_little = budget,
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that moves alike in every step, seeing so much of each frame anew.
    fn steady(frames: usize, new: f64) -> Vec<Chain> {
        under(&vec![2.0; frames], new)
    }

    /// The same in light that takes so many shadow rays a pixel in each frame.
    fn under(shadow_rays: &[f64], new: f64) -> Vec<Chain> {
        let change = Change { outside: new, pixels: 3.0, ..Change::default() };
        let step = Step { forward: change, backward: change };
        let unit = Weights::traced_cost(2.0);
        let steps = vec![step; shadow_rays.len() - 1];
        Chain::of_shot(&steps, shadow_rays, |_| [32, 32], &Weights::HALF_PIXEL, unit)
    }

    fn cost(chains: &[Chain], range: &Range) -> f64 {
        let chain = &chains[range.key];
        let before = chain.backward[..range.key - range.first].iter();
        let after = chain.forward[..range.last - range.key].iter();
        chain.key + before.chain(after).map(|i| i.cost).sum::<f64>()
    }

    #[test]
    fn the_key_frame_is_where_the_image_rests() {
        let moves = Change { outside: 0.04, pixels: 9.0, ..Change::default() };
        let step = |moves: Change| Step { forward: moves, backward: moves };
        let rest = step(Change::default());
        // A move between two rests, the second of which is longer.
        let steps = [[rest; 6].as_slice(), &[step(moves); 8], &[rest; 20]].concat();
        assert_eq!(rests(&steps)[..16], [6, 6, 6, 6, 6, 6, 6, 0, 0, 0, 0, 0, 0, 0, 20, 20]);
        let unit = Weights::traced_cost(2.0);
        let chains = Chain::of_shot(&steps, &[2.0; 35], |_| [64, 64], &Weights::CENTRED, unit);
        let shares = divide(&chains, 1);
        assert!(matches!(shares[0].ranges[..], [Range { key: 14.., first: 0, last: 34 }]), "{shares:?}");
        // However little a frame costs there, beside others, it is no reason to trace more of them.
        let rays: Vec<f64> = (0..35).map(|frame| if frame < 14 { 40.0 } else { 0.0 }).collect();
        let chains =
            Chain::of_shot(&steps, &rays, |_| [64, 64], &Weights::CENTRED, Weights::traced_cost(16.0));
        let resting = |range: &Range| range.key >= 14;
        assert_eq!(divide(&chains, 1)[0].ranges.iter().filter(|&range| resting(range)).count(), 1);
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

    /// The least that one share of all these frames costs.
    fn by_one(chains: &[Chain]) -> f64 {
        Division::of(chains, f64::INFINITY).best[chains.len()].map_or(f64::INFINITY, |best| best.cost)
    }

    /// The least that the dearest share can cost, by trying every end of every share.
    fn by_trial(chains: &[Chain], workers: usize) -> f64 {
        let whole = by_one(chains);
        if workers == 1 {
            return whole;
        }
        let ends = 1..chains.len();
        ends.map(|end| by_one(&chains[..end]).max(by_trial(&chains[end..], workers - 1)))
            .fold(whole, f64::min)
    }

    #[test]
    fn no_other_shares_are_done_sooner() {
        // Where key frames cost differently, fewer frames may cost more: the dear ones, without the cheap one beside them.
        let goes_out = |after: usize| (0..16).map(|i| if i < after { 12.0 } else { 0.0 }).collect::<Vec<_>>();
        let flickers = (0..16).map(|i| f64::from(i * 7 % 11)).collect();
        let lights = [vec![2.0; 24], goes_out(2), goes_out(5), goes_out(15), flickers];
        for (light, new) in lights.iter().flat_map(|light| [0.0, 0.05, 0.4].map(|new| (light, new))) {
            let chains = under(light, new);
            for workers in 1..=4 {
                let dearest = divide(&chains, workers).iter().map(|s| s.cost).fold(0.0, f64::max);
                let best = by_trial(&chains, workers);
                assert!(dearest <= best + SHARE_PRECISION, "{workers} workers: {dearest} {best}, {light:?}");
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
