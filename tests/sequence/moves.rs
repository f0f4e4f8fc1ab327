//! Twelve ways to move a camera through the courtyard.

use buzz::import::{ImportOptions, import};
use buzz::scene::{Channel, Curve, Interpolation, Scene, Target};
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::TAU;
use std::path::Path;

/// Frames of each path.
pub const FRAMES: usize = 24;

/// A camera of one frame: where it stands, what it looks at, and its vertical angle of view in radians.
pub struct Shot {
    eye: DVec3,
    target: DVec3,
    yfov: f64,
}

/// A shot through a normal lens.
fn shot(eye: DVec3, target: DVec3) -> Shot {
    Shot { eye, target, yfov: LENS }
}

const LENS: f64 = 0.8;

/// Across the yard, at the height of the eyes.
const EYE: DVec3 = DVec3::new(-6.0, 1.7, 5.0);
const TARGET: DVec3 = DVec3::new(0.0, 1.5, 0.0);

/// The same from another corner.
const OTHER: DVec3 = DVec3::new(5.0, 2.2, 4.0);

type Move = fn(f64) -> Shot;

/// Names with what the camera does in frame 0, 1, 2, ...
pub const MOVES: [(&str, Move); 12] = [
    ("hold", |_| shot(EYE, TARGET)),
    ("slow dolly", |f| dolly(0.03 * f)),
    ("fast dolly", |f| dolly(0.22 * f)),
    ("orbit", |f| shot(TARGET + DQuat::from_rotation_y(0.03 * f) * (EYE - TARGET), TARGET)),
    ("whip pan", |f| pan(smooth((f - 10.0) / 4.0) * 1.6)),
    ("shake", |f| shot(EYE + 0.04 * wobble(f), TARGET + 0.12 * wobble(f + 0.5))),
    ("zoom", |f| Shot { yfov: LENS * 0.95f64.powf(f), ..shot(EYE, TARGET) }),
    ("dolly-zoom", |f| {
        let moved = dolly(0.12 * f);
        let nearer = (moved.eye - TARGET).length() / (EYE - TARGET).length();
        Shot { yfov: 2.0 * ((0.5 * LENS).tan() / nearer).atan(), ..moved }
    }),
    ("walk with cuts", |f| match f as usize {
        0..9 => dolly(0.06 * f),
        9..17 => shot(OTHER - DVec3::X * 0.05 * f, TARGET),
        _ => shot(OTHER + DVec3::new(-2.0, 0.5, -0.05 * f), TARGET + DVec3::Y),
    }),
    ("return", |f| dolly(0.18 * (12.0 - (f - 11.5).abs()))),
    ("one-frame cuts", |f| match f as usize {
        8 => shot(OTHER, TARGET),
        9 => shot(OTHER + DVec3::new(-2.0, 0.5, -1.0), TARGET + DVec3::Y),
        _ => dolly(0.03 * f),
    }),
    ("still then snap", |f| pan(smooth((f - 16.0) / 2.0) * 1.2)),
];

/// Towards the target, so many metres.
fn dolly(metres: f64) -> Shot {
    shot(EYE + (TARGET - EYE).normalize() * metres, TARGET)
}

/// Turned to the side, so many radians.
fn pan(angle: f64) -> Shot {
    shot(EYE, EYE + DQuat::from_rotation_y(angle) * (TARGET - EYE))
}

/// From 0 to 1, slowly at both ends.
fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A hand that is not steady, within 1 of where it should be.
fn wobble(f: f64) -> DVec3 {
    let at = |rate: f64| (TAU * f * rate).sin();
    DVec3::new(at(0.31), at(0.23), at(0.17))
}

/// The courtyard, seen by a camera that moves so.
pub fn scene(movement: Move) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/courtyard/courtyard.gltf");
    let mut scene = import(&file, &ImportOptions::default()).unwrap();
    scene.channels.clear();
    scene.cuts.clear();
    let camera = scene.add_camera(EYE, TARGET, LENS);
    scene.cuts.push(buzz::scene::Cut { frame: 0, camera });
    let shots: Vec<Shot> = (0..FRAMES).map(|f| movement(f as f64)).collect();
    let node = scene.cameras[camera].node;
    let turned = |s: &Shot| {
        let back = (s.eye - s.target).normalize();
        let right = DVec3::Y.cross(back).normalize();
        DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back))
    };
    let channels: [(Target, usize, Vec<f64>); 3] = [
        (Target::Translation(node), 3, shots.iter().flat_map(|s| s.eye.to_array()).collect()),
        (Target::Rotation(node), 4, shots.iter().flat_map(|s| turned(s).to_array()).collect()),
        (Target::CameraYfov(camera), 1, shots.iter().map(|s| s.yfov).collect()),
    ];
    (scene.timing.first, scene.timing.last) = (0, FRAMES as i64 - 1);
    let times: Vec<f32> = (0..FRAMES as i64).map(|f| scene.timing.time_of(f) as f32).collect();
    for (target, width, values) in channels {
        let (times, values) = (times.clone(), values.into_iter().map(|v| v as f32).collect());
        let rotation = matches!(target, Target::Rotation(_));
        let curve = Curve { times, values, width, interpolation: Interpolation::Step, rotation };
        scene.channels.push(Channel { target, curve });
    }
    scene
}
