//! How the lights differ from those of another frame, and on which ways light comes to a point.

use super::Tracer;
use super::light::Emitter;
use super::sequence::MIDDLE;
use crate::frame::{LightWay, SurfaceSample, Way};
use crate::scene::{LightKind, Pose, PosedLight};

/// The lights of another frame, and what that says about shadow bits found then.
pub struct LightChanges {
    /// In the order of the scene's lights.
    lights: Vec<(Emitter, Change)>,
}

/// What has become of a light's shadow bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Change {
    /// They hold, whatever its colour and intensity are now.
    None,
    /// They hold where it shone: it has another range or cone, or was out.
    Reach,
    /// They say nothing: its light comes from elsewhere.
    Place,
}

impl Change {
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
        let pairs = before.lights.iter().zip(&now.lights).zip(&self.layout.lights);
        let lights = pairs.map(|((before, now), field)| {
            (Emitter::new(before, self.accel.origin()), Change::between(before, now, field.is_share()))
        });
        LightChanges { lights: lights.collect() }
    }

    /// Visits the ways on which light comes to a sample, which is not the background: those of lights whose bits are stale
    /// since `changes`, and all others but from behind the surface.
    pub fn light_ways(
        &self,
        sample: &SurfaceSample,
        changes: &LightChanges,
        visit: &mut dyn FnMut(LightWay),
    ) {
        let (point, normal) = (sample.position, sample.normal.get());
        let lights = self.lights.iter().zip(&self.layout.lights).zip(&changes.lights);
        for ((light, &field), (before, change)) in lights {
            let stale = match change {
                Change::None => false,
                Change::Reach => {
                    before.arriving(point, MIDDLE).is_none() && light.arriving(point, MIDDLE).is_some()
                }
                Change::Place => true,
            };
            let way = light.way(field.is_share());
            let behind = match way {
                Way::From(position, 0.0) => normal.dot(position - point) <= 0.0,
                Way::Along(direction, 0.0) => normal.dot(direction) <= 0.0,
                _ => false,
            };
            if stale || !behind {
                let (word, mask) = field.bits_at();
                visit(LightWay { way, word, mask, stale });
            }
        }
        if let Some(field) = self.layout.ambient {
            let (word, mask) = field.bits_at();
            let way = Way::Around(1.0 / self.options.ambient_samples as f32);
            visit(LightWay { way, word, mask, stale: false });
        }
    }
}
