//! What leaves a surface towards the eye, and the rays that have to be followed to know it.

use super::ggx::{environment_share, refract};
use super::interaction::{Beam, SurfaceInteraction};
use super::lanes::Lanes;
use super::light::{Emitter, Unshadowed};
use super::medium::absorption;
use super::point::{Side, SurfacePoint};
use super::punctual::PunctualLights;
use super::receivers::{Brought, Receivers};
use super::surface::Surface;
use super::visibility::Inquiry;
use super::{Eye, Radiance, Tracer};
use crate::accel::{Ray, Sides};
use crate::frame::{RayCounts, SurfaceSample};
use glam::{Vec3, Vec4};
use std::f32::consts::FRAC_1_PI;

/// A ray is followed only if it carries more than this share of what it finds to the pixel.
const MIN_SHARE: f32 = 1.0 / 256.0;

/// Says which shadow bits a point of a surface has, where that is known without a ray.
pub type KnownLight<'k> = dyn Fn(&SurfaceSample) -> Option<&'k [u32]> + Sync + 'k;

/// How a point came to be looked at.
#[derive(Clone, Copy)]
pub(super) struct Path<'k> {
    /// Mirrored and refracted rays so far.
    bounces: u32,
    /// Share of what leaves the point that reaches the pixel.
    pub share: Vec3,
    /// What the first of those rays was; all that follow are counted with it.
    kind: Option<Kind>,
    beam: Beam,
    /// Whether it has gone straight on from the eye, through what is blended or thin.
    straight: bool,
    /// Absorption of the solid that the path is inside, 1/m.
    inside: Vec3,
    /// What is known of light at what is met.
    known: Option<&'k KnownLight<'k>>,
}

/// The two kinds of secondary rays that are counted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Reflection,
    Refraction,
}

impl<'k> Path<'k> {
    /// From the eye to a point.
    pub fn new(eye: &Eye, point: Vec3, beam: Beam, known: Option<&'k KnownLight<'k>>) -> Self {
        let share = eye.lets_through(point);
        Self { bounces: 0, share, kind: None, beam, straight: true, inside: eye.absorption, known }
    }

    /// On by a ray of `kind` that carries `share`, in another direction.
    fn next(&self, kind: Kind, share: Vec3, inside: Vec3) -> Self {
        Self { straight: false, inside, ..self.straight_on(kind, share) }
    }

    /// On in the same direction.
    fn straight_on(&self, kind: Kind, share: Vec3) -> Self {
        let kind = Some(self.kind.unwrap_or(kind));
        Self { bounces: self.bounces + 1, share: self.share * share, kind, ..*self }
    }

    fn count(&self, rays: &mut RayCounts) {
        match self.kind {
            Some(Kind::Reflection) => rays.reflection += 1,
            Some(Kind::Refraction) => rays.refraction += 1,
            None => {}
        }
    }
}

/// A point of a path, and where it is looked at from.
#[derive(Clone, Copy)]
struct Vertex<'v> {
    it: &'v SurfaceInteraction<'v>,
    surface: &'v Surface,
    toward: Vec3,
    /// See [`Tracer::coverage`].
    coverage: f32,
}

/// What comes back along a ray.
#[derive(Clone, Copy, Default)]
struct Seen {
    light: Vec3,
    /// The share of it in which nothing is seen, as the world is left out.
    open: f32,
}

/// What arrives at a point, and what of it is mirrored to the eye.
#[derive(Default)]
pub(super) struct Incoming {
    /// Of all lights and the world.
    pub irradiance: Vec3,
    /// Of the lights, as radiance.
    pub highlights: Vec3,
    /// Share of the world's light that reaches the point.
    pub openness: f32,
}

impl Incoming {
    /// Adds those of four punctual lights that are `asked` for. `reach` says which share of each reaches the point; it is not asked
    /// of lights that would bring nothing to the eye.
    #[inline]
    pub fn add_four(
        &mut self,
        it: &SurfaceInteraction,
        surface: &Surface,
        toward: Vec3,
        lights: &PunctualLights,
        asked: Lanes,
        reach: impl FnOnce(Lanes) -> Vec4,
    ) {
        let mut brought = Brought::default();
        let receivers = Receivers::all(it, surface, toward);
        receivers.add(lights, asked, reach, &mut brought);
        self.irradiance += brought.irradiance.sum();
        self.highlights += receivers.highlights(&brought).sum();
    }

    /// Adds the `share` of an area light that reaches the point.
    pub fn add(
        &mut self,
        it: &SurfaceInteraction,
        surface: &Surface,
        toward: Vec3,
        light: &Emitter,
        unshadowed: &Unshadowed,
        share: f32,
    ) {
        self.irradiance += unshadowed.irradiance * share;
        self.highlights += surface.highlight(it, toward, light, unshadowed) * share;
    }
}

