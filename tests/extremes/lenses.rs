//! Lenses, images and turns of the camera.

use crate::rig::{EYE, INFERRING, TARGET, add, assert_good, at, drift, film, looking, measure, still_life};
use buzz::scene::Mesh;
use buzz::sequence::Quality;
use glam::{DQuat, DVec3, Vec3};
use std::f64::consts::PI;

const SIZE: (u32, u32) = (128, 72);

#[test]
fn long_and_wide_lenses() {
    // As far away as the lens is long, so that the picture is the same; a pixel a frame.
    for degrees in [0.1f64, 1.0] {
        let yfov = degrees.to_radians();
        let eye = TARGET + (EYE - TARGET).normalize() * 2.5 / (yfov / 2.0).tan();
        let turn = looking(eye, TARGET);
        let path = (0..9).map(|i| (eye + turn * DVec3::X * 0.07 * f64::from(i), turn));
        assert_good(&format!("{degrees} degrees"), &film(still_life(), yfov, path), SIZE, 0.5);
    }
    let close = EYE * 0.45;
    let path = (0..9).map(|i| (close + DVec3::X * 0.02 * f64::from(i), looking(close, TARGET)));
    assert_good("170 degrees", &film(still_life(), 170f64.to_radians(), path), SIZE, 0.5);
}

#[test]
fn the_very_near_and_the_very_far_in_one_view() {
    let mut scene = still_life();
    // A grain a millimetre before the lens, and a mountain beyond.
    let forward = (TARGET - EYE).normalize();
    let grain = EYE + forward * 1e-3 + DVec3::X * 1.5e-4;
    add(&mut scene, Mesh::uv_sphere(1e-4, 16, 0), Vec3::ONE, at(grain.x, grain.y, grain.z));
    add(&mut scene, Mesh::uv_sphere(2e5, 32, 0), Vec3::new(0.3, 0.6, 0.3), at(3e5, -5e4, -8e5));
    let mut scene = drift(scene, DVec3::X * 1e-5, 9);
    scene.cameras[0].lens.near = 1e-4;
    scene.cameras[0].lens.far = 1e6;
    assert_good("near 1e-4, far 1e6", &scene, SIZE, 0.5);
}

#[test]
fn turns() {
    let turn = looking(EYE, TARGET);
    let roll = (0..9).map(|i| (EYE, turn * DQuat::from_rotation_z(0.02 * f64::from(i))));
    assert_good("roll, 1.1 degrees a frame", &film(still_life(), 0.8, roll), SIZE, 0.5);
    // All that was known is behind the camera: nothing may be made of it.
    let about = (0..6).map(|i| (EYE, DQuat::from_rotation_y(PI * f64::from(i)) * turn));
    let about = film(still_life(), 0.8, about);
    for quality in INFERRING {
        let outcome = measure("half a turn a frame", &about, quality, SIZE);
        // What is new is met at some pixels, and between them on the same triangles: but for rounding, as it is.
        let least = if quality == Quality::Centred { 120.0 } else { f64::INFINITY };
        assert!(outcome.mean >= least, "{}: {outcome:?}", quality.name());
    }
}

#[test]
fn images_of_any_shape() {
    let scene = drift(still_life(), DVec3::new(2e-4, 0.0, -0.02), 5);
    for quality in INFERRING {
        for size in [(1, 1), (1, 200), (200, 1), (16384, 16)] {
            let case = format!("{}x{} pixels", size.0, size.1);
            let outcome = measure(&case, &scene, quality, size);
            let name = quality.name();
            assert!(
                outcome.worst > if quality == Quality::HalfPixel { 18.0 } else { 45.0 },
                "{case}, {name}: {outcome:?}"
            );
            // A pixel alone has no neighbours that could say what it shows.
            let saves = quality == Quality::HalfPixel || size != (1, 1);
            assert!(
                quality == Quality::Verified || !saves || outcome.saved > 0.5,
                "{case}, {name}: {outcome:?}"
            );
        }
    }
}
