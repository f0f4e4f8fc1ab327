//! The Buzzbuffer's finer levels: a sample for each sub-pixel that is wanted, and nothing for the others.

use super::lattice::{Cells, Lattice, Position};
use crate::frame::SurfaceSample;
use glam::Vec3;

/// The samples between the centres of pixels; none with one level of super-sampling.
#[derive(Debug, Clone, Default)]
pub struct SubPixels {
    pub(super) lattice: Lattice,
    /// From level 2 on.
    pub levels: Vec<Level>,
}

/// The samples of one level.
#[derive(Debug, Clone, Default)]
pub struct Level {
    /// Which positions have one.
    pub cells: Cells,
    /// A sample for each of them.
    pub samples: Vec<SurfaceSample>,
    /// Their shadow bits, in as many words as a sample has.
    pub lit: Vec<u32>,
    /// Whether no camera ray was cast for the sample.
    pub reused: Vec<bool>,
    words: usize,
}

impl SubPixels {
    /// For an image of so many pixels, with so many levels of super-sampling, where a sample has so many words of shadow bits.
    pub fn new(width: usize, height: usize, levels: u32, words: usize) -> Self {
        let lattice = Lattice::new(width, height, levels);
        let level = |depth| Level { cells: Cells::new(lattice, depth), words, ..Level::default() };
        Self { lattice, levels: (0..levels.saturating_sub(1)).map(level).collect() }
    }

    /// The most that they take for each pixel.
    pub fn bytes_per_pixel(levels: u32, words: usize) -> usize {
        let sample = size_of::<SurfaceSample>() + words * size_of::<u32>() + size_of::<bool>();
        let level = |depth: u32| {
            Cells::bytes_per_pixel(depth) + Self::per_pixel(depth) * (size_of::<Position>() + sample)
        };
        (0..levels.saturating_sub(1)).map(level).sum()
    }

    /// Positions of level 2 (`depth` 0) or one after it to a pixel, at most.
    fn per_pixel(depth: u32) -> usize {
        3 << (2 * depth)
    }

    /// Positions of all levels to a pixel, at most, beside its centre.
    pub fn most_per_pixel(levels: u32) -> usize {
        (0..levels.saturating_sub(1)).map(Self::per_pixel).sum()
    }

    /// Where they may lie.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.levels.iter().map(|level| level.samples.len()).sum()
    }

    /// True where there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Level {
    /// Makes room for a sample at each position.
    pub fn fit(&mut self) {
        let count = self.cells.positions().len();
        self.samples.resize(count, SurfaceSample::background(Vec3::ZERO));
        self.reused.resize(count, false);
        // Without lights there are no words, but a chunk's length may not be zero.
        self.lit.resize(count * self.stride(), 0);
    }

    /// The shadow bits of a sample.
    pub fn lit(&self, number: usize) -> &[u32] {
        &self.lit[number * self.stride()..][..self.words]
    }

    /// Words of shadow bits that a sample has.
    pub fn words(&self) -> usize {
        self.words
    }

    /// Words from one sample's shadow bits to the next.
    pub fn stride(&self) -> usize {
        self.words.max(1)
    }
}
