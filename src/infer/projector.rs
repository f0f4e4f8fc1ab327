//! The paper's "Generalizing Reprojection": where a stored hit lies in another view.

use crate::frame::{SurfaceSample, Way};
use crate::scene::View;
use glam::{DVec3, Mat4, Vec3};

/// The paper's four by four matrix and perspective division: where a stored hit lies in a view.
///
/// Single precision on coordinates relative to `origin` (world metres; the eye of the segment's key frame). On an image of 1280x720
/// that costs 1e-4 pixel for hits as far away as they like and an eye that is as far from the origin as from the nearest thing seen,
/// 1e-3 pixel a hundred times as far away, 0.1 pixel a thousand times.
#[derive(Debug, Clone, Copy)]
pub struct Projector {
    raster_from_world: Mat4,
    eye: Vec3,
    forward: Vec3,
    perspective: bool,
    near: f32,
    far: f32,
    width: f32,
    height: f32,
    columns: usize,
    /// Side of a pixel at planar depth 1, or anywhere in parallel projection.
    pixel: f32,
}

/// Where a sample lies in a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projected {
    /// Pixels from the image's upper left corner, to the right.
    pub x: f32,
    /// Pixels from there, downward.
    pub y: f32,
    /// Planar depth, metres; infinite for the background.
    pub z: f32,
}

impl Projector {
    /// The projection of `view` for positions relative to `origin`.
    pub fn new(view: &View, origin: DVec3) -> Self {
        Self {
            raster_from_world: view.raster_from_world(origin).as_mat4(),
            eye: (view.eye - origin).as_vec3(),
            forward: view.forward.as_vec3(),
            perspective: view.is_perspective(),
            near: view.lens.near as f32,
            far: view.lens.far as f32,
            width: view.width as f32,
            height: view.height as f32,
            columns: view.width as usize,
            pixel: view.pixel_extent().max_element() as f32,
        }
    }

    /// Where a sample appears, or none where it is behind the eye, clipped, or turned away. Its `position` is relative to the origin,
    /// of the background its direction; its `normal` is of any length.
    pub fn project(&self, position: Vec3, normal: Vec3, background: bool) -> Option<Projected> {
        if background {
            // Infinitely far away: only the direction counts. Parallel rays give it no place.
            let r = self.raster_from_world * position.extend(0.0);
            let seen = self.perspective && r.w > 0.0;
            return seen.then(|| Projected { x: r.x / r.w, y: r.y / r.w, z: f32::INFINITY });
        }
        let r = self.raster_from_world * position.extend(1.0);
        let seen = r.z >= self.near && r.z <= self.far && r.w > 0.0 && self.faces(position, normal);
        seen.then(|| Projected { x: r.x / r.w, y: r.y / r.w, z: r.z })
    }

    /// The raster column, with its fraction, of a point before the eye or a direction towards the background.
    pub(super) fn column(&self, position: Vec3, background: bool) -> f32 {
        let r = self.raster_from_world * position.extend(if background { 0.0 } else { 1.0 });
        r.x / r.w
    }

    /// True if a point's surface is turned to the eye.
    pub(super) fn faces(&self, position: Vec3, normal: Vec3) -> bool {
        self.direction_to(position).dot(normal) < 0.0
    }

    /// Planar depth of a sample; infinite for the background.
    #[inline]
    pub fn depth(&self, sample: &SurfaceSample) -> f32 {
        if sample.surface.is_background() {
            f32::INFINITY
        } else {
            (self.raster_from_world * sample.position.extend(1.0)).z
        }
    }

    /// The longer side of a pixel at planar depth 1, or anywhere in parallel projection, metres.
    pub(super) fn side(&self) -> f32 {
        self.pixel
    }

    /// The longer side of a pixel at a point's depth, metres.
    pub fn pixel_width(&self, position: Vec3) -> f32 {
        let depth = if self.perspective { (position - self.eye).dot(self.forward).abs() } else { 1.0 };
        self.pixel * depth
    }

    /// Number of the pixel that holds raster position (x, y), if it is in the window.
    pub fn pixel(&self, x: f32, y: f32) -> Option<usize> {
        let inside = x >= 0.0 && y >= 0.0 && x < self.width && y < self.height;
        inside.then(|| y as u32 as usize * self.columns + x as u32 as usize)
    }

    /// The direction in which a ray of this view passes through `position`; not normalised.
    pub(super) fn direction_to(&self, position: Vec3) -> Vec3 {
        if self.perspective { position - self.eye } else { self.forward }
    }

    /// The line on which the sample is seen, from it to the eye or the other way: from where, along what, how many times as
    /// far. It begins at the sample, but for the background.
    pub(super) fn line_to(&self, sample: &SurfaceSample) -> (Vec3, Vec3, f32) {
        match (self.perspective, sample.surface.is_background()) {
            (true, true) => (self.eye, sample.position, f32::INFINITY),
            (true, false) => (sample.position, self.eye - sample.position, 1.0),
            (false, _) => (sample.position, -self.forward, f32::INFINITY),
        }
    }

    /// The way on which what is not the background is seen.
    pub(super) fn way_to_eye(&self) -> Way {
        if self.perspective { Way::From(self.eye, 0.0) } else { Way::Along(-self.forward, 0.0) }
    }

    /// A number that is another in every view, as if by chance.
    pub(super) fn scatter(&self) -> u64 {
        let bits = self.raster_from_world.to_cols_array().map(f32::to_bits);
        // FNV-1a by words, then its well-mixed half.
        let hash = bits.into_iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, word| {
            (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
        });
        (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 32
    }

    pub(super) fn raster_from_world(&self) -> &Mat4 {
        &self.raster_from_world
    }

    pub(super) fn is_perspective(&self) -> bool {
        self.perspective
    }

    pub(super) fn near(&self) -> f32 {
        self.near
    }

    pub(super) fn size(&self) -> (f32, f32) {
        (self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Lens, Projection};
    use glam::{DVec2, DVec3};

    /// The farthest that a hit a metre before the eye lands from its pixel's centre, where the eye is so far from the origin.
    fn error(away: f64) -> f64 {
        let projection = Projection::Perspective { yfov: 0.8 };
        let lens =
            Lens { projection, shift: DVec2::ZERO, near: 0.01, far: f64::INFINITY, sensor_height: None };
        let eye = DVec3::new(0.6, 0.3, -0.74).normalize() * away;
        let (right, up, forward) = (DVec3::X, DVec3::Y, DVec3::NEG_Z);
        let view = View { eye, right, up, forward, lens, width: 1280, height: 720, pixel_aspect: 1.0 };
        let projector = Projector::new(&view, DVec3::ZERO);
        let error_at = |i: u32| {
            let (x, y) = (f64::from(i * 37 % 1280) + 0.5, f64::from(i * 53 % 720) + 0.5);
            let ray = view.ray(x, y);
            let point = (ray.origin + ray.direction).as_vec3();
            let seen = projector.project(point, Vec3::Z, false).unwrap();
            (f64::from(seen.x) - x).abs().max((f64::from(seen.y) - y).abs())
        };
        (0..2000).map(error_at).fold(0.0, f64::max)
    }

    #[test]
    fn single_precision_costs_as_little_as_is_said() {
        for (away, most) in [(1.0, 2e-4), (10.0, 1e-3), (100.0, 2e-3), (1000.0, 0.1)] {
            assert!(error(away) < most, "{away} times as far away as the hit: {}", error(away));
        }
    }
}