impl Tracer<'_> {
    /// What leaves `it` along `toward`, given what arrives there.
    #[inline]
    pub(super) fn leaving(
        &self,
        it: &SurfaceInteraction,
        surface: &Surface,
        toward: Vec3,
        incoming: &Incoming,
        path: &Path<'_>,
        rays: &mut RayCounts,
    ) -> Radiance {
        let coverage = self.coverage(surface, path.bounces);
        let vertex = &Vertex { it, surface, toward, coverage };
        let (mut specular, mut open) = (incoming.highlights, 0.0);
        if surface.f90 > 0.0 || surface.eta.is_some() {
            specular += self.mirrored(vertex, incoming.openness, path, rays);
        }
        if surface.transmittance != Vec3::ZERO {
            let seen = self.transmitted(vertex, path, rays);
            (specular, open) = (specular + seen.light, seen.open);
        }
        (specular, open) = (specular * coverage, open * coverage);
        if coverage < 1.0 {
            let share = 1.0 - coverage;
            let next = path.straight_on(Kind::Refraction, Vec3::splat(share));
            let seen = self.follow(it, -toward, path, next, rays);
            (specular, open) = (specular + share * seen.light, open + share * seen.open);
        }
        Radiance {
            diffuse: surface.albedo * incoming.irradiance * (FRAC_1_PI * coverage),
            specular,
            emission: surface.emission * coverage,
            alpha: 1.0 - open,
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
        &Vertex { it, surface, toward, coverage }: &Vertex<'_>,
        openness: f32,
        path: &Path<'_>,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let sharp = surface.mirror;
        let blurs = sharp < 1.0 && !self.world.is_black();
        if sharp == 0.0 && !blurs {
            return Vec3::ZERO;
        }
        let cos = it.normal.dot(toward).clamp(0.0, 1.0);
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
                light += share * self.follow(it, direction, path, next, rays).light;
            }
        }
        if blurs {
            let share = environment_share(surface.f0, surface.f90, surface.roughness, cos) * (1.0 - sharp);
            let angle = 2.0 * surface.roughness * surface.roughness;
            light += share * self.world.radiance(direction, angle) * openness;
        }
        light
    }

    /// What passes through: bent by a solid, straight through a thin wall.
    fn transmitted(
        &self,
        &Vertex { it, surface, toward, coverage }: &Vertex<'_>,
        path: &Path<'_>,
        rays: &mut RayCounts,
    ) -> Seen {
        let cos = it.normal.dot(toward).clamp(0.0, 1.0);
        let share = (Vec3::ONE - surface.fresnel(cos)).max(Vec3::ZERO) * surface.transmittance;
        if (path.share * share * coverage).max_element() <= MIN_SHARE {
            return Seen::default();
        }
        let (direction, next) = match (surface.eta, it.point.material.volume) {
            (Some(eta), Some(volume)) => {
                let Some(direction) = refract(-toward, it.normal, eta) else { return Seen::default() };
                let inside = if it.point.front { absorption(&volume) } else { Vec3::ZERO };
                (direction, path.next(Kind::Refraction, share * coverage, inside))
            }
            _ => (-toward, path.straight_on(Kind::Refraction, share * coverage)),
        };
        let seen = self.follow(it, direction, path, next, rays);
        Seen { light: share * seen.light, open: share.element_sum() / 3.0 * seen.open }
    }

    /// What comes back along `direction` from `it`: the world where the path has become too long.
    fn follow(
        &self,
        it: &SurfaceInteraction,
        direction: Vec3,
        path: &Path<'_>,
        next: Path<'_>,
        rays: &mut RayCounts,
    ) -> Seen {
        if path.bounces >= self.options.bounces {
            return self.beyond(direction, &next);
        }
        self.trace(it.point.start(direction), direction, next, rays)
    }

    /// The world, unless that is left out where the eye looks straight at it.
    fn beyond(&self, direction: Vec3, path: &Path<'_>) -> Seen {
        if path.straight && self.options.transparent {
            return Seen { light: Vec3::ZERO, open: 1.0 };
        }
        Seen { light: self.world.radiance(direction, path.beam.spread), open: 0.0 }
    }

    /// What comes along a secondary ray.
    fn trace(&self, origin: Vec3, direction: Vec3, mut path: Path<'_>, rays: &mut RayCounts) -> Seen {
        path.count(rays);
        let ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
        let Some(hit) = self.accel.intersect(self.scene, &ray, Sides::Visible) else {
            return self.beyond(direction, &path);
        };
        path.beam = path.beam.after(hit.t);
        let mut passed = Vec3::ONE;
        if path.inside != Vec3::ZERO {
            passed = (path.inside * -hit.t).exp();
            path.share *= passed;
        }
        let point = SurfacePoint::new(self.scene, self.accel, hit.surface, Side::Front(hit.front));
        let it = self.interaction(&point, -direction, path.beam);
        let mut room = None;
        let surface = self.surface(&it, &mut room);
        let mut incoming = Incoming::default();
        if !it.point.material.unlit {
            let lit = path.known.and_then(|known| known(&self.sample(hit.surface, &point)));
            // As few rays as the path brings little to the pixel.
            let inquiry = Inquiry::Part(path.share.max_element());
            let ambient = self.layout.ambient.map_or(1.0, |field| match lit {
                Some(lit) => field.share(lit),
                None => self.world_share(&point, inquiry, || path.count(rays)),
            });
            incoming = self.skylight(&it, ambient);
            let mut share = |number: usize| match lit {
                Some(lit) => self.layout.lights[number].share(lit),
                None => self.light_share(&point, number, inquiry, || path.count(rays)),
            };
            for lights in &self.punctual_lights {
                let reach = |lanes: Lanes| lanes.replace(Vec4::ZERO, |lane| share(lights.number(lane)));
                incoming.add_four(&it, surface, -direction, lights, Lanes::ALL, reach);
            }
            for &number in &self.area_lights {
                let light = &self.lights[number];
                if let Some(unshadowed) = light.unshadowed(it.point.position, it.normal) {
                    let share = share(number);
                    if share > 0.0 {
                        incoming.add(&it, surface, -direction, light, &unshadowed, share);
                    }
                }
            }
        }
        let leaving = self.leaving(&it, surface, -direction, &incoming, &path, rays);
        Seen { light: passed * leaving.total(), open: 1.0 - leaving.alpha }
    }
}
