//! Vectors four at a time, one to a lane: what is worked out for four lights costs little more than for one.

use glam::{BVec4A, Vec3, Vec4};
use std::ops::{Add, Mul};

/// How many.
pub(super) const LANES: usize = 4;

/// Four vectors, structure of arrays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vec3x4 {
    x: Vec4,
    y: Vec4,
    z: Vec4,
}

impl Vec3x4 {
    /// A vector to each lane.
    pub fn new(lanes: [Vec3; LANES]) -> Self {
        let each = |coordinate: fn(Vec3) -> f32| Vec4::from_array(lanes.map(coordinate));
        Self { x: each(|v| v.x), y: each(|v| v.y), z: each(|v| v.z) }
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

    /// The square of each one's length.
    #[inline]
    pub fn length_squared(self) -> Vec4 {
        self.dot(self)
    }
}

impl Add for Vec3x4 {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl Mul<Vec4> for Vec3x4 {
    type Output = Self;

    #[inline]
    fn mul(self, factors: Vec4) -> Self {
        Self { x: self.x * factors, y: self.y * factors, z: self.z * factors }
    }
}

/// Some of the lanes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lanes(BVec4A);

impl Lanes {
    pub const ALL: Self = Self(BVec4A::TRUE);

    /// Those whose bits are set among the lowest.
    #[inline]
    pub fn from_bits(bits: u32) -> Self {
        const MASKS: [BVec4A; 1 << LANES] = masks();
        Self(MASKS[bits as usize % MASKS.len()])
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

    /// Those of them for which `keep` says so.
    #[inline]
    pub fn filter(self, mut keep: impl FnMut(usize) -> bool) -> Self {
        let mut bits = self.0.bitmask();
        for lane in 0..LANES {
            if bits >> lane & 1 != 0 && !keep(lane) {
                bits &= !(1 << lane);
            }
        }
        Self::from_bits(bits)
    }

    /// `values` in these lanes, 0 in the others.
    #[inline]
    pub fn select(self, values: Vec4) -> Vec4 {
        Vec4::select(self.0, values, Vec4::ZERO)
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
