//! Analytic shapes: surfaces that are given by equations of the second degree, and not by triangles.
//!
//! Whatever its name, a shape is a few [`Face`]s, each a bounded part of a quadric (planes are quadrics too): a cylinder is
//! a curved side and two discs, a capsule a side and two parts of spheres. So one intersection serves them all.

use glam::{DVec3, Vec3};

/// Faces that meet at an edge overlap by this share of the shape's size, so that rounding opens no gap between them.
const OVERLAP: f64 = 1e-12;

/// An analytic shape in object space, metres; the equations are positive outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Its parts, at most six.
    faces: Vec<Face>,
    /// The box around it; infinite where the shape is.
    bounds: [DVec3; 2],
    /// Seen from both sides, whatever its material says.
    double_sided: bool,
}

/// A part of a quadric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Face {
    pub quadric: Quadric,
    /// The part inside this box,
    min: DVec3,
    max: DVec3,
    /// and no further from the Y axis than this.
    radius: f64,
}

/// The points where `squares . (xx, yy, zz) + products . (yz, zx, xy) + linear . (x, y, z) + constant` is zero; outside is
/// where it is positive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quadric {
    /// Factors of x squared, y squared, z squared.
    pub squares: DVec3,
    /// Factors of yz, zx, xy.
    pub products: DVec3,
    /// Factors of x, y, z.
    pub linear: DVec3,
    /// What is left at the origin.
    pub constant: f64,
}

impl Shape {
    /// A sphere around the origin.
    pub fn sphere(radius: f64) -> Self {
        let faces = ball(0.0, radius).into_iter().collect();
        Self::closed(faces, DVec3::splat(radius))
    }

    /// A box around the origin with these full extents along the axes.
    pub fn cuboid(size: DVec3) -> Self {
        let half = size * 0.5;
        let sides = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
        let faces = sides.map(|normal| flat(normal, half));
        Self::closed(faces.collect(), half)
    }

    /// A capped cylinder along Y, its middle at the origin. Where one radius is 0 it is a cone.
    pub fn cylinder(height: f64, radius_top: f64, radius_bottom: f64) -> Self {
        let half = height * 0.5;
        let cap = |normal: DVec3, radius: f64| {
            (radius > 0.0).then_some(Face { radius, ..Face::of(Quadric::plane(normal, half)) })
        };
        let side = side((half, radius_top), (-half, radius_bottom));
        let faces = [side, cap(DVec3::Y, radius_top), cap(DVec3::NEG_Y, radius_bottom)];
        let radius = radius_top.max(radius_bottom);
        Self::closed(faces.into_iter().flatten().collect(), DVec3::new(radius, half, radius))
    }

    /// Two spheres on the Y axis, `height` between their centres, and the cone that touches both. Where one holds the
    /// other, it is that sphere alone.
    pub fn capsule(height: f64, radius_top: f64, radius_bottom: f64) -> Self {
        let half = height * 0.5;
        let difference = radius_bottom - radius_top;
        let (top, bottom) = (ball(half, radius_top), ball(-half, radius_bottom));
        let faces = if difference.abs() >= height {
            let larger = if difference < 0.0 { top } else { bottom };
            larger.into_iter().collect()
        } else {
            // The cone's normals are tilted up by the angle with this sine; it touches the spheres where theirs are.
            let sin = difference / height;
            let cos = (1.0 - sin * sin).sqrt();
            let touch = |centre: f64, radius: f64| (centre + radius * sin, radius * cos);
            let (from, to) = (touch(half, radius_top), touch(-half, radius_bottom));
            let mut top = top;
            let mut bottom = bottom;
            top.iter_mut().for_each(|face| face.min.y = from.0);
            bottom.iter_mut().for_each(|face| face.max.y = to.0);
            [side(from, to), top, bottom].into_iter().flatten().collect()
        };
        let radius = radius_top.max(radius_bottom);
        let mut shape = Self::closed(faces, DVec3::splat(radius));
        shape.bounds[0].y = (half - radius_top).min(-half - radius_bottom);
        shape.bounds[1].y = (half + radius_top).max(-half + radius_bottom);
        shape
    }

    /// The plane y = 0 seen from +Y, `size_x` by `size_z` around the origin; either may be infinite.
    pub fn plane(size_x: f64, size_z: f64, double_sided: bool) -> Self {
        let half = DVec3::new(size_x, 0.0, size_z) * 0.5;
        Self { double_sided, ..Self::closed(vec![flat(DVec3::Y, half)], half) }
    }

    /// The part of a quadric inside a box.
    pub fn quadric(quadric: Quadric, min: DVec3, max: DVec3) -> Self {
        Self { faces: vec![Face { min, max, ..Face::of(quadric) }], bounds: [min, max], double_sided: false }
            .overlapping()
    }

