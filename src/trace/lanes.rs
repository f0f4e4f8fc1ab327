//! Vectors four at a time, one to a lane: what is worked out for four lights, or four points, costs little more than for
//! one.

use glam::{BVec4A, Vec3, Vec4};
use std::f32::consts::{FRAC_PI_2, PI};
use std::ops::{Add, AddAssign, BitAnd, BitOr, Mul, Neg, Sub};

/// How many.
pub(super) const LANES: usize = 4;

/// Four vectors, structure of arrays.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Vec3x4 {
    x: Vec4,
    y: Vec4,
    z: Vec4,
}

impl Vec3x4 {
    /// A vector to each lane.
    #[inline]
    pub fn of(vector: impl Fn(usize) -> Vec3) -> Self {
        let (a, b, c, d) = (vector(0), vector(1), vector(2), vector(3));
        Self {
            x: Vec4::new(a.x, b.x, c.x, d.x),
            y: Vec4::new(a.y, b.y, c.y, d.y),
            z: Vec4::new(a.z, b.z, c.z, d.z),
        }
    }

    /// The same vector in all lanes.
    #[inline]
    pub fn splat(v: Vec3) -> Self {
        Self { x: Vec4::splat(v.x), y: Vec4::splat(v.y), z: Vec4::splat(v.z) }
    }

    /// The dot product of each with its own other one.
    #[inline]
    pub fn dot(self, other: Self) -> Vec4 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// The cross product of each with its own other one.
    #[inline]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// The square of each one's length.
    #[inline]
    pub fn length_squared(self) -> Vec4 {
        self.dot(self)
    }

    /// Each one made as long as 1; those that have no direction become `fallback`.
    #[inline]
    pub fn normalize_or(self, fallback: Self) -> Self {
        let per_length = Vec4::ONE / self.length_squared().sqrt();
        let regular = per_length.cmpgt(Vec4::ZERO) & per_length.cmplt(Vec4::INFINITY);
        let Self { x, y, z } = self * per_length;
        Self {
            x: Vec4::select(regular, x, fallback.x),
            y: Vec4::select(regular, y, fallback.y),
            z: Vec4::select(regular, z, fallback.z),
        }
    }

    /// The vector of a lane.
    #[inline]
    pub fn lane(self, lane: usize) -> Vec3 {
        Vec3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    /// The sum of all four.
    #[inline]
    pub fn sum(self) -> Vec3 {
        let Self { x, y, z } = self;
        Vec3::new(x.element_sum(), y.element_sum(), z.element_sum())
    }
}

impl Add for Vec3x4 {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl AddAssign for Vec3x4 {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Vec3x4 {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl Neg for Vec3x4 {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

/// Each times its own other one, coordinate by coordinate, as light times a reflectance.
impl Mul for Vec3x4 {
    type Output = Self;

    #[inline]
    fn mul(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }
}

impl Mul<Vec4> for Vec3x4 {
    type Output = Self;

    #[inline]
    fn mul(self, factors: Vec4) -> Self {
        Self { x: self.x * factors, y: self.y * factors, z: self.z * factors }
    }
}

/// The angles, 0 to pi, of which `sines` and `cosines` are the sine, not negative, and the cosine, both times any one length.
///
/// Within 1e-6 by a polynomial for the arc tangent (Abramowitz and Stegun 1964, 4.4.49).
#[inline]
pub(super) fn angles(sines: Vec4, cosines: Vec4) -> Vec4 {
    const TERMS: [f32; 8] = [
        0.002_866_225_7,
        -0.016_165_737,
        0.042_909_614,
        -0.075_289_64,
        0.106_562_64,
        -0.142_089,
        0.199_935_51,
        -0.333_331_45,
    ];
    let along = cosines.abs();
    let tangents = sines.min(along) / sines.max(along);
    let square = tangents * tangents;
    let series = TERMS.iter().fold(Vec4::ZERO, |sum, &term| sum * square + term);
    let acute = tangents + tangents * square * series;
    let acute = Vec4::select(sines.cmpgt(along), FRAC_PI_2 - acute, acute);
    Vec4::select(cosines.cmplt(Vec4::ZERO), PI - acute, acute)
}

/// Some of the lanes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lanes(BVec4A);

impl Lanes {
    pub const NONE: Self = Self(BVec4A::FALSE);
    pub const ALL: Self = Self(BVec4A::TRUE);

    /// Those whose bits are set among the lowest.
    #[inline]
    pub fn from_bits(bits: u32) -> Self {
        const MASKS: [BVec4A; 1 << LANES] = masks();
        Self(MASKS[bits as usize % MASKS.len()])
    }

    /// Those for which it `is` so.
    #[inline]
    pub fn of(is: impl Fn(usize) -> bool) -> Self {
        Self::from_bits((0..LANES).fold(0, |bits, lane| bits | u32::from(is(lane)) << lane))
    }

    /// Those in which `values` are above 0.
    #[inline]
    pub fn above_zero(values: Vec4) -> Self {
        Self(values.cmpgt(Vec4::ZERO))
    }

    #[inline]
    pub fn is_empty(self) -> bool {
        !self.0.any()
    }

    /// True if it is one of them.
    pub fn has(self, lane: usize) -> bool {
        self.0.bitmask() >> lane & 1 != 0
    }

    /// `others`, but in these lanes what `value` says, one by one.
    #[inline]
    pub fn replace(self, others: Vec4, mut value: impl FnMut(usize) -> f32) -> Vec4 {
        if self.is_empty() {
            return others;
        }
        let mut values = others.to_array();
        let lanes = values.iter_mut().enumerate().filter(|&(lane, _)| self.has(lane));
        lanes.for_each(|(lane, place)| *place = value(lane));
        Vec4::from_array(values)
    }

    /// Those of them that are not `others`.
    #[inline]
    pub fn without(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// `values` in these lanes, 0 in the others.
    #[inline]
    pub fn select(self, values: Vec4) -> Vec4 {
        self.choose(values, Vec4::ZERO)
    }

    /// `values` in these lanes, `others` in the others.
    #[inline]
    pub fn choose(self, values: Vec4, others: Vec4) -> Vec4 {
        Vec4::select(self.0, values, others)
    }
}

impl BitAnd for Lanes {
    type Output = Self;

    #[inline]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOr for Lanes {
    type Output = Self;

    #[inline]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

const fn masks() -> [BVec4A; 1 << LANES] {
    let mut masks = [BVec4A::FALSE; 1 << LANES];
    let mut bits = 0;
    while bits < masks.len() {
        masks[bits] = BVec4A::new(bits & 1 != 0, bits & 2 != 0, bits & 4 != 0, bits & 8 != 0);
        bits += 1;
    }
    masks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_arc_tangent() {
        for i in 0..=4000 {
            let angle = f64::from(i) / 4000.0 * std::f64::consts::PI;
            for length in [1e-12, 1.0, 1e12] {
                let (sine, cosine) = ((angle.sin() * length) as f32, (angle.cos() * length) as f32);
                let found = angles(Vec4::splat(sine), Vec4::splat(cosine)).x;
                assert!((f64::from(found) - angle).abs() < 1e-6, "{angle} {found}");
            }
        }
    }
}
