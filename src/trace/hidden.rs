//! Which samples are hidden from the eye.

use super::{Eye, Tracer};
use crate::accel::{Frustum, Ray, Sides};
use crate::frame::SurfaceSample;
use std::ops::Range;

/// Something this much nearer than a sample, as a share of its distance, hides it: of what is to be proven visible, hardly more than
/// what single precision makes of its own surface.
const PROVEN_SHARE: f32 = 1e-4;

/// The same for what is only counted (the audit).
const COUNTED_SHARE: f32 = 1e-3;

/// What is looked at for many samples at once ends at least so much before the nearest of them, and behind where something would
/// hide the farthest, as a share of their distance: more than what single precision makes of a plane.
const MARGIN: f32 = 1e-5;

impl Tracer<'_> {
    /// True if something stands between the eye and a sample, nearer by more than a thousandth of its distance; for
    /// the background, if anything stands there at all. The ray is not counted.
    ///
    /// An orthographic background sample does not say where it is, and is never found hidden.
    pub fn is_hidden(&self, eye: &Eye, sample: &SurfaceSample) -> bool {
        self.is_hidden_before(eye, sample, 1.0 - COUNTED_SHARE)
    }

    /// The same of a sample that is to be proven visible, by a ten-thousandth.
    pub fn may_be_hidden(&self, eye: &Eye, sample: &SurfaceSample) -> bool {
        self.is_hidden_before(eye, sample, 1.0 - PROVEN_SHARE)
    }

    /// True if something stands before a sample in this share of the way to it.
    fn is_hidden_before(&self, eye: &Eye, sample: &SurfaceSample, share: f32) -> bool {
        let (origin, direction, until) = match (eye.perspective, sample.surface.is_background()) {
            (true, true) => (eye.position, sample.position, f32::INFINITY),
            (true, false) => (eye.position, sample.position - eye.position, share),
            (false, true) => return false,
            (false, false) => {
                let depth = (sample.position - eye.position).dot(eye.forward);
                (sample.position - eye.forward * depth, eye.forward * depth, share)
            }
        };
        // Planar depth to a length of `direction`.
        let planar = direction.dot(eye.forward);
        let (t_min, t_max) = (eye.near / planar, (eye.far / planar).min(until));
        let ray = Ray { origin, direction, t_min, t_max };
        planar > 0.0 && self.accel.intersect(self.scene, &ray, Sides::Visible).is_some()
    }

    /// True if one look at the space before a rectangle of pixels makes it certain that [`Tracer::may_be_hidden`] is true for none of
    /// the samples `at` their centres. They must be background, or all close to one plane.
    ///
    /// Where the plane lies, and where a sample would be hidden, are compared by their distances along its normal: seen from the eye
    /// these are in proportion to the distances along a ray.
    pub fn sees_all(
        &self,
        eye: &Eye,
        (columns, rows): (Range<usize>, Range<usize>),
        at: impl Fn(usize, usize) -> SurfaceSample,
    ) -> bool {
        let (left, right, top, bottom) = (columns.start, columns.end, rows.start, rows.end);
        if !eye.perspective || columns.is_empty() || rows.is_empty() {
            return false;
        }
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        let rays = corners.map(|(x, y)| eye.ray(self.accel, x as f64, y as f64).direction);
        let samples =
            || rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y))).map(|(x, y)| at(x, y));
        let sky = samples().filter(|sample| sample.surface.is_background()).count();
        if sky == columns.len() * rows.len() {
            return self.accel.is_empty_within(&Frustum::along(eye.position, rays));
        }
        let position = |x: usize, y: usize| at(x, y).position - eye.position;
        let (first, across) = (position(left, top), position(right - 1, top));
        let normal = (across - first).cross(position(left, bottom - 1) - first).normalize_or_zero();
        let normal = if normal.dot(first) < 0.0 { -normal } else { normal };
        let distances = || samples().map(|sample| normal.dot(sample.position - eye.position));
        let (nearest, farthest) =
            distances().fold((f32::INFINITY, 0.0_f32), |(n, f), d| (n.min(d), f.max(d)));
        // In the middle of what is left.
        let hiding = farthest * (1.0 - PROVEN_SHARE);
        let end = (nearest + hiding) / 2.0;
        let is_flat = nearest - end > MARGIN * farthest;
        if sky > 0 || !is_flat {
            return false;
        }
        let ends = rays.map(|ray| eye.position + ray * (end / normal.dot(ray)));
        let are_before =
            rays.iter().all(|ray| normal.dot(*ray) > 0.0) && ends.iter().all(|end| end.is_finite());
        are_before && self.accel.is_empty_within(&Frustum::to(eye.position, ends))
    }
}
