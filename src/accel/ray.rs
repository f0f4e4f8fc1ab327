//! Rays, and what they meet.

use super::bounds::Bounds;
use super::triangle::ShearedRay;
use super::wide::SlabRay;
use crate::frame::SurfaceRef;
use glam::Vec3;

/// A ray in render space, relative to [`Accel::origin`](super::Accel::origin), and the part of it that counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where its parameter is 0.
    pub origin: Vec3,
    /// Of any length; the ray's parameter is measured in it.
    pub direction: Vec3,
    /// Nothing nearer is met.
    pub t_min: f32,
    /// Nothing farther is met.
    pub t_max: f32,
}

/// A ray prepared to meet known surfaces, one by one.
#[derive(Debug, Clone, Copy)]
pub struct PreparedRay {
    pub(super) ray: Ray,
    pub(super) sheared: ShearedRay,
}

impl PreparedRay {
    /// Prepares a ray.
    pub fn new(ray: Ray) -> Self {
        Self { ray, sheared: ShearedRay::new(ray.origin, ray.direction) }
    }

    /// Ends it where it has met something.
    pub fn end_at(&mut self, t: f32) {
        self.ray.t_max = t;
    }
}

/// What a ray meets: the little that is needed to go on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayHit {
    /// In lengths of the ray's direction.
    pub t: f32,
    /// Where it is on which surface.
    pub surface: SurfaceRef,
    /// True on the side from which the triangle is wound counter-clockwise (clockwise where its instance is mirrored),
    /// and outside of a shape.
    pub front: bool,
}

/// Which sides of surfaces a ray meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// What the eye sees: no back faces of materials that are neither double-sided nor transmissive.
    Visible,
    /// Everything.
    Both,
}

/// A ray in the space of a tree. Its direction is not normalised, so that its parameter is measured alike in all.
pub(super) struct LocalRay {
    pub origin: Vec3,
    pub direction: Vec3,
    pub t_min: f32,
    /// How far along the whole ray it starts.
    pub start: f32,
}

impl LocalRay {
    pub fn whole(&Ray { origin, direction, t_min, .. }: &Ray) -> Self {
        Self { origin, direction, t_min, start: 0.0 }
    }

    /// The same from where it comes near to what it is to meet.
    #[inline]
    pub fn approaching(&self, bounds: &Bounds) -> Self {
        let &Self { origin, direction, t_min, start } = self;
        let on = bounds.approach(origin, direction);
        Self { origin: origin + direction * on, direction, t_min: t_min - on, start: start + on }
    }

    pub fn prepare(&self) -> (SlabRay, ShearedRay) {
        (SlabRay::new(self.origin, self.direction, self.t_min), ShearedRay::new(self.origin, self.direction))
    }
}
