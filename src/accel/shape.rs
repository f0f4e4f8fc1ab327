//! Where rays meet analytic shapes, and how a point on one is named.
//!
//! Rays are turned into the shape's space and met there in double precision: a sphere a thousand times its radius away is
//! as round as one nearby (what single precision does to the quadratic: Haines et al., *Precision Improvements for Ray/Sphere
//! Intersection*, Ray Tracing Gems 2019).
//!
//! A point is named by its two coordinates across the axis that the surface faces most, and by that axis; the third
//! follows from the equation. The number of the primitive says which face, which axis, and which way along it
//! the surface looks, so that within one primitive the surface is a graph over the two coordinates, at most 55 degrees steep.

use crate::frame::SurfaceRef;
use crate::scene::{Face, Quadric, Shape};
use glam::{DVec3, Vec3};

/// Nothing farther from a shape's middle is met; it would overflow when squared in single precision.
const MAX_COORDINATE: f64 = 1e15;

/// Where a ray meets a shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShapeHit {
    /// In lengths of the ray's direction.
    pub t: f64,
    /// The `primitive`, `u` and `v` of a [`SurfaceRef`].
    pub primitive: u32,
    pub u: f32,
    pub v: f32,
    /// True from outside.
    pub front: bool,
}

impl Shape {
    /// The nearest hit of a ray in the shape's space with `t_min <= t <= t_max`; of those from inside only if `both`.
    pub(super) fn intersect(
        &self,
        origin: DVec3,
        direction: DVec3,
        (t_min, t_max): (f64, f64),
        both: bool,
    ) -> Option<ShapeHit> {
        // From where the ray is nearest to the middle, distances are small, and their squares lose nothing.
        let [min, max] = self.bounds();
        let middle = (min + max) * 0.5;
        let middle = if middle.is_finite() { middle } else { DVec3::ZERO };
        let start = (middle - origin).dot(direction) / direction.length_squared();
        let from = origin + direction * start;
        let (near, mut far) = (t_min - start, t_max - start);
        let mut nearest = None;
        for (number, face) in self.faces().iter().enumerate() {
            for t in face.quadric.meet(from, direction) {
                let p = from + direction * t;
                if !(t >= near && t <= far && face.holds(p) && p.abs().max_element() < MAX_COORDINATE) {
                    continue;
                }
                // The tip of a cone looks no way in particular; it is met as if it faced the ray.
                let normal =
                    Some(face.quadric.gradient(p)).filter(|n| *n != DVec3::ZERO).unwrap_or(-direction);
                let front = normal.dot(direction) < 0.0;
                if both || front {
                    far = t;
                    nearest = Some((number, p, normal, front));
                }
            }
        }
        let (number, p, normal, front) = nearest?;
        let axis = normal.abs().max_position();
        let (first, second) = others(axis);
        Some(ShapeHit {
            t: far + start,
            primitive: (number * 6 + axis * 2 + usize::from(normal[axis] < 0.0)) as u32,
            u: p[first] as f32,
            v: p[second] as f32,
            front,
        })
    }

    /// The point that a [`SurfaceRef`] names, in the shape's space, and the unit normal there, outwards.
    pub(crate) fn point(&self, surface: SurfaceRef) -> (Vec3, Vec3) {
        let SurfaceRef { primitive, u, v, .. } = surface;
        let (number, axis) = (primitive as usize / 6, primitive as usize % 6 / 2);
        let Some(Face { quadric, .. }) = self.faces().get(number) else { return (Vec3::ZERO, Vec3::Y) };
        let (first, second) = others(axis);
        let mut p = DVec3::ZERO;
        (p[first], p[second]) = (f64::from(u), f64::from(v));
        let side = if primitive % 2 == 0 { 1.0 } else { -1.0 };
        p[axis] = quadric.solve(p, axis, side);
        (p.as_vec3(), quadric.gradient(p).normalize_or(DVec3::AXES[axis] * side).as_vec3())
    }
}

/// The two axes beside this one.
fn others(axis: usize) -> (usize, usize) {
    ((axis + 1) % 3, (axis + 2) % 3)
}

impl Quadric {
    /// The parameters at which a line meets the surface, NaN where it does not.
    fn meet(&self, origin: DVec3, direction: DVec3) -> [f64; 2] {
        let a = self.second(direction);
        let b = self.gradient(origin).dot(direction);
        let c = self.value(origin);
        // Neither root is a difference of numbers that are nearly the same. A line that meets the surface only once has
        // its other root at infinity.
        let q = -0.5 * (b + (b * b - 4.0 * a * c).sqrt().copysign(b));
        [q / a, c / q]
    }

