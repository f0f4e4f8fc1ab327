//! What there is to ask about light: at each pixel some lights, and of some it is in doubt what was carried there.

use super::buzz_buffer::{BuzzBuffer, words_by_rows};
use rayon::prelude::*;

/// For all pixels of an image, in as many words as a pixel has shadow bits.
#[derive(Debug, Default)]
pub(super) struct LightQuestions {
    size: (usize, usize),
    words: usize,
    /// Bits of the lights that have to be asked. They stay once these have been; where that settles all, all are set.
    pub ask: Vec<u32>,
    /// Bits of the lights of which it is in doubt whether what was carried to the pixel is right around it.
    pub doubt: Vec<u32>,
}

/// The same for the pixels of a row, or of several, or for one.
pub(super) struct Questions<'a> {
    pub ask: &'a mut [u32],
    pub doubt: &'a mut [u32],
    words: usize,
}

impl LightQuestions {
    /// What it holds for each pixel with so many words of shadow bits.
    pub fn bytes_per_pixel(words: usize) -> usize {
        2 * words * size_of::<u32>()
    }

    /// Makes room for the pixels of an image that is inferred from `old`.
    pub fn fit(&mut self, old: &BuzzBuffer) {
        (self.size, self.words) = ((old.width(), old.height()), old.lit_words());
    }

    /// So many rows at a time, for writing in parallel; the last may have fewer.
    pub fn bands_mut(&mut self, rows: usize) -> impl IndexedParallelIterator<Item = Questions<'_>> {
        let (words, (width, height)) = (self.words, self.size);
        let [ask, doubt] =
            [&mut self.ask, &mut self.doubt].map(|bits| words_by_rows(bits, width * words, height, rows));
        ask.zip(doubt).map(move |(ask, doubt)| Questions { ask, doubt, words })
    }
}

impl<'a> Questions<'a> {
    /// Those of column `x`.
    #[inline]
    pub fn at(&mut self, x: usize) -> Questions<'_> {
        let words = self.words;
        let columns = x * words..(x + 1) * words;
        Questions { ask: &mut self.ask[columns.clone()], doubt: &mut self.doubt[columns], words }
    }

    /// What is before column `x`, and what is from there on.
    pub fn split_at(self, x: usize) -> [Questions<'a>; 2] {
        let Self { ask, doubt, words } = self;
        let at = (x * words).min(ask.len());
        let (ask, doubt) = (ask.split_at_mut(at), doubt.split_at_mut(at));
        [(ask.0, doubt.0), (ask.1, doubt.1)].map(|(ask, doubt)| Questions { ask, doubt, words })
    }
}
