//! Where the samples of a new image come from.

use super::buzz_buffer::BuzzBuffer;
use super::marks::Marks;
use super::project::Landings;
use crate::frame::PixelClass;
use rayon::prelude::*;
use std::ops::Range;
use std::slice::SliceIndex;

/// Nothing landed on the pixel. The numbers of old pixels are below: an image has fewer than 2^30 pixels.
pub(super) const NOTHING: u32 = (1 << 30) - 1;

/// Set where something unknown may stand before what landed on the pixel, if anything did.
pub(super) const SUSPECT: u32 = 1 << 31;

/// Set where what landed on the pixel is away from its centre.
pub(super) const MOVED: u32 = 1 << 30;

/// Words that name a triangle, or a face of a shape.
pub(super) const NAMES: usize = 2;

/// For each pixel: the old pixel whose sample landed on it, whether that is to be believed, and what of the sample its
/// neighbours are held against.
#[derive(Debug, Default)]
pub(super) struct Sources {
    /// Numbers of old pixels or [`NOTHING`], and flags.
    landed: Vec<u32>,
    /// Image after image, word after word: the names of triangles, then the shadow bits; 0 where nothing landed. So a word of
    /// many pixels is compared at once.
    words: Vec<u32>,
}

impl Sources {
    /// What it holds for each pixel, where a sample has so many words of shadow bits.
    pub fn bytes_per_pixel(lit_words: usize) -> usize {
        (1 + NAMES + lit_words) * size_of::<u32>()
    }

    /// Settles it for all pixels, once all samples have landed and all marks are set.
    pub fn settle(&mut self, old: &BuzzBuffer, landings: &Landings, marks: &Marks) {
        let (width, height, pixels) = (old.width(), old.height(), landings.len());
        self.landed.resize(pixels, NOTHING);
        self.landed.par_iter_mut().with_min_len(1 << 14).enumerate().for_each(|(pixel, source)| {
            *source = landings.landed(pixel).map_or(NOTHING, |(i, away)| {
                let flag = if away { MOVED } else { 0 };
                i as u32 | flag
            });
            if let Some(PixelClass::Bad | PixelClass::Moved | PixelClass::Entering) = marks.get(pixel) {
                *source |= SUSPECT;
            }
        });
        self.words.resize(pixels * (NAMES + old.lit_words()), 0);
        let landed = &self.landed;
        self.words.par_chunks_mut(width).with_min_len(16).enumerate().for_each(|(row, words)| {
            let (number, landed) = (row / height, &landed[row % height * width..][..width]);
            let word = |i: usize| match number {
                0 => old.surface[i].instance,
                1 => old.surface[i].primitive,
                _ => old.lit(i)[number - NAMES],
            };
            for (to, source) in words.iter_mut().zip(landed) {
                let i = source & NOTHING;
                *to = if i == NOTHING { 0 } else { word(i as usize) };
            }
        });
    }

    /// Those of the columns `columns` of row `y` of an image so wide: numbers of old pixels or [`NOTHING`], and flags.
    pub fn row(&self, width: usize, y: usize, columns: impl SliceIndex<[u32], Output = [u32]>) -> &[u32] {
        &self.landed[y * width..][columns]
    }

    /// Word number `number` of what landed there.
    pub fn words(&self, number: usize, width: usize, y: usize, columns: Range<usize>) -> &[u32] {
        &self.words[number * self.landed.len() + y * width..][columns]
    }

    /// The old pixel whose sample landed here.
    pub fn of(&self, pixel: usize) -> Option<usize> {
        let source = self.landed[pixel] & NOTHING;
        (source != NOTHING).then_some(source as usize)
    }

    /// True if nothing landed on pixel (x, y) of an image so wide, nor on any around it.
    pub fn is_nothing_around(&self, width: usize, (x, y): (usize, usize)) -> bool {
        let (columns, height) = (x.saturating_sub(1)..(x + 2).min(width), self.landed.len() / width);
        let mut rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.all(|y| self.row(width, y, columns.clone()).iter().all(|source| source & NOTHING == NOTHING))
    }

    /// True if a sample landed on the pixel's very centre.
    pub fn is_centred(&self, pixel: usize) -> bool {
        self.of(pixel).is_some() && self.landed[pixel] & MOVED == 0
    }

    /// True if something unknown may stand in front here.
    pub fn is_suspect(&self, pixel: usize) -> bool {
        self.landed[pixel] & SUSPECT != 0
    }
}
