//! What of a view is the same for every pixel, worked out once: its ray, its beam.

use super::interaction::Beam;
use super::lanes::Vec3x4;
use crate::accel::{Accel, Ray};
use crate::scene::View;
use glam::{DVec2, Vec3, Vec4};

/// The eye of a view in render space.
#[derive(Debug, Clone, Copy)]
pub struct Eye {
    view: View,
    half_extent: DVec2,
    /// Relative to the tracer's origin.
    pub(super) position: Vec3,
    pub(super) forward: Vec3,
    pub(super) perspective: bool,
    /// Side of a pixel at planar depth 1, or anywhere for orthographic views.
    pub(super) pixel: f32,
    pub(super) near: f32,
    pub(super) far: f32,
    /// Of the solid that it is inside, 1/m.
    pub(super) absorption: Vec3,
}

impl Eye {
    pub(super) fn new(view: &View, accel: &Accel) -> Self {
        Self {
            view: *view,
            half_extent: view.half_extent(),
            position: (view.eye - accel.origin()).as_vec3(),
            forward: view.forward.as_vec3(),
            perspective: view.is_perspective(),
            pixel: view.pixel_size() as f32,
            near: view.lens.near.max(0.0) as f32,
            far: view.lens.far as f32,
            absorption: Vec3::ZERO,
        }
    }

    /// The same eye with beams as wide as sub-pixels, of which there are 2^level to a pixel's side.
    #[must_use]
    pub fn finer(&self, level: usize) -> Self {
        Self { pixel: self.pixel / (1u32 << level) as f32, ..*self }
    }

    /// The ray through raster position (x, y), from the near plane to the far plane; its parameter is planar depth.
    #[inline]
    pub(super) fn ray(&self, accel: &Accel, x: f64, y: f64) -> Ray {
        let ray = self.view.ray_within(self.half_extent, x, y);
        let origin = if self.perspective { self.position } else { (ray.origin - accel.origin()).as_vec3() };
        Ray { origin, direction: ray.direction.as_vec3(), t_min: self.near, t_max: self.far }
    }

    /// Unit direction from `point` to the eye, and the pixel's beam there.
    pub(super) fn seen_from(&self, point: Vec3) -> (Vec3, Beam) {
        let (toward, widths) = self.seen_from_four(Vec3x4::splat(point));
        (toward.lane(0), Beam { width: widths.x, spread: self.spread() })
    }

    /// Unit directions from four points to the eye, and how wide the pixel's beam is there.
    #[inline]
    pub(super) fn seen_from_four(&self, points: Vec3x4) -> (Vec3x4, Vec4) {
        let forward = Vec3x4::splat(self.forward);
        if !self.perspective {
            return (-forward, Vec4::splat(self.pixel));
        }
        let along = points - Vec3x4::splat(self.position);
        (-along.normalize_or(forward), along.dot(forward).abs() * self.pixel)
    }

    /// How much wider a pixel's beam becomes by the metre.
    #[inline]
    pub(super) fn spread(&self) -> f32 {
        if self.perspective { self.pixel } else { 0.0 }
    }
}
