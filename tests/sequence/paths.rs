//! Plans of twelve camera paths against the best that there are: each pair of a key frame and a frame is rendered and
//! counted once, and the best division is found from these counts.
//!
//! `cargo test --release --test sequence paths -- --nocapture` prints the table of `docs/planning.md`.

use crate::chains;
use crate::moves::{self, FRAMES, MOVES};
use buzz::accel::Accel;
use buzz::frame::FrameKind;
use buzz::plan::{LONGEST_SEGMENT, Plan, PlanOptions, Reason, Segment, Weights, plan};
use buzz::sequence::{Quality, Settings, Unwatched, camera_path};

const WIDTH: u32 = 80;
const HEIGHT: u32 = 45;

/// Counted costs of a path in camera rays, and its plan.
struct Measured {
    plan: Plan,
    /// `cost[key][frame]`; infinite where a carried-on sample would cost more than a new one.
    cost: Vec<Vec<f64>>,
}

impl Measured {
    fn segment(&self, key: usize, first: usize, last: usize) -> f64 {
        self.cost[key][first..=last].iter().sum()
    }

    /// What the planned segments cost.
    fn planned(&self) -> f64 {
        let of = |s: &Segment| self.segment(s.key as usize, s.first as usize, s.last as usize);
        self.plan.segments.iter().map(of).sum()
    }

    /// What tracing every frame costs.
    fn full(&self) -> f64 {
        (0..FRAMES).map(|f| self.cost[f][f]).sum()
    }

    /// The least that any segments cost which do not reach across a cut, and their key frames: every first, last and
    /// key frame is tried.
    fn best(&self) -> (f64, Vec<usize>) {
        let mut best = vec![(0.0, Vec::new())];
        for last in 0..FRAMES {
            let shot = self.plan.cuts.iter().map(|&c| c as usize).filter(|&c| c <= last).max().unwrap_or(0);
            let segments = (shot..=last).flat_map(|first| (first..=last).map(move |key| (first, key)));
            let costs =
                segments.map(|(first, key)| (best[first].0 + self.segment(key, first, last), first, key));
            let (cost, first, key) = costs.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            let keys = best[first].1.iter().copied().chain([key]).collect();
            best.push((cost, keys));
        }
        best.swap_remove(FRAMES)
    }
}

fn measure(movement: fn(f64) -> moves::Shot, quality: Quality) -> Measured {
    let scene = moves::scene(movement);
    let mut accel = Accel::new(&scene);
    let settings = Settings { quality, bounces: 0, ..Settings::new(WIDTH, HEIGHT) };
    let path = camera_path(&scene, &mut accel, &settings, &Unwatched).unwrap();
    let options = PlanOptions { quality, longest_segment: LONGEST_SEGMENT, workers: 1 };
    let plan = plan(&path, &[], options);
    let weights = Weights::of(quality);
    let mut cost = vec![vec![f64::INFINITY; FRAMES]; FRAMES];
    for (key, row) in cost.iter_mut().enumerate() {
        let segment = Segment { key: key as i64, first: 0, last: FRAMES as i64 - 1 };
        for (frame, stats) in chains::count(&scene, &mut accel, &settings, segment).unwrap() {
            let kind = if frame == segment.key { FrameKind::Traced } else { segment.kind(frame) };
            row[frame as usize] = weights.cost(kind, u64::from(WIDTH * HEIGHT), &stats.rays);
        }
    }
    Measured { plan, cost }
}

fn plans_are_near_the_best(quality: Quality) {
    let mut joins = Vec::new();
    let mut steps = Vec::new();
    let mut bad = Vec::new();
    println!(
        "| path, {} | key frames | planned | best | over best | over tracing every frame |",
        quality.name()
    );
    for (name, movement) in MOVES {
        let measured = measure(movement, quality);
        let (planned, (best, best_keys), full) = (measured.planned(), measured.best(), measured.full());
        let keys: Vec<String> =
            measured.plan.keyframes.iter().map(|k| format!("{} {}", k.frame, k.reason.name())).collect();
        let pixels = f64::from(WIDTH * HEIGHT);
        println!(
            "| {name} | {} | {:.2} | {:.2} | {:+.1} % | {:+.1} % |",
            keys.join(", "),
            planned / pixels,
            best / pixels,
            100.0 * (planned / best - 1.0),
            100.0 * (planned / full - 1.0)
        );
        if planned > 1.10 * best || planned > 1.03 * full {
            bad.push(format!(
                "{name}: {planned:.0}, best {best:.0} with key frames {best_keys:?}, all traced {full:.0}"
            ));
        }

        // What a key frame is said to be there for is so.
        let onto = |frame: usize| measured.cost[frame - 1][frame] / measured.cost[frame][frame];
        for (key, segment) in measured.plan.keyframes.iter().zip(&measured.plan.segments) {
            let first = segment.first as usize;
            match key.reason {
                Reason::First if first == 0 => {}
                Reason::Cut if measured.plan.cuts.contains(&segment.first) && onto(first) > 0.5 => {}
                Reason::Cost if onto(first) > 0.9 => {}
                Reason::Length if onto(first) < 1.1 => {}
                reason => bad.push(format!("{name}: {reason:?} at {first}, which costs {:.2}", onto(first))),
            }
            if matches!(key.reason, Reason::Cost | Reason::Length) {
                joins.push(onto(first));
            }
        }
        steps.extend((1..FRAMES).map(onto));
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    assert!(mean(&joins) > mean(&steps), "joins are where inference is dear: {joins:?}");
}

#[test]
fn half_pixel_plans_are_near_the_best() {
    plans_are_near_the_best(Quality::HalfPixel);
}

#[test]
fn centred_plans_are_near_the_best() {
    plans_are_near_the_best(Quality::Centred);
}
