//! The per-pixel record that is carried from frame to frame.

use glam::{Vec2, Vec3, vec2};

/// A point on a surface: which instance, which triangle, where in it; or of an analytic shape, which part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceRef {
    /// Index into `Scene::instances`; [`SurfaceRef::NONE`] for the background.
    pub instance: u32,
    /// Index into `Mesh::triangles`. Of a shape: which of its faces, and which way that looks most: six numbers a face, for
    /// +X, -X, +Y, -Y, +Z, -Z of the object's axes.
    pub primitive: u32,
    /// Barycentric weight of the triangle's second vertex. Of a shape: the object coordinate on the axis after that
    /// which the face looks along (X, Y, Z, X, ...), metres.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex. Of a shape: the coordinate on the axis after that.
    pub v: f32,
}

impl SurfaceRef {
    /// The instance number that means background.
    pub const NONE: u32 = u32::MAX;

    /// The background.
    pub const BACKGROUND: Self = Self { instance: Self::NONE, primitive: 0, u: 0.0, v: 0.0 };

    /// True where the ray met nothing.
    pub fn is_background(self) -> bool {
        self.instance == Self::NONE
    }
}

/// What a ray through a pixel found that does not depend on the eye (the paper's intersection point, normal, id_tag).
/// The shadow bits stand beside it, in words of 32: one for each light, more for one that has a size. The paper's diffuse colour is not stored: it
/// follows from the bits, and shading goes through the lights that they name anyway, for the highlights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSample {
    /// Hit relative to the segment's origin, metres, world axes. For the background: the unit direction.
    pub position: Vec3,
    /// Where that is on which surface.
    pub surface: SurfaceRef,
    /// Object tag; 0 is the background.
    pub object: u32,
    /// Geometric normal along the world's axes, turned to the side from which it was seen.
    pub normal: PackedNormal,
}

impl SurfaceSample {
    /// What a ray in `direction` (unit) finds when it meets nothing.
    pub fn background(direction: Vec3) -> Self {
        Self {
            position: direction,
            surface: SurfaceRef::BACKGROUND,
            object: 0,
            normal: PackedNormal::default(),
        }
    }
}

/// A unit vector in 32 bits: octahedral map, 16 bits a side, error under 7e-5 radians.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PackedNormal(u32);

/// Steps from the middle of the map to its side.
const STEPS: f32 = 32767.0;

impl PackedNormal {
    /// Packs a unit vector.
    pub fn new(n: Vec3) -> Self {
        let n = n / (n.x.abs() + n.y.abs() + n.z.abs()).max(f32::MIN_POSITIVE);
        let p = if n.z >= 0.0 { vec2(n.x, n.y) } else { fold(vec2(n.x, n.y)) };
        let q = |x: f32| (x.clamp(-1.0, 1.0) * STEPS).round() as i16 as u16;
        Self(u32::from(q(p.x)) | u32::from(q(p.y)) << 16)
    }

    /// The unit vector.
    pub fn get(self) -> Vec3 {
        self.direction().normalize()
    }

    /// A vector of the same direction and of any length: all that is needed to tell sides apart.
    #[inline]
    pub fn direction(self) -> Vec3 {
        let d = |x: u32| f32::from(x as u16 as i16);
        let p = vec2(d(self.0), d(self.0 >> 16));
        let z = STEPS - p.x.abs() - p.y.abs();
        // Below, the point is mirrored across the diagonal of its quadrant.
        let fold = (-z).max(0.0);
        Vec3::new(p.x - fold.copysign(p.x), p.y - fold.copysign(p.y), z)
    }
}

/// Mirrors a point of the octahedron's map across the diagonal of its quadrant.
fn fold(p: Vec2) -> Vec2 {
    let sign = |x: f32| if x < 0.0 { -1.0 } else { 1.0 };
    vec2((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_packed_normal_keeps_its_direction(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..1.0) {
            let n = Vec3::new(x, y, z);
            prop_assume!(n.length() > 1e-3);
            let n = n.normalize();
            prop_assert!(PackedNormal::new(n).get().as_dvec3().cross(n.as_dvec3()).length() < 7e-5);
            prop_assert!(PackedNormal::new(n).get().dot(n) > 0.0);
        }
    }
}
