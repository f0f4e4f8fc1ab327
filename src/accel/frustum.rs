//! Whether anything stands in a space before the eye: one question in place of a ray for each pixel.
//!
//! The answer is given on the safe side. What cannot be told apart from something in the space, by single precision or because it
//! is not a triangle, counts as in it; rays will tell. After beam tracing (Heckbert and Hanrahan 1984), which is much harder, as it asks
//! what is in a beam, not whether anything is.

use super::opacity::{CULL_BACK, EYE_PASS, MIRRORED};
use super::wide::{Pending, WideNode};
use super::{Accel, Placed, PlacedTree};
use glam::{Affine3A, Vec3, Vec3A, Vec4};

/// What the rounding of a point's distance from a plane may come to, of the largest coordinate in it.
const ROUNDING: f32 = 4.0 * f32::EPSILON;

/// So far from edge on, as a sine, a triangle surely turns its back or its front to a point.
const EDGE_ON: f32 = 1e-4;

/// Side planes, and the one at the end.
const PLANES: usize = 5;

/// Corners of a triangle cut by that many planes, each of which adds one at most. If rounding adds more they are left out: some are left.
const MOST_CORNERS: usize = 3 + PLANES;

/// The space between four rays from the eye, as far as a plane that cuts them, in render space.
#[derive(Debug, Clone, Copy)]
pub struct Frustum {
    eye: Vec3,
    /// Where the rays end, in order around; directions if they do not.
    ends: [Vec3; 4],
    is_endless: bool,
}

impl Frustum {
    /// Between the rays from `eye` to four points of a plane, in order around.
    pub fn to(eye: Vec3, ends: [Vec3; 4]) -> Self {
        Self { eye, ends, is_endless: false }
    }

    /// Between the rays from `eye` along four directions, in order around.
    pub fn along(eye: Vec3, directions: [Vec3; 4]) -> Self {
        Self { eye, ends: directions, is_endless: true }
    }

    fn bounded(&self, to_local: &Affine3A) -> Bounded {
        let eye = to_local.transform_point3a(self.eye.into());
        let edges = self.ends.map(|end| match self.is_endless {
            true => to_local.transform_vector3a(end.into()),
            false => to_local.transform_point3a(end.into()) - eye,
        });
        let middle = edges[0] + edges[1] + edges[2] + edges[3];
        let towards = |normal: Vec3A, inside: Vec3A| {
            let normal = normal.normalize_or_zero();
            if normal.dot(inside) < 0.0 { -normal } else { normal }
        };
        let [a, b, c, d] = edges;
        // Without an end nothing is beyond it.
        let cap = if self.is_endless { Vec3A::ZERO } else { towards((c - a).cross(d - b), -middle) };
        // The farthest of the ends, as rounding leaves them.
        let distance = edges.iter().map(|&edge| -cap.dot(edge)).fold(0.0, f32::max);
        let side = |a: Vec3A, b: Vec3A| towards(a.cross(b), middle);
        let normals = [side(a, b), side(b, c), side(c, d), side(d, a), cap];
        // Directions have no size: a scene of any is the same.
        let sizes: &[Vec3A] = if self.is_endless { &[] } else { &edges };
        let reach = sizes.iter().fold(Vec3A::ZERO, |reach, edge| reach.max(edge.abs())).max_element();
        let rounding = ROUNDING * (eye.abs().max_element() + reach);
        Bounded { eye, normals, distances: [0.0, 0.0, 0.0, 0.0, distance], rounding }
    }
}

/// A frustum in the space of a tree: where no plane's normal points away.
struct Bounded {
    eye: Vec3A,
    normals: [Vec3A; PLANES],
    /// Of the planes from the eye.
    distances: [f32; PLANES],
    /// That of its own coordinates.
    rounding: f32,
}

/// The planes, made ready for boxes.
struct Slabs {
    normals: [[Vec4; 3]; PLANES],
    /// For each plane and axis: 1 if boxes' maxima lie farthest along the normal.
    far: [[usize; 3]; PLANES],
    offsets: [Vec4; PLANES],
}

