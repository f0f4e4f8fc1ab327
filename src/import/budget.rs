//! How much memory a file may take: what its size justifies.
//!
//! A few bytes of JSON can claim arrays of 2^32 elements, or use one array ten thousand times over. What is taken
//! is therefore counted and bounded by a multiple of what was read.

use crate::{Error, Result};
use std::cell::Cell;

/// Counts what pictures take at least once they are decoded, which their size says nothing of: flat colour packs a thousand times.
pub(super) struct Pictures {
    most: u64,
    taken: Cell<u64>,
}

impl Pictures {
    /// Pictures that may take `most` bytes; where nothing is said, any number.
    pub fn new(most: Option<u64>) -> Self {
        Self { most: most.unwrap_or(u64::MAX), taken: Cell::default() }
    }

    /// Takes a picture of so many pixels, so many bytes each, and its smaller levels.
    pub fn take(&self, pixels: usize, bytes_per_texel: usize) -> Result<()> {
        let bytes = (pixels as u64).saturating_mul(bytes_per_texel as u64);
        self.taken.set(self.taken.get().saturating_add(bytes).saturating_add(bytes / 3));
        if self.taken.get() <= self.most {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "the scene's pictures take at least {} MiB, over the {} MiB that there are or that --memory allows; make them smaller",
            self.taken.get().div_ceil(1 << 20),
            self.most >> 20
        )))
    }
}

/// Bytes that any file may take: the smallest scenes are not worth refusing.
const FLOOR: usize = 64 << 20;
/// Bytes of geometry and animation that each byte read may become. An 8-bit triangle strip index becomes 12 bytes;
/// `EXT_meshopt_compression` packs regular data a hundred times.
const PER_BYTE: usize = 256;

/// Counts what one file takes.
pub(super) struct Budget {
    left: Cell<usize>,
    taken: Cell<usize>,
}

impl Budget {
    /// A budget for a file and its buffers of `bytes` in all.
    pub fn new(bytes: usize) -> Self {
        Self { left: Cell::new(FLOOR.saturating_add(bytes.saturating_mul(PER_BYTE))), taken: Cell::default() }
    }

    /// Takes `count` things of `size` bytes, or makes an error of `refuse`.
    pub fn take(&self, count: usize, size: usize, refuse: impl FnOnce(String) -> Error) -> Result<()> {
        let wanted = count.saturating_mul(size);
        match self.left.get().checked_sub(wanted) {
            Some(left) => {
                self.left.set(left);
                self.taken.set(self.taken.get() + wanted);
                Ok(())
            }
            None => Err(refuse(format!(
                "needs {wanted} bytes beside {} that were taken before, more than a file of this size can justify; check its counts, or export it again",
                self.taken.get()
            ))),
        }
    }
}
