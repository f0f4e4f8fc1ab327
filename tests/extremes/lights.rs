//! Very many lights, none, and very bright ones.

use crate::rig::{
    INFERRING, add_light, assert_good, at, bar, decibels, drift, infer, measure, still_life, trace,
};
use buzz::scene::LightKind;
use buzz::sequence::Quality;
use glam::DVec3;
use std::collections::BTreeSet;

const SIZE: (u32, u32) = (128, 72);
const STEP: DVec3 = DVec3::new(0.05, 0.01, -0.04);

#[test]
fn thousands_of_lights() {
    let mut scene = still_life();
    for i in 0..2000 {
        // Over the scene on a grid.
        let (column, row) = (f64::from(i % 50), f64::from(i / 50));
        add_light(&mut scene, LightKind::Point, 0.02, at(column * 0.2 - 5.0, 3.0, row * 0.25 - 5.0));
    }
    let outcome = measure("2,000 lights", &drift(scene, STEP, 4), Quality::Centred, (48, 27));
    assert!(outcome.worst > bar(Quality::Centred) && outcome.saved > 0.6, "{outcome:?}");
}

#[test]
fn no_lights() {
    let mut scene = still_life();
    scene.lights.clear();
    assert_good("no lights", &drift(scene, STEP, 9), SIZE, 0.7);
}

/// Radiance far over what a half holds, and far under it: inferred frames are as good as those of lights of ordinary strength.
#[test]
fn lights_of_any_strength() {
    let frames: BTreeSet<i64> = [2, 8].into();
    let ordinary = drift(still_life(), STEP, 9);
    let truth = trace(&ordinary, SIZE, &frames);
    for strength in [1e-30f32, 1e-6, 1e10, 1e30] {
        let mut scene = ordinary.clone();
        scene.world.color *= strength;
        scene.lights.iter_mut().for_each(|l| l.intensity *= strength);
        for quality in INFERRING {
            let mut ours = infer(&scene, quality, SIZE, &frames);
            ours.iter_mut()
                .flat_map(|f| &mut f.color)
                .for_each(|c| c[..3].iter_mut().for_each(|v| *v /= strength));
            let worst = decibels(&ours, &truth).into_iter().fold(f64::INFINITY, f64::min);
            println!("{strength:.0e} times as bright | `{}` | {worst:.1} dB", quality.name());
            assert!(worst > bar(quality), "{strength:.0e}, {}: {worst}", quality.name());
        }
    }
}
