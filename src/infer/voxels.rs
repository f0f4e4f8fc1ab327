//! The space that a surface takes up, as a grid of marked voxels (the paper's "Moving objects").

use glam::{IVec3, UVec3, Vec3, Vec3A};

/// Voxels along the longest side of what moved. The seam around it, in which pixels and shadows are asked anew for nothing, is
/// one voxel wide; marking takes time in proportion.
const LONGEST: f32 = 64.0;

/// Voxels along each side of a brick, whose 64 bits are a word: most bricks are empty, and are passed in one step.
const BRICK: u32 = 4;

/// Cubes of equal size around a surface; those that it passes through are marked.
#[derive(Debug, Clone, Default)]
pub struct Voxels {
    min: Vec3,
    max: Vec3,
    /// Voxels to a metre.
    per_metre: f32,
    /// In voxels.
    size: UVec3,
    /// In bricks.
    bricks: UVec3,
    /// Those of each brick.
    bits: Vec<u64>,
}

/// A straight line from a point, which is asked about boxes.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    from: Vec3A,
    direction: Vec3A,
    /// One over the direction, or nearly so where that would be infinite.
    per: Vec3A,
    until: f32,
}

impl Line {
    /// The line from `from` along `direction`, up to `until` times as far (which may be infinite).
    pub fn new(from: Vec3, direction: Vec3, until: f32) -> Self {
        let (from, direction) = (Vec3A::from(from), Vec3A::from(direction));
        // No number is 0 times what a line parallel to a side has instead of infinity.
        let zero = direction.cmpeq(Vec3A::ZERO);
        let per = Vec3A::select(zero, Vec3A::splat(f32::MIN_POSITIVE), direction).recip();
        Self { from, direction, per, until }
    }

