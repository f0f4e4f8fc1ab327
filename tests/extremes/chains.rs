//! Long chains of inference, and motion too slow to be seen.

use crate::rig::{
    EYE, INFERRING, SAME, TARGET, bar, decibels, drift, film, infer, looking, measure_frames, still_life,
    trace,
};
use buzz::sequence::Quality;
use glam::{DQuat, DVec3};
use std::collections::BTreeSet;
use std::f64::consts::TAU;

const SIZE: (u32, u32) = (64, 36);

/// The camera goes round and round, so that frames that lie whole rounds apart show the same: what differs between them is
/// what inference adds up.
#[test]
fn a_chain_of_two_thousand_frames_gets_no_worse() {
    const ROUND: i64 = 199;
    let path = (0..=2000).map(|i| {
        let turn = DQuat::from_rotation_y(TAU * i as f64 / ROUND as f64);
        let eye = turn * EYE;
        (eye, looking(eye, TARGET))
    });
    let scene = film(still_life(), 0.8, path);
    for quality in INFERRING {
        // The tenth frame of the first, second, fourth and eleventh round, and three beside each of them.
        let rounds = [0, 1, 3, 10];
        let frames: BTreeSet<i64> =
            rounds.iter().flat_map(|r| (0..4).map(move |i| r * ROUND + 10 - i)).collect();
        let (ours, truth) = (infer(&scene, quality, SIZE, &frames), trace(&scene, SIZE, &frames));
        let all: Vec<f64> = decibels(&ours, &truth).into_iter().map(|db| db.min(SAME)).collect();
        let means: Vec<f64> = all.chunks(4).map(|four| four.iter().sum::<f64>() / 4.0).collect();
        let cells: Vec<String> = means.iter().map(|db| format!("{db:.1} dB")).collect();
        println!("frames 10, 209, 607, 2000 of a chain | `{}` | {}", quality.name(), cells.join(", "));
        assert!(means[3] > means[0] - 1.0, "{}: {means:?}", quality.name());
    }
}

#[test]
fn motion_of_a_millionth_of_a_pixel_a_frame() {
    // A pixel is 0.14 m wide at the target.
    let scene = drift(still_life(), DVec3::X * 1.4e-7, 1001);
    for quality in INFERRING {
        let frames = [500, 1000].into();
        let outcome = measure_frames("1e-6 pixel a frame, 1000 frames", &scene, quality, SIZE, &frames);
        assert!(outcome.worst > 50.0, "{}: {outcome:?}", quality.name());
        assert!(quality == Quality::Verified || outcome.saved > 0.9, "{}: {outcome:?}", quality.name());
    }
}

/// Each step is smaller than what counts as standing still, but together they are two pixels.
#[test]
fn what_creeps_arrives() {
    let scene = drift(still_life(), DVec3::X * 2.8e-4, 1001);
    for quality in INFERRING {
        let frames = [250, 500, 1000].into();
        let outcome = measure_frames("0.002 pixel a frame, 1000 frames", &scene, quality, SIZE, &frames);
        assert!(outcome.worst > bar(quality), "{}: {outcome:?}", quality.name());
    }
}

#[test]
fn a_camera_that_stands_still_costs_nothing() {
    let scene = drift(still_life(), DVec3::ZERO, 5);
    for quality in INFERRING {
        let outcome = measure_frames("identical frames", &scene, quality, SIZE, &(0..5).collect());
        assert!(outcome.mean.is_infinite(), "{}: {outcome:?}", quality.name());
        assert!(quality == Quality::Verified || outcome.saved > 0.995, "{}: {outcome:?}", quality.name());
    }
}
