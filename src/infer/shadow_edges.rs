//! Follows the edges of shadows from where they are known to where they are not.
//!
//! A shadow too thin to be sampled when it was far away may be several pixels wide by now, with all samples around it
//! agreeing that there is none. But it is known somewhere: where it is nearer, or was traced. So wherever two neighbours
//! on one surface disagree about a light, and it is in doubt whether the bit of either was carried rightly, a ray is cast
//! to it from both; where that changes a bit, the pixels around are looked at again, until the edge has been followed to
//! its end.

use super::around::is_one_surface;
use super::buzz_buffer::{BuzzBuffer, pixels_around};
use super::frontier::Frontier;
use super::projector::Projector;
use super::questions::LightQuestions;
use super::rays::CastCentres;
use crate::frame::RayCounts;
use rayon::prelude::*;
use std::ops::Range;

/// What following holds between frames beside its frontier, so that nothing is allocated for each.
#[derive(Debug, Default)]
pub(super) struct ShadowEdges {
    /// For each pixel of the frontier, in as many words as a pixel has shadow bits: the lights to ask, and the bits then.
    ask: Vec<u32>,
    lit: Vec<u32>,
}

impl ShadowEdges {
    /// The most that it holds for each pixel with so many words of shadow bits.
    pub fn bytes_per_pixel(words: usize) -> usize {
        2 * words * size_of::<u32>()
    }

    /// Settles the shadow bits of `buffer`, which is complete. `questions` name the lights that each pixel has asked already; those
    /// that it asks here are added. Where a bit changes here, all that was carried to the pixel is in doubt.
    pub fn follow(
        &mut self,
        frontier: &mut Frontier,
        buffer: &mut BuzzBuffer,
        view: &Projector,
        questions: &mut LightQuestions,
        rays: &impl CastCentres,
    ) -> RayCounts {
        let mut counts = RayCounts::default();
        let words = buffer.lit_words();
        if words == 0 {
            return counts;
        }
        for bits in [&mut self.ask, &mut self.lit] {
            bits.clear();
            bits.reserve(buffer.object.len() * words);
        }
        let wonders = |pixel: usize| {
            let asked = &questions.ask[pixel * words..][..words];
            let asks = || {
                let mut around = pixels_around(buffer.width(), buffer.height(), pixel);
                around.any(|other| may_ask(buffer, questions, (pixel, other)))
            };
            asked.iter().any(|&bits| bits != u32::MAX) && differs_around(buffer, pixel, rays) && asks()
        };
        frontier.begin(buffer, |stretch| is_even(buffer, &stretch), wonders);
        while !frontier.pixels().is_empty() && !rays.is_cancelled() {
            counts += self.ask(frontier.pixels(), buffer, view, questions, rays);
            self.apply(frontier, buffer, questions);
        }
        counts
    }

    /// Asks the lights about which any neighbour disagrees.
    fn ask(
        &mut self,
        pixels: &[u32],
        buffer: &BuzzBuffer,
        view: &Projector,
        questions: &LightQuestions,
        rays: &impl CastCentres,
    ) -> RayCounts {
        let words = buffer.lit_words();
        self.ask.clear();
        self.ask.resize(pixels.len() * words, 0);
        self.lit.resize(pixels.len() * words, 0);
        let ask_one = |(&pixel, (ask, lit)): (&u32, (&mut [u32], &mut [u32]))| {
            let i = pixel as usize;
            lit.copy_from_slice(buffer.lit(i));
            let sample = buffer.sample(i);
            for other in pixels_around(buffer.width(), buffer.height(), i) {
                if may_ask(buffer, questions, (i, other))
                    && rays.has_edge(lit, buffer.lit(other))
                    && is_one_surface(&sample, &buffer.sample(other), view)
                {
                    rays.differ(lit, buffer.lit(other), ask);
                }
            }
            rays.keep_edges(ask);
            ask.iter_mut().zip(&questions.ask[i * words..]).for_each(|(ask, asked)| *ask &= !asked);
            let mut counts = RayCounts::default();
            rays.recast(&sample, ask, lit, &mut counts);
            counts
        };
        let answers = self.ask.par_chunks_mut(words).zip(self.lit.par_chunks_mut(words));
        pixels.par_iter().zip(answers).with_min_len(64).map(ask_one).sum()
    }

    /// Takes over the answers; where they change a bit, the pixels around are looked at next.
    fn apply(&self, frontier: &mut Frontier, buffer: &mut BuzzBuffer, questions: &mut LightQuestions) {
        let (words, size) = (buffer.lit_words(), (buffer.width(), buffer.height()));
        let mut answers = self.ask.chunks(words).zip(self.lit.chunks(words));
        let changes = |pixel: usize| {
            answers.next().is_some_and(|(ask, lit)| {
                let bits = pixel * words..(pixel + 1) * words;
                questions.ask[bits.clone()].iter_mut().zip(ask).for_each(|(asked, ask)| *asked |= ask);
                let changes = buffer.lit(pixel) != lit;
                if changes {
                    questions.doubt[bits.clone()].fill(u32::MAX);
                    buffer.lit[bits].copy_from_slice(lit);
                }
                changes
            })
        };
        frontier.go_on(size, changes, |_| true);
    }
}

/// True if the pixels of a stretch within a row are inside the image and have the same shadow bits as all around them.
fn is_even(buffer: &BuzzBuffer, stretch: &Range<usize>) -> bool {
    let (width, height, words) = (buffer.width(), buffer.height(), buffer.lit_words());
    let (x, y) = (stretch.start % width, stretch.start / width);
    let is_inside = x > 0 && x + stretch.len() < width && y > 0 && y + 1 < height;
    is_inside && {
        let row = |first: usize| &buffer.lit[(first - 1) * words..(first + stretch.len() + 1) * words];
        let own = row(stretch.start);
        own[words..] == own[..own.len() - words]
            && own == row(stretch.start - width)
            && own == row(stretch.start + width)
    }
}

/// True if `pixel` and `other` differ in a bit about which what is around either may be wrong, and `pixel` has not asked
/// about all in which they do.
fn may_ask(buffer: &BuzzBuffer, questions: &LightQuestions, (pixel, other): (usize, usize)) -> bool {
    let words = buffer.lit_words();
    let (mut in_doubt, mut unasked) = (0, 0);
    for (own, other) in (pixel * words..(pixel + 1) * words).zip(other * words..) {
        let differ = buffer.lit[own] ^ buffer.lit[other];
        in_doubt |= differ & (questions.doubt[own] | questions.doubt[other]);
        unasked |= differ & !questions.ask[own];
    }
    in_doubt != 0 && unasked != 0
}

/// True where an edge of a shadow may lie between a pixel and one around it.
fn differs_around(buffer: &BuzzBuffer, pixel: usize, rays: &impl CastCentres) -> bool {
    let (width, height, words) = (buffer.width(), buffer.height(), buffer.lit_words());
    let (x, y, own) = (pixel % width, pixel / width, buffer.lit(pixel));
    if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
        return pixels_around(width, height, pixel).any(|other| rays.has_edge(own, buffer.lit(other)));
    }
    // Nearly every pixel ends here, so three to a row.
    let differs = |middle: usize| {
        let three = &buffer.lit[(middle - 1) * words..(middle + 2) * words];
        three.chunks_exact(words).any(|bits| !bits.iter().eq(own) && rays.has_edge(own, bits))
    };
    [pixel - width, pixel, pixel + width].into_iter().any(differs)
}