    /// The part of the line that lies within a box, as multiples of its direction; none where it passes by.
    #[inline]
    pub(super) fn within(&self, (min, max): (Vec3A, Vec3A)) -> Option<(f32, f32)> {
        let (a, b) = ((min - self.from) * self.per, (max - self.from) * self.per);
        let near = a.min(b).max_element().max(0.0);
        let far = a.max(b).min_element().min(self.until);
        (near <= far).then_some((near, far))
    }
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
        let bricks = size.map(|side| side.div_ceil(BRICK));
        let bits = vec![0; bricks.element_product() as usize];
        let mut this = Self { min, max, per_metre, size, bricks, bits };
        for corners in triangles {
            let (from, to, slack) = around(corners);
            this.mark(corners, from, to, slack);
        }
        this
    }

    /// Marks the voxels, of a grid that triangles around it have made, near which a surface `may_pass`: it is asked for balls of
    /// some radius around points. `slack` is what the grid was made with.
    pub fn mark_near(&mut self, may_pass: impl Fn(Vec3, f32) -> bool, slack: impl Fn(Vec3) -> f32) {
        let side = self.per_metre.recip();
        let middle = |first: UVec3, sides: u32| self.min + (first.as_vec3() + sides as f32 * 0.5) * side;
        // Half of a cube's diagonal.
        let radius = |sides: u32| sides as f32 * side * 0.75f32.sqrt();
        let cubes = |size: UVec3| {
            (0..size.z).flat_map(move |z| {
                (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec3::new(x, y, z)))
            })
        };
        for brick in cubes(self.bricks) {
            let first = brick * BRICK;
            // The slack is no larger than a voxel.
            if !may_pass(middle(first, BRICK), radius(BRICK) + side) {
                continue;
            }
            let passed = cubes(UVec3::splat(BRICK)).filter(|&place| {
                let middle = middle(first + place, 1);
                may_pass(middle, radius(1) + slack(middle))
            });
            let bits = passed.fold(0, |bits, place| bits | 1 << bit(place));
            let number = self.brick(brick);
            self.bits[number] |= bits;
        }
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
                        let brick = self.brick(voxel / BRICK);
                        self.bits[brick] |= 1 << bit(voxel % BRICK);
                    }
                }
            }
        }
    }

    /// The voxel of a point in voxels from the grid's corner, or the nearest one.
    fn voxel(&self, at: Vec3) -> UVec3 {
        at.max(Vec3::ZERO).as_uvec3().min(self.size - 1)
    }

    /// The number of the brick at a place among bricks.
    fn brick(&self, at: UVec3) -> usize {
        ((at.z * self.bricks.y + at.y) * self.bricks.x + at.x) as usize
    }

    /// True where nothing is marked.
    pub fn is_empty(&self) -> bool {
        self.bits.is_empty()
    }

    /// Lowest and highest corner of the grid, as triangles are given; none where nothing is marked.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        (!self.is_empty()).then_some((self.min, self.max))
    }

    /// True if a line passes through a marked voxel.
    pub fn are_crossed(&self, line: &Line) -> bool {
        self.walk(line, false)
    }

    /// The same of a line that begins on the surface itself: voxels that are marked all the way from there do not count.
    pub fn are_crossed_again(&self, line: &Line) -> bool {
        self.walk(line, true)
    }

    /// Walks the voxels on a line until one is marked, once `inside` has been left: brick by brick, and voxel by voxel where
    /// any of a brick is marked.
    fn walk(&self, line: &Line, mut inside: bool) -> bool {
        if self.is_empty() {
            return false;
        }
        let Some((begin, end)) = line.within((self.min.into(), self.max.into())) else { return false };
        let length = end - begin;
        // In voxels, from where the line comes in.
        let start = (Vec3::from(line.from + line.direction * begin) - self.min) * self.per_metre;
        let along = Vec3::from(line.direction) * self.per_metre;
        let side = BRICK as f32;
        let first = (self.voxel(start) / BRICK).as_ivec3();
        let mut bricks = Walk::new(start / side, along / side, first);
        let mut passed = 0.0;
        loop {
            let word = self.bits[self.brick(bricks.cell.as_uvec3())];
            if word == 0 {
                inside = false;
            } else {
                let corner = bricks.cell.as_vec3() * side;
                let entry = (start + along * passed - corner).clamp(Vec3::ZERO, Vec3::splat(side));
                let voxel = entry.as_ivec3().min(IVec3::splat(BRICK as i32 - 1));
                let mut voxels = Walk::new(entry, along, voxel);
                loop {
                    let marked = word >> bit(voxels.cell.as_uvec3()) & 1 != 0;
                    if marked && !inside {
                        return true;
                    }
                    inside &= marked;
                    if passed + voxels.advance() > length || !voxels.are_in(UVec3::splat(BRICK)) {
                        break;
                    }
                }
            }
            passed = bricks.advance();
            if passed > length || !bricks.are_in(self.bricks) {
                return false;
            }
        }
    }
}

/// The bit of a voxel at a place in its brick.
fn bit(at: UVec3) -> u32 {
    (at.z * BRICK + at.y) * BRICK + at.x
}

/// The cells of a grid that a line passes, one after the other (Amanatides and Woo 1987, "A Fast Voxel Traversal Algorithm").
struct Walk {
    cell: IVec3,
    step: IVec3,
    /// How far along the line the next cell begins on each axis, as a multiple of its direction.
    next: Vec3,
    /// How far a cell is across.
    across: Vec3,
}

impl Walk {
    /// Those of the line from `start`, which lies in `first`, along `along`, in cells.
    fn new(start: Vec3, along: Vec3, first: IVec3) -> Self {
        let still = along.cmpeq(Vec3::ZERO);
        let ahead = first.as_vec3() + Vec3::select(along.cmpgt(Vec3::ZERO), Vec3::ONE, Vec3::ZERO) - start;
        // A line that keeps to one slab of cells never leaves it.
        let next = Vec3::select(still, Vec3::INFINITY, ahead / along);
        Self { cell: first, step: along.signum().as_ivec3(), next, across: along.abs().recip() }
    }

    /// Goes on to the next cell, and says how far along the line that begins.
    fn advance(&mut self) -> f32 {
        let axis = self.next.min_position();
        let at = self.next[axis];
        self.cell[axis] += self.step[axis];
        self.next[axis] += self.across[axis];
        at
    }

    /// True in a grid of that size.
    fn are_in(&self, size: UVec3) -> bool {
        // What is below zero is beyond all sizes.
        self.cell.as_uvec3().cmplt(size).all()
    }
}
