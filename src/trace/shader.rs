//! Shading of many samples: the paper's *enhancement*.

use super::interaction::{Beam, SurfaceInteraction, footprints};
use super::lanes::{LANES, Lanes, Vec3x4};
use super::point::{Side, SurfacePoint};
use super::receivers::{Brought, Receivers};
use super::surface::Surface;
use super::whitted::{Incoming, KnownLight, Path};
use super::{Eye, Radiance, Tracer};
use crate::frame::{RayCounts, SurfaceSample};
use glam::Vec3;
use std::slice;

/// How many samples are shaded at once.
pub const SHADED_AT_ONCE: usize = LANES;

/// Shades samples that lie side by side. Neighbours mostly lie on one triangle, so it keeps what it knows of the last ones;
/// values do not depend on the order.
///
/// Four at a time go through one stage after another: arithmetic is shared between them, and the memory that a stage needs is
/// asked for by all of them before the next stage waits for it. None of them changes what another one looks like.
pub struct Shader<'t, 'a> {
    tracer: &'t Tracer<'a>,
    /// Where the last samples are, one to a lane.
    points: Option<[SurfacePoint<'a>; LANES]>,
    /// What is known of light where mirrored and refracted rays end.
    known: Option<&'t KnownLight<'t>>,
}

impl<'a> Tracer<'a> {
    /// For the samples of one thread.
    pub fn shader(&self) -> Shader<'_, 'a> {
        Shader { tracer: self, points: None, known: None }
    }

    /// [`Shader::shade`] for a single sample.
    pub fn shade(&self, eye: &Eye, sample: &SurfaceSample, lit: &[u32], rays: &mut RayCounts) -> Radiance {
        self.shader().shade(eye, sample, lit, rays)
    }
}

impl<'t> Shader<'t, '_> {
    /// Mirrored and refracted rays ask no lights where it is `known` which of them shine.
    pub fn knowing(self, known: Option<&'t KnownLight<'t>>) -> Self {
        Self { known, ..self }
    }

    /// [`Shader::shade_four`] for a single sample.
    pub fn shade(
        &mut self,
        eye: &Eye,
        sample: &SurfaceSample,
        lit: &[u32],
        rays: &mut RayCounts,
    ) -> Radiance {
        let mut radiance = Default::default();
        self.shade_four(eye, slice::from_ref(sample), [lit; SHADED_AT_ONCE], rays, &mut radiance);
        radiance[0]
    }

    /// What the eye sees of four samples, or fewer, each with its shadow bits. Everything that depends on the eye is worked out
    /// anew, for cast and reused samples alike. Counts `reflection` and `refraction`.
    pub fn shade_four(
        &mut self,
        eye: &Eye,
        samples: &[SurfaceSample],
        lit: [&[u32]; SHADED_AT_ONCE],
        rays: &mut RayCounts,
        radiance: &mut [Radiance; SHADED_AT_ONCE],
    ) {
        let is_surface = |sample: &SurfaceSample| !sample.surface.is_background();
        if let Some(some) = samples.iter().position(is_surface) {
            // A lane that shows no surface does as another one, and is not asked for.
            let (mut lanes, mut bits) = ([&samples[some]; LANES], [lit[some]; LANES]);
            let mut shown = [false; LANES];
            for (lane, sample) in samples.iter().enumerate().filter(|(_, sample)| is_surface(sample)) {
                (lanes[lane], bits[lane], shown[lane]) = (sample, lit[lane], true);
            }
            self.enhance(eye, (lanes, bits), shown, rays, radiance);
        }
        for (sample, radiance) in samples.iter().zip(radiance).filter(|(sample, _)| !is_surface(sample)) {
            if self.tracer.options.transparent {
                *radiance = Radiance::default();
                continue;
            }
            let angle = eye.pixel * f32::from(eye.perspective);
            let emission = finite(self.tracer.world.radiance(sample.position, angle));
            *radiance = Radiance { emission, alpha: 1.0, ..Radiance::default() };
        }
    }