impl Slabs {
    fn new(of: &Bounded) -> Self {
        let offset = |(normal, distance): (&Vec3A, &f32)| distance - normal.dot(of.eye) + of.rounding;
        let mut offsets = of.normals.iter().zip(&of.distances).map(offset).map(Vec4::splat);
        Self {
            normals: of.normals.map(|normal| normal.to_array().map(Vec4::splat)),
            far: of.normals.map(|normal| normal.to_array().map(|n| usize::from(n >= 0.0))),
            offsets: std::array::from_fn(|_| offsets.next().unwrap_or_default()),
        }
    }

    /// A bit for each of the eight boxes that may reach into the frustum.
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

impl Bounded {
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

    /// Whether anything of a triangle is inside, from corners relative to the eye.
    fn holds_any_of(&self, triangle: [Vec3A; 3], rounding: f32) -> bool {
        let mut corners = [Vec3A::ZERO; MOST_CORNERS];
        corners[..3].copy_from_slice(&triangle);
        let mut count = 3;
        // Sutherland and Hodgman: Reentrant Polygon Clipping (1974).
        for (normal, distance) in self.normals.iter().zip(self.distances) {
            let (uncut, uncut_count) = (corners, count);
            count = 0;
            let inside = |corner: Vec3A| normal.dot(corner) + distance + rounding;
            for i in 0..uncut_count {
                let (from, to) = (uncut[i], uncut[(i + 1) % uncut_count]);
                let (is, will_be) = (inside(from), inside(to));
                if is >= 0.0 && count < MOST_CORNERS {
                    corners[count] = from;
                    count += 1;
                }
                if (is >= 0.0) != (will_be >= 0.0) && count < MOST_CORNERS {
                    corners[count] = from + (to - from) * (is / (is - will_be));
                    count += 1;
                }
            }
        }
        count > 0
    }

    /// Whether a triangle, from corners relative to the eye, surely has its back to the eye.
    fn sees_back(&self, [a, b, c]: [Vec3A; 3], is_mirrored: bool) -> bool {
        let normal = (b - a).cross(c - a);
        let side = if is_mirrored { normal.dot(a) } else { -normal.dot(a) };
        side < -EDGE_ON * normal.length() * a.length()
    }
}

impl Accel {
    /// True if it is certain that the eye meets nothing within `frustum`. Holes cut by alpha count as filled.
    pub fn is_empty_within(&self, frustum: &Frustum) -> bool {
        if !self.endless.is_empty() {
            return false;
        }
        !self.with_pending(|pending| {
            if let [Placed::Tree(only)] = self.placed.as_slice() {
                return self.holds(only, frustum, pending);
            }
            let slabs = Slabs::new(&frustum.bounded(&Affine3A::IDENTITY));
            self.upper.any(
                |node| slabs.meet(node),
                pending,
                |leaf, pending| {
                    self.placed[self.upper_leaves[leaf].clone()].iter().any(|placed| match placed {
                        Placed::Tree(tree) => self.holds(tree, frustum, pending),
                        Placed::Shape(_) => true,
                    })
                },
            )
        })
    }

    /// True if anything of one placed group may stand in the frustum.
    fn holds(&self, placed: &PlacedTree, frustum: &Frustum, pending: &mut [Pending]) -> bool {
        let (tree, _) = self.lower(placed);
        let bounded = frustum.bounded(&placed.object_from_render);
        let slabs = Slabs::new(&bounded);
        tree.wide.any(
            |node| slabs.meet(node),
            pending,
            |leaf, _| {
                let pack = &tree.leaves[leaf];
                let (mask, rounding) = bounded.may_hold(pack.corners());
                (0..4).filter(|lane| mask >> lane & 1 == 1).any(|lane| {
                    let flags = pack.flags(lane);
                    let triangle = pack.triangle(lane).map(|corner| corner - bounded.eye);
                    flags & EYE_PASS == 0
                        && !(flags & CULL_BACK != 0 && bounded.sees_back(triangle, flags & MIRRORED != 0))
                        && bounded.holds_any_of(triangle, rounding[lane])
                })
            },
        )
    }
}
