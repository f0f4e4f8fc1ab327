//! What solids absorb of the light that passes through them (`KHR_materials_volume`), one solid at a time.

use super::point::{Side, SurfacePoint};
use super::{Eye, Tracer};
use crate::accel::{Ray, Sides};
use crate::scene::Volume;
use glam::Vec3;

/// A direction along which faces seldom lie.
const OUTWARDS: Vec3 = Vec3::new(0.369, 0.906, 0.207);

/// So many surfaces are looked at on the way out of a scene.
const MOST_SURFACES: usize = 256;

/// Absorption of a solid, 1/m: what is left after the attenuation distance is the attenuation colour. A colour of 0
/// lets a hundred-thousandth through.
pub(super) fn absorption(volume: &Volume) -> Vec3 {
    let distance = volume.attenuation_distance;
    if !(distance > 0.0 && distance.is_finite()) {
        return Vec3::ZERO;
    }
    volume.attenuation_color.clamp(Vec3::splat(1e-5), Vec3::ONE).map(|c| -c.ln() / distance)
}

impl Tracer<'_> {
    /// Absorption of the solid that a place is inside, 1/m: the first whose inner side is met on the way out, but for those that
    /// are entered before.
    pub(super) fn absorption_at(&self, place: Vec3) -> Vec3 {
        let absorbs = |volume: &Volume| absorption(volume) != Vec3::ZERO;
        if !self.scene.materials.iter().filter_map(|m| m.volume.as_ref()).any(absorbs) {
            return Vec3::ZERO;
        }
        let (mut origin, mut entered) = (place, 0);
        for _ in 0..MOST_SURFACES {
            let ray = Ray { origin, direction: OUTWARDS, t_min: 0.0, t_max: f32::INFINITY };
            let Some(hit) = self.accel.intersect(self.scene, &ray, Sides::Both) else { break };
            let point = SurfacePoint::new(self.scene, self.accel, hit.surface, Side::Front(hit.front));
            if let Some(volume) = &point.material.volume {
                match (hit.front, entered) {
                    (true, _) => entered += 1,
                    (false, 0) => return absorption(volume),
                    (false, _) => entered -= 1,
                }
            }
            origin = point.start(OUTWARDS);
        }
        Vec3::ZERO
    }
}

impl Eye {
    /// The share of the light from a point in sight that the solid around the eye lets through.
    #[inline]
    pub(super) fn lets_through(&self, point: Vec3) -> Vec3 {
        if self.absorption == Vec3::ZERO {
            return Vec3::ONE;
        }
        let way = point - self.position;
        let distance = if self.perspective { way.length() } else { way.dot(self.forward).max(0.0) };
        (self.absorption * -distance).exp()
    }
}
