//! The right eye of a stereo pair, from the left one of the same frame.

use super::SegmentRenderer;
use super::shot::Shot;
use crate::Result;
use crate::accel::Accel;
use crate::frame::{Quality, StereoEye};
use crate::infer::{BuzzBuffer, Inference, Move};
use crate::trace::Tracer;

impl SegmentRenderer<'_> {
    /// In stereo, makes and finishes the right eye of a frame that is wanted. Nothing else hangs on it: the next frame's
    /// comes from its own left eye, so an error is not carried on.
    pub(super) fn emit_right(
        &mut self,
        (accel, tracer): (&Accel, &Tracer<'_>),
        (left, left_shot): (&BuzzBuffer, &Shot),
        right: &mut BuzzBuffer,
        inference: &mut Inference,
    ) -> Result<()> {
        if self.settings.stereo.is_none() || !self.wanted.contains(&left_shot.frame) {
            return Ok(());
        }
        let shot = Shot::of_eye(Some(StereoEye::Right), self.scene, self.settings, left_shot.frame);
        let stats = if self.settings.quality == Quality::Full {
            self.trace(tracer, &shot, right, inference)
        } else {
            // Between the eyes of a frame nothing moves.
            let caster = self.caster(tracer, &shot, None);
            self.infer(Move::OtherEye, (left, left_shot), (&mut *right, &shot), &caster, inference)
        };
        self.emit((accel, tracer), &shot, right, stats)
    }
}
