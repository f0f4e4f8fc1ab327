//! Irradiance of evenly bright shapes in closed form: the integral of the cosine over the directions in which they are
//! seen, those below the horizon left out.

use super::lanes::Lanes;
use glam::{DVec3, Vec4};
use std::f64::consts::PI;

/// The integral over a disc in the sky, as a share of that of one overhead. `cos` is the cosine between the normal and
/// the disc's middle, `sin` the sine of the disc's half angle.
///
/// Snyder, *Area Light Sources for Real-Time Graphics* (1996). A sphere is seen as such a disc.
pub(super) fn disc_share(cos: f32, sin: f32) -> f32 {
    if cos >= sin {
        return cos;
    }
    if cos <= -sin {
        return 0.0;
    }
    // Double precision: large terms cancel where the disc is small.
    let (c, s) = (f64::from(cos), f64::from(sin).min(1.0));
    let height = (1.0 - c * c).sqrt();
    let x = (1.0 - s * s).sqrt() / s;
    let y = (-x * c / height).clamp(-1.0, 1.0);
    let z = height * (1.0 - y * y).sqrt();
    (((c * y.acos() - x * z) * s * s + z.atan2(x)) / (PI * s * s)).max(0.0) as f32
}

/// [`disc_share`] for four discs.
#[inline]
pub(super) fn disc_shares(cosines: Vec4, sines: Vec4) -> Vec4 {
    let cut = Lanes::above_zero(sines - cosines) & Lanes::above_zero(sines + cosines);
    cut.replace(cosines.max(Vec4::ZERO), |lane| disc_share(cosines[lane], sines[lane]))
}

/// Corners of a panel's polygon, at most.
pub(super) const MOST_PANEL_CORNERS: usize = 16;

/// The integral over a convex polygon, its corners relative to the point.
///
/// Lambert's formula: a sum over edges, each the angle under which it is seen times the height of the normal over the
/// plane through it.
pub(super) fn polygon(corners: impl Iterator<Item = DVec3> + Clone, normal: DVec3) -> f64 {
    // The part above the horizon has at most one corner more.
    let mut above = [DVec3::ZERO; MOST_PANEL_CORNERS + 1];
    let mut count = 0;
    let mut add = |corner: DVec3| {
        if count < above.len() {
            above[count] = corner;
            count += 1;
        }
    };
    for (a, b) in corners.clone().zip(corners.cycle().skip(1)) {
        let (ha, hb) = (a.dot(normal), b.dot(normal));
        if ha >= 0.0 {
            add(a);
        }
        if (ha >= 0.0) != (hb >= 0.0) {
            add(a.lerp(b, ha / (ha - hb)));
        }
    }
    let above = &above[..count];
    let next = above.iter().cycle().skip(1);
    let edge = |(a, b): (&DVec3, &DVec3)| {
        let cross = a.cross(*b);
        let length = cross.length();
        if length > 0.0 { length.atan2(a.dot(*b)) * cross.dot(normal) / length } else { 0.0 }
    };
    above.iter().zip(next).map(edge).sum::<f64>().abs() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral of max(0, cosine) over the directions for which `seen`, summed over a grid of the sphere.
    fn by_summing(normal: DVec3, seen: impl Fn(DVec3) -> bool) -> f64 {
        let (rows, columns) = (1000, 2000);
        let mut sum = 0.0;
        for row in 0..rows {
            let y = (f64::from(row) + 0.5) / f64::from(rows) * 2.0 - 1.0;
            for column in 0..columns {
                let (sin, cos) = ((f64::from(column) + 0.5) / f64::from(columns) * 2.0 * PI).sin_cos();
                let radius = (1.0 - y * y).sqrt();
                let direction = DVec3::new(radius * cos, y, radius * sin);
                sum += if seen(direction) { direction.dot(normal).max(0.0) } else { 0.0 };
            }
        }
        sum * 4.0 * PI / f64::from(rows * columns)
    }

    #[test]
    fn a_disc_sinks_below_the_horizon() {
        assert_eq!((disc_share(0.7, 0.2), disc_share(-0.3, 0.2), disc_share(0.4, 0.0)), (0.7, 0.0, 0.4));
        assert_eq!((disc_share(1.0, 1.0), disc_share(-1.0, 1.0)), (1.0, 0.0));
        for sin in [0.3f64, 0.8, 1.0] {
            for cos in [-0.25f64, 0.0, 0.2, 0.29] {
                let axis = DVec3::new((1.0 - cos * cos).sqrt(), cos, 0.0);
                let limit = (1.0 - sin * sin).sqrt();
                let expected = by_summing(DVec3::Y, |d| d.dot(axis) > limit) / (PI * sin * sin);
                let got = f64::from(disc_share(cos as f32, sin as f32));
                assert!((got - expected).abs() < 1e-3, "{cos} {sin}: {got} {expected}");
            }
        }
        // Half of a small disc at the horizon: 2 / (3 pi) of its radius.
        let sin = 1e-4;
        let expected = sin * 2.0 / (3.0 * std::f32::consts::PI);
        assert!((disc_share(0.0, sin) - expected).abs() < 1e-3 * expected);
    }

    #[test]
    fn a_rectangle_has_the_form_factor_of_the_handbooks() {
        // A corner over the point, sides a and b at height 1, parallel to the surface (Siegel and Howell, C-12).
        let (a, b) = (1.5f64, 0.7f64);
        let corners = [[0.0, 0.0], [a, 0.0], [a, b], [0.0, b]].map(|[x, z]| DVec3::new(x, 1.0, z));
        let term = |p: f64, q: f64| p / (1.0 + p * p).sqrt() * (q / (1.0 + p * p).sqrt()).atan();
        let expected = (term(a, b) + term(b, a)) / 2.0;
        assert!((polygon(corners.into_iter(), DVec3::Y) - expected).abs() < 1e-12);
        assert!((polygon(corners.into_iter().rev(), DVec3::Y) - expected).abs() < 1e-12);
        assert_eq!(polygon(corners.into_iter(), DVec3::NEG_Y), 0.0);
    }

    #[test]
    fn a_polygon_is_cut_off_at_the_horizon() {
        let corners =
            [[-1.0, -0.8], [1.2, -0.3], [0.9, 1.0], [-0.6, 0.7]].map(|[y, z]| DVec3::new(1.0, y, z));
        let inside = |d: DVec3| {
            let p = d / d.x;
            let edges = corners.into_iter().zip(corners.into_iter().cycle().skip(1));
            d.x > 0.0
                && edges.into_iter().all(|(a, b)| (b.y - a.y) * (p.z - a.z) - (b.z - a.z) * (p.y - a.y) > 0.0)
        };
        for normal in [DVec3::Y, DVec3::new(0.6, -0.8, 0.0), DVec3::X] {
            let (got, expected) = (polygon(corners.into_iter(), normal), by_summing(normal, inside));
            assert!((got - expected).abs() < 2e-3, "{normal}: {got} {expected}");
        }
    }

    #[test]
    fn all_around_is_pi() {
        let far = 1e6;
        let corners =
            [[-far, -far], [far, -far], [far, far], [-far, far]].map(|[x, z]| DVec3::new(x, 1.0, z));
        assert!((polygon(corners.into_iter(), DVec3::Y) - PI).abs() < 1e-5);
    }
}
