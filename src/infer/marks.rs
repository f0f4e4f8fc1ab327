//! What has been found out about pixels while samples land.

use crate::frame::PixelClass;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

/// What has been found out about each pixel. The strongest finding stays, whatever the order of finding.
#[derive(Debug, Default)]
pub struct Marks(Vec<AtomicU8>);

impl Marks {
    /// What it holds for each pixel.
    pub(super) const BYTES_PER_PIXEL: usize = size_of::<AtomicU8>();

    /// Nothing is known about any of `pixels` pixels.
    pub fn clear(&mut self, pixels: usize) {
        self.0.resize_with(pixels, AtomicU8::default);
        self.0.par_iter_mut().with_min_len(1 << 14).for_each(|m| *m.get_mut() = 0);
    }

    /// Notes that a pixel is of `class`, one of those below; a later one in this order wins.
    pub fn set(&self, pixel: usize, class: PixelClass) {
        let rank = Self::RANKS.iter().position(|&c| c == class).unwrap_or(0) as u8 + 1;
        // Reading is much cheaper, and nearly all that is found is known.
        if self.0[pixel].load(Relaxed) < rank {
            self.0[pixel].fetch_max(rank, Relaxed);
        }
    }

    /// The strongest finding about a pixel.
    pub fn get(&self, pixel: usize) -> Option<PixelClass> {
        let rank = self.0[pixel].load(Relaxed).checked_sub(1)?;
        Some(Self::RANKS[rank as usize])
    }

    const RANKS: [PixelClass; 5] = [
        PixelClass::Overlapped,
        PixelClass::Bad,
        PixelClass::Moved,
        PixelClass::Entering,
        PixelClass::Creeping,
    ];
}
