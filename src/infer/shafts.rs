//! Which lights nothing that moved can hide, told for many pixels at once: shaft culling (Haines and Wallace 1991, "Shaft Culling
//! for Efficient Ray-Traced Radiosity").

use super::bodies::{Bodies, Shaft};
use super::buzz_buffer::{BuzzBuffer, UNKNOWN};
use crate::frame::{LightChange, LightWay, SurfaceSample};
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
    /// The bits of all lights; none where the lights themselves have changed.
    all: Option<Vec<u32>>,
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
        self.all = ways.iter().all(|light| light.change == LightChange::None).then(|| {
            let mut all = vec![0; words];
            ways.iter().for_each(|light| all[light.word] |= light.mask);
            all
        });
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
        let (span, clear) = self.tile(pixel);
        clear[light.word] & light.mask == light.mask && span.has(sample.position)
    }

    /// True if that goes for all lights, of which none has changed.
    pub fn are_all_clear(&self, pixel: usize, sample: &SurfaceSample) -> bool {
        let (span, clear) = self.tile(pixel);
        self.all.as_ref().is_some_and(|all| clear.iter().eq(all)) && span.has(sample.position)
    }

    /// Where the samples of a pixel's tile were. What was cast since may lie elsewhere.
    fn tile(&self, pixel: usize) -> (&Span, &[u32]) {
        let (x, y) = (pixel % self.width, pixel / self.width);
        let tile = y / TILE * self.width.div_ceil(TILE) + x / TILE;
        let words = self.clear.len() / self.spans.len();
        (&self.spans[tile], &self.clear[tile * words..][..words])
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{SurfaceRef, Way};
    use crate::infer::{Body, Voxels};

    /// Ten by ten pixels that show a wall a metre wide, and a small body before its left half.
    fn wall_and_body() -> (BuzzBuffer, Bodies) {
        let mut wall = BuzzBuffer::new(10, 10, 1);
        for i in 0..100 {
            wall.position[i] = Vec3::new(i as f32 % 10.0 / 10.0, i as f32 / 100.0, 0.0);
            wall.surface[i] = SurfaceRef { instance: 1, ..SurfaceRef::BACKGROUND };
            wall.object[i] = 1;
        }
        let triangle = [(0.2, 0.2), (0.3, 0.2), (0.2, 0.3)].map(|(x, y)| Vec3::new(x, y, 0.5));
        let entered = Voxels::new(std::iter::once(triangle), |_| 0.01);
        (wall, Bodies::new(vec![Body { entered, left: Voxels::default() }]))
    }

    #[test]
    fn a_tile_is_clear_unless_a_body_may_stand_before_any_of_it() {
        let (wall, bodies) = wall_and_body();
        let light = |change| LightWay { way: Way::Along(Vec3::Z, 0.0), word: 0, mask: 1, change };
        let mut shafts = Shafts::default();
        let none = light(LightChange::None);
        shafts.look(&wall, &bodies, &[none]);
        // Tiles of eight by eight: the body stands before the first.
        let clear: Vec<_> = (0..100).map(|i| shafts.are_clear(i, &wall.sample(i), &none)).collect();
        let expected: Vec<_> = (0..100).map(|i| i % 10 >= 8 || i / 10 >= 8).collect();
        assert_eq!(clear, expected);
        assert!((0..100).all(|i| shafts.are_all_clear(i, &wall.sample(i)) == clear[i]));
        // Of a sample that is not where those of its pixel's tile were, nothing is known.
        let elsewhere = SurfaceSample { position: Vec3::new(0.25, 0.25, 0.0), ..wall.sample(99) };
        assert!(!shafts.are_clear(99, &elsewhere, &none));
        // A light that changes is never quiet, though nothing stands before it.
        let changing = light(LightChange::Reach);
        shafts.look(&wall, &bodies, &[changing]);
        assert!(shafts.are_clear(99, &wall.sample(99), &changing));
        assert!(!shafts.are_all_clear(99, &wall.sample(99)));
    }
}
