//! The bad pixels: what an old hit hid may stand in front of what is reused.
//!
//! Anything may lie on the line L behind an old hit, as seen from the old eye. Where L passes before a reused sample
//! in the new view, that sample cannot be trusted (the paper's "Solving the Generalized Bad Pixel Problem").
//!
//! Departures: L is walked after all samples have landed, so the result does not depend on their order (the paper
//! tests a pixel only if something landed there before). L is clipped to the new view's near side, where the paper
//! projects its far end even if that lies behind the eye. The walk follows the exact line, not one rounded to pixel
//! centres, which kills wrongly at the line's start. And only samples at a discontinuity start a line: within a
//! surface, the lines of its rim bound the hidden volume already.

use super::buzz_buffer::{BuzzBuffer, UNKNOWN, pixels_around};
use super::marks::Marks;
use super::project::Landings;
use super::projector::Projector;
use crate::frame::PixelClass;
use glam::{Vec2, Vec4};
use rayon::prelude::*;

/// Relative step in depth from which two neighbours count as apart. 3 % is what a prototype used; walking from every
/// sample changed no count that it saw.
pub(super) const DEPTH_STEP: f32 = 1.03;

/// Walks L behind every old hit at a discontinuity and marks the pixels whose sample it may hide.
pub fn obscured(
    old: &BuzzBuffer,
    old_view: &Projector,
    new_view: &Projector,
    landings: &Landings,
    marks: &Marks,
) {
    let (width, height) = (old.width(), old.height());
    (0..height).into_par_iter().with_min_len(8).for_each(|y| {
        let mut smooth = [false; STRETCH];
        for x in 0..width {
            if x % STRETCH == 0 {
                smooth = are_smooth(old, x, y);
            }
            let i = y * width + x;
            if smooth[x % STRETCH] || old.surface[i].is_background() || !hides_something(old, x, y) {
                continue;
            }
            let position = old.position[i];
            let direction = old_view.direction_to(position);
            if let Some(line) = ImageLine::new(new_view, position.extend(1.0), direction.extend(0.0)) {
                let begin = new_view.project_unclipped(position);
                line.walk(new_view, |pixel, int_z| {
                    // Where nothing landed, what landed around it shows how far away things are.
                    let around = || {
                        let around = pixels_around(width, height, pixel);
                        around.filter_map(|other| landings.z(other)).reduce(f32::max)
                    };
                    let z = landings.z(pixel).or_else(around);
                    if Some(pixel) != begin && z.is_none_or(|z| z > int_z) {
                        marks.set(pixel, PixelClass::Bad);
                    }
                });
            }
        }
    });
}

/// Pixels of a row that are looked at together.
const STRETCH: usize = 64;

/// For each pixel of a stretch of row `y`, from column `first` on, whether the 3x3 around it is of one object without a step
/// down: it hides nothing, as nearly everywhere. Not at the sides of the image.
fn are_smooth(old: &BuzzBuffer, first: usize, y: usize) -> [bool; STRETCH] {
    let (width, height) = (old.width(), old.height());
    if y == 0 || y + 1 >= height {
        return [false; STRETCH];
    }
    let columns = first.saturating_sub(1)..(first + STRETCH + 1).min(width);
    // Where `columns` begin; what lies outside the image is like nothing in it.
    let at = columns.start + 1 - first;
    let rows = [y - 1, y, y + 1].map(|y| y * width + columns.start..y * width + columns.end);
    let (mut objects, mut deepest) = ([UNKNOWN; STRETCH + 2], [f32::INFINITY; STRETCH + 2]);
    let (mut middle, mut differs) = ([0.0; STRETCH + 2], [0; STRETCH + 2]);
    // First down each column, then along the row.
    let [above, own, below] = rows.clone().map(|row| &old.object[row]);
    for (x, ((above, own), below)) in above.iter().zip(own).zip(below).enumerate() {
        (objects[at + x], differs[at + x]) = (*own, own ^ above | own ^ below);
    }
    let [above, own, below] = rows.map(|row| &old.z[row]);
    for (x, ((above, own), below)) in above.iter().zip(own).zip(below).enumerate() {
        (middle[at + x], deepest[at + x]) = (*own, above.max(*own).max(*below));
    }
    std::array::from_fn(|x| {
        let differs = differs[x] | differs[x + 1] | differs[x + 2];
        let differs = differs | objects[x] ^ objects[x + 1] | objects[x + 2] ^ objects[x + 1];
        let deepest = deepest[x].max(deepest[x + 1]).max(deepest[x + 2]);
        differs == 0 && deepest <= middle[x + 1] * DEPTH_STEP
    })
}

