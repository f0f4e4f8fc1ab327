//! Highlights of lights that have a size.

use super::ggx::{density, lobes};
use super::interaction::SurfaceInteraction;
use super::lanes::{Lanes, Vec3x4};
use super::light::{Emitter, Unshadowed};
use super::parts::GRID;
use super::surface::Surface;
use glam::{Vec3, Vec4};
use std::f32::consts::TAU;

/// A highlight is left out where its lobe has less density than this, 1/sr: but for grazing angles it would add less
/// than 1e-4 of what a white diffuse surface does.
pub(super) const MIN_LOBE: f32 = 1e-4;

impl Surface {
    /// The highlight of a light that has a size, nothing in its way.
    pub fn highlight(
        &self,
        it: &SurfaceInteraction,
        toward: Vec3,
        light: &Emitter,
        unshadowed: &Unshadowed,
    ) -> Vec3 {
        if !self.has_highlights() {
            return Vec3::ZERO;
        }
        // A light is cut in parts narrower than the lobe, as far as a few will do, and the lobe is widened by their size.
        let position = it.point.position;
        let spread = light.solid_angle(position) / TAU;
        let rows = (4.0 * spread.sqrt() / self.alpha).ceil().clamp(1.0, GRID as f32);
        let alpha = (self.alpha * self.alpha + spread / (rows * rows)).sqrt();
        let middle = unshadowed.to_light;
        let [normals, views] = [it.normal, toward].map(Vec3x4::splat);
        let (mut sums, mut all) = ([Vec4::ZERO; 2], Vec4::ZERO);
        let mut add = |to_lights: Vec3x4, cosines: Vec4, weights: Vec4| {
            all += weights;
            let shining = Lanes::above_zero(weights);
            let to_lights = (to_lights, cosines);
            if let Some((lobes, cosines)) =
                lobes(normals, views, to_lights, Vec4::splat(alpha), MIN_LOBE, shining)
            {
                let mirrored = weights * lobes;
                let at_grazing = mirrored * self.grazing(cosines);
                sums[0] += mirrored - at_grazing;
                sums[1] += at_grazing;
            }
        };
        if rows == 1.0 {
            let cosines = Vec4::splat(it.normal.dot(middle));
            add(Vec3x4::splat(middle), cosines, Lanes::above_zero(cosines).select(Vec4::X));
        } else if may_mirror(it.normal, toward, middle, light.chord(position), alpha) {
            light
                .parts(position, it.normal, rows as u32)
                .for_each(|p| add(p.to_lights, p.cosines, p.weights));
        }
        let all = all.element_sum();
        if all <= 0.0 {
            return Vec3::ZERO;
        }
        let [normal, grazing] = self.reflectances();
        let [at_normal, at_grazing] = sums.map(|sum| sum.element_sum() / all);
        unshadowed.irradiance * (normal * at_normal + grazing * at_grazing)
    }
}

/// False if no direction that is within `chord` of `light`, all of them unit vectors, has a lobe that counts.
fn may_mirror(normal: Vec3, view: Vec3, light: Vec3, chord: f32, alpha: f32) -> bool {
    let half = view + light;
    let length = half.length();
    // The half vector moves by no more than the light does: so far at most does it turn.
    let sin = chord / length;
    if sin.is_nan() || sin >= 1.0 {
        return true;
    }
    let turn = (sin, (1.0 - sin * sin).sqrt());
    let cos = normal.dot(half) / length;
    if cos >= turn.1 {
        return true;
    }
    let nearest = cos * turn.1 + (1.0 - cos * cos).max(0.0).sqrt() * turn.0;
    density(nearest.max(0.0).powi(2), alpha * alpha) >= MIN_LOBE
}
