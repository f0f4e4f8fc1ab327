//! Tiles of samples that are proven visible at one look.
//!
//! To prove a sample visible takes a ray. But most of an image is surfaces that reach over many pixels, and if nothing stands in the
//! space before such a tile, none of its samples is hidden. So tiles are looked at, those that do not pass in quarters, and what is left
//! in the smallest takes rays.

use super::buzz_buffer::{BuzzBuffer, UNKNOWN};
use rayon::prelude::*;
use std::ops::Range;

/// Sides of the largest tiles and of the smallest, in pixels.
const LARGEST: usize = 32;
const SMALLEST: usize = 4;

/// The smallest tiles across and down the largest.
const ACROSS: usize = LARGEST / SMALLEST;

/// Columns and rows of an image.
type Pixels = (Range<usize>, Range<usize>);

/// Which pixels are proven visible.
#[derive(Debug, Default)]
pub(super) struct Tiles {
    /// Columns of the image.
    width: usize,
    /// For each largest tile, each of the smallest in it.
    proven: Vec<[bool; ACROSS * ACROSS]>,
}

impl Tiles {
    /// The most that it holds for each pixel.
    pub const BYTES_PER_PIXEL: usize = size_of::<bool>().div_ceil(SMALLEST * SMALLEST);

    /// Nothing is proven.
    pub fn clear(&mut self) {
        self.proven.clear();
    }

    /// Looks at all samples of `buffer` that are known; `sees_all` says if those of some columns and rows are visible.
    pub fn look(&mut self, buffer: &BuzzBuffer, sees_all: impl Fn(Pixels) -> bool + Sync) {
        self.width = buffer.width();
        let across = self.width.div_ceil(LARGEST);
        let tiles = across * buffer.height().div_ceil(LARGEST);
        self.proven.clear();
        self.proven.resize(tiles, [false; ACROSS * ACROSS]);
        self.proven.par_iter_mut().enumerate().for_each(|(number, proven)| {
            let first = (number % across * LARGEST, number / across * LARGEST);
            look_at(buffer, &sees_all, (first, LARGEST), &mut |(x, y)| {
                proven[(y - first.1) / SMALLEST * ACROSS + (x - first.0) / SMALLEST] = true;
            });
        });
    }

    /// True if pixel (x, y) is proven visible, unless something else has been put there since.
    pub fn has(&self, (x, y): (usize, usize)) -> bool {
        let across = self.width.div_ceil(LARGEST);
        let tile = self.proven.get(y / LARGEST * across + x / LARGEST);
        tile.is_some_and(|proven| proven[y % LARGEST / SMALLEST * ACROSS + x % LARGEST / SMALLEST])
    }
}

/// Calls `proves` with the first pixel of each smallest tile within a tile that is found to be visible.
fn look_at(
    buffer: &BuzzBuffer,
    sees_all: &impl Fn(Pixels) -> bool,
    ((x, y), side): ((usize, usize), usize),
    proves: &mut impl FnMut((usize, usize)),
) {
    let (width, height) = (buffer.width(), buffer.height());
    let (columns, rows): Pixels = (x..(x + side).min(width), y..(y + side).min(height));
    if columns.is_empty() || rows.is_empty() {
        return;
    }
    let is_known = |y: usize| columns.clone().all(|x| buffer.object[y * width + x] != UNKNOWN);
    if rows.clone().all(is_known) && sees_all((columns.clone(), rows.clone())) {
        for y in rows.step_by(SMALLEST) {
            columns.clone().step_by(SMALLEST).for_each(|x| proves((x, y)));
        }
    } else if side > SMALLEST {
        let half = side / 2;
        for quarter in [(x, y), (x + half, y), (x, y + half), (x + half, y + half)] {
            look_at(buffer, sees_all, (quarter, half), proves);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_seen_or_is_unknown_keeps_its_smallest_tile_only() {
        let (width, height) = (75, 41);
        let mut buffer = BuzzBuffer::new(width, height, 0);
        buffer.object.fill(1);
        let (hidden, unknown) = ((37, 9), (74, 40));
        buffer.object[unknown.1 * width + unknown.0] = UNKNOWN;
        let mut tiles = Tiles::default();
        tiles.look(&buffer, |(columns, rows)| {
            assert!(columns.end <= width && rows.end <= height);
            !(columns.contains(&hidden.0) && rows.contains(&hidden.1))
        });
        let tile = |(x, y): (usize, usize)| (x / SMALLEST, y / SMALLEST);
        for pixel in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let is_proven = tile(pixel) != tile(hidden) && tile(pixel) != tile(unknown);
            assert_eq!(tiles.has(pixel), is_proven, "{pixel:?}");
        }
        tiles.clear();
        assert!(!tiles.has((0, 0)));
    }
}
