//! Segments by dynamic programming over predicted cost.

use super::Step;

/// Cost of a frame traced in full is 1. What an inferred frame costs beside its traced share: projecting, walking
/// lines, cleaning up.
const INFERENCE: f64 = 0.12;

/// Share of pixels that samples carried on lose in the end, at little and at much motion. One sample a pixel, pushed
/// forward frame after frame, tends to a random pattern: the price of the half-pixel guarantee.
const DECAYED: [f64; 2] = [0.25, 0.34];

/// Motion in pixels a frame at which the second of [`DECAYED`] is reached.
const MUCH_MOTION: f64 = 30.0;

/// Share of the way to that pattern which one step goes at most, and the motion that goes most of it. Fitted, with the
/// two above, to frames of an interior dolly at 1-30 pixels a frame and a walk through an atrium at 3-35.
const STEP_DECAY: f64 = 0.4;
const DECAY_MOTION: f64 = 10.0;

/// Share of pixels at the edges of surfaces, which are cast in every frame where samples are centred.
const EDGES: f64 = 0.15;

/// Predicted costs of the frames inferred outward from one key frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chain {
    /// Traced share of the 1st, 2nd, ... frame after the key, up to where inference becomes dearer than tracing.
    forward: Vec<f64>,
    /// The same before the key.
    backward: Vec<f64>,
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
    /// The chains of every possible key frame of a shot with these steps, of segments up to `others` frames besides
    /// the key: at most half of them before it, so that together they keep to the length.
    pub fn of_shot(steps: &[Step], others: usize, centred: bool) -> Vec<Self> {
        let predict = |steps: &mut dyn Iterator<Item = (f64, f64, bool)>, longest: usize| {
            let mut order = 1.0;
            let chain = steps.take(longest).map_while(|(new, pixels, changed)| {
                order *= (-STEP_DECAY * (1.0 - (-pixels / DECAY_MOTION).exp())).exp();
                let decayed = DECAYED[0] + (DECAYED[1] - DECAYED[0]) * (pixels / MUCH_MOTION).min(1.0);
                let traced = new + if centred { EDGES } else { decayed * (1.0 - order) };
                let traced = traced.min(1.0);
                (!changed && traced <= Step::DEAR).then_some(traced)
            });
            chain.collect::<Vec<_>>()
        };
        (0..=steps.len())
            .map(|key| {
                let mut after = steps[key..].iter().map(|s| (s.new_forward, s.pixels, s.scene_changed));
                let mut before =
                    steps[..key].iter().rev().map(|s| (s.new_backward, s.pixels, s.scene_changed));
                Self {
                    forward: predict(&mut after, others - others / 2),
                    backward: predict(&mut before, others / 2),
                }
            })
            .collect()
    }

    /// Share of pixels predicted to be traced in the frame at `offset` from the key.
    pub fn predicted(&self, offset: isize) -> f64 {
        let of = |chain: &[f64]| chain.get(offset.unsigned_abs() - 1).copied().unwrap_or(1.0);
        match offset {
            0 => 1.0,
            1.. => of(&self.forward),
            _ => of(&self.backward),
        }
    }
}

/// Divides a shot of `frames` frames into segments of least predicted cost.
///
/// `closed[j]` is the least cost of the first j frames; `open` closes over a key frame k whose segment began before it.
pub fn divide(chains: &[Chain], frames: usize) -> Vec<Range> {
    let mut closed = vec![f64::INFINITY; frames + 1];
    let mut ranges = vec![Range { key: 0, first: 0, last: 0 }; frames + 1];
    closed[0] = 0.0;
    for (key, chain) in chains.iter().enumerate().take(frames) {
        let (mut open, mut first, mut cost) = (closed[key] + 1.0, key, 1.0);
        for (back, traced) in chain.backward.iter().enumerate() {
            cost += INFERENCE + traced;
            let start = key - back - 1;
            if closed[start] + cost < open {
                (open, first) = (closed[start] + cost, start);
            }
        }
        let mut total = open;
        for last in key..frames {
            if last > key {
                let Some(traced) = chain.forward.get(last - key - 1) else { break };
                total += INFERENCE + traced;
            }
            if total < closed[last + 1] {
                closed[last + 1] = total;
                ranges[last + 1] = Range { key, first, last };
            }
        }
    }
    let mut found = Vec::new();
    let mut end = frames;
    while end > 0 {
        found.push(ranges[end]);
        end = ranges[end].first;
    }
    found.reverse();
    found
}
