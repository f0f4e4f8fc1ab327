//! Shading of many samples: the paper's *enhancement*.

use super::interaction::Beam;
use super::point::{Side, SurfacePoint};
use super::whitted::{Incoming, Path};
use super::{Eye, Radiance, Tracer};
use crate::frame::{RayCounts, SurfaceSample};
use glam::Vec3;

/// Shades one sample after another. Neighbours mostly lie on one triangle, so it keeps what it knows of the last one;
/// values do not depend on the order.
pub struct Shader<'t, 'a> {
    tracer: &'t Tracer<'a>,
    last: Option<SurfacePoint<'a>>,
}

impl<'a> Tracer<'a> {
    /// For the samples of one thread.
    pub fn shader(&self) -> Shader<'_, 'a> {
        Shader { tracer: self, last: None }
    }

    /// [`Shader::shade`] for a single sample.
    pub fn shade(&self, eye: &Eye, sample: &SurfaceSample, lit: &[u32], rays: &mut RayCounts) -> Radiance {
        self.shader().shade(eye, sample, lit, rays)
    }

    /// What leaves a point on a surface along `toward`, to which the lights come that its shadow bits name.
    fn enhance(
        &self,
        point: &SurfacePoint,
        toward: Vec3,
        beam: Beam,
        lit: &[u32],
        rays: &mut RayCounts,
    ) -> Radiance {
        let it = self.interaction(point, toward, beam);
        let mut room = None;
        let surface = self.surface(&it, &mut room);
        let mut incoming = Incoming::default();
        if !point.material.unlit {
            incoming = self.skylight(&it, self.layout.ambient.map_or(1.0, |field| field.share(lit)));
            for lights in &self.delta_lights {
                let reached = lights.lit(lit);
                if !reached.is_empty() {
                    incoming.add_four(&it, surface, toward, lights, reached, |seen| seen);
                }
            }
            for &number in &self.sized_lights {
                let (light, field) = (&self.lights[number], self.layout.lights[number]);
                if field.is_set(lit)
                    && let Some(unshadowed) = light.unshadowed(point.position, it.normal)
                {
                    incoming.add(&it, surface, toward, light, &unshadowed, field.share(lit));
                }
            }
        }
        self.leaving(&it, surface, toward, &incoming, &Path::new(beam), rays)
    }
}

impl Shader<'_, '_> {
    /// What the eye sees of `sample`, whose shadow bits are `lit`: everything that depends on the eye is worked out
    /// anew, for cast and reused samples alike. Counts `reflection` and `refraction`.
    pub fn shade(
        &mut self,
        eye: &Eye,
        sample: &SurfaceSample,
        lit: &[u32],
        rays: &mut RayCounts,
    ) -> Radiance {
        let Self { tracer, last } = self;
        if sample.surface.is_background() {
            let angle = eye.pixel * f32::from(eye.perspective);
            let emission = finite(tracer.world.radiance(sample.position, angle));
            return Radiance { emission, alpha: 1.0, ..Radiance::default() };
        }
        let side = || Side::Towards(sample.normal.direction());
        if !last.as_mut().is_some_and(|point| point.move_to(sample.surface, side())) {
            *last = None;
        }
        let point =
            last.get_or_insert_with(|| SurfacePoint::new(tracer.scene, tracer.accel, sample.surface, side()));
        let (toward, beam) = eye.seen_from(sample.position);
        let seen = tracer.enhance(point, toward, beam, lit, rays);
        if seen.total().is_finite() {
            return seen;
        }
        Radiance {
            diffuse: finite(seen.diffuse),
            specular: finite(seen.specular),
            emission: finite(seen.emission),
            alpha: 1.0,
        }
    }
}

/// `light`, or nothing where arithmetic on extreme input has overflowed: one such pixel would spoil every filter
/// after us.
pub(super) fn finite(light: Vec3) -> Vec3 {
    if light.is_finite() { light } else { Vec3::ZERO }
}
