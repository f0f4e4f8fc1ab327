//! A triangle as rays meet it: watertight along shared edges.
//!
//! Woop, Benthin, Wald: Watertight Ray/Triangle Intersection (JCGT 2013). The vertices are sheared into the ray's own
//! frame, where an edge's function is computed from its two vertices alone; two triangles that share the edge
//! get exactly opposite values, so no ray slips between them. Zero counts as inside for both.

use glam::{BVec4A, Vec3, Vec3A, Vec4, Vec4Swizzles};

/// A triangle, and what a hit on it needs to know.
#[derive(Debug, Clone, Copy)]
pub(super) struct TreeTriangle {
    pub corners: [Vec3; 3],
    /// Its number in its mesh.
    pub primitive: u32,
    /// The number of the mesh in the tree.
    pub part: u32,
    /// Those of [`super::opacity`].
    pub flags: u32,
}

/// Up to four triangles, which are tested at once.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrianglePack {
    /// For each corner and axis: the coordinates of all. NaN where there is none, so that it is never met.
    corners: [[Vec4; 3]; 3],
    primitives: [u32; 4],
    parts: [u32; 4],
    flags: [u32; 4],
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

/// Where a ray meets the triangles of a pack, and a bit for each that it meets.
#[derive(Debug, Clone, Copy)]
pub(super) struct PackHits {
    mask: u32,
    t: Vec4,
    u: Vec4,
    v: Vec4,
    front: u32,
}

impl TrianglePack {
    /// Triangles in a pack.
    pub const MOST: usize = 4;

    /// Of one to four triangles.
    pub fn new<'a>(triangles: impl Iterator<Item = &'a TreeTriangle>) -> Self {
        let (mut corners, mut numbers) = ([[Vec4::NAN; 3]; 3], [[0; 4]; 3]);
        for (lane, triangle) in triangles.take(Self::MOST).enumerate() {
            for (axes, corner) in corners.iter_mut().zip(triangle.corners) {
                axes.iter_mut().zip(corner.to_array()).for_each(|(axis, value)| axis[lane] = value);
            }
            let of = [triangle.primitive, triangle.part, triangle.flags];
            numbers.iter_mut().zip(of).for_each(|(numbers, number)| numbers[lane] = number);
        }
        let [primitives, parts, flags] = numbers;
        Self { corners, primitives, parts, flags }
    }

    /// For each corner and axis: the coordinates of all.
    pub fn corners(&self) -> &[[Vec4; 3]; 3] {
        &self.corners
    }

    /// The corners of one.
    pub fn triangle(&self, lane: usize) -> [Vec3A; 3] {
        self.corners.map(|[x, y, z]| Vec3A::new(x[lane], y[lane], z[lane]))
    }

    pub fn primitive(&self, lane: usize) -> u32 {
        self.primitives[lane]
    }

    pub fn part(&self, lane: usize) -> u32 {
        self.parts[lane]
    }

    pub fn flags(&self, lane: usize) -> u32 {
        self.flags[lane]
    }
}

impl PackHits {
    /// The bits, and the barycentric weights of the second and the third corners.
    pub fn weights(&self) -> (u32, Vec4, Vec4) {
        (self.mask, self.u, self.v)
    }
}

impl Iterator for PackHits {
    type Item = (usize, TriangleHit);

    /// The next triangle that is met, by its place in the pack.
    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        if self.mask == 0 {
            return None;
        }
        let lane = self.mask.trailing_zeros() as usize & 3;
        self.mask &= self.mask - 1;
        let hit = TriangleHit {
            t: self.t[lane],
            u: self.u[lane],
            v: self.v[lane],
            front: self.front >> lane & 1 == 1,
        };
        Some((lane, hit))
    }
}

/// A ray prepared for many triangles: its origin, and the shear that turns its direction into +Z. Or four of them, prepared
/// for one triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShearedRay {
    /// Axes: the third is the direction's longest, the others keep the triangle's winding.
    axes: [usize; 3],
    /// In the order of the axes.
    origin: [Vec4; 3],
    shear: [Vec4; 3],
}

