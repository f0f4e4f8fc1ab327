//! The space that a surface takes up, as a grid of marked voxels (the paper's "Moving objects").

use glam::{UVec3, Vec3};

/// Voxels along the longest side of what moved. The seam around it, in which pixels and shadows are asked anew for nothing, is
/// one voxel wide; marking and walking take time in proportion.
const LONGEST: f32 = 64.0;

/// Cubes of equal size around a surface; those that it passes through are marked.
#[derive(Debug, Clone, Default)]
pub struct Voxels {
    min: Vec3,
    max: Vec3,
    /// Voxels to a metre.
    per_metre: f32,
    size: UVec3,
    bits: Vec<u64>,
}

impl Voxels {
    /// Marks the voxels of `triangles` (metres, relative to the segment's origin), which may be anywhere; those that are not finite are left out. `slack` says how
    /// far around a point its voxels are marked too, metres.
    pub fn new(triangles: impl Iterator<Item = [Vec3; 3]> + Clone, slack: impl Fn(Vec3) -> f32) -> Self {
        let around = |corners: [Vec3; 3]| {
            let slack = corners.map(&slack).into_iter().fold(0.0, f32::max);
            let [min, max] =
                [Vec3::min, Vec3::max].map(|pick| corners.into_iter().reduce(pick).unwrap_or_default());
            (min - slack, max + slack, slack)
        };
        let triangles = triangles.filter(|corners| corners.iter().all(|c| c.is_finite()));
        let (mut min, mut max, mut widest) = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0.0f32);
        for (from, to, slack) in triangles.clone().map(around) {
            (min, max, widest) = (min.min(from), max.max(to), widest.max(slack));
        }
        let longest = (max - min).max_element();
        if !longest.is_finite() {
            return Self::default();
        }
        // A voxel is no smaller than the slack, since its neighbours would be marked as well.
        let side = (longest / LONGEST).max(widest).max(f32::MIN_POSITIVE);
        let per_metre = side.recip();
        let size = ((max - min) * per_metre).ceil().as_uvec3().max(UVec3::ONE);
        let bits = vec![0; (size.element_product() as usize).div_ceil(64)];
        let mut this = Self { min, max, per_metre, size, bits };
        for corners in triangles {
            let (from, to, slack) = around(corners);
            this.mark(corners, from, to, slack);
        }
        this
    }

    /// Marks the voxels in the box `from` to `to` that the plane of the triangle passes within `slack`.
    fn mark(&mut self, corners: [Vec3; 3], from: Vec3, to: Vec3, slack: f32) {
        let [first, last] = [from, to].map(|p| self.voxel((p - self.min) * self.per_metre));
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let half = 0.5 / self.per_metre;
        // What lies within the box spanned by the voxel's half sides, along the normal, and what rounding may take.
        let reach = half * normal.abs().element_sum() * 1.001 + slack;
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in first.x..=last.x {
                    let voxel = UVec3::new(x, y, z);
                    let middle = self.min + (voxel.as_vec3() + 0.5) / self.per_metre;
                    if normal.dot(middle - a).abs() <= reach {
                        let bit = self.bit(voxel);
                        self.bits[bit / 64] |= 1 << (bit % 64);
                    }
                }
            }
        }
    }

    /// The voxel of a point in voxels from the grid's corner, or the nearest one.
    fn voxel(&self, at: Vec3) -> UVec3 {
        at.max(Vec3::ZERO).as_uvec3().min(self.size - 1)
    }

    fn bit(&self, voxel: UVec3) -> usize {
        ((voxel.z * self.size.y + voxel.y) * self.size.x + voxel.x) as usize
    }

    /// True where nothing is marked.
    pub fn is_empty(&self) -> bool {
        self.bits.is_empty()
    }

    /// Lowest and highest corner of the grid, as triangles are given; none where nothing is marked.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        (!self.is_empty()).then_some((self.min, self.max))
    }

    /// True if the line from `from` along `direction`, up to `until` times as far (which may be infinite), passes through a
    /// marked voxel.
    pub fn are_crossed(&self, from: Vec3, direction: Vec3, until: f32) -> bool {
        self.walk(from, direction, until, false)
    }

    /// The same of a line that begins on the surface itself: voxels that are marked all the way from there do not count.
    pub fn are_crossed_again(&self, from: Vec3, direction: Vec3, until: f32) -> bool {
        self.walk(from, direction, until, true)
    }

    /// Walks the voxels on a line until one is marked, once `inside` has been left.
    fn walk(&self, from: Vec3, direction: Vec3, until: f32, mut inside: bool) -> bool {
        let Some((begin, end)) = clip((self.min, self.max), from, direction, until) else { return false };
        if self.is_empty() {
            return false;
        }
        // In voxels, from where the line comes in.
        let start = (from + direction * begin - self.min) * self.per_metre;
        let along = direction * self.per_metre;
        let mut voxel = self.voxel(start).as_ivec3();
        let last = self.size.as_ivec3() - 1;
        let step = along.signum().as_ivec3();
        let across = along.abs().recip();
        let ahead = voxel.as_vec3() + Vec3::select(along.cmpgt(Vec3::ZERO), Vec3::ONE, Vec3::ZERO) - start;
        // A line that keeps to one slab of voxels never leaves it.
        let leaves = Vec3::select(along.cmpeq(Vec3::ZERO), Vec3::INFINITY, ahead / along);
        let mut next = leaves;
        loop {
            let bit = self.bit(voxel.as_uvec3());
            let marked = self.bits[bit / 64] >> (bit % 64) & 1 != 0;
            if marked && !inside {
                return true;
            }
            inside &= marked;
            let axis = next.min_position();
            if next[axis] > end - begin {
                return false;
            }
            voxel[axis] += step[axis];
            next[axis] += across[axis];
            if voxel[axis] < 0 || voxel[axis] > last[axis] {
                return false;
            }
        }
    }
}

/// The part of a line that lies within a box, as multiples of `direction`; none where it passes by.
pub(super) fn clip((min, max): (Vec3, Vec3), from: Vec3, direction: Vec3, until: f32) -> Option<(f32, f32)> {
    // No number is 0 times what a line parallel to a side has instead of infinity.
    let zero = direction.cmpeq(Vec3::ZERO);
    let per = Vec3::select(zero, Vec3::splat(f32::MIN_POSITIVE), direction).recip();
    let (a, b) = ((min - from) * per, (max - from) * per);
    let near = a.min(b).to_array().into_iter().fold(0.0, f32::max);
    let far = a.max(b).to_array().into_iter().fold(until, f32::min);
    (near <= far).then_some((near, far))
}
