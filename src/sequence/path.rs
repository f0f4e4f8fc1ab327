//! The camera's path as the planner wants it.

use super::{Observer, Settings, go_on};
use crate::Result;
use crate::accel::Accel;
use crate::frame::{RayCounts, SurfaceSample};
use crate::infer::{Projector, is_one_surface};
use crate::plan::{PathFrame, ProbePoint};
use crate::scene::{Instance, Pose, Scene, View};
use crate::trace::Tracer;
use glam::DVec3;
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
    let view_at = |frame: i64, pose: &Pose| {
        let camera = scene.camera_at(frame, settings.camera);
        scene.view(pose, camera, settings.width, settings.height)
    };
    let pose_at = |frame: i64| scene.pose(scene.timing.time_of(frame));
    for frame in scene.timing.first..=scene.timing.last {
        go_on(observer)?;
        let pose = pose_at(frame);
        let view = view_at(frame, &pose);
        // The probe is coarse: it may keep the first eye for its origin.
        if before.as_ref().is_none_or(|b| !scene.surfaces_alike(b, &pose)) {
            accel.place(scene, &pose, view.eye);
        }
        // Nothing is known about the frame before the first; its pose counts as the same.
        let is_moved = |i: &Instance| before.as_ref().is_some_and(|b| scene.is_changed(i, b, &pose));
        let moved: Vec<bool> = scene.instances.iter().map(is_moved).collect();
        let neighbours = [frame - 1, frame + 1].map(|n| view_at(n, &pose_at(n)));
        let tracer = Tracer::new(scene, accel, &pose, settings.trace_options());
        let seen = probe(&tracer, accel.origin(), &view, &neighbours);
        let shows_moved = |s: &&Seen| moved.get(s.instance as usize).is_some_and(|&moved| moved);
        let mean = |sum: f64| sum / seen.len().max(1) as f64;
        path.push(PathFrame {
            frame,
            view,
            moved: mean(seen.iter().filter(shows_moved).count() as f64),
            shadow_rays: mean(seen.iter().map(|s| s.shadow_rays as f64).sum()),
            probe: seen.into_iter().map(|s| s.point).collect(),
        });
        before = Some(pose);
    }
    Ok(path)
}

/// What a place of the probe shows.
struct Seen {
    point: ProbePoint,
    instance: u32,
    /// Rays to lights and to the world that a pixel there takes.
    shadow_rays: u64,
}

/// Looks through a coarse grid of pixels: what each shows, whether an edge is within a pixel of it, and whether the
/// neighbours' eyes see it too.
fn probe(tracer: &Tracer<'_>, origin: DVec3, view: &View, neighbours: &[View; 2]) -> Vec<Seen> {
    let positions: Vec<(f64, f64)> = PathFrame::probe_positions(view).collect();
    let projector = Projector::new(view, origin);
    let position = |sample: &SurfaceSample| match sample.surface.is_background() {
        true => sample.position.as_dvec3(),
        false => sample.position.as_dvec3() + origin,
    };
    let (eye, neighbours) = (tracer.eye(view), neighbours.map(|n| tracer.eye(&n)));
    let look = |&(x, y): &(f64, f64)| {
        let (mut lit, mut rays) = (vec![0; tracer.lit_words()], RayCounts::default());
        let sample = tracer.cast(&eye, x, y, &mut lit, &mut rays);
        let shadow_rays = rays.shadow + rays.ambient;
        let mut hit = |dx: f64, dy: f64| tracer.hit(&eye, x + dx, y + dy, &mut rays);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        let is_edge = corners.into_iter().any(|(dx, dy)| !is_one_surface(&sample, &hit(dx, dy), &projector));
        let beside = [hit(1.0, 0.0), hit(0.0, 1.0)].map(|s| position(&s));
        let hidden = neighbours.map(|n| tracer.is_hidden(&n, &sample));
        let at = position(&sample);
        let z = match sample.surface.is_background() {
            true => f64::INFINITY,
            false => (at - view.eye).dot(view.forward),
        };
        let point = ProbePoint { position: at, z, beside, is_edge, hidden };
        Seen { point, instance: sample.surface.instance, shadow_rays }
    };
    positions.par_iter().with_min_len(64).map(look).collect()
}
