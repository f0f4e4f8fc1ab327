//! Follows the outlines of what comes into view from where it was met to where it was not.
//!
//! Past the paper: in place of its line L and its contested area, which clear whatever something unseen might be standing before.
//!
//! What the old view did not see may come in between samples that all agree. But it is mostly met somewhere: where nothing
//! landed, at an outline, at a side of the image, or where a proof was asked for. So wherever a ray met something that
//! stands before its neighbour and that nothing around that neighbour knows of, the neighbour is to be proven visible;
//! where it is hidden, a ray is cast there, and the pixels around are looked at again, until the new object has been
//! followed to its end.
//!
//! Of what has come into view nothing is known, and most of it is only filled in [between](super::between) pixels of its row that
//! were cast. So there a ray is cast wherever one beside it has met another surface, before it or not.

use super::around::{Tangent, is_one_surface};
use super::buzz_buffer::{BuzzBuffer, pixels_around};
use super::cast::Pass;
use super::frontier::Frontier;
use super::questions::LightQuestions;
use super::rays::CastCentres;
use crate::frame::{PixelClass, RayCounts};
use std::ops::Range;

/// What following holds between frames beside its frontier, so that nothing is allocated for each.
#[derive(Debug, Default)]
pub(super) struct Outlines {
    /// For each pixel, whether it had to be proven.
    proven: Vec<bool>,
}

impl Outlines {
    /// What it holds for each pixel.
    pub const BYTES_PER_PIXEL: usize = size_of::<bool>();

    /// Settles which samples of `buffer`, which is complete, are reused, where `pass` casts the rays.
    pub fn follow<R: CastCentres>(
        &mut self,
        frontier: &mut Frontier,
        pass: &Pass<'_, R>,
        buffer: &mut BuzzBuffer,
        questions: &mut LightQuestions,
    ) -> RayCounts {
        let mut counts = RayCounts::default();
        self.proven.clear();
        self.proven.resize(buffer.object.len(), false);
        let is_even = |stretch| is_all_reused(buffer, &stretch) || is_one_triangle(buffer, &stretch);
        frontier.begin(buffer, is_even, |pixel| may_be_hidden(pass, buffer, pixel));
        while !frontier.pixels().is_empty() && !pass.basis.rays.is_cancelled() {
            counts += pass.prove(buffer, frontier.pixels(), questions);
            frontier.pixels().iter().for_each(|&pixel| self.proven[pixel as usize] = true);
            let size = (buffer.width(), buffer.height());
            let is_hidden = |pixel: usize| !buffer.class[pixel].is_reused();
            frontier
                .go_on(size, is_hidden, |pixel| !self.proven[pixel] && may_be_hidden(pass, buffer, pixel));
        }
        counts
    }
}

/// True if the pixels of a stretch within a row, and all around them, are reused: nothing was met there.
fn is_all_reused(buffer: &BuzzBuffer, stretch: &Range<usize>) -> bool {
    rows_around(buffer, stretch).all(|row| {
        let classes = &buffer.class[row];
        classes.iter().fold(true, |all, class| all & class.is_reused())
    })
}

/// True if they all show one triangle: nothing stands before another.
fn is_one_triangle(buffer: &BuzzBuffer, stretch: &Range<usize>) -> bool {
    rows_around(buffer, stretch).all(|mut row| row.all(|i| buffer.is_same_primitive(i, stretch.start)))
}

/// The pixels of a stretch within a row, and all around them, row by row.
fn rows_around(buffer: &BuzzBuffer, stretch: &Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let (width, height) = (buffer.width(), buffer.height());
    let (x, y) = (stretch.start % width, stretch.start / width);
    let columns = x.saturating_sub(1)..(x + stretch.len() + 1).min(width);
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    rows.map(move |y| y * width + columns.start..y * width + columns.end)
}

/// True if a reused sample may be hidden by what a ray has met at a pixel beside it: something that stands before it and is of no
/// surface that landed around it, or moves otherwise. Where none landed, anything that is not of its own surface.
fn may_be_hidden<R: CastCentres>(pass: &Pass<'_, R>, buffer: &BuzzBuffer, pixel: usize) -> bool {
    let around = || pixels_around(buffer.width(), buffer.height(), pixel);
    let is_unknown = |met: usize| {
        let sample = buffer.sample(met);
        // What landed there is what a ray mostly meets.
        let landed = [met]
            .into_iter()
            .chain(around())
            .chain([pixel])
            .filter_map(|around| pass.basis.sources.of(around));
        let mut known = landed.map(|k| pass.basis.old.sample(k)).chain([buffer.sample(pixel)]);
        !known.any(|known| is_one_surface(&known, &sample, pass.basis.view))
    };
    let is_met_elsewhere =
        |met: usize| !buffer.class[met].is_reused() && !buffer.is_same_primitive(met, pixel);
    let body_of =
        |pixel: usize| pass.basis.rays.motion().and_then(|motion| motion.body_of(&buffer.sample(pixel)));
    // Of what moves otherwise, a part may come out that was inside of what landed here.
    let comes_out = |met: usize| body_of(met) != body_of(pixel);
    if !buffer.class[pixel].is_reused() || !is_beside_met(buffer, pixel) {
        return false;
    }
    if buffer.class[pixel] == PixelClass::Filled && pass.is_new(pixel) {
        let tangent = Tangent::new(buffer.sample(pixel), pass.basis.view);
        return around().any(|met| is_met_elsewhere(met) && !tangent.is_one_thing_with(&buffer.sample(met)));
    }
    around().any(|met| {
        is_met_elsewhere(met) && buffer.z[met] < buffer.z[pixel] && (comes_out(met) || is_unknown(met))
    })
}

/// True if a ray was cast at any of the nine pixels around and at `pixel`.
fn is_beside_met(buffer: &BuzzBuffer, pixel: usize) -> bool {
    let (width, x) = (buffer.width(), pixel % buffer.width());
    let is_inside = x > 0 && x + 1 < width && pixel > width && pixel + width < buffer.class.len();
    let is_met = |middle: usize| buffer.class[middle - 1..middle + 2].iter().any(|class| !class.is_reused());
    !is_inside || is_met(pixel - width) || is_met(pixel) || is_met(pixel + width)
}
