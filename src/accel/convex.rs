//! Convex spaces, and what of a tree's triangles is in them.
//!
//! Answers are on the safe side: what cannot be told apart from something inside, by single precision, counts as inside.

use super::tree::Tree;
use super::wide::{Pending, WideNode};
use super::{Accel, Placed};
use glam::{Vec3A, Vec4};

/// What the rounding of a point's distance from a plane may come to, of the largest coordinate in it.
pub(super) const ROUNDING: f32 = 4.0 * f32::EPSILON;

/// Corners of a triangle cut by the planes of any space, each of which adds one at most. If rounding adds more they are left out: some are
/// left.
pub(super) const MOST_CUT_CORNERS: usize = 3 + 6;

/// Where no plane's normal points away, in the space of a tree.
pub(super) struct Convex<const PLANES: usize> {
    /// Where distances are measured from.
    pub eye: Vec3A,
    pub normals: [Vec3A; PLANES],
    /// Of the planes from the eye: how far it is inside of each.
    pub distances: [f32; PLANES],
    /// That of its own coordinates.
    pub rounding: f32,
}

/// The planes, made ready for boxes.
struct Slabs<const PLANES: usize> {
    normals: [[Vec4; 3]; PLANES],
    /// For each plane and axis: 1 if boxes' maxima lie farthest along the normal.
    far: [[usize; 3]; PLANES],
    offsets: [Vec4; PLANES],
}

/// The outline of a part of a triangle, from the eye.
pub(super) struct Outline {
    corners: [Vec3A; MOST_CUT_CORNERS],
    count: usize,
}

impl Outline {
    /// In order around; none where nothing is left.
    pub fn corners(&self) -> &[Vec3A] {
        &self.corners[..self.count]
    }
}

impl<const PLANES: usize> Slabs<PLANES> {
    fn new(of: &Convex<PLANES>) -> Self {
        let offset = |(normal, distance): (&Vec3A, &f32)| distance - normal.dot(of.eye) + of.rounding;
        let mut offsets = of.normals.iter().zip(&of.distances).map(offset).map(Vec4::splat);
        Self {
            normals: of.normals.map(|normal| normal.to_array().map(Vec4::splat)),
            far: of.normals.map(|normal| normal.to_array().map(|n| usize::from(n >= 0.0))),
            offsets: std::array::from_fn(|_| offsets.next().unwrap_or_default()),
        }
    }

    /// A bit for each of the eight boxes that may reach into the space.
    #[inline(always)]
    fn meet(&self, node: &WideNode) -> u32 {
        let mut mask = 0;
        for half in 0..2 {
            let mut inside = 0b1111;
            for ((normal, far), offset) in self.normals.iter().zip(&self.far).zip(&self.offsets) {
                let along = |axis: usize| normal[axis] * node.bounds[axis][far[axis] & 1][half];
                let farthest = along(0) + along(1) + (along(2) + *offset);
                inside &= farthest.cmpge(Vec4::ZERO).bitmask();
            }
            mask |= inside << (4 * half);
        }
        mask
    }
}

impl<const PLANES: usize> Convex<PLANES> {
    /// A bit for each of four triangles that no single plane keeps out, and what rounding may come to on each.
    fn may_hold(&self, corners: &[[Vec4; 3]; 3]) -> (u32, Vec4) {
        let mut reach = Vec4::splat(self.eye.abs().max_element());
        for axis in corners.iter().flatten() {
            reach = reach.max(axis.abs());
        }
        let rounding = reach * ROUNDING + Vec4::splat(self.rounding);
        let eye = self.eye.to_array().map(Vec4::splat);
        let mut mask = 0b1111;
        for (normal, &distance) in self.normals.iter().zip(&self.distances) {
            let [x, y, z] = normal.to_array().map(Vec4::splat);
            let offset = rounding + Vec4::splat(distance);
            let inside = |c: &[Vec4; 3]| {
                let along = (c[0] - eye[0]) * x + (c[1] - eye[1]) * y + (c[2] - eye[2]) * z;
                (along + offset).cmpge(Vec4::ZERO).bitmask()
            };
            mask &= corners.iter().map(inside).fold(0, |any, bits| any | bits);
        }
        (mask, rounding)
    }

    /// What is inside of a triangle with those corners from the eye.
    pub fn cut(&self, triangle: [Vec3A; 3], rounding: f32) -> Outline {
        let mut outline = Outline { corners: [Vec3A::ZERO; MOST_CUT_CORNERS], count: 3 };
        outline.corners[..3].copy_from_slice(&triangle);
        // Sutherland and Hodgman: Reentrant Polygon Clipping (1974).
        for (normal, distance) in self.normals.iter().zip(self.distances) {
            let Outline { corners: uncut, count: uncut_count } = outline;
            outline.count = 0;
            let mut keep = |corner| {
                if outline.count < MOST_CUT_CORNERS {
                    outline.corners[outline.count] = corner;
                    outline.count += 1;
                }
            };
            let inside = |corner: Vec3A| normal.dot(corner) + distance + rounding;
            for i in 0..uncut_count {
                let (from, to) = (uncut[i], uncut[(i + 1) % uncut_count]);
                let (is, will_be) = (inside(from), inside(to));
                if is >= 0.0 {
                    keep(from);
                }
                if (is >= 0.0) != (will_be >= 0.0) {
                    keep(from + (to - from) * (is / (is - will_be)));
                }
            }
        }
        outline
    }
}

impl Tree {
    /// True if `is` is true for any triangle that no single plane keeps out of `space`, which is in the tree's own: given its flags,
    /// its corners from the eye, and what rounding may come to on it.
    pub fn any_within<const PLANES: usize>(
        &self,
        space: &Convex<PLANES>,
        pending: &mut [Pending],
        mut is: impl FnMut(u32, [Vec3A; 3], f32) -> bool,
    ) -> bool {
        let slabs = Slabs::new(space);
        self.wide.any(
            |node| slabs.meet(node),
            pending,
            |leaf, _| {
                let pack = &self.leaves[leaf];
                let (mask, rounding) = space.may_hold(pack.corners());
                let mut inside = (0..4).filter(|lane| mask >> lane & 1 == 1);
                inside.any(|lane| {
                    is(pack.flags(lane), pack.triangle(lane).map(|corner| corner - space.eye), rounding[lane])
                })
            },
        )
    }
}

impl Accel {
    /// True if `is` is true for anything placed whose box may reach into a `space` of render space.
    pub(super) fn any_placed_within<const PLANES: usize>(
        &self,
        space: impl FnOnce() -> Convex<PLANES>,
        mut is: impl FnMut(&Placed, &mut [Pending]) -> bool,
    ) -> bool {
        self.with_pending(|pending| {
            // Scenes that stand still are one tree: there is nothing to choose from.
            if let [only] = self.placed.as_slice() {
                return is(only, pending);
            }
            let slabs = Slabs::new(&space());
            self.upper.any(
                |node| slabs.meet(node),
                pending,
                |leaf, pending| {
                    self.placed[self.upper_leaves[leaf].clone()].iter().any(|placed| is(placed, pending))
                },
            )
        })
    }
}
