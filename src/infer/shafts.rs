//! Which lights nothing that moved can hide, told for many pixels at once: shaft culling (Haines and Wallace 1991, "Shaft Culling
//! for Efficient Ray-Traced Radiosity").

use super::bodies::{Bodies, Shaft};
use super::buzz_buffer::{BuzzBuffer, UNKNOWN};
use crate::frame::{LightWay, SurfaceSample};
use glam::Vec3;
use rayon::prelude::*;

/// Rows and columns of a tile.
pub(super) const TILE: usize = 8;

/// The box around points that were included.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    min: Vec3,
    max: Vec3,
}

impl Default for Span {
    fn default() -> Self {
        Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY }
    }
}

impl Span {
    pub fn include(&mut self, point: Vec3) {
        (self.min, self.max) = (self.min.min(point), self.max.max(point));
    }

    fn has(&self, point: Vec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// Its middle, and half of its sides; none where nothing was included.
    pub fn middle_and_half(&self) -> Option<(Vec3, Vec3)> {
        let middle = (self.min + self.max) / 2.0;
        // Rounding may have moved the middle.
        self.min.cmple(self.max).all().then(|| (middle, (self.max - middle).max(middle - self.min)))
    }
}

/// For each tile of an image, where its samples are, and which lights they see past all that moved.
#[derive(Debug, Default)]
pub struct Shafts {
    /// Columns of the image.
    width: usize,
    spans: Vec<Span>,
    /// For each tile, bits of lights.
    clear: Vec<u32>,
}

impl Shafts {
    /// The most that it holds for each pixel, whose samples have so many words of shadow bits.
    pub fn bytes_per_pixel(words: usize) -> usize {
        (size_of::<Span>() + words * size_of::<u32>()).div_ceil(TILE * TILE)
    }

    /// Finds out what no body hides or has hidden, now or before, from the samples of `new`.
    pub fn look(&mut self, new: &BuzzBuffer, bodies: &Bodies, ways: &[LightWay]) {
        let words = new.lit_words();
        self.width = new.width();
        let across = self.width.div_ceil(TILE);
        let tiles = across * new.height().div_ceil(TILE);
        self.spans.resize(tiles, Span::default());
        // Without lights there are no words, but a chunk's length may not be zero.
        self.clear.resize(tiles * words.max(1), 0);
        let tiles = self.spans.par_iter_mut().zip(self.clear.par_chunks_mut(words.max(1)));
        tiles.enumerate().with_min_len(64).for_each(|(tile, (span, clear))| {
            *span = Span::default();
            let known = pixels(new.width(), new.height(), (tile % across, tile / across))
                .filter(|&i| new.object[i] != UNKNOWN && !new.surface[i].is_background());
            known.for_each(|i| span.include(new.position[i]));
            clear.fill(0);
            let Some((middle, half)) = span.middle_and_half() else { return };
            for light in ways {
                let shaft = Shaft::new(light.way, middle);
                if !bodies.entered.may_meet(&shaft, half) && !bodies.left.may_meet(&shaft, half) {
                    clear[light.word] |= light.mask;
                }
            }
        });
    }

    /// True if nothing that moved is or was between a light and a sample in pixel number `pixel`.
    pub fn are_clear(&self, pixel: usize, sample: &SurfaceSample, light: &LightWay) -> bool {
        let (x, y) = (pixel % self.width, pixel / self.width);
        let tile = y / TILE * self.width.div_ceil(TILE) + x / TILE;
        let words = self.clear.len() / self.spans.len();
        let is_clear = self.clear[tile * words + light.word] & light.mask == light.mask;
        // What was cast since may lie elsewhere.
        is_clear && self.spans[tile].has(sample.position)
    }
}

/// The pixels of the tile in column `x` and row `y` of tiles.
pub(super) fn pixels(
    width: usize,
    height: usize,
    (x, y): (usize, usize),
) -> impl Iterator<Item = usize> + Clone {
    let columns = x * TILE..((x + 1) * TILE).min(width);
    let rows = y * TILE..((y + 1) * TILE).min(height);
    rows.flat_map(move |y| columns.clone().map(move |x| y * width + x))
}
