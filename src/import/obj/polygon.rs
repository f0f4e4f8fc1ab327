//! Polygons to triangles: fans where they are convex, ears where they are not.

use earcut::{Earcut, utils3d::project3d_to_2d};
use glam::{DVec2, Vec3};

/// Sine of the angle by which a corner has to turn back: less is rounding.
const STRAIGHT: f64 = 1e-6;

/// Cuts polygons up, with memory for the next.
#[derive(Default)]
pub(super) struct Cutter {
    corners: Vec<[f64; 3]>,
    flat: Vec<[f64; 2]>,
    ears: Vec<u32>,
    earcut: Earcut<f64>,
}

impl Cutter {
    /// Adds the triangles of `polygon` to `out`; all turn as it does.
    pub fn cut(&mut self, polygon: &[u32], positions: &[Vec3], out: &mut Vec<[u32; 3]>) {
        if polygon.len() > 3 && self.is_concave(polygon, positions) {
            self.earcut.earcut_slice(&self.flat, &[], &mut self.ears);
            let turn = |[a, b, c]: [u32; 3]| {
                let [a, b, c] = [a, b, c].map(|i| DVec2::from(self.flat[i as usize]));
                (b - a).perp_dot(c - a)
            };
            for &[a, b, c] in self.ears.as_chunks().0 {
                let ear = if turn([a, b, c]) < 0.0 { [a, c, b] } else { [a, b, c] };
                out.push(ear.map(|i| polygon[i as usize]));
            }
        } else if let [hub, rim @ ..] = polygon {
            out.extend(rim.windows(2).map(|edge| [*hub, edge[0], edge[1]]));
        }
    }

    /// Whether a corner turns against the whole; if so, `flat` is the polygon seen from its front.
    fn is_concave(&mut self, polygon: &[u32], positions: &[Vec3]) -> bool {
        let at = |corner: u32| positions[corner as usize].as_dvec3();
        let origin = at(polygon[0]);
        self.corners.clear();
        self.corners.extend(polygon.iter().map(|&corner| (at(corner) - origin).to_array()));
        if !self.corners.as_flattened().iter().all(|c| c.is_finite())
            || !project3d_to_2d(&self.corners, self.corners.len(), &mut self.flat)
        {
            return false;
        }
        let count = self.flat.len();
        (0..count).any(|i| {
            let [a, b, c] = [i, i + 1, i + 2].map(|i| DVec2::from(self.flat[i % count]));
            let (before, after) = (b - a, c - b);
            before.perp_dot(after) < -STRAIGHT * before.length() * after.length()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The area of the triangles, each counted as it turns, along the polygon's normal.
    fn area(triangles: &[[u32; 3]], positions: &[Vec3], along: Vec3) -> (f32, f32) {
        let areas = triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            (b - a).cross(c - a).dot(along) / 2.0
        });
        areas.fold((0.0, 0.0), |(sum, size), area| (sum + area, size + area.abs()))
    }

    #[test]
    fn concave_polygons_are_covered_once_however_they_lie() {
        let u = [[-1., -1.], [1., -1.], [1., 1.], [0.3, 1.], [0.3, 0.], [-0.3, 0.], [-0.3, 1.], [-1., 1.]];
        for (x, y) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::X), (Vec3::Y, Vec3::Z), (Vec3::X, Vec3::ONE)] {
            let positions: Vec<Vec3> = u.iter().map(|[a, b]| x * *a + y * *b + Vec3::splat(9.0)).collect();
            let normal = x.cross(y);
            for first in 0..8 {
                let polygon: Vec<u32> = (0..8).map(|i| (i + first) % 8).collect();
                let mut out = Vec::new();
                Cutter::default().cut(&polygon, &positions, &mut out);
                let (sum, size) = area(&out, &positions, normal.normalize());
                let expected = 3.4 * normal.length();
                assert!((sum - expected).abs() < 1e-4 && (size - expected).abs() < 1e-4, "{first}: {out:?}");
            }
        }
    }

    #[test]
    fn convex_polygons_are_fans_from_their_first_corner() {
        let positions =
            [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.1], [0., 1., 0.], [-0.5, 0.5, 0.]].map(Vec3::from);
        let mut out = Vec::new();
        Cutter::default().cut(&[0, 1, 2, 3, 4], &positions, &mut out);
        assert_eq!(out, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }

    #[test]
    fn what_is_no_polygon_is_survived() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::NAN, Vec3::Y];
        let mut out = Vec::new();
        for polygon in [&[][..], &[0], &[0, 1], &[0, 1, 2, 3], &[0, 0, 0, 0], &[0, 1, 0, 1, 3, 0, 1]] {
            Cutter::default().cut(polygon, &positions, &mut out);
        }
        assert!(out.iter().flatten().all(|&i| i < 4));
    }
}
