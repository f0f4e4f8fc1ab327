//! The camera's path as the planner wants it.

use super::{Observer, Settings, go_on};
use crate::Result;
use crate::accel::{Accel, Sides};
use crate::plan::{PathFrame, ProbePoint};
use crate::scene::{Pose, Scene, View};
use rayon::prelude::*;

/// Every frame of the scene's range: the camera, a coarse probe of what it sees, and whether the scene changed.
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
        let scene_changed = before.as_ref().is_some_and(|b| !scene.looks_alike(b, &pose));
        // The probe is coarse: it may keep the first eye for its origin.
        if before.is_none() || scene_changed {
            accel.place(scene, &pose, view.eye);
        }
        path.push(PathFrame { frame, view, probe: probe(scene, accel, &view), scene_changed });
        before = Some(pose);
    }
    Ok(path)
}

fn probe(scene: &Scene, accel: &Accel, view: &View) -> Vec<ProbePoint> {
    let positions: Vec<(f64, f64)> = PathFrame::probe_positions(view).collect();
    let cast = |&(x, y): &(f64, f64)| {
        let ray = view.ray(x, y);
        let hit = accel.intersect(scene, &accel.camera_ray(view, x, y), Sides::Visible);
        match hit.map(|h| f64::from(h.t)) {
            Some(z) => ProbePoint { position: ray.origin + ray.direction * z, z },
            None => ProbePoint { position: ray.direction, z: f64::INFINITY },
        }
    };
    positions.par_iter().with_min_len(64).map(cast).collect()
}

impl Scene {
    /// True if the two poses differ in nothing that is seen but cameras.
    pub(super) fn looks_alike(&self, a: &Pose, b: &Pose) -> bool {
        let placed = |i: &crate::scene::Instance| {
            let still = |n: usize| a.world_from_node[n] == b.world_from_node[n];
            let joints_still = i.skin.is_none_or(|s| self.skins[s].joints.iter().all(|&j| still(j)));
            let node_still = i.skin.is_some() || still(i.node);
            a.visible[i.node] == b.visible[i.node]
                && a.weights[i.node] == b.weights[i.node]
                && (!a.visible[i.node] || (node_still && joints_still))
        };
        a.lights == b.lights && self.instances.iter().all(placed)
    }
}
