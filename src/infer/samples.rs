//! All samples of an image by number and by place.

use super::buzz_buffer::BuzzBuffer;
use super::lattice::{Lattice, Position};
use super::subpixel::Level;
use crate::frame::SurfaceSample;

/// The samples of an image, of pixels and sub-pixels alike.
#[derive(Clone, Copy)]
pub struct Samples<'a> {
    /// Those at the centres of pixels.
    pub pixels: &'a BuzzBuffer,
    /// Where the others may lie.
    pub lattice: Lattice,
    /// The others, from level 2 on.
    pub levels: &'a [Level],
}

impl<'a> Samples<'a> {
    /// All that a buffer holds.
    pub fn of(pixels: &'a BuzzBuffer) -> Self {
        Self { pixels, lattice: pixels.finer.lattice, levels: &pixels.finer.levels }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.pixels.object.len() + self.levels.iter().map(|level| level.samples.len()).sum::<usize>()
    }

    /// A sample and its shadow bits by number: pixels first, then level by level.
    pub fn get(&self, number: usize) -> (SurfaceSample, &'a [u32]) {
        match self.place(number) {
            (0, pixel) => (self.pixels.sample(pixel), self.pixels.lit(pixel)),
            (level, rest) => {
                let level = &self.levels[level - 1];
                (level.samples[rest], level.lit(rest))
            }
        }
    }

    /// The level that a sample by number is of, counted from 0 for pixels, and its number there.
    pub fn place(&self, number: usize) -> (usize, usize) {
        let pixels = self.pixels.object.len();
        let (mut level, mut rest, mut count) = (0, number, pixels);
        while rest >= count {
            rest -= count;
            count = self.levels[level].samples.len();
            level += 1;
        }
        (level, rest)
    }

    /// The number of the sample at a position, if one is there.
    pub fn number(&self, at: Position) -> Option<usize> {
        if let Some(pixel) = self.lattice.pixel_at(at) {
            return Some(pixel);
        }
        let depth = self.levels.iter().position(|level| {
            let half = level.cells.side() as u32 / 2;
            at.iter().all(|c| c.is_multiple_of(half))
        })?;
        let before: usize = self.levels[..depth].iter().map(|level| level.samples.len()).sum();
        Some(self.pixels.object.len() + before + self.levels[depth].cells.find(at)?)
    }

    /// The sample at a position and its shadow bits, if it is there.
    pub fn at(&self, at: Position) -> Option<(SurfaceSample, &'a [u32])> {
        self.number(at).map(|number| self.get(number))
    }
}
