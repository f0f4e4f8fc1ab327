//! Follows the edges of shadows from where they are known to where they are not.
//!
//! A shadow too thin to be sampled when it was far away may be several pixels wide by now, with all samples around it
//! agreeing that there is none. But it is known somewhere: where it is nearer, or was traced. So wherever two neighbours
//! on one surface disagree about a light, a ray is cast to it from both; where that changes a bit, the pixels around are
//! looked at again, until the edge has been followed to its end.

use super::around::is_one_surface;
use super::buzz_buffer::{BuzzBuffer, Projector};
use super::centre::CastCentres;
use crate::frame::RayCounts;
use rayon::prelude::*;

/// What following holds between frames, so that nothing is allocated for each.
#[derive(Debug, Default)]
pub(super) struct ShadowEdges {
    /// For each row: pixels at which neighbours disagree.
    rows: Vec<Vec<u32>>,
    /// Pixels to look at, in order; those to look at next.
    pixels: Vec<u32>,
    next: Vec<u32>,
    /// For each of `pixels`, in as many words as a pixel has shadow bits: the lights to ask, and the bits then.
    ask: Vec<u32>,
    lit: Vec<u32>,
}

impl ShadowEdges {
    /// Settles the shadow bits of `buffer`, which is complete. `asked` has the bits of the lights that each pixel has
    /// asked already; those that it asks here are added.
    pub fn follow(
        &mut self,
        buffer: &mut BuzzBuffer,
        view: &Projector,
        asked: &mut [u32],
        rays: &impl CastCentres,
    ) -> RayCounts {
        let mut counts = RayCounts::default();
        let (width, words) = (buffer.width(), buffer.lit_words());
        if words == 0 {
            return counts;
        }
        self.rows.resize_with(buffer.height(), Vec::new);
        self.rows.par_iter_mut().with_min_len(8).enumerate().for_each(|(y, row)| {
            row.clear();
            let pixels = y * width..(y + 1) * width;
            row.extend(pixels.filter(|&pixel| differs_around(buffer, pixel, y)).map(|pixel| pixel as u32));
        });
        self.pixels.clear();
        self.rows.iter().for_each(|row| self.pixels.extend(row));
        while !self.pixels.is_empty() && !rays.is_cancelled() {
            counts += self.ask(buffer, view, asked, rays);
            self.apply(buffer, asked);
        }
        counts
    }

    /// Asks the lights about which any neighbour disagrees.
    fn ask(
        &mut self,
        buffer: &BuzzBuffer,
        view: &Projector,
        asked: &[u32],
        rays: &impl CastCentres,
    ) -> RayCounts {
        let words = buffer.lit_words();
        self.ask.clear();
        self.ask.resize(self.pixels.len() * words, 0);
        self.lit.resize(self.pixels.len() * words, 0);
        let ask_one = |((&pixel, ask), lit): ((&u32, &mut [u32]), &mut [u32])| {
            let i = pixel as usize;
            lit.copy_from_slice(buffer.lit(i));
            let sample = buffer.sample(i);
            for k in around(buffer, pixel).filter(|&k| buffer.lit(i) != buffer.lit(k)) {
                if is_one_surface(&sample, &buffer.sample(k), view) {
                    rays.differ(lit, buffer.lit(k), ask);
                }
            }
            ask.iter_mut().zip(&asked[i * words..]).for_each(|(ask, asked)| *ask &= !asked);
            let mut counts = RayCounts::default();
            rays.recast(&sample, ask, lit, &mut counts);
            counts
        };
        let all =
            self.pixels.par_iter().zip(self.ask.par_chunks_mut(words)).zip(self.lit.par_chunks_mut(words));
        all.with_min_len(64).map(ask_one).reduce(RayCounts::default, |mut a, b| {
            a += b;
            a
        })
    }

    /// Takes over the answers; where they change a bit, the pixels around are looked at next.
    fn apply(&mut self, buffer: &mut BuzzBuffer, asked: &mut [u32]) {
        let words = buffer.lit_words();
        self.next.clear();
        let answers = self.ask.chunks(words).zip(self.lit.chunks(words));
        for (&pixel, (ask, lit)) in self.pixels.iter().zip(answers) {
            let i = pixel as usize;
            asked[i * words..].iter_mut().zip(ask).for_each(|(asked, ask)| *asked |= ask);
            if buffer.lit(i) != lit {
                buffer.lit[i * words..][..words].copy_from_slice(lit);
                self.next.push(pixel);
                self.next.extend(around(buffer, pixel).map(|k| k as u32));
            }
        }
        self.next.sort_unstable();
        self.next.dedup();
        std::mem::swap(&mut self.pixels, &mut self.next);
    }
}

/// True where the shadow bits of pixel `i`, in row `y`, may differ from those of a pixel around it.
fn differs_around(buffer: &BuzzBuffer, i: usize, y: usize) -> bool {
    let (width, words) = (buffer.width(), buffer.lit_words());
    if y == 0 || y + 1 == buffer.height() || words > 1 || i == y * width || i + 1 == (y + 1) * width {
        return true;
    }
    let row = |i: usize| {
        let lit = &buffer.lit[i - 1..=i + 1];
        [lit[0], lit[1], lit[2]]
    };
    let own = buffer.lit[i];
    let differ =
        [row(i - width), row(i), row(i + width)].as_flattened().iter().fold(0, |d, bits| d | (bits ^ own));
    differ != 0
}

/// The pixels around one, inside the image.
fn around(buffer: &BuzzBuffer, pixel: u32) -> impl Iterator<Item = usize> + use<> {
    let (width, height) = (buffer.width(), buffer.height());
    let (x, y) = (pixel as usize % width, pixel as usize / width);
    let columns = x.saturating_sub(1)..=(x + 1).min(width - 1);
    let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
    rows.flat_map(move |y| columns.clone().map(move |x| y * width + x)).filter(move |&k| k != pixel as usize)
}
