//! How the lights differ from those of another frame, and on which ways light comes.

use super::Tracer;
use super::light::Emitter;
use super::sequence::MIDDLE;
use crate::frame::{LightChange, LightWay, SurfaceSample, Way};
use crate::scene::{LightKind, Pose, PosedLight};

/// The lights of another frame, and what that says about shadow bits found then.
pub struct LightChanges {
    /// In the order of the scene's lights.
    before: Vec<Emitter>,
    /// The same, and the world's if it gives ambient light.
    ways: Vec<LightWay>,
}

impl LightChanges {
    /// On which ways light comes now: one for each light, and one for the world if it gives ambient light.
    pub fn ways(&self) -> &[LightWay] {
        &self.ways
    }
}

impl LightChange {
    /// From `before` to `now`; with soft shadows if `is_soft`.
    fn between(before: &PosedLight, now: &PosedLight, is_soft: bool) -> Self {
        let same_intensity = PosedLight { intensity: now.intensity, ..before.clone() };
        let was_out = before.intensity.max_element() <= 0.0 && now.intensity.max_element() > 0.0;
        if same_intensity == *now && !was_out {
            return Self::None;
        }
        // What part of a light that has a size shines here depends on all that it has.
        let stays = match now.kind {
            LightKind::Point | LightKind::Spot { .. } => before.position == now.position,
            LightKind::Directional => before.direction == now.direction,
            LightKind::Area { .. } => false,
        };
        if stays && !is_soft { Self::Reach } else { Self::Place }
    }
}

impl Tracer<'_> {
    /// How the lights have changed from `before` to `now`, which is the pose of this tracer.
    pub fn light_changes(&self, before: &Pose, now: &Pose) -> LightChanges {
        let ways = self.lights.iter().zip(&self.layout.lights).zip(before.lights.iter().zip(&now.lights));
        let ways = ways.map(|((light, &field), (before, now))| {
            let (word, mask) = field.bits_at();
            let change = LightChange::between(before, now, field.is_share());
            LightWay { way: light.way(field.is_share()), word, mask, change }
        });
        let ambient = self.layout.ambient.map(|field| {
            let (word, mask) = field.bits_at();
            let way = Way::Around(1.0 / self.options.ambient_samples as f32);
            LightWay { way, word, mask, change: LightChange::None }
        });
        LightChanges {
            before: before.lights.iter().map(|light| Emitter::new(light, self.accel.origin())).collect(),
            ways: ways.chain(ambient).collect(),
        }
    }

    /// True if light number `light` shines where a sample is, which is not the background, and before `changes` did not.
    pub fn arrives_anew(&self, light: usize, sample: &SurfaceSample, changes: &LightChanges) -> bool {
        let arrives = |light: &Emitter| light.arriving(sample.position, MIDDLE).is_some();
        !arrives(&changes.before[light]) && arrives(&self.lights[light])
    }
}