    /// The coordinate along `axis` at which the surface lies, given the two others of `p`: where its normal looks along
    /// the axis, or against it if `side` is -1. Where rounding has moved `p` past the surface's rim, the rim.
    fn solve(&self, mut p: DVec3, axis: usize, side: f64) -> f64 {
        p[axis] = 0.0;
        let (a, b, c) = (self.squares[axis], self.gradient(p)[axis], self.value(p));
        // The normal's part along the axis is 2 a x + b.
        let slope = side * (b * b - 4.0 * a * c).max(0.0).sqrt();
        let x = if slope * b >= 0.0 { -2.0 * c / (b + slope) } else { (slope - b) / (2.0 * a) };
        // The tip of a cone.
        if x.is_finite() { x } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn first(shape: &Shape, origin: DVec3, direction: DVec3) -> Option<(DVec3, Vec3, bool)> {
        let hit = shape.intersect(origin, direction, (0.0, f64::INFINITY), true)?;
        Some((origin + direction * hit.t, shape.point(named(&hit)).1, hit.front))
    }

    fn named(hit: &ShapeHit) -> SurfaceRef {
        SurfaceRef { instance: 0, primitive: hit.primitive, u: hit.u, v: hit.v }
    }

    fn shapes() -> impl Strategy<Value = Shape> {
        let size = 0.1..10.0f64;
        let sizes = || (size.clone(), size.clone(), size.clone());
        let corner = DVec3::new(1.5, 2.0, 1.0);
        prop_oneof![
            size.clone().prop_map(Shape::sphere),
            sizes().prop_map(|(x, y, z)| Shape::cuboid(DVec3::new(x, y, z))),
            sizes().prop_map(|(height, top, bottom)| Shape::cylinder(height, top, bottom)),
            (size.clone(), size.clone()).prop_map(|(height, radius)| Shape::cylinder(height, 0.0, radius)),
            sizes().prop_map(|(height, top, bottom)| Shape::capsule(height, top, bottom)),
            (size.clone(), size).prop_map(|(x, z)| Shape::plane(x, z, true)),
            Just(Shape::plane(f64::INFINITY, f64::INFINITY, false)),
            // A saddle, a hyperboloid, and one whose axes are not the world's.
            proptest::array::uniform10(-1.0..1.0f64).prop_map(move |c| {
                let quadric = Quadric {
                    squares: DVec3::new(c[0], c[1], c[2]),
                    products: DVec3::new(c[3], c[4], c[5]),
                    linear: DVec3::new(c[6], c[7], c[8]),
                    constant: c[9],
                };
                Shape::quadric(quadric, -corner, corner)
            }),
        ]
    }

    fn direction() -> impl Strategy<Value = DVec3> {
        let part = || -1.0..1.0f64;
        (part(), part(), part())
            .prop_map(|(x, y, z)| DVec3::new(x, y, z))
            .prop_filter("has a length", |d| d.length() > 0.1)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]

        /// The name of a point gives the point on the ray, and the way that the surface lies there.
        #[test]
        fn a_hit_is_found_again_by_its_name(
            shape in shapes(), from in direction(), aim in direction(), away in 0.1..1e4f64,
        ) {
            let (origin, target) = (from * away, aim * 0.5);
            let direction = (target - origin) * 0.3;
            if let Some(hit) = shape.intersect(origin, direction, (0.0, f64::INFINITY), true) {
                let on_ray = origin + direction * hit.t;
                let (point, normal) = shape.point(named(&hit));
                let reach = on_ray.abs().max_element().max(1.0);
                prop_assert!(on_ray.distance(point.as_dvec3()) < 1e-6 * reach, "{on_ray} {point} {hit:?}");
                let facing = normal.as_dvec3().dot(direction) / direction.length();
                prop_assert!(facing.abs() < 1e-3 || (facing < 0.0) == hit.front, "{facing} {hit:?}");
                prop_assert!((normal.length() - 1.0).abs() < 1e-5);
            }
        }

        /// A closed shape is left as often as it is entered, also by rays through its edges.
        #[test]
        fn what_goes_in_comes_out(
            size in (0.1..4.0f64, 0.0..4.0f64, 0.1..4.0f64), from in direction(), rim in 0.0..std::f64::consts::TAU,
            along in -1.0..1.0f64, kind in 0..4,
        ) {
            let (height, top, bottom) = size;
            let shape = match kind {
                0 => Shape::cylinder(height, top, bottom),
                1 => Shape::capsule(height, top, bottom),
                2 => Shape::sphere(height),
                _ => Shape::cuboid(DVec3::new(height, bottom.max(0.1), height)),
            };
            // Aims at the rim of a cylinder's foot, the edges of a box, or anywhere between.
            let target = DVec3::new(bottom * rim.cos(), -0.5 * height, bottom * rim.sin())
                * if along > 0.0 { 1.0 } else { -along };
            let origin = from.normalize() * 50.0;
            let direction = target - origin;
            let (mut t, mut crossings) = (0.0, Vec::new());
            while let Some(hit) = shape.intersect(origin, direction, (t, f64::INFINITY), true) {
                crossings.push(hit.front);
                t = hit.t + 1e-9;
            }
            let expected: &[bool] = if crossings.is_empty() { &[] } else { &[true, false] };
            // A ray that only touches an edge may meet the two faces there within the step.
            prop_assert!(crossings == expected || t < 1.0 + 2e-9 && crossings.len() == 1, "{crossings:?}");
        }

        /// No rounding cuts a hole in what has none.
        #[test]
        fn an_endless_plane_has_no_holes(from in direction(), away in 0.1..1e4f64, aim in direction()) {
            let origin = DVec3::new(from.x, from.y.abs() + 1e-6, from.z) * away;
            let direction = DVec3::new(aim.x, -aim.y.abs() - 1e-4, aim.z);
            let plane = Shape::plane(f64::INFINITY, f64::INFINITY, false);
            let hit = plane.intersect(origin, direction, (0.0, f64::INFINITY), false);
            let expected = origin.y / -direction.y;
            prop_assert!(hit.is_some_and(|hit| (hit.t / expected - 1.0).abs() < 1e-9), "{hit:?} {expected}");
        }
    }

