//! Worlds far from their origin, and of any size.

use crate::rig::{
    EYE, INFERRING, Outcome, SAME, TARGET, bar, decibels, drift, film, infer, looking, measure, placed,
    still_life, trace,
};
use buzz::frame::Frame;
use buzz::scene::Scene;
use buzz::sequence::Quality;
use glam::DVec3;
use std::collections::BTreeSet;

const SIZE: (u32, u32) = (128, 72);
const STEP: DVec3 = DVec3::new(0.05, 0.01, -0.04);

fn scene(offset: DVec3, scale: f64) -> Scene {
    placed(drift(still_life(), STEP, 9), offset, scale)
}

/// Pixels of which a channel is off by more than a hundredth.
fn differing(a: &[Frame], b: &[Frame]) -> usize {
    let pairs = a.iter().zip(b).flat_map(|(a, b)| a.color.iter().zip(&b.color));
    pairs.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 0.01)).count()
}

fn is_like(moved: Outcome, still: Outcome) -> bool {
    let near = |a: f64, b: f64| (a.min(SAME) - b.min(SAME)).abs() < 1.0;
    near(moved.mean, still.mean)
        && near(moved.worst, still.worst)
        && (moved.saved - still.saved).abs() < 0.01
        && moved.hidden <= still.hidden + 1e-3
}

/// The largest relative error of the floor's depth in inferred frames, which double precision knows.
fn depth_error(scene: &Scene, floor: f64) -> f64 {
    const FLOOR_TAG: u32 = 1;
    let frames: BTreeSet<i64> = [4, 8].into();
    let mut worst = 0.0f64;
    let mut seen = 0;
    for frame in infer(scene, Quality::Centred, SIZE, &frames) {
        for (i, (&tag, &z)) in frame.object.iter().zip(&frame.depth).enumerate() {
            if tag != FLOOR_TAG {
                continue;
            }
            let (x, y) = (i as u32 % SIZE.0, i as u32 / SIZE.0);
            let ray = frame.view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let truth = (floor - ray.origin.y) / ray.direction.y;
            worst = worst.max((f64::from(z) / truth - 1.0).abs());
            seen += 1;
        }
    }
    assert!(seen > 5_000, "{seen} pixels show the floor");
    worst
}

/// The picture, and what inference makes of it, must be those of the same world at its origin, in metres.
fn assert_are_the_same_world(worlds: &[(String, DVec3, f64)]) {
    let frames: BTreeSet<i64> = [0, 8].into();
    let here = scene(DVec3::ZERO, 1.0);
    let truth = trace(&here, SIZE, &frames);
    let still = INFERRING.map(|quality| measure("as it is", &here, quality, SIZE));
    for (case, offset, scale) in worlds {
        let there = scene(*offset, *scale);
        let different = differing(&truth, &trace(&there, SIZE, &frames));
        let pixels = truth.len() * truth[0].color.len();
        assert!(
            different as f64 <= 2e-3 * pixels as f64,
            "{case}: {different} of {pixels} pixels differ in full"
        );
        let error = depth_error(&there, offset.y);
        assert!(error < 1e-4, "{case}: depths are off by {error:.1e}");
        println!("{case}: {different} of {pixels} pixels differ when traced, depths are off by {error:.1e}");
        for (quality, still) in INFERRING.into_iter().zip(still) {
            let moved = measure(case, &there, quality, SIZE);
            assert!(is_like(moved, still), "{case}, {}: {moved:?}, {still:?}", quality.name());
        }
    }
}

#[test]
fn a_world_far_from_its_origin_is_the_same() {
    let world = |distance: f64| {
        let offset = DVec3::new(distance, -0.5 * distance, 0.7 * distance);
        (format!("{distance:.0e} m from the origin"), offset, 1.0)
    };
    assert_are_the_same_world(&[1e3, 1e4, 1e5, 1e6, 1e7, 1e8].map(world));
}

#[test]
fn a_world_of_any_size_is_the_same() {
    let world = |scale: f64| (format!("{scale:.0e} times as large"), DVec3::ZERO, scale);
    assert_are_the_same_world(&[1e-6, 1e-3, 1e3, 1e6].map(world));
}

/// What was too small to be sampled is met as it grows; and positions are relative to the key frame's eye, so that they are
/// coarser the farther the camera goes in one segment.
#[test]
fn a_camera_may_come_from_afar() {
    for (distance, holds) in [(1e2, true), (1e3, true), (1e4, true), (1e5, false), (1e6, false)] {
        for nearer in [1.1, 1.5] {
            // Nearer by as much in each frame, then slowly on.
            let approach = std::iter::successors(Some(distance), |d| Some(d / nearer));
            let mut far: Vec<f64> = approach.take_while(|&d| d > 6.4).collect();
            far.extend((0..8).map(|i| 6.4 - 0.03 * f64::from(i)));
            let forward = (TARGET - EYE).normalize();
            let turn = looking(EYE, TARGET);
            let scene = film(still_life(), 0.8, far.iter().map(|d| (TARGET - forward * d, turn)));
            let last = scene.timing.last;
            let frames: BTreeSet<i64> = (last - 2..=last).collect();
            for quality in [Quality::Centred, Quality::Verified] {
                let all = decibels(&infer(&scene, quality, SIZE, &frames), &trace(&scene, SIZE, &frames));
                let worst = all.into_iter().fold(f64::INFINITY, f64::min);
                let case = format!("from {distance:.0e} m, {nearer} times nearer a frame");
                println!("{case} | `{}` | {worst:.1} dB", quality.name());
                assert!(!holds || worst > bar(quality) - 5.0, "{case}, {}: {worst}", quality.name());
            }
        }
    }
}
