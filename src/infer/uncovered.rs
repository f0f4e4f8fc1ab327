//! What comes out of nothing: surfaces that the old view saw edge-on, or from behind where their backs are culled, and what its near or
//! far plane cut off.
//!
//! Nothing of them is among the old samples, and no line L leads to them, since no hit stood before them: a thin sheet
//! appears where the eye crosses its plane, a house where it comes within the far plane. The paper does not have these cases; its
//! objects are solid, and no plane cuts them. So whatever lies behind such a surface on the new image is not to be believed.

use super::marks::Marks;
use super::project::Landings;
use super::projector::Projector;
use crate::frame::PixelClass;
use glam::{DVec4, Vec3};

/// Marks the pixels on which something flat, given by its outline's corners in order around (metres, relative to the segment's origin, as
/// samples are), stands before what landed there.
pub fn uncovered(outline: &[Vec3], view: &Projector, landings: &Landings, marks: &Marks) {
    // A floor may begin under the eye and end at the horizon: in single precision its near part would be lost.
    let raster_from_world = view.raster_from_world().as_dmat4();
    let (mut corners, count) = ([DVec4::ZERO; MOST_OUTLINE_CORNERS], outline.len().min(MOST_OUTLINE_CORNERS));
    corners.iter_mut().zip(outline).for_each(|(c, p)| *c = raster_from_world * p.as_dvec3().extend(1.0));
    let (corners, count) = before_the_eye(&corners[..count], view.near().into(), view.is_perspective());
    let corners = &corners[..count];
    let Some(nearest) = corners.iter().map(|c| c.z).reduce(f64::min) else { return };
    let mut outline = [(0.0, 0.0); MOST_OUTLINE_CORNERS + 1];
    outline.iter_mut().zip(corners).for_each(|(place, c)| *place = (c.x / c.w, c.y / c.w));
    let (width, height) = view.size();
    for_each_centre(&outline[..count], (width.into(), height.into()), |x, y| {
        if let Some(pixel) = view.pixel(x as f32, y as f32)
            && landings.z(pixel).is_none_or(|z| f64::from(z) > nearest)
        {
            marks.set(pixel, PixelClass::Bad);
        }
    });
}

/// Corners of an outline, at most: a triangle's that six planes have cut.
const MOST_OUTLINE_CORNERS: usize = 9;

/// What is nearer to the plane of a perspective eye than this share of the farthest corner's depth is cut off with what is before
/// the near plane: it lies far outside the image, and division by its depth would leave no digit.
const NEAREST: f64 = 1e-9;

/// The part of an outline beyond the near plane, in homogeneous raster coordinates: so many corners.
fn before_the_eye(
    outline: &[DVec4],
    near: f64,
    perspective: bool,
) -> ([DVec4; MOST_OUTLINE_CORNERS + 1], usize) {
    let farthest = outline.iter().map(|c| c.z).fold(0.0, f64::max);
    let near = if perspective { near.max(NEAREST * farthest) } else { near };
    let (mut kept, mut count) = ([DVec4::ZERO; MOST_OUTLINE_CORNERS + 1], 0);
    // Of what rounding has made less than convex some corners may be left out.
    let mut keep = |corner| {
        if let Some(place) = kept.get_mut(count) {
            *place = corner;
            count += 1;
        }
    };
    for (i, &a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        if a.z > near {
            keep(a);
        }
        if (a.z > near) != (b.z > near) {
            keep(a.lerp(b, (near - a.z) / (b.z - a.z)));
        }
    }
    (kept, count)
}

/// Visits the centre of every pixel of the window that a convex outline covers.
fn for_each_centre(outline: &[(f64, f64)], (width, height): (f64, f64), mut visit: impl FnMut(f64, f64)) {
    let (top, bottom) = span(outline.iter().map(|p| p.1));
    let mut y = first_centre(top);
    while y <= bottom.min(height) {
        let crossings = outline.iter().enumerate().filter_map(|(i, &a)| {
            let b = outline[(i + 1) % outline.len()];
            let (low, high) = if a.1 <= b.1 { (a, b) } else { (b, a) };
            let crosses = low.1 <= y && y <= high.1 && low.1 < high.1;
            crosses.then(|| low.0 + (high.0 - low.0) * ((y - low.1) / (high.1 - low.1)))
        });
        let (from, to) = span(crossings);
        let mut x = first_centre(from);
        while x <= to.min(width) {
            visit(x, y);
            x += 1.0;
        }
        y += 1.0;
    }
}

/// The least and the greatest value.
fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), v| (least.min(v), greatest.max(v)))
}

/// The first centre of a pixel of the window at `from` or after it.
fn first_centre(from: f64) -> f64 {
    (from - 0.5).ceil().max(0.0) + 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    /// True if a point lies in the triangle.
    fn holds(t: &[(f64, f64); 3], p: (f64, f64)) -> bool {
        let side = |a: (f64, f64), b: (f64, f64)| (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0);
        let sides = [side(t[0], t[1]), side(t[1], t[2]), side(t[2], t[0])];
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    }

    proptest! {
        /// Every pixel is visited whose centre lies in the triangle, and no other.
        #[test]
        fn centres_in_a_triangle_are_visited(x in prop::array::uniform3(-5.0..25.0f64), y in prop::array::uniform3(-5.0..15.0f64)) {
            let t = [(x[0], y[0]), (x[1], y[1]), (x[2], y[2])];
            let mut visited = HashSet::new();
            for_each_centre(&t, (20.0, 10.0), |x, y| {
                visited.insert((x as i32, y as i32));
            });
            for i in 0..200 {
                let pixel = (i % 20, i / 20);
                let centre = (f64::from(pixel.0) + 0.5, f64::from(pixel.1) + 0.5);
                prop_assert_eq!(visited.contains(&pixel), holds(&t, centre), "{:?}", centre);
            }
        }
    }

    #[test]
    fn what_is_behind_the_eye_is_cut_off() {
        let corner = |z: f64| DVec4::new(0.0, 0.0, z, z);
        assert_eq!(before_the_eye(&[corner(-1.0), corner(-2.0), corner(0.1)], 0.5, true).1, 0);
        assert_eq!(before_the_eye(&[corner(1.0), corner(2.0), corner(3.0)], 0.5, true).1, 3);
        let cut = before_the_eye(&[corner(-1.0), corner(2.0), corner(3.0)], 0.5, true);
        assert_eq!(cut.1, 4);
        assert!(cut.0[..cut.1].iter().all(|c| c.z >= 0.5 - 1e-6));
        // Without a near plane too.
        let cut = before_the_eye(&[corner(-1.0), corner(2.0), corner(3.0)], 0.0, true);
        assert!(cut.0[..cut.1].iter().all(|c| c.z > 0.0));
        // Parallel rays see as much of what is near.
        let cut = before_the_eye(&[corner(1e-3), corner(2e6), corner(3e6)], 0.0, false);
        assert_eq!(cut.1, 3);
    }
}
