//! What leaves a surface towards the eye, and the rays that have to be followed to know it.

use super::ggx::{environment_share, lobe, refract};
use super::interaction::{Beam, SurfaceInteraction};
use super::light::Arriving;
use super::point::Side;
use super::surface::{Surface, occlusion};
use super::{Radiance, Tracer};
use crate::accel::Sides;
use crate::frame::RayCounts;
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

/// A ray is followed only if it carries more than this share of what it finds to the pixel.
const MIN_SHARE: f32 = 1.0 / 256.0;

/// A highlight is left out where its lobe has less density than this, 1/sr: but for grazing angles it would add less
/// than 1e-4 of what a white diffuse surface does.
const MIN_LOBE: f32 = 1e-4;

/// How a point came to be looked at.
#[derive(Clone, Copy)]
pub(super) struct Path {
    /// Mirrored and refracted rays so far.
    bounces: u32,
    /// Share of what leaves the point that reaches the pixel.
    share: Vec3,
    /// What the first of those rays was; all that follow are counted with it.
    kind: Option<Kind>,
    beam: Beam,
    /// Absorption of the solid that the path is inside, 1/m.
    inside: Vec3,
}

/// The two kinds of secondary rays that are counted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Reflection,
    Refraction,
}

impl Path {
    /// From the eye.
    pub fn new(beam: Beam) -> Self {
        Self { bounces: 0, share: Vec3::ONE, kind: None, beam, inside: Vec3::ZERO }
    }

    /// On by a ray of `kind` that carries `share`.
    fn next(&self, kind: Kind, share: Vec3, inside: Vec3) -> Self {
        let kind = Some(self.kind.unwrap_or(kind));
        Self { bounces: self.bounces + 1, share: self.share * share, kind, inside, ..*self }
    }

    fn count(&self, rays: &mut RayCounts) {
        match self.kind {
            Some(Kind::Reflection) => rays.reflection += 1,
            Some(Kind::Refraction) => rays.refraction += 1,
            None => {}
        }
    }
}

impl Surface {
    /// The highlight of a light, its cosine already in `arriving`.
    pub fn highlight(&self, it: &SurfaceInteraction, toward: Vec3, arriving: &Arriving) -> Vec3 {
        // Inside a solid, and where nothing is reflected, there is none.
        if self.f90 == 0.0 || self.eta.is_some_and(|eta| eta < 1.0) {
            return Vec3::ZERO;
        }
        match lobe(it.normal, toward, arriving.to_light, self.alpha(), MIN_LOBE) {
            Some((lobe, cos)) => arriving.irradiance * lobe * self.fresnel(cos),
            None => Vec3::ZERO,
        }
    }
}

