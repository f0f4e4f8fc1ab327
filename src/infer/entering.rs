//! New objects: where the new view looks through space that the old one did not see.
//!
//! The paper's "The New Object Problem". Samples that barely move leave no gap through which something that comes in
//! from the side could be found. So no old sample is trusted on the contested area: the pixels whose pyramid, at the
//! depth k behind which new things may be, lies outside the old viewing volume. Pure rotations need none of this:
//! they move every sample alike, and what comes into view finds its pixels empty.
//!
//! Past the paper, for samples at pixel centres, less is enough: [`at_sides`]. What a near or far plane no longer cuts off comes in
//! anywhere: see [`uncovered`](super::uncovered()).

use super::buzz_buffer::BuzzBuffer;
use super::cell::place_before;
use super::marks::Marks;
use super::project::{AT_CENTRE, Landings};
use super::projector::Projector;
use crate::frame::PixelClass;
use crate::scene::View;
use glam::{DMat4, DVec3, Vec2};
use rayon::prelude::*;
use std::ops::Range;

/// Camera moves shorter than this share of k count as pure rotations: they shift nothing by a thousandth of a pixel
/// on an image of a thousand.
const STILL: f64 = 1e-6;

/// Where the old view saw what is at planar depth k, metres, or farther.
///
/// A pixel is known if the point at depth k on its centre ray lies in the old viewing volume. That point's old raster
/// position is a homography of the new one, so each row's known pixels are one span; together they are the paper's
/// scan-converted polygon of at most eight vertices. The others are its contested area.
#[derive(Debug, Clone, Copy)]
pub(super) struct KnownArea<'a> {
    old: &'a View,
    new: &'a View,
    old_raster_from_world: DMat4,
    k: f64,
}

impl<'a> KnownArea<'a> {
    /// None where nothing is contested: the camera only turns.
    pub fn between(old: &'a View, new: &'a View, k: f64) -> Option<Self> {
        let moves = (old.eye - new.eye).length() > STILL * k || !old.is_perspective();
        moves.then(|| Self { old, new, old_raster_from_world: old.raster_from_world(DVec3::ZERO), k })
    }

    /// The known columns of a row.
    pub fn columns(&self, row: usize) -> Range<usize> {
        let (width, height) = (f64::from(self.old.width), f64::from(self.old.height));
        let near = self.old.lens.near;
        // Positive inside, affine along a row.
        let sides = |column: f64| {
            let ray = self.new.ray(column, row as f64 + 0.5);
            let r = self.old_raster_from_world * (ray.origin + ray.direction * self.k).extend(1.0);
            [r.x, r.y, width * r.w - r.x, height * r.w - r.y, r.z - near]
        };
        let columns = self.new.width as usize;
        let (first, last) = (sides(0.5), sides(columns as f64 - 0.5));
        let (mut from, mut to) = (0, columns);
        for (a, b) in first.into_iter().zip(last) {
            let (f, t) = positive_span(a, b, columns);
            from = from.max(f);
            to = to.min(t);
        }
        from..to.max(from)
    }
}

/// Marks the contested area for new objects that are at planar depth `k` (metres) or farther.
pub fn entering(old: &View, new: &View, k: f64, marks: &Marks) {
    let Some(area) = KnownArea::between(old, new, k) else { return };
    let columns = new.width as usize;
    (0..new.height as usize).into_par_iter().for_each(|row| {
        let known = area.columns(row);
        for x in (0..known.start).chain(known.end..columns) {
            marks.set(row * columns + x, PixelClass::Entering);
        }
    });
}

/// Marks the pixels at the sides of the image whose centre was not between old ones, or on which nothing landed (past the paper).
///
/// What comes in passes there, or has gone farther in if it is nearer than what is behind it: in the contested area some samples are
/// [proven](super::cast). Where a ray meets it, it is [followed](super::outlines) from there as far as it goes, however near it
/// is, so that none of the area need be cleared. So are the edges of shadows that come in.
pub(super) fn at_sides(old: &BuzzBuffer, view: &Projector, landings: &Landings, marks: &Marks) {
    let (width, height) = (old.width(), old.height());
    let last = Vec2::new(width as f32, height as f32) - 1.0;
    // Where all is side, a sample is good for its pixel.
    let slack = Vec2::select(last.cmpgt(Vec2::ZERO), Vec2::splat(AT_CENTRE), Vec2::splat(0.5));
    let mark = |x: usize, y: usize| {
        let pixel = y * width + x;
        let place = landings.source(pixel).and_then(|i| place_before(old, view, i, (x, y)));
        if place.is_none_or(|p| p.cmplt(-slack).any() || p.cmpgt(last + slack).any()) {
            marks.set(pixel, PixelClass::Entering);
        }
    };
    for y in 0..height {
        [0, width - 1].into_iter().for_each(|x| mark(x, y));
    }
    for x in 0..width {
        [0, height - 1].into_iter().for_each(|y| mark(x, y));
    }
}

/// Columns `from..to` on which a value that goes evenly from `a` (first column) to `b` (last) is not negative. Slack of
/// a thousandth of a pixel keeps what touches the border.
fn positive_span(a: f64, b: f64, columns: usize) -> (usize, usize) {
    let slack = 1e-3 * (a.abs() + b.abs()) / columns as f64;
    let (a, b) = (a + slack, b + slack);
    let steps = (columns - 1).max(1) as f64;
    match (a >= 0.0, b >= 0.0) {
        (true, true) => (0, columns),
        (false, false) => (0, 0),
        (true, false) => (0, (a / (a - b) * steps).floor() as usize + 1),
        (false, true) => ((a / (a - b) * steps).ceil() as usize, columns),
    }
}
