//! A still life that may stand anywhere in any size, cameras that move through it, and what inference makes of that.

use buzz::accel::Accel;
use buzz::frame::{Aov, Frame, FrameKind, RayCounts};
use buzz::measure::{Exposure, psnr};
use buzz::output::MemorySink;
use buzz::plan::{Plan, Segment};
use buzz::scene::{Channel, Curve, Interpolation, LightKind, LocalTransform, Material, Mesh, Scene, Target};
use buzz::sequence::{Quality, Settings, Unwatched, render_sequence};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

pub const INFERRING: [Quality; 3] = [Quality::HalfPixel, Quality::Centred, Quality::Verified];

/// Where the camera of the still life stands at rest, and what it looks at.
pub const EYE: DVec3 = DVec3::new(0.0, 2.0, 6.0);
pub const TARGET: DVec3 = DVec3::new(0.0, 0.7, 0.0);

/// Node that everything hangs on.
const WORLD: usize = 0;

pub fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

/// Turned so that -Z points down.
pub fn down() -> DQuat {
    DQuat::from_rotation_x(-FRAC_PI_2)
}

pub fn matt(color: Vec3) -> Material {
    Material { specular: 0.0, double_sided: true, ..Material::dielectric(color, 1.0) }
}

pub fn add(scene: &mut Scene, mesh: Mesh, color: Vec3, place: DAffine3) -> usize {
    let material = scene.add_material(matt(color));
    let mesh = scene.add_mesh(Mesh { material, ..mesh });
    let instance = scene.add_instance(mesh, place);
    scene.nodes[scene.instances[instance].node].parent = Some(WORLD);
    instance
}

pub fn add_light(scene: &mut Scene, kind: LightKind, intensity: f32, place: DAffine3) {
    let light = scene.add_light(kind, intensity, place);
    let node = scene.lights[light].node;
    scene.nodes[node].parent = Some(WORLD);
}

/// Nothing but the node that all hangs on.
pub fn nothing() -> Scene {
    let mut scene = Scene::default();
    scene.add_node("world", DAffine3::IDENTITY);
    scene.world.color = Vec3::new(0.1, 0.15, 0.2);
    scene
}

/// Three balls, a mirror and a card on a floor, under a lamp and a sun.
pub fn still_life() -> Scene {
    let mut scene = nothing();
    add(&mut scene, Mesh::plane(5.0, 0), Vec3::new(0.6, 0.55, 0.5), at(0.0, 0.0, 0.0));
    for (x, z, color) in [(-1.6, 0.0, Vec3::X), (0.1, 0.8, Vec3::Y), (1.7, -0.6, Vec3::new(0.2, 0.3, 1.0))] {
        add(&mut scene, Mesh::uv_sphere(0.6, 24, 0), color, at(x, 0.6, z));
    }
    let upright = DQuat::from_rotation_x(FRAC_PI_2);
    let card = DAffine3::from_rotation_translation(upright, DVec3::new(0.6, 1.0, -1.8));
    add(&mut scene, Mesh::plane(1.0, 0), Vec3::new(0.9, 0.8, 0.2), card);
    let mirror = add(&mut scene, Mesh::uv_sphere(0.4, 24, 0), Vec3::ONE, at(-0.6, 0.4, 1.6));
    let mesh = scene.instances[mirror].mesh;
    let material = scene.meshes[mesh].material;
    scene.materials[material] = Material { roughness: 0.0, ..Material::default() };
    add_light(&mut scene, LightKind::Point, 60.0, at(2.0, 4.0, 3.0));
    let slant = DQuat::from_euler(glam::EulerRot::YXZ, 0.6, -0.9, 0.0);
    add_light(&mut scene, LightKind::Directional, 1.0, DAffine3::from_quat(slant));
    scene
}

