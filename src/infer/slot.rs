//! Sub-pixels that are being made, and where their samples may come from.

use super::buzz_buffer::BuzzBuffer;
use super::lattice::Position;
use crate::frame::SurfaceSample;

/// A sub-pixel that is being made.
pub(super) struct Slot<'a> {
    pub at: Position,
    pub sample: &'a mut SurfaceSample,
    pub lit: &'a mut [u32],
    /// Bits of the lights that have to be asked.
    pub ask: &'a mut [u32],
}

/// Where samples may come from instead of from rays.
pub(super) trait Source: Sync {
    /// True if a sample of a sub-pixel landed there.
    fn is_landed(&self, at: Position) -> bool;

    /// Finds the sample without a ray, if it can, and which lights must be asked, in a frame of which the `pixels` are there.
    fn settle(&self, slot: &mut Slot<'_>, pixels: &BuzzBuffer) -> bool;

    /// Lends the sample, which was cast, shadow bits; what it cannot lend must be asked.
    fn lend(&self, slot: &mut Slot<'_>);
}

/// A key frame has no other to take samples from.
pub(super) struct Nothing;

impl Source for Nothing {
    fn is_landed(&self, _: Position) -> bool {
        false
    }

    fn settle(&self, _: &mut Slot<'_>, _: &BuzzBuffer) -> bool {
        false
    }

    fn lend(&self, slot: &mut Slot<'_>) {
        slot.ask.fill(u32::MAX);
    }
}
