//! From a segment's key frame outward: each frame inferred from its neighbour.

use super::motion::SceneMotion;
use super::shot::Shot;
use super::{InferenceBuffers, SegmentRenderer};
use crate::Result;
use crate::accel::Accel;
use crate::infer::Move;
use crate::scene::{Pose, Requirements};
use crate::trace::Tracer;

/// The scene through the frames of a segment.
pub(super) enum Stage<'a> {
    /// Only the camera moves: all frames are traced alike.
    Still { accel: &'a Accel, tracer: &'a Tracer<'a> },
    /// Placed anew for each frame; `placed` is how it stands.
    Moving { accel: &'a mut Accel, placed: Pose },
}

impl SegmentRenderer<'_> {
    /// Infers and finishes the frames before the key frame and those after it, as far as a wanted one lies.
    pub(super) fn infer_outward(
        &mut self,
        mut stage: Stage<'_>,
        key_shot: Shot,
        carried: &mut InferenceBuffers,
    ) -> Result<()> {
        let (scene, settings, key_frame) = (self.scene, self.settings, self.segment.key);
        let InferenceBuffers { key, old, new, right, inference } = carried;
        let needs = Requirements::of(scene);
        let before = self.wanted.first().copied().unwrap_or(key_frame)..key_frame;
        let after = key_frame + 1..=self.wanted.last().copied().unwrap_or(key_frame);
        let (mut from, mut to) = (key_shot.clone(), key_shot);
        for frames in [before.rev().collect::<Vec<_>>(), after.collect()] {
            from.move_to(scene, settings, key_frame);
            for (i, &number) in frames.iter().enumerate() {
                to.move_to(scene, settings, number);
                let source = if i == 0 { &*key } else { &*old };
                let fresh;
                let (accel, tracer, moving) = match &mut stage {
                    Stage::Still { accel, tracer } => (*accel, *tracer, false),
                    Stage::Moving { accel, placed } => {
                        if needs.moving_objects && !scene.surfaces_alike(placed, &to.pose) {
                            accel.place(scene, &to.pose, self.origin);
                            placed.clone_from(&to.pose);
                        }
                        fresh = Tracer::new(scene, accel, &to.pose, settings.trace_options());
                        (&**accel, &fresh, true)
                    }
                };
                let poses = (&from.pose, &to.pose);
                let between = || SceneMotion::between(scene, accel, tracer, poses, &to.view);
                let motion = moving.then(between).flatten();
                let caster = self.caster(tracer, &to, motion.as_ref());
                let stats = self.infer(Move::Camera, (source, &from), (new, &to), &caster, inference);
                self.emit((accel, tracer), &to, new, stats)?;
                self.emit_right((accel, tracer), (new, &to), right, inference)?;
                std::mem::swap(old, new);
                std::mem::swap(&mut from, &mut to);
            }
        }
        Ok(())
    }
}