    /// The box around it in object space, lowest and highest corner; infinite where the shape is.
    pub fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }

    /// The two triangles of a plane, counter-clockwise as its front is seen, in object space; none of a solid. A plane without
    /// end is taken to end a million metres away.
    pub fn sheet(&self) -> impl Iterator<Item = [Vec3; 3]> + use<> {
        const ENDLESS: f64 = 1e6;
        let is_flat = self.bounds[0].y == self.bounds[1].y;
        let [min, max] =
            self.bounds.map(|p| p.clamp(DVec3::splat(-ENDLESS), DVec3::splat(ENDLESS)).as_vec3());
        let [a, b, c, d] = [(min.x, min.z), (min.x, max.z), (max.x, max.z), (max.x, min.z)]
            .map(|(x, z)| Vec3::new(x, min.y, z));
        is_flat.then_some([[a, b, c], [a, c, d]]).into_iter().flatten()
    }

    /// Whether it is seen from both sides, whatever its material says.
    pub fn is_double_sided(&self) -> bool {
        self.double_sided
    }

    /// Whether its surface may come nearer than `reach` to a point; false only where it surely does not.
    pub fn may_pass(&self, point: DVec3, reach: f64) -> bool {
        self.faces.iter().any(|face| face.may_pass(point, reach))
    }

    pub(crate) fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// A shape that reaches as far on both sides of the origin.
    fn closed(faces: Vec<Face>, half: DVec3) -> Self {
        Self { faces, bounds: [-half, half], double_sided: false }.overlapping()
    }

    fn overlapping(mut self) -> Self {
        let reach = self.bounds[0].abs().max(self.bounds[1].abs());
        let reach = reach.to_array().into_iter().filter(|r| r.is_finite()).fold(0.0, f64::max);
        let overlap = reach * OVERLAP;
        for face in &mut self.faces {
            face.min -= overlap;
            face.max += overlap;
            face.radius += overlap;
        }
        self
    }
}

/// The side of a box that looks along an axis. It has no bounds on that axis: rounding would cut holes.
fn flat(normal: DVec3, half: DVec3) -> Face {
    let across = normal.cmpeq(DVec3::ZERO);
    let max = DVec3::select(across, half, DVec3::INFINITY);
    Face {
        min: -max,
        max,
        ..Face::of(Quadric::plane(normal, normal.abs().dot(DVec3::select(across, DVec3::ZERO, half))))
    }
}

/// A sphere on the Y axis; none without a size.
fn ball(y: f64, radius: f64) -> Option<Face> {
    let quadric = Quadric {
        squares: DVec3::ONE,
        linear: DVec3::new(0.0, -2.0 * y, 0.0),
        constant: y * y - radius * radius,
        ..Quadric::default()
    };
    (radius > 0.0).then_some(Face::of(quadric))
}

/// The side of a cone between two heights, with the radius at each; none without an area.
fn side((top, radius_top): (f64, f64), (bottom, radius_bottom): (f64, f64)) -> Option<Face> {
    if top <= bottom || radius_top.max(radius_bottom) <= 0.0 {
        return None;
    }
    // The radius is `slope y + at_zero`.
    let slope = (radius_top - radius_bottom) / (top - bottom);
    let at_zero = (radius_bottom * top - radius_top * bottom) / (top - bottom);
    let quadric = Quadric {
        squares: DVec3::new(1.0, -slope * slope, 1.0),
        linear: DVec3::new(0.0, -2.0 * slope * at_zero, 0.0),
        constant: -at_zero * at_zero,
        ..Quadric::default()
    };
    let mut face = Face::of(quadric);
    (face.min.y, face.max.y) = (bottom, top);
    Some(face)
}

impl Face {
    /// All of a quadric.
    fn of(quadric: Quadric) -> Self {
        Self { quadric, min: DVec3::NEG_INFINITY, max: DVec3::INFINITY, radius: f64::INFINITY }
    }

    /// Whether a point of the quadric is on the part that counts.
    pub fn holds(&self, p: DVec3) -> bool {
        self.holds_near(p, 0.0)
    }

    /// Whether that part's bounds come so near to a point.
    fn holds_near(&self, p: DVec3, reach: f64) -> bool {
        let within = (p + reach).cmpge(self.min).all() && (p - reach).cmple(self.max).all();
        within && p.x.hypot(p.z) <= self.radius + reach
    }

    fn may_pass(&self, p: DVec3, reach: f64) -> bool {
        let Quadric { squares, products, .. } = self.quadric;
        // The most that the equation's left side can change on the way there.
        let curvature = squares.abs().max_element() + products.abs().element_sum() / 2.0;
        let change = self.quadric.gradient(p).length() * reach + curvature * reach * reach;
        self.holds_near(p, reach) && self.quadric.value(p).abs() <= change
    }
}

impl Quadric {
    /// The plane with this unit normal, so far from the origin along it.
    pub fn plane(normal: DVec3, distance: f64) -> Self {
        Self { linear: normal, constant: -distance, ..Self::default() }
    }