impl ShearedRay {
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let d = direction.to_array();
        let axes = axes_along(direction);
        let [first, second, longest] = axes;
        let inverse = 1.0 / d[longest];
        Self {
            axes,
            origin: axes.map(|axis| Vec4::splat(origin[axis])),
            shear: [d[first] * inverse, d[second] * inverse, inverse].map(Vec4::splat),
        }
    }

    /// Four rays from one point, of which `directions` has each axis, if all look mostly along the same one.
    pub fn four(origin: Vec3, directions: [Vec4; 3]) -> Option<Self> {
        let axes = axes_along(Vec3::from(directions.map(|d| d.x)));
        let [first, second, longest] = axes.map(|axis| directions[axis]);
        let is_longest = longest.abs().cmpgt(first.abs()) & longest.abs().cmpgt(second.abs());
        let is_forward = longest.cmpgt(Vec4::ZERO);
        let inverse = Vec4::ONE / longest;
        (is_longest.all() && (is_forward.all() || !is_forward.any())).then(|| Self {
            axes,
            origin: axes.map(|axis| Vec4::splat(origin[axis])),
            shear: [first * inverse, second * inverse, inverse],
        })
    }

    /// The hits with `t_min <= t <= t_max`.
    #[inline(always)]
    pub fn intersect(&self, pack: &TrianglePack, t_min: f32, t_max: f32) -> PackHits {
        self.meet_all(&pack.corners, t_min, t_max)
    }

    /// The hits with `t_min <= t <= t_max` on triangles of which there is each corner and axis. False comparisons with NaN make a miss of every degenerate case.
    #[inline(always)]
    pub fn meet_all(&self, corners: &[[Vec4; 3]; 3], t_min: f32, t_max: f32) -> PackHits {
        let [kx, ky, kz] = self.axes;
        let [ox, oy, oz] = self.origin;
        let [sx, sy, sz] = self.shear;
        let shear = |corner: &[Vec4; 3]| {
            let z = corner[kz] - oz;
            [corner[kx] - ox - sx * z, corner[ky] - oy - sy * z, z]
        };
        let [a, b, c] = corners;
        let (a, b, c) = (shear(a), shear(b), shear(c));
        let wa = c[0] * b[1] - c[1] * b[0];
        let wb = a[0] * c[1] - a[1] * c[0];
        let wc = b[0] * a[1] - b[1] * a[0];
        let zero = Vec4::ZERO;
        let inside = (wa.cmpge(zero) & wb.cmpge(zero) & wc.cmpge(zero))
            | (wa.cmple(zero) & wb.cmple(zero) & wc.cmple(zero));
        let sum = wa + wb + wc;
        let inside = inside & sum.cmpne(zero);
        if !inside.any() {
            return PackHits { mask: 0, t: zero, u: zero, v: zero, front: 0 };
        }
        let inverse = Vec4::ONE / sum;
        let t = (wa * a[2] + wb * b[2] + wc * c[2]) * inverse * sz;
        let mut met = inside & t.cmpge(Vec4::splat(t_min)) & t.cmple(Vec4::splat(t_max));
        if met.any() {
            let largest = |axis: usize| a[axis].abs().max(b[axis].abs()).max(c[axis].abs());
            let weight = wa.abs().max(wb.abs()).max(wc.abs());
            let doubtful = met & t.cmplt(rounding([0, 1, 2].map(largest), weight) * (inverse * sz).abs());
            if doubtful.any() {
                met &= !doubtful | self.by_plane(corners).cmpge(Vec4::splat(t_min));
            }
        }
        let (u, v) = (wb * inverse, wc * inverse);
        PackHits { mask: met.bitmask(), t, u, v, front: sum.cmpgt(zero).bitmask() }
    }

    /// Where the ray meets the planes of triangles. Weights sum up to next to nothing on slivers, and where these are seen from their edge: a
    /// ray that leaves one would meet those beside it, which are behind it, were it not for this.
    #[cold]
    fn by_plane(&self, corners: &[[Vec4; 3]; 3]) -> Vec4 {
        let [sx, sy, sz] = self.shear;
        let [a, b, c] = corners.each_ref().map(|corner| {
            let axis = |i: usize| corner[self.axes[i]] - self.origin[i];
            [axis(0), axis(1), axis(2)]
        });
        let [p, q] = [b, c].map(|corner| [corner[0] - a[0], corner[1] - a[1], corner[2] - a[2]]);
        let normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        let height = normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2];
        height * sz / (normal[0] * sx + normal[1] * sy + normal[2])
    }

    /// The hit on one triangle, of which each axis has the coordinates of all corners, with `t_min <= t <= t_max`:
    /// to the last bit that of a pack.
    #[inline]
    pub fn meet(&self, corners: &[Vec4; 3], t_min: f32, t_max: f32) -> Option<TriangleHit> {
        let [kx, ky, kz] = self.axes;
        let [ox, oy, oz] = self.origin;
        let [sx, sy, sz] = self.shear;
        let z = corners[kz] - oz;
        let (x, y) = (corners[kx] - ox - sx * z, corners[ky] - oy - sy * z);
        let weights = x.zxyw() * y.yzxw() - y.zxyw() * x.yzxw();
        let all = |lanes: BVec4A| lanes.bitmask() & 0b111 == 0b111;
        let inside = all(weights.cmpge(Vec4::ZERO)) || all(weights.cmple(Vec4::ZERO));
        let sum = weights.x + weights.y + weights.z;
        if !inside || sum == 0.0 {
            return None;
        }
        let inverse = 1.0 / sum;
        let weighed = weights * z;
        let t = (weighed.x + weighed.y + weighed.z) * inverse * sz.x;
        let largest = |v: Vec4| Vec4::splat(v.truncate().abs().max_element());
        let is_doubtful = || {
            let rounding = rounding([x, y, z].map(largest), largest(weights)).x;
            t < rounding * (inverse * sz.x).abs()
        };
        let is_before = || {
            let corner = |lane: usize| corners.map(|axis| Vec4::splat(axis[lane]));
            self.by_plane(&[corner(0), corner(1), corner(2)]).x >= t_min
        };
        let met = t >= t_min && t <= t_max && (!is_doubtful() || is_before());
        met.then_some(TriangleHit { t, u: weights.y * inverse, v: weights.z * inverse, front: sum > 0.0 })
    }
}

