//! The camera's path as the planner wants it.

use super::{Observer, Settings, go_on};
use crate::Result;
use crate::accel::{Accel, Sides};
use crate::plan::{PathFrame, ProbePoint};
use crate::scene::{Instance, Pose, Scene, View};
use rayon::prelude::*;

/// Every frame of the scene's range: the camera, a coarse probe of what it sees, and how much of that has moved.
///
/// # Errors
/// [`crate::Error::Interrupted`] if `observer` asks to stop.
pub fn camera_path(
    scene: &Scene,
    accel: &mut Accel,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<Vec<PathFrame>> {
    let mut path: Vec<PathFrame> = Vec::new();
    let mut before: Option<Pose> = None;
    for frame in scene.timing.first..=scene.timing.last {
        go_on(observer)?;
        let pose = scene.pose(scene.timing.time_of(frame));
        let camera = scene.camera_at(frame, settings.camera);
        let view = scene.view(&pose, camera, settings.width, settings.height);
        // Nothing is known about the frame before the first; its pose counts as the same.
        // The probe is coarse: it may keep the first eye for its origin.
        if before.as_ref().is_none_or(|b| !scene.surfaces_alike(b, &pose)) {
            accel.place(scene, &pose, view.eye);
        }
        let is_moved = |i: &Instance| before.as_ref().is_some_and(|b| scene.is_changed(i, b, &pose));
        let moved: Vec<bool> = scene.instances.iter().map(is_moved).collect();
        let (probe, shows_moved) = probe(scene, accel, &view, &moved);
        path.push(PathFrame { frame, view, probe, moved: shows_moved });
        before = Some(pose);
    }
    Ok(path)
}

/// What the probe's rays see, and the share of them that see something that is `moved`.
fn probe(scene: &Scene, accel: &Accel, view: &View, moved: &[bool]) -> (Vec<ProbePoint>, f64) {
    let positions: Vec<(f64, f64)> = PathFrame::probe_positions(view).collect();
    let cast = |&(x, y): &(f64, f64)| {
        let ray = view.ray(x, y);
        let hit = accel.intersect(scene, &accel.camera_ray(view, x, y), Sides::Visible);
        match hit.map(|h| (f64::from(h.t), moved[h.surface.instance as usize])) {
            Some((z, moved)) => (ProbePoint { position: ray.origin + ray.direction * z, z }, moved),
            None => (ProbePoint { position: ray.direction, z: f64::INFINITY }, false),
        }
    };
    let (points, moved): (Vec<_>, Vec<_>) = positions.par_iter().with_min_len(64).map(cast).unzip();
    let share = moved.iter().filter(|&&m| m).count() as f64 / points.len().max(1) as f64;
    (points, share)
}