    /// The equation's left side: 0 on the surface, positive outside.
    pub fn value(&self, p: DVec3) -> f64 {
        self.second(p) + self.linear.dot(p) + self.constant
    }

    /// Where the left side grows fastest: on the surface, its outward normal, not of unit length.
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        let DVec3 { x: yz, y: zx, z: xy } = self.products;
        let across = DVec3::new(xy * p.y + zx * p.z, xy * p.x + yz * p.z, zx * p.x + yz * p.y);
        self.squares * p * 2.0 + across + self.linear
    }

    /// The part of the left side that is of second degree.
    pub(crate) fn second(&self, p: DVec3) -> f64 {
        self.squares.dot(p * p) + self.products.dot(DVec3::new(p.y * p.z, p.z * p.x, p.x * p.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every face's equation is zero on points that are known to be on it, and its gradient points outwards there.
    #[test]
    fn faces_are_where_they_should_be() {
        let on = |shape: &Shape, p: DVec3, normal: DVec3| {
            let found = shape.faces().iter().any(|f| {
                let n = f.quadric.gradient(p).normalize();
                f.holds(p) && f.quadric.value(p).abs() < 1e-12 && n.distance(normal.normalize()) < 1e-9
            });
            assert!(found, "{p} {normal} {shape:?}");
        };
        on(&Shape::sphere(2.0), DVec3::new(0.0, 2.0, 0.0), DVec3::Y);
        let cuboid = Shape::cuboid(DVec3::new(2.0, 4.0, 6.0));
        on(&cuboid, DVec3::new(-1.0, 1.5, 2.5), DVec3::NEG_X);
        on(&cuboid, DVec3::new(0.5, 1.5, 3.0), DVec3::Z);
        let cone = Shape::cylinder(2.0, 0.0, 1.0);
        on(&cone, DVec3::new(0.5, 0.0, 0.0), DVec3::new(2.0, 1.0, 0.0));
        on(&cone, DVec3::new(0.3, -1.0, 0.3), DVec3::NEG_Y);
        assert_eq!(cone.faces().len(), 2);
        // 5, 4, 3: the sine of the tilt is 0.6.
        let capsule = Shape::capsule(5.0, 1.0, 4.0);
        on(&capsule, DVec3::new(0.0, 3.5, 0.0), DVec3::Y);
        on(&capsule, DVec3::new(0.8, 2.5 + 0.6, 0.0), DVec3::new(0.8, 0.6, 0.0));
        on(&capsule, DVec3::new(2.0, (3.1 - 0.1) / 2.0, 0.0), DVec3::new(0.8, 0.6, 0.0));
        assert_eq!(capsule.bounds(), [DVec3::new(-4.0, -6.5, -4.0), DVec3::new(4.0, 3.5, 4.0)]);
        on(&Shape::plane(f64::INFINITY, 2.0, false), DVec3::new(1e9, 0.0, -1.0), DVec3::Y);
    }

    /// Balls around points of the surface are passed however small, and from some distance on those elsewhere are not.
    #[test]
    fn a_ball_is_passed_where_the_surface_is() {
        let paraboloid =
            Quadric { squares: DVec3::new(1.0, 0.0, 1.0), linear: DVec3::NEG_Y, ..Quadric::default() };
        let bowl = Shape::quadric(paraboloid, DVec3::new(-1.0, 0.0, -1.0), DVec3::ONE);
        assert!(bowl.may_pass(DVec3::new(0.6, 0.36, 0.0), 1e-9));
        assert!(!bowl.may_pass(DVec3::new(0.0, 0.7, 0.0), 0.2));
        assert!(bowl.may_pass(DVec3::new(0.0, 0.7, 0.0), 0.9));
        assert!(!bowl.may_pass(DVec3::new(1.5, 2.25, 0.0), 0.4), "beyond its bounds");
        let cone = Shape::cylinder(2.0, 0.0, 1.0);
        assert!(cone.may_pass(DVec3::new(0.55, 0.0, 0.0), 0.05) && !cone.may_pass(DVec3::ZERO, 0.2));
        assert!(
            cone.may_pass(DVec3::new(0.2, -1.05, 0.2), 0.06)
                && !cone.may_pass(DVec3::new(1.2, -1.0, 0.0), 0.1)
        );
    }

    #[test]
    fn what_has_no_size_has_no_face() {
        assert!(Shape::sphere(0.0).faces().is_empty());
        assert!(Shape::cylinder(1.0, 0.0, 0.0).faces().is_empty());
        assert_eq!(Shape::capsule(0.0, 1.0, 1.0).faces().len(), 1);
        assert_eq!(Shape::capsule(1.0, 0.5, 3.0).bounds()[1].y, 2.5, "one sphere holds the other");
    }
}
