//! Whether anything stands in a space before the eye: one question in place of a ray for each pixel.
//!
//! The answer is given on the safe side. What cannot be told apart from something in the space, by single precision or because it
//! is not a triangle, counts as in it; rays will tell. After beam tracing (Heckbert and Hanrahan 1984), which is much harder, as it asks
//! what is in a beam, not whether anything is.

use super::convex::{Convex, ROUNDING};
use super::opacity::{CULL_BACK, EYE_PASS, MIRRORED};
use super::wide::Pending;
use super::{Accel, Placed, PlacedTree};
use glam::{Affine3A, Vec3, Vec3A};

/// So far from edge on, as a sine, a triangle surely turns its back or its front to a point.
const EDGE_ON: f32 = 1e-4;

/// Side planes, and the one at the end.
const PLANES: usize = 5;

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

    /// The same in the space of a tree.
    fn within(&self, to_local: &Affine3A) -> Convex<PLANES> {
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
        Convex { eye, normals, distances: [0.0, 0.0, 0.0, 0.0, distance], rounding }
    }
}

impl Accel {
    /// True if it is certain that the eye meets nothing within `frustum`. Holes cut by alpha count as filled.
    pub fn is_empty_within(&self, frustum: &Frustum) -> bool {
        if !self.endless.is_empty() {
            return false;
        }
        let space = || frustum.within(&Affine3A::IDENTITY);
        !self.any_placed_within(space, |placed, pending| match placed {
            Placed::Tree(tree) => self.holds(tree, frustum, pending),
            Placed::Shape(_) => true,
        })
    }

    /// True if anything of one placed group may stand in the frustum.
    fn holds(&self, placed: &PlacedTree, frustum: &Frustum, pending: &mut [Pending]) -> bool {
        let space = frustum.within(&placed.object_from_render);
        self.lower(placed).0.any_within(&space, pending, |flags, triangle, rounding| {
            flags & EYE_PASS == 0
                && !(flags & CULL_BACK != 0 && sees_back(triangle, flags & MIRRORED != 0))
                && !space.cut(triangle, rounding).corners().is_empty()
        })
    }
}

/// Whether a triangle, from corners relative to the eye, surely has its back to the eye.
fn sees_back([a, b, c]: [Vec3A; 3], is_mirrored: bool) -> bool {
    let normal = (b - a).cross(c - a);
    let side = if is_mirrored { normal.dot(a) } else { -normal.dot(a) };
    side < -EDGE_ON * normal.length() * a.length()
}