    /// What leaves points on surfaces to the eye, to which the lights come that their shadow bits name.
    fn enhance(
        &mut self,
        eye: &Eye,
        (samples, lit): ([&SurfaceSample; LANES], [&[u32]; LANES]),
        shown: [bool; LANES],
        rays: &mut RayCounts,
        radiance: &mut [Radiance; LANES],
    ) {
        let (tracer, known) = (self.tracer, self.known);
        let points = self.points(samples);
        let (toward, widths) = eye.seen_from_four(Vec3x4::of(|lane| samples[lane].position));
        let beam = |lane: usize| Beam { width: widths[lane], spread: eye.spread() };
        let normals = Vec3x4::of(|lane| points[lane].geometric);
        let footprints = footprints(widths, normals.dot(toward));
        // Filled where they are: to move them would cost as much as to fill them.
        let geometric = |lane: usize| SurfaceInteraction::geometric(tracer.scene, &points[lane]);
        let mut its = [geometric(0), geometric(1), geometric(2), geometric(3)];
        for (lane, it) in its.iter_mut().enumerate() {
            tracer.look_up(it, footprints[lane]);
        }
        let [mut a, mut b, mut c, mut d] = [const { None }; LANES];
        let surfaces = [
            tracer.surface(&its[0], &mut a),
            tracer.surface(&its[1], &mut b),
            tracer.surface(&its[2], &mut c),
            tracer.surface(&its[3], &mut d),
        ];
        let shaded = Lanes::of(|lane| !points[lane].material.unlit);
        let (receivers, mut brought) = (Receivers::new(&its, surfaces, toward), Brought::default());
        for (field, lights) in &tracer.single_lights {
            let shares = field.shares(lit);
            let asked = Lanes::above_zero(shares) & shaded;
            if !asked.is_empty() {
                receivers.add(lights, asked, |_| shares, &mut brought);
            }
        }
        let highlights = receivers.highlights(&brought);
        for lane in (0..LANES).filter(|&lane| shown[lane]) {
            let (it, surface, toward) = (&its[lane], surfaces[lane], toward.lane(lane));
            let mut incoming = Incoming::default();
            if !points[lane].material.unlit {
                incoming = tracer.without_punctual_lights(it, surface, toward, lit[lane]);
                incoming.irradiance += brought.irradiance.lane(lane);
                incoming.highlights += highlights.lane(lane);
            }
            let path = Path::new(eye, it.point.position, beam(lane), known);
            let leaving = tracer.leaving(it, surface, toward, &incoming, &path, rays).behind(path.share);
            let is_finite = leaving.total().is_finite();
            radiance[lane] = if is_finite { leaving } else { leaving.where_finite() };
        }
    }

    /// Where four samples are.
    #[inline]
    fn points(&mut self, samples: [&SurfaceSample; LANES]) -> &[SurfacePoint<'_>; LANES] {
        let Tracer { scene, accel, .. } = *self.tracer;
        let side = |sample: &SurfaceSample| Side::Towards(sample.normal.direction());
        let new = |sample: &SurfaceSample| SurfacePoint::new(scene, accel, sample.surface, side(sample));
        let points = self.points.get_or_insert_with(|| {
            let point = new(samples[0]);
            [point.clone(), point.clone(), point.clone(), point]
        });
        // The triangles first: what is copied of one is then not what was just written, which would have to be waited for.
        for (lane, sample) in samples.into_iter().enumerate() {
            let beside = &points[(lane + LANES - 1) % LANES];
            if !points[lane].shares_triangle(sample.surface) {
                let shared = beside.shares_triangle(sample.surface);
                points[lane] = if shared { beside.clone() } else { new(sample) };
            }
        }
        for (point, sample) in points.iter_mut().zip(samples) {
            point.place(sample.surface, side(sample));
        }
        points
    }
}

impl Tracer<'_> {
    /// What arrives at a point from the world, and from area lights.
    #[inline]
    fn without_punctual_lights(
        &self,
        it: &SurfaceInteraction,
        surface: &Surface,
        toward: Vec3,
        lit: &[u32],
    ) -> Incoming {
        let mut incoming = self.skylight(it, self.layout.ambient.map_or(1.0, |field| field.share(lit)));
        for &number in &self.area_lights {
            let (light, field) = (&self.lights[number], self.layout.lights[number]);
            if field.is_set(lit)
                && let Some(unshadowed) = light.unshadowed(it.point.position, it.normal)
            {
                incoming.add(it, surface, toward, light, &unshadowed, field.share(lit));
            }
        }
        incoming
    }
}

impl Radiance {
    /// The same, without the parts in which arithmetic on extreme input has overflowed.
    #[cold]
    fn where_finite(&self) -> Self {
        let Self { diffuse, specular, emission, alpha } = *self;
        Self { diffuse: finite(diffuse), specular: finite(specular), emission: finite(emission), alpha }
    }
}

/// `light`, or nothing where arithmetic on extreme input has overflowed: one such pixel would spoil every filter
/// after us.
pub(super) fn finite(light: Vec3) -> Vec3 {
    if light.is_finite() { light } else { Vec3::ZERO }
}