    #[test]
    fn hits_are_where_arithmetic_puts_them() {
        let from_above = |shape: &Shape, x: f64| first(shape, DVec3::new(x, 20.0, 0.0), DVec3::NEG_Y);
        let near = |a: Option<(DVec3, Vec3, bool)>, p: DVec3, n: Vec3, front: bool| {
            let (at, normal, side) = a.unwrap();
            assert!(
                at.distance(p) < 1e-9 && normal.distance(n.normalize()) < 1e-6 && side == front,
                "{at} {normal}"
            );
        };
        let ball = Shape::sphere(5.0);
        near(from_above(&ball, 3.0), DVec3::new(3.0, 4.0, 0.0), Vec3::new(3.0, 4.0, 0.0), true);
        // From inside.
        near(first(&ball, DVec3::ZERO, DVec3::X), DVec3::X * 5.0, Vec3::X, false);
        let cone = Shape::cylinder(4.0, 0.0, 2.0);
        near(from_above(&cone, 1.0), DVec3::new(1.0, 0.0, 0.0), Vec3::new(2.0, 1.0, 0.0), true);
        near(from_above(&cone, 0.0), DVec3::new(0.0, 2.0, 0.0), Vec3::Y, true);
        let capsule = Shape::capsule(6.0, 2.0, 2.0);
        near(from_above(&capsule, 1.2), DVec3::new(1.2, 4.6, 0.0), Vec3::new(1.2, 1.6, 0.0), true);
        // At the seam of ball and side.
        let seam = first(&capsule, DVec3::new(9.0, 3.0, 0.0), DVec3::NEG_X);
        near(seam, DVec3::new(2.0, 3.0, 0.0), Vec3::X, true);
        let cuboid = Shape::cuboid(DVec3::new(2.0, 4.0, 6.0));
        near(from_above(&cuboid, -0.9), DVec3::new(-0.9, 2.0, 0.0), Vec3::Y, true);
        assert!(from_above(&cuboid, 1.1).is_none());
        let below = first(&Shape::plane(2.0, 2.0, false), DVec3::new(0.5, -1.0, 0.5), DVec3::Y);
        near(below, DVec3::new(0.5, 0.0, 0.5), Vec3::Y, false);
        // z = x y, met once by a ray along an axis.
        let saddle = Quadric { products: DVec3::Z, linear: DVec3::NEG_Z, ..Quadric::default() };
        let saddle = Shape::quadric(saddle, DVec3::splat(-2.0), DVec3::splat(2.0));
        let hit = first(&saddle, DVec3::new(0.5, -0.5, 9.0), DVec3::NEG_Z);
        near(hit, DVec3::new(0.5, -0.5, -0.25), Vec3::new(-0.5, 0.5, -1.0), false);
    }

    #[test]
    fn a_ball_is_round_from_far_away() {
        let ball = Shape::sphere(0.01);
        for (off, meets) in [(0.01 - 1e-8, true), (0.01 + 1e-8, false)] {
            let origin = DVec3::new(off, 1e4, 0.0);
            assert_eq!(ball.intersect(origin, DVec3::NEG_Y, (0.0, 1e9), false).is_some(), meets, "{off}");
        }
    }

    #[test]
    fn only_what_is_asked_for_is_met() {
        let ball = Shape::sphere(1.0);
        let meet = |range, both| ball.intersect(DVec3::Z * 3.0, DVec3::NEG_Z, range, both).map(|hit| hit.t);
        assert_eq!(meet((0.0, 10.0), false), Some(2.0));
        assert_eq!(meet((2.5, 10.0), true), Some(4.0));
        assert_eq!(meet((2.5, 10.0), false), None, "the inside is not seen");
        assert_eq!(meet((0.0, 1.5), true), None);
    }
}
