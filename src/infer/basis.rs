//! What inferring a frame from another goes by, once all samples have landed.

use super::around::Trust;
use super::buzz_buffer::BuzzBuffer;
use super::projector::Projector;
use super::sources::Sources;

/// What inferring a frame from another goes by.
pub(super) struct Basis<'a, R> {
    pub old: &'a BuzzBuffer,
    /// What of it has landed where.
    pub sources: &'a Sources,
    pub view: &'a Projector,
    pub rays: &'a R,
    pub trust: Trust,
}

impl<R> Clone for Basis<'_, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<R> Copy for Basis<'_, R> {}
