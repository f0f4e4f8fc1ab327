//! Axis-aligned boxes.

use glam::{Affine3A, Vec3};

/// A ray that starts further away than this many sizes of a tree's bounds is brought nearer.
const FAR: f32 = 4.0;

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub min: Vec3,
    pub max: Vec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY }
    }
}

impl Bounds {
    /// The box around those of the points that are finite.
    pub fn of(points: &[Vec3]) -> Self {
        let mut bounds = Self::default();
        points.iter().filter(|p| p.is_finite()).for_each(|&p| bounds.include(p));
        bounds
    }

    pub fn include(&mut self, point: Vec3) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    pub fn join(&mut self, other: Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let pick = |bit: usize, min: f32, max: f32| if i & bit == 0 { min } else { max };
            let (min, max) = (self.min, self.max);
            Vec3::new(pick(1, min.x, max.x), pick(2, min.y, max.y), pick(4, min.z, max.z))
        })
    }

    /// The box around this one where `m` puts it.
    pub fn transformed(&self, m: &Affine3A) -> Self {
        let mut bounds = Self::default();
        self.corners().into_iter().for_each(|corner| bounds.include(m.transform_point3(corner)));
        bounds
    }

    /// The largest absolute coordinate.
    pub fn reach(&self) -> f32 {
        self.min.abs().max(self.max.abs()).max_element()
    }

    /// How far along it a ray should start so that the tests against what is in here, whose errors grow with the
    /// distance of the origin, stay within the boxes' padding: 0 if it is near, otherwise the parameter of a point
    /// about one size before the bounds. Rounding that point moves the ray as a whole, the same for all tests, and no
    /// more than rounding has moved it already.
    pub fn approach(&self, origin: Vec3, direction: Vec3) -> f32 {
        let size = (self.max - self.min).max_element();
        let away = (self.min - origin).max(origin - self.max).max_element();
        if away <= size * FAR {
            return 0.0;
        }
        // As far as the origin is away, less one size, is surely before the bounds, whatever the direction.
        let start = (away - size) / direction.length();
        if start.is_finite() { start } else { 0.0 }
    }
}