/// How far rounding may take the sum of corners' depths, each with its weight, where no sheared coordinate is over `largest` and no weight over
/// `weight` (Pharr, Jakob, Humphreys: Physically Based Rendering, 3rd edition, 3.9.6).
#[inline(always)]
fn rounding([x, y, z]: [Vec4; 3], weight: Vec4) -> Vec4 {
    const fn gamma(operations: f32) -> f32 {
        let n = operations * 0.5 * f32::EPSILON;
        n / (1.0 - n)
    }
    let (dx, dy, dz) = ((x + z) * gamma(5.0), (y + z) * gamma(5.0), z * gamma(3.0));
    let edge = 2.0 * (x * y * gamma(2.0) + dy * x + dx * y);
    3.0 * (weight * z * gamma(3.0) + edge * z + dz * weight)
}

/// The axes of a ray's own frame: the third is the direction's longest, the others keep a triangle's winding.
fn axes_along(direction: Vec3) -> [usize; 3] {
    let longest = direction.abs().max_position();
    let (first, second) = ((longest + 1) % 3, (longest + 2) % 3);
    if direction[longest] < 0.0 { [second, first, longest] } else { [first, second, longest] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A triangle alone is met where it is met in a pack, to the last bit.
        #[test]
        fn one_triangle_is_met_as_in_a_pack(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0..1.0f32)),
            [u, v] in prop::array::uniform2(-0.2..1.2f32),
            origin in prop::array::uniform3(-3.0..3.0f32),
            length in 0.1..4.0f32,
        ) {
            let corners = corners.map(Vec3::from);
            let [a, b, c] = corners;
            let origin = Vec3::from(origin);
            // Towards the triangle or past its sides, and at times too short to reach it.
            let ray = ShearedRay::new(origin, (a + (b - a) * u + (c - a) * v - origin) / length);
            let axes = [0, 1, 2].map(|axis| Vec4::new(a[axis], b[axis], c[axis], 0.0));
            let bits = |hit: TriangleHit| ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.front);
            let alone = ray.meet(&axes, 0.0, 3.0).map(bits);
            prop_assert_eq!(alone, meet(&ray, corners, 0.0, 3.0).map(bits));
        }

        /// Four rays together meet a triangle where each does alone, to the last bit.
        #[test]
        fn four_rays_meet_as_each_alone(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0..1.0f32)),
            towards in prop::array::uniform4(prop::array::uniform2(-0.2..1.2f32)),
            origin in prop::array::uniform3(-3.0..3.0f32),
        ) {
            let (corners, origin) = (corners.map(Vec3::from), Vec3::from(origin));
            let [a, b, c] = corners;
            let directions = towards.map(|[u, v]| a + (b - a) * u + (c - a) * v - origin);
            let bits = |hit: TriangleHit| ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.front);
            if let Some(four) = ShearedRay::four(origin, [0, 1, 2].map(|axis| directions.map(|d| d[axis]).into())) {
                let mut together = [None; 4];
                let all = corners.map(|corner| corner.to_array().map(Vec4::splat));
                four.meet_all(&all, 0.0, 3.0).for_each(|(ray, hit)| together[ray] = Some(bits(hit)));
                let alone = directions.map(|d| meet(&ShearedRay::new(origin, d), corners, 0.0, 3.0).map(bits));
                prop_assert_eq!(together, alone);
            }
        }
    }

    const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    /// What the ray meets of one triangle.
    fn meet(ray: &ShearedRay, corners: [Vec3; 3], t_min: f32, t_max: f32) -> Option<TriangleHit> {
        let triangle = TreeTriangle { corners, primitive: 0, part: 0, flags: 0 };
        ray.intersect(&TrianglePack::new([triangle].iter()), t_min, t_max).next().map(|(_, hit)| hit)
    }

    #[test]
    fn a_hit_has_its_barycentrics_and_side() {
        let down = ShearedRay::new(Vec3::new(0.25, 0.5, 3.0), Vec3::NEG_Z);
        let hit = meet(&down, CORNERS, 0.0, 10.0).unwrap();
        assert_eq!((hit.t, hit.u, hit.v, hit.front), (3.0, 0.25, 0.5, true));
        let up = ShearedRay::new(Vec3::new(0.25, 0.5, -3.0), Vec3::Z);
        let hit = meet(&up, CORNERS, 0.0, 10.0).unwrap();
        assert_eq!((hit.t, hit.u, hit.v, hit.front), (3.0, 0.25, 0.5, false));
        assert!(meet(&up, CORNERS, 0.0, 2.9).is_none() && meet(&up, CORNERS, 3.1, 9.0).is_none());
    }

    #[test]
    fn a_pack_meets_each_of_its_triangles_and_no_other() {
        let at = |z: f32, part: u32| TreeTriangle {
            corners: CORNERS.map(|c| c + Vec3::Z * z),
            primitive: 10 + part,
            part,
            flags: 20 + part,
        };
        let aside = TreeTriangle { corners: CORNERS.map(|c| c + Vec3::X * 5.0), ..at(0.0, 1) };
        let pack = TrianglePack::new([at(0.0, 0), aside, at(-1.0, 2)].iter());
        let ray = ShearedRay::new(Vec3::new(0.25, 0.5, 3.0), Vec3::NEG_Z);
        let hits: Vec<_> = ray.intersect(&pack, 0.0, 10.0).map(|(lane, hit)| (lane, hit.t)).collect();
        assert_eq!(hits, [(0, 3.0), (2, 4.0)]);
        assert_eq!((pack.primitive(2), pack.part(2), pack.flags(2)), (12, 2, 22));
    }

    #[test]
    fn degenerate_triangles_and_rays_miss() {
        let ray = ShearedRay::new(Vec3::new(0.0, 0.0, 3.0), Vec3::NEG_Z);
        for corners in [[Vec3::ZERO; 3], [Vec3::ZERO, Vec3::X, Vec3::X * 2.0], [Vec3::NAN, Vec3::X, Vec3::Y]]
        {
            assert!(meet(&ray, corners, 0.0, 10.0).is_none());
        }
        let nowhere = ShearedRay::new(Vec3::new(0.1, 0.1, 3.0), Vec3::ZERO);
        assert!(meet(&nowhere, CORNERS, 0.0, 10.0).is_none());
    }
}
