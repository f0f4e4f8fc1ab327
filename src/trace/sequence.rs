//! Points that fill a square evenly, and what they are mapped to.

use crate::accel::scrambled;
use glam::{Vec2, Vec3, vec2};
use std::f32::consts::FRAC_PI_4;

/// The middle of the square, which all maps here take to the middle of their target.
pub(super) const MIDDLE: Vec2 = Vec2::splat(0.5);

/// Point number `i` of the (0, 2)-sequence of Sobol', Owen-scrambled by `seed`: any power of two of its points fills
/// the square as evenly as can be, and points of different seeds have nothing to do with each other.
pub(super) fn sobol(i: u32, seed: u32) -> Vec2 {
    let mut second = 0;
    let (mut bits, mut direction) = (i, 1 << 31);
    while bits != 0 {
        second ^= if bits & 1 != 0 { direction } else { 0 };
        bits >>= 1;
        direction ^= direction >> 1;
    }
    let unit = |bits: u32| (bits >> 8) as f32 / (1 << 24) as f32;
    vec2(unit(scramble(i.reverse_bits(), seed)), unit(scramble(second, hash(seed, 1))))
}

/// Nested uniform scrambling by a hash (Laine and Karras 2011, *Stratified Sampling for Stochastic Transparency*; the
/// constants are Vegdahl's, as in pbrt-v4).
fn scramble(bits: u32, seed: u32) -> u32 {
    let mut x = bits.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul(seed >> 16 | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// Mixes a number into a seed.
pub(super) fn hash(seed: u32, number: u32) -> u32 {
    scrambled(seed ^ number.wrapping_mul(0x9e37_79b9))
}

/// From the unit square to the unit disc, equal areas to equal areas (Shirley and Chiu 1997).
pub(super) fn disc(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return p;
    }
    if p.x.abs() > p.y.abs() {
        p.x * Vec2::from_angle(FRAC_PI_4 * p.y / p.x)
    } else {
        let Vec2 { x, y } = p.y * Vec2::from_angle(FRAC_PI_4 * p.x / p.y);
        vec2(y, x)
    }
}

/// From the unit square to the directions within a cone around `axis`, equal areas to equal solid angles. `height` is 1
/// less the cosine of the cone's half angle. Also returns 1 less the direction's own cosine, which keeps its precision
/// in narrow cones.
pub(super) fn cone(u: Vec2, axis: Vec3, height: f32) -> (Vec3, f32) {
    let disc = disc(u);
    let fall = disc.length_squared() * height;
    // The sine over the disc's radius.
    let spread = (height * (2.0 - fall)).sqrt();
    let (right, up) = axis.any_orthonormal_pair();
    (axis * (1.0 - fall) + (right * disc.x + up * disc.y) * spread, fall)
}

/// From the unit square to the directions around `normal`, by the cosine with it.
pub(super) fn cosine_hemisphere(u: Vec2, normal: Vec3) -> Vec3 {
    let disc = disc(u);
    let (right, up) = normal.any_orthonormal_pair();
    right * disc.x + up * disc.y + normal * (1.0 - disc.length_squared()).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stratum_of_a_power_of_two_holds_one_point() {
        for seed in [0, 1, 0xdead_beef, hash(7, 3)] {
            // All the ways to cut the square into 64 equal boxes.
            for bits in 0..=6 {
                let (columns, rows) = (1 << bits, 64 >> bits);
                let mut boxes: Vec<u32> = (0..64)
                    .map(|i| {
                        let p = sobol(i, seed);
                        (p.y * rows as f32) as u32 * columns + (p.x * columns as f32) as u32
                    })
                    .collect();
                boxes.sort_unstable();
                assert_eq!(boxes, (0..64).collect::<Vec<_>>(), "seed {seed}, {columns} columns");
            }
        }
    }

    #[test]
    fn seeds_are_independent() {
        // The mean of one point over many seeds is the middle, and so is that of another beside it.
        let n = 4096;
        let (mut mean, mut product) = (Vec2::ZERO, 0.0);
        for seed in 0..n {
            let (a, b) = (sobol(5, hash(seed, 0)), sobol(5, hash(seed, 1)));
            mean += a / n as f32;
            product += (a - MIDDLE).dot(b - MIDDLE) / n as f32;
        }
        assert!((mean - MIDDLE).abs().max_element() < 0.02, "{mean}");
        assert!(product.abs() < 0.01, "{product}");
    }

    #[test]
    fn maps_keep_the_middle_and_the_density() {
        assert_eq!((disc(MIDDLE), cone(MIDDLE, Vec3::Y, 0.3).0), (Vec2::ZERO, Vec3::Y));
        let n = 1 << 12;
        let points = || (0..n).map(|i| sobol(i, 9));
        let share = |inside: &dyn Fn(Vec2) -> bool| points().filter(|&u| inside(u)).count() as f32 / n as f32;
        assert!((share(&|u| disc(u).length() < 0.5) - 0.25).abs() < 2e-3);
        assert!((share(&|u| disc(u).x > 0.0) - 0.5).abs() < 2e-3);
        // Half of a cone's solid angle lies within half its height.
        assert!((share(&|u| cone(u, Vec3::X, 0.5).0.x > 0.75) - 0.5).abs() < 2e-3);
        // Half of a hemisphere's cosine lies within 45 degrees.
        assert!((share(&|u| cosine_hemisphere(u, Vec3::Z).z > 0.5f32.sqrt()) - 0.5).abs() < 2e-3);
        for u in points() {
            let (direction, fall) = cone(u, Vec3::Y, 0.4);
            assert!((direction.length() - 1.0).abs() < 1e-5 && (1.0 - direction.y - fall).abs() < 1e-6);
            assert!((cosine_hemisphere(u, Vec3::NEG_Y).length() - 1.0).abs() < 1e-5);
        }
    }
}
