//! Stereoscopic ray-tracing: the right eye from the left, the special case that the paper begins with.
//!
//! The eyes differ by a step along the scan-line, so a sample stays on its scan-line and at its depth, and how far it moves
//! follows from its depth alone. What an old hit may be hiding comes into view where neighbours land with a positive gap
//! between them, and nowhere else.
//!
//! Departures: gaps are cleared after all samples have landed, so that the order of pixels does not matter; and what stands
//! in a gap stays if it is nearer than anything that was hidden could be there.

use super::buzz_buffer::BuzzBuffer;
use super::marks::Marks;
use super::obscured::DEPTH_STEP;
use super::project::Landings;
use super::projector::{Projected, Projector};
use crate::frame::PixelClass;
use crate::scene::View;
use glam::DVec3;
use rayon::prelude::*;

/// The paper's closed form X + e z_p / (d + z_p): from the left eye's raster to the right one's.
///
/// A point at planar depth z appears `at_infinity - pixels / z` columns further right, the same number at one depth for
/// every point.
#[derive(Debug, Clone, Copy)]
pub struct Parallax {
    left: Projector,
    right: Projector,
    /// Columns that the background moves.
    at_infinity: f32,
    /// Columns that a point at planar depth 1 falls back behind the background, metres times columns.
    pixels: f32,
}

impl Parallax {
    /// Between two perspective views that differ by a step along `right` and by a horizontal shift of the window.
    pub fn between(left: &View, right: &View, origin: DVec3) -> Self {
        let width = f64::from(left.width);
        let step = (right.eye - left.eye).dot(left.right);
        Self {
            left: Projector::new(left, origin),
            right: Projector::new(right, origin),
            at_infinity: (0.5 * width * (left.lens.shift.x - right.lens.shift.x)) as f32,
            pixels: (0.5 * width * step / left.half_extent().x) as f32,
        }
    }

    /// Where the left eye's sample `i` lies on the right eye's scan-line, if its depth were `z`.
    fn column(&self, left: &BuzzBuffer, i: usize, z: f32) -> f32 {
        let old = self.left.column(left.position[i], left.surface[i].is_background());
        old + self.at_infinity - self.pixels / z
    }
}

/// Lands the left eye's samples in the right eye's view, the nearest on each pixel. Returns the least depth of all.
pub fn other_eye(left: &BuzzBuffer, parallax: &Parallax, landings: &Landings, marks: &Marks) -> Option<f32> {
    let scan_line = |y: usize| {
        let row = y * left.width()..(y + 1) * left.width();
        let mut nearest = f32::INFINITY;
        for i in row.clone() {
            let background = left.surface[i].is_background();
            let z = left.z[i];
            nearest = nearest.min(z);
            let column = parallax.column(left, i, z);
            let at = Projected { x: column, y: y as f32 + 0.5, z };
            if let Some(pixel) = parallax.right.pixel(at.x, at.y)
                && (background || parallax.right.faces(left.position[i], left.normal[i].direction()))
            {
                landings.land(pixel, at, i, marks);
            }
        }
        nearest
    };
    let rows = (0..left.height()).into_par_iter().with_min_len(8);
    let nearest = rows.map(scan_line).reduce(|| f32::INFINITY, f32::min);
    nearest.is_finite().then_some(nearest)
}

/// Marks what a positive gap between samples uncovers.
pub fn in_gaps(left: &BuzzBuffer, parallax: &Parallax, landings: &Landings, marks: &Marks) {
    (0..left.height()).into_par_iter().with_min_len(8).for_each(|y| {
        for i in y * left.width()..(y + 1) * left.width() - 1 {
            if left.z[i + 1] > left.z[i] * DEPTH_STEP || left.object[i + 1] != left.object[i] {
                clear_gap(left, i, y, parallax, landings, marks);
            }
        }
    });
}

/// Marks what shows in the gap between sample `i` and its right neighbour, as far as something that `i` hid from the left
/// eye may stand before it.
fn clear_gap(left: &BuzzBuffer, i: usize, y: usize, parallax: &Parallax, landings: &Landings, marks: &Marks) {
    let begin = parallax.column(left, i, left.z[i]);
    let end = parallax.column(left, i + 1, left.z[i + 1]);
    let farthest = parallax.column(left, i, f32::INFINITY);
    let columns = begin.max(-1.0).floor() as isize + 1..end.min(left.width() as f32).floor() as isize;
    for column in columns {
        let pixel = y * left.width() + column as usize;
        // The line L behind the sample is farthest away where it leaves the pixel.
        let left_behind = farthest - (column + 1) as f32;
        let int_z = if left_behind > 0.0 { parallax.pixels / left_behind } else { f32::INFINITY };
        if landings.z(pixel).is_none_or(|z| z > int_z) {
            marks.set(pixel, PixelClass::Bad);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::StereoEye;
    use crate::scene::{Lens, Projection, Stereo};
    use glam::{DVec2, Vec3};
    use proptest::prelude::*;

    proptest! {
        /// The closed form is the four by four matrix, for eyes.
        #[test]
        fn the_closed_form_is_the_projection(
            x in -5.0..5.0f32, z in 0.5..200.0f32, interocular in 0.01..0.5f64, convergence in 1.0..50.0f64,
            shift in -0.3..0.3f64,
        ) {
            let middle = View {
                eye: DVec3::new(0.3, 0.1, -0.2),
                right: DVec3::X,
                up: DVec3::Y,
                forward: DVec3::NEG_Z,
                lens: Lens {
                    projection: Projection::Perspective { yfov: 0.8 },
                    shift: DVec2::new(shift, 0.1),
                    near: 0.01,
                    far: f64::INFINITY,
                    sensor_height: None,
                },
                width: 640,
                height: 360,
                pixel_aspect: 1.0,
            };
            let stereo = Stereo { interocular, convergence };
            let (left, right) = (middle.of_eye(stereo, StereoEye::Left), middle.of_eye(stereo, StereoEye::Right));
            let parallax = Parallax::between(&left, &right, middle.eye);
            let mut buffer = BuzzBuffer::new(1, 1, 1);
            buffer.position[0] = Vec3::new(x, 0.2, -z);
            buffer.surface[0].instance = 1;
            let seen = Projector::new(&right, middle.eye).project(buffer.position[0], Vec3::Z, false).unwrap();
            let column = parallax.column(&buffer, 0, z);
            prop_assert!((column - seen.x).abs() < 1e-3 * (1.0 + seen.x.abs() / 640.0), "{} {}", column, seen.x);
            prop_assert!((seen.z - z).abs() < 1e-4 * z);
        }
    }
}
