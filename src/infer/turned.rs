//! What opens to the eye: surfaces that the old view saw edge-on, or from behind where their backs are culled.
//!
//! Nothing of them is among the old samples, and no line L leads to them, since no hit stood before them: a thin sheet
//! comes out of nothing where the eye crosses its plane. The paper does not have this case; its objects are solid. So
//! whatever lies behind such a surface on the new image is not to be believed.

use super::Marks;
use super::buzz_buffer::Projector;
use super::project::Landings;
use crate::frame::PixelClass;
use glam::{Vec3, Vec4};

/// Marks the pixels on which the triangles (relative to the view's origin) stand before what landed there.
pub fn turned(triangles: &[[Vec3; 3]], view: &Projector, landings: &Landings, marks: &Marks) {
    for triangle in triangles {
        let corners =
            before_the_eye(triangle.map(|p| *view.raster_from_world() * p.extend(1.0)), view.near());
        let Some(nearest) = corners.iter().map(|c| c.z).reduce(f32::min) else { continue };
        let outline: Vec<(f32, f32)> = corners.iter().map(|c| (c.x / c.w, c.y / c.w)).collect();
        for_each_pixel(&outline, view.size(), |x, y| {
            if let Some(pixel) = view.pixel(x, y)
                && landings.z(pixel).is_none_or(|z| z > nearest)
            {
                marks.set(pixel, PixelClass::Bad);
            }
        });
    }
}

/// The part of a triangle beyond the near plane, in homogeneous raster coordinates: up to four corners.
fn before_the_eye(triangle: [Vec4; 3], near: f32) -> Vec<Vec4> {
    let mut kept = Vec::with_capacity(4);
    for (i, &a) in triangle.iter().enumerate() {
        let b = triangle[(i + 1) % 3];
        if a.z > near {
            kept.push(a);
        }
        if (a.z > near) != (b.z > near) {
            kept.push(a.lerp(b, (near - a.z) / (b.z - a.z)));
        }
    }
    kept
}

/// Visits a point in every pixel of the window that a convex outline touches.
fn for_each_pixel(outline: &[(f32, f32)], (width, height): (f32, f32), mut visit: impl FnMut(f32, f32)) {
    let rows = outline.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), p| (a.min(p.1), b.max(p.1)));
    let (top, bottom) = (rows.0.floor().max(0.0), rows.1.floor().min(height - 1.0));
    let mut y = top;
    while y <= bottom {
        let (mut from, mut to) = (f32::INFINITY, f32::NEG_INFINITY);
        for (i, &a) in outline.iter().enumerate() {
            let b = outline[(i + 1) % outline.len()];
            let (low, high) = if a.1 <= b.1 { (a, b) } else { (b, a) };
            if high.1 < y || low.1 > y + 1.0 {
                continue;
            }
            // The part of the side that lies in the row.
            let at =
                |row: f32| low.0 + (high.0 - low.0) * ((row.clamp(low.1, high.1) - low.1) / (high.1 - low.1));
            let ends = if high.1 > low.1 { [at(y), at(y + 1.0)] } else { [low.0, high.0] };
            for x in ends {
                (from, to) = (from.min(x), to.max(x));
            }
        }
        let mut x = from.floor().max(0.0);
        while x <= to.floor().min(width - 1.0) {
            visit(x + 0.5, y + 0.5);
            x += 1.0;
        }
        y += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    /// True if a point lies in the triangle.
    fn holds(t: &[(f32, f32); 3], p: (f32, f32)) -> bool {
        let side = |a: (f32, f32), b: (f32, f32)| (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0);
        let sides = [side(t[0], t[1]), side(t[1], t[2]), side(t[2], t[0])];
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    }

    proptest! {
        /// Every pixel that any point of the triangle lies on is visited, and none beyond the box around it.
        #[test]
        fn every_pixel_of_a_triangle_is_visited(x in prop::array::uniform3(-5.0..25.0f32), y in prop::array::uniform3(-5.0..15.0f32)) {
            let t = [(x[0], y[0]), (x[1], y[1]), (x[2], y[2])];
            let mut visited = HashSet::new();
            for_each_pixel(&t, (20.0, 10.0), |x, y| {
                visited.insert((x as i32, y as i32));
            });
            for i in 0..2000 {
                let p = ((i % 50) as f32 * 0.4 + 0.01, (i / 50) as f32 * 0.25 + 0.01);
                if holds(&t, p) {
                    prop_assert!(visited.contains(&(p.0 as i32, p.1 as i32)), "{:?}", p);
                }
            }
            let (left, right) = (x.iter().copied().fold(f32::MAX, f32::min), x.iter().copied().fold(f32::MIN, f32::max));
            prop_assert!(visited.iter().all(|v| v.0 as f32 >= left.floor() && v.0 as f32 <= right));
        }
    }

    #[test]
    fn what_is_behind_the_eye_is_cut_off() {
        let corner = |z: f32| Vec4::new(0.0, 0.0, z, z);
        assert_eq!(before_the_eye([corner(-1.0), corner(-2.0), corner(0.1)], 0.5).len(), 0);
        assert_eq!(before_the_eye([corner(1.0), corner(2.0), corner(3.0)], 0.5).len(), 3);
        let cut = before_the_eye([corner(-1.0), corner(2.0), corner(3.0)], 0.5);
        assert_eq!(cut.len(), 4);
        assert!(cut.iter().all(|c| c.z >= 0.5 - 1e-6));
    }
}
