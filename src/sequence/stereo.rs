//! The right eye of a stereo pair, from the left one of the same frame.

use super::{Emitter, Shot, shot_of};
use crate::Result;
use crate::frame::{FrameKind, Quality, StereoEye};
use crate::infer::{BuzzBuffer, Inference, Move};

impl Emitter<'_> {
    /// In stereo, makes and finishes the right eye of a frame that is wanted. Nothing else hangs on it: the next frame's
    /// comes from its own left eye, so an error is not carried on.
    pub(super) fn emit_right(
        &mut self,
        number: i64,
        (left, left_shot): (&BuzzBuffer, &Shot),
        right: &mut BuzzBuffer,
        inference: &mut Inference,
    ) -> Result<()> {
        if self.settings.stereo.is_none() || !self.wanted.contains(&number) {
            return Ok(());
        }
        let shot = shot_of(Some(StereoEye::Right), self.scene, self.settings, number);
        let (kind, stats) = if self.settings.quality == Quality::Full {
            (FrameKind::Traced, self.trace(number, &shot, right))
        } else {
            let (old, new) = ((left, left_shot), (&mut *right, &shot));
            let stats = self.infer(number, Move::OtherEye, old, new, inference);
            (FrameKind::Inferred { from: number }, stats)
        };
        self.emit(number, kind, &shot, right, stats)
    }
}
