//! A camera that orbits the scene, for files without one, and light for those in which nothing shines.

use crate::{
    Error, Result,
    scene::{
        Camera, Channel, Curve, Instance, Interpolation, Lens, Light, LightKind, LocalTransform, Node, Pose,
        Projection, Scene, Target,
    },
};
use glam::{DMat3, DQuat, DVec2, DVec3, Vec3};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Vertical field of view, radians: 40 degrees, about a 50 mm lens.
const YFOV: f64 = 0.7;
/// How high above the horizon the camera stands, radians.
const ELEVATION: f64 = 0.35;
/// Room around the scene's bounding sphere.
const MARGIN: f64 = 1.05;
/// Where nothing shines, a sun does: the irradiance of what faces it, W/m2, so that white is about 1 with the sky's share.
const SUN: f32 = 2.5;
/// And a grey sky: its radiance.
const SKY: f32 = 0.2;
/// Frames that an orbit may have.
const LONGEST: u32 = 100_000;

/// Replaces the scene's cameras by one that goes round it once in `frames` frames.
///
/// It stands on the first frame where the scene's own range begins, looks at the middle of the scene's bounds at
/// that frame, and does not repeat the first position at the end, so that the sequence loops.
///
/// A scene in which nothing shines gets a sun that stands still, from above the first frame's left shoulder, and a grey sky.
pub(super) fn apply(scene: &mut Scene, frames: u32) -> Result<()> {
    if frames == 0 || frames > LONGEST {
        return Err(Error::Usage(format!("--turntable takes from 1 to {LONGEST} frames, not {frames}")));
    }
    let timing = &mut scene.timing;
    timing.last = timing.first + i64::from(frames) - 1;
    let timing = *timing;
    let (low, high) = bounds(scene, &scene.pose(timing.time_of(timing.first)));
    let (centre, radius) = ((low + high) * 0.5, ((high - low) * 0.5).length());
    let radius = if radius > 0.0 && radius.is_finite() { radius } else { 1.0 };
    let aspect =
        timing.resolution.map_or(16.0 / 9.0, |(w, h)| f64::from(w) * timing.pixel_aspect / f64::from(h));
    let narrow = ((YFOV * 0.5).tan() * aspect.min(1.0)).atan();
    let distance = radius / narrow.sin() * MARGIN;

    let mut times = Vec::new();
    let (mut translations, mut rotations) = (Vec::new(), Vec::new());
    for k in 0..i64::from(frames) {
        let angle = TAU * k as f64 / f64::from(frames);
        let turned = DQuat::from_rotation_y(angle) * DQuat::from_rotation_x(-ELEVATION);
        let position = centre + turned * DVec3::new(0.0, 0.0, distance);
        times.push(timing.time_of(timing.first + k) as f32);
        translations.extend(position.as_vec3().to_array());
        rotations.extend(DQuat::from_mat3(&DMat3::from_quat(turned)).as_quat().to_array());
    }
    let node = scene.nodes.len();
    scene.nodes.push(Node { name: "turntable".into(), ..Node::default() });
    scene.channels.retain(|channel| !aims_at_camera(channel.target));
    for (target, values, width) in
        [(Target::Translation(node), translations, 3), (Target::Rotation(node), rotations, 4)]
    {
        let rotation = width == 4;
        let curve =
            Curve { times: times.clone(), values, width, interpolation: Interpolation::Linear, rotation };
        scene.channels.push(Channel { target, curve });
    }
    let near = (distance - radius) * 0.01;
    let lens = Lens {
        projection: Projection::Perspective { yfov: YFOV },
        shift: DVec2::ZERO,
        near,
        far: f64::INFINITY,
        sensor_height: None,
    };
    scene.cameras = vec![Camera { name: "turntable".into(), node, lens, elsewhere: false }];
    scene.cuts.clear();
    // What exporters say of a missing camera no longer holds.
    scene.ignored.retain(|ignored| !ignored.feature.starts_with("no camera of "));
    if scene.is_dark() {
        light_up(scene);
    }
    Ok(())
}

fn light_up(scene: &mut Scene) {
    let rotation = DQuat::from_rotation_y(-FRAC_PI_4) * DQuat::from_rotation_x(-FRAC_PI_4);
    let transform = LocalTransform::Trs { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
    let (name, node) = (String::from("turntable sun"), scene.nodes.len());
    scene.nodes.push(Node { name: name.clone(), transform, ..Node::default() });
    let kind = LightKind::Directional;
    scene.lights.push(Light { name, node, kind, color: Vec3::ONE, intensity: SUN, size: 0.0, range: None });
    scene.world.color = Vec3::splat(SKY);
}

fn aims_at_camera(target: Target) -> bool {
    matches!(
        target,
        Target::CameraYfov(_)
            | Target::CameraXmag(_)
            | Target::CameraYmag(_)
            | Target::CameraNear(_)
            | Target::CameraFar(_)
            | Target::CameraShift(_)
    )
}

/// The lowest and highest corner of what is visible in `pose`; a unit cube if nothing is.
///
/// Skinned meshes count as if all their vertices hung on their first joint, which is near enough to frame them.
fn bounds(scene: &Scene, pose: &Pose) -> (DVec3, DVec3) {
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    let boxes: Vec<(DVec3, DVec3)> = scene
        .meshes
        .iter()
        .map(|mesh| {
            if let Some(shape) = &mesh.shape {
                let [low, high] = shape.bounds();
                return (low, high);
            }
            let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            mesh.positions
                .iter()
                .fold(start, |(low, high), p| (low.min(p.as_dvec3()), high.max(p.as_dvec3())))
        })
        .collect();
    for Instance { node, mesh, skin, node_from_object, .. } in &scene.instances {
        if !pose.visible[*node] {
            continue;
        }
        let joint = skin.and_then(|s| scene.skins[s].joints.first().zip(scene.skins[s].inverse_bind.first()));
        let world_from_object = match joint {
            Some((&joint, &bind)) => glam::DMat4::from(pose.world_from_node[joint]) * bind,
            None => glam::DMat4::from(pose.world_from_node[*node] * *node_from_object),
        };
        let (from, to) = boxes[*mesh];
        for corner in 0..8 {
            let pick = |bit: usize, axis: usize| if corner >> bit & 1 == 0 { from[axis] } else { to[axis] };
            let point = world_from_object.transform_point3(DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2)));
            if point.is_finite() {
                low = low.min(point);
                high = high.max(point);
            }
        }
    }
    if low.x <= high.x { (low, high) } else { (DVec3::splat(-0.5), DVec3::splat(0.5)) }
}
