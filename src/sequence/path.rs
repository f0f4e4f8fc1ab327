//! The camera's path as the planner wants it.

use super::{Observer, Settings, go_on};
use crate::Result;
use crate::accel::Accel;
use crate::frame::{RayCounts, SurfaceSample};
use crate::infer::{Projector, is_one_surface};
use crate::plan::{PathFrame, ProbePoint};
use crate::scene::{Pose, Scene, View};
use crate::trace::Tracer;
use glam::DVec3;
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
    let view_at = |frame: i64, pose: &Pose| {
        let camera = scene.camera_at(frame, settings.camera);
        scene.view(pose, camera, settings.width, settings.height)
    };
    let pose_at = |frame: i64| scene.pose(scene.timing.time_of(frame));
    for frame in scene.timing.first..=scene.timing.last {
        go_on(observer)?;
        let pose = pose_at(frame);
        let view = view_at(frame, &pose);
        // Nothing is known about the frame before the first; its pose counts as the same.
        let scene_changed = before.as_ref().is_some_and(|b| !scene.looks_alike(b, &pose));
        // The probe is coarse: it may keep the first eye for its origin.
        if before.is_none() || scene_changed {
            accel.place(scene, &pose, view.eye);
        }
        let neighbours = [frame - 1, frame + 1].map(|n| view_at(n, &pose_at(n)));
        let tracer = Tracer::new(scene, accel, &pose, settings.trace_options());
        let (probe, shadow_rays) = probe(&tracer, accel.origin(), &view, &neighbours);
        path.push(PathFrame { frame, view, probe, shadow_rays, scene_changed });
        before = Some(pose);
    }
    Ok(path)
}

/// Looks through a coarse grid of pixels: what each shows, whether an edge is within a pixel of it, and whether the
/// neighbours' eyes see it too. Also counts the shadow rays that a pixel takes.
fn probe(tracer: &Tracer<'_>, origin: DVec3, view: &View, neighbours: &[View; 2]) -> (Vec<ProbePoint>, f64) {
    let positions: Vec<(f64, f64)> = PathFrame::probe_positions(view).collect();
    let projector = Projector::new(view, origin);
    let position = |sample: &SurfaceSample| match sample.surface.is_background() {
        true => sample.position.as_dvec3(),
        false => sample.position.as_dvec3() + origin,
    };
    let look = |&(x, y): &(f64, f64)| {
        let (mut lit, mut rays) = (vec![0; tracer.lit_words()], RayCounts::default());
        let sample = tracer.cast(view, x, y, &mut lit, &mut rays);
        let shadow_rays = rays.shadow + rays.ambient;
        let mut hit = |dx: f64, dy: f64| tracer.hit(view, x + dx, y + dy, &mut rays);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        let is_edge = corners.into_iter().any(|(dx, dy)| !is_one_surface(&sample, &hit(dx, dy), &projector));
        let beside = [hit(1.0, 0.0), hit(0.0, 1.0)].map(|s| position(&s));
        let hidden = neighbours.map(|n| tracer.is_hidden(&n, &sample));
        let at = position(&sample);
        let z = match sample.surface.is_background() {
            true => f64::INFINITY,
            false => (at - view.eye).dot(view.forward),
        };
        (ProbePoint { position: at, z, beside, is_edge, hidden }, shadow_rays)
    };
    let seen: Vec<(ProbePoint, u64)> = positions.par_iter().with_min_len(64).map(look).collect();
    let shadow_rays: u64 = seen.iter().map(|s| s.1).sum();
    let mean = shadow_rays as f64 / seen.len().max(1) as f64;
    (seen.into_iter().map(|s| s.0).collect(), mean)
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
