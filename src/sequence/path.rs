//! The camera's path as the planner wants it.

use super::{Observer, Settings, go_on};
use crate::Result;
use crate::accel::{Accel, Displaced};
use crate::frame::{RayCounts, SurfaceSample};
use crate::infer::{Projector, is_one_surface};
use crate::plan::{PathFrame, ProbePoint};
use crate::scene::{Pose, Scene, View};
use crate::trace::{Eye, Tracer};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Every frame of the scene's range: the camera, and a coarse probe of what it sees and where that is in the frames beside it.
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
        // The probe is coarse: it may keep an eye's place for its origin for long.
        let reach = FARTHEST * nearest(path.last());
        let is_near = (view.eye - accel.origin()).length() <= reach;
        if !is_near || before.as_ref().is_none_or(|b| !scene.surfaces_alike(b, &pose)) {
            accel.place(scene, &pose, view.eye);
        }
        let tracer = Tracer::new(scene, accel, &pose, settings.trace_options());
        let neighbours = [frame - 1, frame + 1].map(|n| {
            let there = pose_at(n);
            let eye = tracer.eye(&view_at(n, &there));
            let moved = !scene.surfaces_alike(&pose, &there);
            Neighbour { eye, surfaces: moved.then(|| accel.displaced(scene, &there)), pose: there }
        });
        let seen = probe(scene, &tracer, accel.origin(), &view, &neighbours);
        path.push(PathFrame {
            frame,
            view,
            shadow_rays: seen.iter().map(|s| s.shadow_rays as f64).sum::<f64>() / seen.len().max(1) as f64,
            probe: seen.into_iter().map(|s| s.point).collect(),
        });
        before = Some(pose);
    }
    Ok(path)
}

/// As many times as far from the origin as what is seen is from the eye, single precision is too coarse to tell how it moves
/// (`docs/limits.md`, positions).
const FARTHEST: f64 = 1e4;

/// How near anything is that the frame's probe has met; 0 if nothing is known.
fn nearest(frame: Option<&PathFrame>) -> f64 {
    frame.map_or(0.0, |frame| frame.probe.iter().map(|point| point.z).fold(f64::INFINITY, f64::min))
}

/// What a place of the probe shows.
struct Seen {
    point: ProbePoint,
    /// Rays to lights and to the world that a pixel there takes.
    shadow_rays: u64,
}

/// The frame before or after.
struct Neighbour {
    eye: Eye,
    pose: Pose,
    /// Where surfaces are then; none where that is where they are now.
    surfaces: Option<Displaced>,
}

impl Neighbour {
    /// How far a sample's surface moves until then, and whether it is hidden or not there. What moves is taken for seen: what is around
    /// it, and may hide it, mostly moves along.
    fn sees(&self, scene: &Scene, tracer: &Tracer<'_>, sample: &SurfaceSample) -> (Vec3, bool) {
        let surface = sample.surface;
        let Some(surfaces) = self.surfaces.as_ref().filter(|_| !surface.is_background()) else {
            return (Vec3::ZERO, tracer.is_hidden(&self.eye, sample));
        };
        let shift = surfaces.point(scene, surface) - sample.position;
        let is_there = self.pose.visible[scene.instances[surface.instance as usize].node];
        (shift, !is_there || shift == Vec3::ZERO && tracer.is_hidden(&self.eye, sample))
    }
}

/// Looks through a coarse grid of pixels: what each shows, whether an edge is within a pixel of it, and whether the
/// neighbours' eyes see it too.
fn probe(
    scene: &Scene,
    tracer: &Tracer<'_>,
    origin: DVec3,
    view: &View,
    neighbours: &[Neighbour; 2],
) -> Vec<Seen> {
    let positions: Vec<(f64, f64)> = PathFrame::probe_positions(view).collect();
    let projector = Projector::new(view, origin);
    let position = |sample: &SurfaceSample| match sample.surface.is_background() {
        true => sample.position.as_dvec3(),
        false => sample.position.as_dvec3() + origin,
    };
    let eye = tracer.eye(view);
    let look = |&(x, y): &(f64, f64)| {
        let (mut lit, mut rays) = (vec![0; tracer.lit_words()], RayCounts::default());
        let sample = tracer.cast(&eye, x, y, &mut lit, &mut rays);
        let shadow_rays = rays.shadow + rays.ambient;
        let mut hit = |dx: f64, dy: f64| tracer.hit(&eye, x + dx, y + dy, &mut rays);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        let is_edge = corners.into_iter().any(|(dx, dy)| !is_one_surface(&sample, &hit(dx, dy), &projector));
        let beside = [hit(1.0, 0.0), hit(0.0, 1.0)].map(|s| position(&s));
        let [before, after] = neighbours.each_ref().map(|n| n.sees(scene, tracer, &sample));
        let at = position(&sample);
        let z = match sample.surface.is_background() {
            true => f64::INFINITY,
            false => (at - view.eye).dot(view.forward),
        };
        let (shifts, hidden) = ([before.0, after.0], [before.1, after.1]);
        Seen { point: ProbePoint { position: at, z, beside, is_edge, shifts, hidden }, shadow_rays }
    };
    positions.par_iter().with_min_len(64).map(look).collect()
}