/// Moves the whole world, and makes it larger; lamps shine as much brighter as the picture needs to stay the same.
pub fn placed(mut scene: Scene, offset: DVec3, scale: f64) -> Scene {
    scene.nodes[WORLD].transform =
        LocalTransform::Trs { translation: offset, rotation: DQuat::IDENTITY, scale: DVec3::splat(scale) };
    for light in scene.lights.iter_mut().filter(|l| l.kind == LightKind::Point) {
        light.intensity *= (scale * scale) as f32;
    }
    scene
}

/// Turned so that -Z points from `eye` to `target`.
pub fn looking(eye: DVec3, target: DVec3) -> DQuat {
    let forward = (target - eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    DQuat::from_mat3(&DMat3::from_cols(right, right.cross(forward), -forward))
}

/// Adds a camera that goes from place to place, a frame each, in the world's own measure.
pub fn film(mut scene: Scene, yfov: f64, path: impl Iterator<Item = (DVec3, DQuat)>) -> Scene {
    let camera = scene.add_camera(DVec3::ZERO, DVec3::NEG_Z, yfov);
    let node = scene.cameras[camera].node;
    scene.nodes[node].parent = Some(WORLD);
    let (places, turns): (Vec<DVec3>, Vec<DQuat>) = path.unzip();
    let fps = scene.timing.fps.value();
    let times: Vec<f32> = (0..places.len()).map(|i| (i as f64 / fps) as f32).collect();
    let mut drive = |target, values: Vec<f32>, width, rotation| {
        let interpolation = Interpolation::Linear;
        let curve = Curve { times: times.clone(), values, width, interpolation, rotation };
        scene.channels.push(Channel { target, curve });
    };
    drive(Target::Translation(node), places.iter().flat_map(|p| p.as_vec3().to_array()).collect(), 3, false);
    drive(Target::Rotation(node), turns.iter().flat_map(|q| q.as_quat().to_array()).collect(), 4, true);
    scene.timing.last = places.len() as i64 - 1;
    scene
}

/// The camera drifts by `step` a frame and looks straight ahead from [`EYE`].
pub fn drift(scene: Scene, step: DVec3, frames: usize) -> Scene {
    let turn = looking(EYE, TARGET);
    film(scene, 0.8, (0..frames).map(|i| (EYE + step * i as f64, turn)))
}

/// From so many decibels on, two pictures differ by rounding only.
pub const SAME: f64 = 100.0;

/// Decibels that the worst frame of a case has to reach, unless the case is one of which nobody can say what is right.
pub fn bar(quality: Quality) -> f64 {
    if quality == Quality::HalfPixel { 25.0 } else { 45.0 }
}

/// Measures a case in all qualities: errors are those of their promises, and rays are saved.
#[track_caller]
pub fn assert_good(case: &str, scene: &Scene, size: (u32, u32), saved: f64) {
    for quality in INFERRING {
        let outcome = measure(case, scene, quality, size);
        assert!(outcome.worst > bar(quality), "{case}, {}: {outcome:?}", quality.name());
        // Proofs are rays too.
        let enough = quality == Quality::Verified || outcome.saved > saved;
        assert!(enough, "{case}, {}: {outcome:?}", quality.name());
    }
}

/// What a case came to.
#[derive(Debug, Clone, Copy)]
pub struct Outcome {
    /// Mean and least PSNR of inferred frames against full ones; infinite if none differs.
    pub mean: f64,
    pub worst: f64,
    /// Share of the camera and shadow rays of the inferred frames that were not cast.
    pub saved: f64,
    /// Reused samples that something hides, of all pixels.
    pub hidden: f64,
}

/// Renders `frames` as one segment of key frame 0.
pub fn infer(scene: &Scene, quality: Quality, size: (u32, u32), frames: &BTreeSet<i64>) -> Vec<Frame> {
    let last = frames.last().copied().unwrap_or(0);
    render(scene, quality, size, vec![Segment { key: 0, first: 0, last }], frames)
}

/// Renders `frames`, each traced.
pub fn trace(scene: &Scene, size: (u32, u32), frames: &BTreeSet<i64>) -> Vec<Frame> {
    let segments = frames.iter().map(|&f| Segment { key: f, first: f, last: f }).collect();
    render(scene, Quality::Full, size, segments, frames)
}

fn render(
    scene: &Scene,
    quality: Quality,
    (width, height): (u32, u32),
    segments: Vec<Segment>,
    frames: &BTreeSet<i64>,
) -> Vec<Frame> {
    let aovs = [Aov::Depth, Aov::Object].into_iter().collect();
    let settings = Settings { quality, audit: true, aovs, ..Settings::new(width, height) };
    let plan = Plan { segments, ..Plan::default() };
    let mut sink = MemorySink::default();
    let mut accel = Accel::new(scene);
    render_sequence(scene, &mut accel, &settings, &plan, frames, &mut sink, &mut Unwatched).unwrap();
    sink.frames.sort_by_key(|f| f.number);
    sink.frames
}

/// PSNR of each frame against the one of its number, infinite if they are identical.
pub fn decibels(frames: &[Frame], truth: &[Frame]) -> Vec<f64> {
    let exposure = Exposure::of(truth.iter().map(|f| f.color.as_slice()));
    let one = |(a, b): (&Frame, &Frame)| {
        assert_eq!(a.number, b.number);
        assert!(a.color.iter().flatten().all(|v| v.is_finite()), "frame {}", a.number);
        psnr(&a.color, &b.color, exposure).unwrap_or(f64::INFINITY)
    };
    frames.iter().zip(truth).map(one).collect()
}

/// Infers all frames from the first, traces them all, and prints what came of it as a row of a table.
pub fn measure(case: &str, scene: &Scene, quality: Quality, size: (u32, u32)) -> Outcome {
    measure_frames(case, scene, quality, size, &(0..=scene.timing.last).collect())
}

/// The same for some frames.
pub fn measure_frames(
    case: &str,
    scene: &Scene,
    quality: Quality,
    size: (u32, u32),
    frames: &BTreeSet<i64>,
) -> Outcome {
    let (frames, truth) = (infer(scene, quality, size, frames), trace(scene, size, frames));
    assert!(shows_something(&truth), "{case}: nothing is seen");
    let all = decibels(&frames, &truth);
    let rays = |frames: &[Frame]| {
        let inferred = frames.iter().filter(|f| f.number != 0);
        inferred.map(|f| f.stats.rays).sum::<RayCounts>().primary_and_shadow() as f64
    };
    let finite = || all.iter().copied().filter(|db| db.is_finite());
    let pixels = frames.iter().map(|f| f.color.len()).sum::<usize>() as f64;
    let outcome = Outcome {
        mean: if finite().count() == 0 {
            f64::INFINITY
        } else {
            finite().sum::<f64>() / finite().count() as f64
        },
        worst: finite().fold(f64::INFINITY, f64::min),
        saved: 1.0 - rays(&frames) / rays(&truth),
        hidden: frames.iter().filter_map(|f| f.stats.hidden).sum::<u64>() as f64 / pixels,
    };
    assert!(frames.iter().all(|f| (f.number == 0) == (f.kind == FrameKind::Traced)));
    let db = |db: f64| if db < SAME { format!("{db:.1} dB") } else { "the same".into() };
    let Outcome { mean, worst, saved, hidden } = outcome;
    println!(
        "| {case} | `{}` | {} | {} | {:.1} % | {:.3} % |",
        quality.name(),
        db(mean),
        db(worst),
        100.0 * saved,
        100.0 * hidden
    );
    if quality == Quality::Verified {
        assert_eq!(hidden, 0.0, "{case}: a proven sample is hidden");
    }
    outcome
}

/// A picture of one colour would agree with any other.
fn shows_something(frames: &[Frame]) -> bool {
    let brightest = |f: &Frame| f.color.iter().map(|c| c[1]).fold(0.0, f32::max);
    let darkest = |f: &Frame| f.color.iter().map(|c| c[1]).fold(f32::INFINITY, f32::min);
    frames.iter().any(|f| f.color.len() == 1 || brightest(f) > 1.5 * darkest(f))
}