impl Tracer<'_> {
    /// What leaves `it` along `toward`, given what arrives there.
    #[expect(clippy::too_many_arguments, reason = "what is known of the point, and how it is reached")]
    pub(super) fn leaving(
        &self,
        it: &SurfaceInteraction,
        surface: &Surface,
        toward: Vec3,
        irradiance: Vec3,
        highlights: Vec3,
        path: &Path,
        rays: &mut RayCounts,
    ) -> Radiance {
        let coverage = self.coverage(surface, path.bounces);
        let mut specular = highlights;
        if surface.f90 > 0.0 || surface.eta.is_some() {
            specular += self.mirrored(it, surface, toward, coverage, path, rays);
        }
        if surface.transmittance != Vec3::ZERO {
            specular += self.transmitted(it, surface, toward, coverage, path, rays);
        }
        specular *= coverage;
        if coverage < 1.0 {
            let share = Vec3::splat(1.0 - coverage);
            specular +=
                share * self.follow(it, -toward, path, path.next(Kind::Refraction, share, path.inside), rays);
        }
        Radiance {
            diffuse: surface.albedo * irradiance * (FRAC_1_PI * coverage),
            specular,
            emission: surface.emission * coverage,
            alpha: 1.0,
        }
    }

    /// How much of what is behind a surface it hides, after so many bounces. Where a blended surface is the last
    /// thing that may be met, it hides all.
    pub(super) fn coverage(&self, surface: &Surface, bounces: u32) -> f32 {
        if bounces >= self.options.bounces { 1.0 } else { surface.coverage }
    }

    /// What the surface mirrors of other things: sharp where smooth, the world's blurred light where rough.
    fn mirrored(
        &self,
        it: &SurfaceInteraction,
        surface: &Surface,
        toward: Vec3,
        coverage: f32,
        path: &Path,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let cos = it.normal.dot(toward).clamp(0.0, 1.0);
        let sharp = surface.mirror();
        let mut direction = it.normal * (2.0 * it.normal.dot(toward)) - toward;
        let below = direction.dot(it.point.geometric);
        if below < 0.0 {
            direction -= it.point.geometric * (2.0 * below);
        }
        let direction = direction.normalize_or(it.point.geometric);
        let mut light = Vec3::ZERO;
        if sharp > 0.0 {
            let share = surface.fresnel(cos) * sharp;
            if (path.share * share * coverage).max_element() > MIN_SHARE {
                let next = path.next(Kind::Reflection, share * coverage, path.inside);
                light += share * self.follow(it, direction, path, next, rays);
            }
        }
        if sharp < 1.0 && !self.world.is_black() {
            let share = environment_share(surface.f0, surface.f90, surface.roughness, cos) * (1.0 - sharp);
            let angle = 2.0 * surface.roughness * surface.roughness;
            light += share * self.world.radiance(direction, angle) * occlusion(it);
        }
        light
    }

    /// What passes through: bent by a solid, straight through a thin wall.
    fn transmitted(
        &self,
        it: &SurfaceInteraction,
        surface: &Surface,
        toward: Vec3,
        coverage: f32,
        path: &Path,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let cos = it.normal.dot(toward).clamp(0.0, 1.0);
        let share = (Vec3::ONE - surface.fresnel(cos)).max(Vec3::ZERO) * surface.transmittance;
        if (path.share * share * coverage).max_element() <= MIN_SHARE {
            return Vec3::ZERO;
        }
        let (direction, inside) = match (surface.eta, it.point.material.volume) {
            (Some(eta), Some(volume)) => {
                let Some(direction) = refract(-toward, it.normal, eta) else { return Vec3::ZERO };
                (direction, if it.point.front { absorption(&volume) } else { Vec3::ZERO })
            }
            _ => (-toward, path.inside),
        };
        share * self.follow(it, direction, path, path.next(Kind::Refraction, share * coverage, inside), rays)
    }

    /// What comes back along `direction` from `it`: the world where the path has become too long.
    fn follow(
        &self,
        it: &SurfaceInteraction,
        direction: Vec3,
        path: &Path,
        next: Path,
        rays: &mut RayCounts,
    ) -> Vec3 {
        if path.bounces >= self.options.bounces {
            return self.world.radiance(direction, path.beam.spread);
        }
        self.trace(it.point.start(direction), direction, next, rays)
    }

    /// What comes along a secondary ray.
    fn trace(&self, origin: Vec3, direction: Vec3, mut path: Path, rays: &mut RayCounts) -> Vec3 {
        path.count(rays);
        let Some(hit) =
            self.accel.intersect(self.scene, origin, direction, 0.0, f32::INFINITY, Sides::Visible)
        else {
            return self.world.radiance(direction, path.beam.spread);
        };
        path.beam = path.beam.after(hit.t);
        let mut passed = Vec3::ONE;
        if path.inside != Vec3::ZERO {
            passed = (path.inside * -hit.t).exp();
            path.share *= passed;
        }
        let side = Side::Front(hit.front);
        let it = SurfaceInteraction::new(self.scene, self.accel, hit.surface, side, -direction, path.beam);
        let surface = Surface::new(&it);
        let (mut irradiance, mut highlights) = (Vec3::ZERO, Vec3::ZERO);
        if !it.point.material.unlit {
            irradiance = self.ambient(&it);
            for light in &self.lights {
                if let Some(arriving) = self.facing(&it, light) {
                    path.count(rays);
                    if self.reaches(&it.point, &arriving) {
                        irradiance += arriving.irradiance;
                        highlights += surface.highlight(&it, -direction, &arriving);
                    }
                }
            }
        }
        passed * self.leaving(&it, &surface, -direction, irradiance, highlights, &path, rays).total()
    }
}

/// Absorption of a solid, 1/m: what is left after the attenuation distance is the attenuation colour. A colour of 0
/// lets a hundred-thousandth through.
fn absorption(volume: &crate::scene::Volume) -> Vec3 {
    let distance = volume.attenuation_distance;
    if !(distance > 0.0 && distance.is_finite()) {
        return Vec3::ZERO;
    }
    volume.attenuation_color.clamp(Vec3::splat(1e-5), Vec3::ONE).map(|c| -c.ln() / distance)
}