/// True where one of the eight neighbours lies behind the sample, or is not known because the image ends.
fn hides_something(old: &BuzzBuffer, x: usize, y: usize) -> bool {
    let (width, height) = (old.width(), old.height());
    if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
        return true;
    }
    let i = y * width + x;
    let (z, object) = (old.z[i], old.object[i]);
    [i - width - 1, i - width, i - width + 1, i - 1, i + 1, i + width - 1, i + width, i + width + 1]
        .into_iter()
        .any(|n| old.z[n] > z * DEPTH_STEP || (old.object[n] != object && old.z[n] >= z))
}

impl Projector {
    /// The pixel of a point, whichever way it faces.
    fn project_unclipped(&self, position: glam::Vec3) -> Option<usize> {
        let r = *self.raster_from_world() * position.extend(1.0);
        if r.w > 0.0 { self.pixel(r.x / r.w, r.y / r.w) } else { None }
    }
}

/// C1: the part of L that the new view sees, on the raster.
struct ImageLine {
    begin: Vec2,
    end: Vec2,
    /// What is linear on the raster: 1/z in perspective, z in parallel projection; at `begin` and `end`.
    depth: [f32; 2],
    perspective: bool,
}

impl ImageLine {
    /// Projects the line from a point towards a direction (homogeneous) and clips it to the view: its near side and
    /// the four sides of the window, all linear in s of H(s) = (1 - s) A + s B.
    fn new(view: &Projector, from: Vec4, towards: Vec4) -> Option<Self> {
        let (a, b) = (*view.raster_from_world() * from, *view.raster_from_world() * towards);
        let (width, height) = view.size();
        let sides = [
            (a.z - view.near(), b.z),
            (a.x, b.x),
            (a.y, b.y),
            (width * a.w - a.x, width * b.w - b.x),
            (height * a.w - a.y, height * b.w - b.y),
        ];
        // Parallel rays never reach their far end on the raster; stop where it is a million times as far.
        let mut range = [0.0f32, if view.is_perspective() { 1.0 } else { 1.0 - 1e-6 }];
        for (at_a, at_b) in sides {
            match (at_a >= 0.0, at_b >= 0.0) {
                (true, true) => {}
                (false, false) => return None,
                (true, false) => range[1] = range[1].min(at_a / (at_a - at_b)),
                (false, true) => range[0] = range[0].max(at_a / (at_a - at_b)),
            }
        }
        if range[0] >= range[1] {
            return None;
        }
        let at = range.map(|s| {
            let h = a * (1.0 - s) + b * s;
            let depth = if view.is_perspective() { (1.0 - s) / h.z } else { h.z / (1.0 - s) };
            (Vec2::new(h.x / h.w, h.y / h.w), depth)
        });
        let [(begin, z0), (end, z1)] = at;
        let finite = begin.is_finite() && end.is_finite() && z0.is_finite() && z1.is_finite();
        finite.then_some(Self { begin, end, depth: [z0, z1], perspective: view.is_perspective() })
    }

    /// Visits each pixel that the line crosses with `int_z`, the depth of its far end within the pixel's pyramid.
    fn walk(&self, view: &Projector, mut visit: impl FnMut(usize, f32)) {
        let (width, height) = view.size();
        let last = Vec2::new(width - 1.0, height - 1.0);
        let along = self.end - self.begin;
        let mut cell = self.begin.floor().clamp(Vec2::ZERO, last);
        let end_cell = self.end.floor().clamp(Vec2::ZERO, last);
        let step = Vec2::new(along.x.signum(), along.y.signum());
        // Parameter at which the line leaves the cell through a vertical and through a horizontal side.
        let delta = Vec2::new(1.0 / along.x.abs(), 1.0 / along.y.abs());
        let side = cell + Vec2::new(f32::from(along.x > 0.0), f32::from(along.y > 0.0));
        let mut next = Vec2::new(
            if along.x == 0.0 { f32::INFINITY } else { (side.x - self.begin.x) / along.x },
            if along.y == 0.0 { f32::INFINITY } else { (side.y - self.begin.y) / along.y },
        );
        let mut entered = 0.0;
        let mut cells_left = (cell - end_cell).abs().element_sum() as usize + 1;
        loop {
            let left = next.min_element().min(1.0);
            let int_z = self.z(entered).max(self.z(left));
            visit(cell.y as usize * width as usize + cell.x as usize, int_z);
            cells_left -= 1;
            if cells_left == 0 {
                return;
            }
            if next.x < next.y {
                cell.x += step.x;
                next.x += delta.x;
            } else {
                cell.y += step.y;
                next.y += delta.y;
            }
            if cell.cmplt(Vec2::ZERO).any() || cell.cmpgt(last).any() {
                return;
            }
            entered = left;
        }
    }

    fn z(&self, t: f32) -> f32 {
        let depth = self.depth[0] + (self.depth[1] - self.depth[0]) * t;
        match self.perspective {
            true if depth <= 0.0 => f32::INFINITY,
            true => 1.0 / depth,
            false => depth,
        }
    }
}
