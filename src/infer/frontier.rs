//! Pixels to look at, from which more are found: how far something reaches is followed from pixel to pixel.

use super::buzz_buffer::{BuzzBuffer, pixels_around};
use rayon::prelude::*;
use std::ops::Range;

/// Pixels of a row that are looked at together; nearly everywhere they end there.
const STRETCH: usize = 16;

/// What following holds between frames, so that nothing is allocated for each.
#[derive(Debug, Default)]
pub(super) struct Frontier {
    /// Row by row, pixels with which to begin, and how many each row has.
    rows: Vec<u32>,
    found: Vec<usize>,
    /// Pixels to look at, in order; those to look at next.
    pixels: Vec<u32>,
    next: Vec<u32>,
    /// For each pixel, whether it is among the next: false between two calls.
    queued: Vec<bool>,
}

impl Frontier {
    /// What it holds for each pixel, if it begins with all.
    pub const BYTES_PER_PIXEL: usize = 3 * size_of::<u32>() + size_of::<bool>();

    /// Begins with the pixels of `buffer` that are `wanted`. Stretches within a row are left out where none is: those that are
    /// `even`, which is asked first.
    pub fn begin(
        &mut self,
        buffer: &BuzzBuffer,
        even: impl Fn(Range<usize>) -> bool + Sync,
        wanted: impl Fn(usize) -> bool + Sync,
    ) {
        let (width, height) = (buffer.width(), buffer.height());
        // Memory for as many pixels as there can be; what is not written to costs nothing.
        self.rows.resize(width * height, 0);
        self.found.resize(height, 0);
        self.queued.resize(width * height, false);
        for list in [&mut self.pixels, &mut self.next] {
            list.clear();
            list.reserve(width * height);
        }
        let rows = self.rows.par_chunks_mut(width).zip(&mut self.found);
        rows.with_min_len(8).enumerate().for_each(|(y, (row, found))| {
            *found = 0;
            for first in (0..width).step_by(STRETCH) {
                let stretch = y * width + first..y * width + (first + STRETCH).min(width);
                if !even(stretch.clone()) {
                    for pixel in stretch.filter(|&pixel| wanted(pixel)) {
                        row[*found] = pixel as u32;
                        *found += 1;
                    }
                }
            }
        });
        let rows = self.rows.chunks(width).zip(&self.found);
        rows.for_each(|(row, &found)| self.pixels.extend(&row[..found]));
    }

    /// Pixels to look at, in order.
    pub fn pixels(&self) -> &[u32] {
        &self.pixels
    }

    /// Goes on, in an image of that size, from those pixels that it `moves` on from, asked in order: to them and all around them, as far
    /// as they are `wanted`.
    pub fn go_on(
        &mut self,
        (width, height): (usize, usize),
        mut moves: impl FnMut(usize) -> bool,
        mut wanted: impl FnMut(usize) -> bool,
    ) {
        let Self { pixels, next, queued, .. } = self;
        next.clear();
        for pixel in pixels.iter().map(|&pixel| pixel as usize).filter(|&pixel| moves(pixel)) {
            let block = pixels_around(width, height, pixel).chain([pixel]);
            let new = block.filter(|&pixel| !std::mem::replace(&mut queued[pixel], true));
            next.extend(new.map(|pixel| pixel as u32));
        }
        next.iter().for_each(|&pixel| queued[pixel as usize] = false);
        next.sort_unstable();
        next.retain(|&pixel| wanted(pixel as usize));
        std::mem::swap(pixels, next);
    }
}
