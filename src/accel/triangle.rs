//! A triangle as rays meet it: watertight along shared edges.
//!
//! Woop, Benthin, Wald: Watertight Ray/Triangle Intersection (JCGT 2013). The vertices are sheared into the ray's own
//! frame, where an edge's function is computed from its two vertices alone; two triangles that share the edge
//! get exactly opposite values, so no ray slips between them. Zero counts as inside for both.

use glam::Vec3;

/// A triangle in the order of its tree: 48 bytes, corners and what a hit needs to know.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(super) struct TreeTriangle {
    /// Corners in x, y, z. In the fourth place, as bits: the primitive's number in its mesh, the number of the mesh
    /// in the tree, and the [`super::opacity`] flags.
    corners: [[f32; 4]; 3],
}

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct TriangleHit {
    pub t: f32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
    /// True on the side from which the corners go counter-clockwise.
    pub front: bool,
}

impl TreeTriangle {
    pub fn new(corners: [Vec3; 3], primitive: u32, part: u32, flags: u32) -> Self {
        let with = |p: Vec3, bits: u32| [p.x, p.y, p.z, f32::from_bits(bits)];
        let [a, b, c] = corners;
        Self { corners: [with(a, primitive), with(b, part), with(c, flags)] }
    }

    pub fn primitive(&self) -> u32 {
        self.corners[0][3].to_bits()
    }

    pub fn part(&self) -> u32 {
        self.corners[1][3].to_bits()
    }

    pub fn flags(&self) -> u32 {
        self.corners[2][3].to_bits()
    }

    pub fn corners(&self) -> [Vec3; 3] {
        self.corners.map(|[x, y, z, _]| Vec3::new(x, y, z))
    }
}

/// A ray prepared for many triangles: its origin, and the shear that turns its direction into +Z.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShearedRay {
    origin: [f32; 4],
    /// Axes: the third is the direction's longest, the others keep the triangle's winding.
    axes: [usize; 3],
    shear: [f32; 3],
}

impl ShearedRay {
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let d = direction.to_array();
        let longest = direction.abs().max_position();
        let (mut first, mut second) = ((longest + 1) % 3, (longest + 2) % 3);
        if d[longest] < 0.0 {
            std::mem::swap(&mut first, &mut second);
        }
        let inverse = 1.0 / d[longest];
        Self {
            origin: origin.extend(0.0).to_array(),
            axes: [first, second, longest],
            shear: [d[first] * inverse, d[second] * inverse, inverse],
        }
    }

    /// The hit with `t_min <= t <= t_max`, where there is one. False comparisons with NaN make a miss of every
    /// degenerate case.
    #[inline(always)]
    pub fn intersect(&self, triangle: &TreeTriangle, t_min: f32, t_max: f32) -> Option<TriangleHit> {
        // The mask proves to the compiler that the indices are in range.
        let [kx, ky, kz] = self.axes.map(|k| k & 3);
        let [sx, sy, sz] = self.shear;
        let shear = |corner: &[f32; 4]| {
            let z = corner[kz] - self.origin[kz];
            [corner[kx] - self.origin[kx] - sx * z, corner[ky] - self.origin[ky] - sy * z, z]
        };
        let [a, b, c] = &triangle.corners;
        let (a, b, c) = (shear(a), shear(b), shear(c));
        let wa = c[0] * b[1] - c[1] * b[0];
        let wb = a[0] * c[1] - a[1] * c[0];
        let wc = b[0] * a[1] - b[1] * a[0];
        let inside = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
        if !inside {
            return None;
        }
        let sum = wa + wb + wc;
        if sum == 0.0 {
            return None;
        }
        let inverse = 1.0 / sum;
        let t = (wa * a[2] + wb * b[2] + wc * c[2]) * inverse * sz;
        (t >= t_min && t <= t_max).then_some(TriangleHit {
            t,
            u: wb * inverse,
            v: wc * inverse,
            front: sum > 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn a_hit_has_its_barycentrics_and_side() {
        let triangle = TreeTriangle::new(CORNERS, 7, 8, 9);
        assert_eq!((triangle.primitive(), triangle.part(), triangle.flags()), (7, 8, 9));
        let down = ShearedRay::new(Vec3::new(0.25, 0.5, 3.0), Vec3::NEG_Z);
        let hit = down.intersect(&triangle, 0.0, 10.0).unwrap();
        assert_eq!((hit.t, hit.u, hit.v, hit.front), (3.0, 0.25, 0.5, true));
        let up = ShearedRay::new(Vec3::new(0.25, 0.5, -3.0), Vec3::Z);
        let hit = up.intersect(&triangle, 0.0, 10.0).unwrap();
        assert_eq!((hit.t, hit.u, hit.v, hit.front), (3.0, 0.25, 0.5, false));
        assert!(up.intersect(&triangle, 0.0, 2.9).is_none() && up.intersect(&triangle, 3.1, 9.0).is_none());
    }

    #[test]
    fn degenerate_triangles_and_rays_miss() {
        let ray = ShearedRay::new(Vec3::new(0.0, 0.0, 3.0), Vec3::NEG_Z);
        for corners in [[Vec3::ZERO; 3], [Vec3::ZERO, Vec3::X, Vec3::X * 2.0], [Vec3::NAN, Vec3::X, Vec3::Y]]
        {
            assert!(ray.intersect(&TreeTriangle::new(corners, 0, 0, 0), 0.0, 10.0).is_none());
        }
        let nowhere = ShearedRay::new(Vec3::new(0.1, 0.1, 3.0), Vec3::ZERO);
        assert!(nowhere.intersect(&TreeTriangle::new(CORNERS, 0, 0, 0), 0.0, 10.0).is_none());
    }
}
