//! Tracing as Whitted did: one ray through a pixel, shadow rays to each light, mirrored and refracted rays on from
//! there. `docs/shading.md` has the model, its formulas and its cut-offs.
//!
//! The work is split as the paper splits it. [`Tracer::cast`] finds what does not depend on the eye and takes rays to
//! know: the point, and which lights reach it. [`Shader::shade`] adds the rest (the paper's *enhancement*): the light that
//! arrives, the texture under the pixel's beam, highlights, reflection, refraction. It is a function of the view, the
//! sample and its shadow bits alone, whether the sample was just cast or carried over from another frame: so a still
//! camera gives the same values frame after frame.

mod changes;
mod eye;
mod form_factor;
mod ggx;
mod hidden;
mod highlight;
mod interaction;
mod known;
mod lanes;
mod light;
mod medium;
mod panel;
mod parts;
mod point;
mod punctual;
mod reach;
mod receivers;
mod sequence;
mod shader;
mod surface;
mod visibility;
mod whitted;
mod world;

use crate::accel::{Accel, Sides};
use crate::frame::{PackedNormal, RayCounts, SurfaceRef, SurfaceSample};
use crate::scene::{Pose, Scene, View};
pub use changes::LightChanges;
pub use eye::Eye;
use glam::{Vec3, Vec4};
use interaction::{Beam, SurfaceInteraction, footprints};
use light::Emitter;
use point::{Side, SurfacePoint};
use punctual::{PunctualLights, is_punctual};
use shader::finite;
pub use shader::{SHADED_AT_ONCE, Shader};
use std::f32::consts::FRAC_1_PI;
use surface::{ShadingMaterial, Surface, occlusion};
use visibility::{Field, Inquiry, Layout};
use whitted::Incoming;
pub use whitted::KnownLight;
use world::Surroundings;

/// How deep and how finely to trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TraceOptions {
    /// Mirrored and refracted rays in a row, at most.
    pub bounces: u32,
    /// Shadow rays to each light that has a size.
    pub light_samples: u32,
    /// Rays to the world, where there is one; without any its light reaches everything.
    pub ambient_samples: u32,
    /// Leaves out the world where the eye sees it, also straight through what is blended or thin; it still lights everything, and is
    /// mirrored and refracted.
    pub transparent: bool,
}

impl Default for TraceOptions {
    fn default() -> Self {
        Self { bounces: 4, light_samples: 1, ambient_samples: 0, transparent: false }
    }
}

/// What reaches the eye from a point, in W/m2/sr. The sum of the parts is the pixel's colour.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Radiance {
    /// Scattered light of the lights and the world.
    pub diffuse: Vec3,
    /// Highlights, reflection, refraction, and what is seen through blended surfaces.
    pub specular: Vec3,
    /// Emission, unlit colour, and the background.
    pub emission: Vec3,
    /// Coverage: 1 on surfaces and background alike, less where the world is left out.
    pub alpha: f32,
}

impl Radiance {
    /// All parts together.
    pub fn total(&self) -> Vec3 {
        self.diffuse + self.specular + self.emission
    }

    /// What is left of it behind something that lets a share through; it covers as much.
    fn behind(&self, share: Vec3) -> Self {
        let Self { diffuse, specular, emission, alpha } = *self;
        Self { diffuse: diffuse * share, specular: specular * share, emission: emission * share, alpha }
    }
}

/// Traces rays through a scene at one time. Shared by all threads.
pub struct Tracer<'a> {
    scene: &'a Scene,
    accel: &'a Accel,
    options: TraceOptions,
    lights: Vec<Emitter>,
    /// The punctual ones of them, four at a time.
    punctual_lights: Vec<PunctualLights>,
    /// The same one by one, each for four points.
    single_lights: Vec<(Field, PunctualLights)>,
    /// The numbers of the others.
    area_lights: Vec<usize>,
    layout: Layout,
    world: Surroundings<'a>,
    /// In the order of the scene's materials.
    materials: Vec<ShadingMaterial>,
}

impl<'a> Tracer<'a> {
    /// A tracer of `scene` as `accel` has it placed, under the lights of `pose`.
    pub fn new(scene: &'a Scene, accel: &'a Accel, pose: &Pose, options: TraceOptions) -> Self {
        let lights: Vec<_> = pose.lights.iter().map(|l| Emitter::new(l, accel.origin())).collect();
        let layout = Layout::new(scene, options);
        Self {
            scene,
            accel,
            options,
            punctual_lights: PunctualLights::groups(&lights),
            single_lights: PunctualLights::singles(&lights, &layout.lights),
            area_lights: (0..lights.len()).filter(|&n| !is_punctual(&lights[n])).collect(),
            lights,
            layout,
            world: Surroundings::new(scene),
            materials: scene.materials.iter().map(ShadingMaterial::new).collect(),
        }
    }

    /// The eye of a view, for everything that is asked of its pixels.
    pub fn eye(&self, view: &View) -> Eye {
        let mut eye = Eye::new(view, self.accel);
        eye.absorption = self.absorption_at(eye.position);
        eye
    }

    /// Words of 32 shadow bits that a sample needs; see [`lit_words`].
    pub fn lit_words(&self) -> usize {
        self.layout.words
    }

    /// Casts a ray from the eye through raster position (x, y), and from what it meets rays to every light that could
    /// shine there. Says in `lit` which do.
    ///
    /// The ray starts at the near plane and ends at the far plane. Counts `primary`, `shadow` and `ambient`.
    pub fn cast(&self, eye: &Eye, x: f64, y: f64, lit: &mut [u32], rays: &mut RayCounts) -> SurfaceSample {
        lit.fill(0);
        let (sample, point) = self.first_hit(eye, x, y, rays);
        if let Some(point) = point {
            self.look_for_lights(&point, |_, _| Some(Inquiry::Part(1.0)), lit, rays);
        }
        sample
    }

    /// Casts a ray from the eye through raster position (x, y), and none to the lights. Counts `primary`.
    pub fn hit(&self, eye: &Eye, x: f64, y: f64, rays: &mut RayCounts) -> SurfaceSample {
        self.first_hit(eye, x, y, rays).0
    }

    /// Finds out anew whether the lights of which any bit is set in `ask` reach a sample, and changes their bits in `lit`.
    /// A share of which not the highest bit is set is believed, and renewed by a few rays unless they speak against it.
    /// Counts `shadow` and `ambient`.
    pub fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], rays: &mut RayCounts) {
        if !sample.surface.is_background() {
            let point = self.point_of(sample);
            self.look_for_lights(&point, |field, lit| field.inquiry(ask, lit), lit, rays);
        }
    }

    /// Sets in `differ` bits of the lights on which the shadow bits of two samples disagree, as [`Tracer::recast`] takes
    /// them. Shares that came out differently by chance agree; those that are not far apart are to be confirmed.
    pub fn differ(&self, a: &[u32], b: &[u32], differ: &mut [u32]) {
        self.layout.differ(a, b, differ);
    }

    /// True if [`Tracer::differ`] sets no bit.
    pub fn agree(&self, a: &[u32], b: &[u32]) -> bool {
        self.layout.agree(a, b)
    }

    /// True if an edge of a light's shadow may lie between two samples. The world throws none.
    pub fn has_edge(&self, a: &[u32], b: &[u32]) -> bool {
        self.layout.has_edge(a, b)
    }

    /// Whether samples have shares of any light, not only bits.
    pub fn has_shares(&self) -> bool {
        self.layout.has_shares()
    }

    /// Sets in `ask` the bits by which [`Tracer::recast`] confirms all shares and finds all else anew.
    pub fn confirm(&self, ask: &mut [u32]) {
        self.layout.confirm(ask);
    }

    /// Makes of all that `ask` asks of shares to confirm them.
    pub fn soften(&self, ask: &mut [u32]) {
        self.layout.soften(ask);
    }

    /// Clears in `ask` the bits by which shares are only to be confirmed.
    pub fn keep_edges(&self, ask: &mut [u32]) {
        self.layout.keep_edges(ask);
    }

    /// Sets all bits of the shares about which `ask` asks anything: once answered, nothing is left to be asked.
    pub fn settle(&self, ask: &mut [u32]) {
        self.layout.settle(ask);
    }

    /// Sets the shares in `lit` to the weighted mean of those that are `known`; single bits stay.
    pub fn blend<'b>(&self, known: impl Iterator<Item = (&'b [u32], f32)> + Clone, lit: &mut [u32]) {
        self.layout.blend(known, lit);
    }

    /// Visits the triangles that open to the eye between two views; see [`Accel::turned`].
    pub fn turned(&self, old: &View, new: &View, visit: &(dyn Fn([Vec3; 3]) + Sync)) {
        self.accel.turned(self.scene, (old, new), visit);
    }

    /// Visits what the near or far plane cut off in one view, and another view sees; see [`Accel::uncut`].
    pub fn uncut(&self, old: &View, new: &View, visit: &(dyn Fn(&[Vec3]) + Sync)) {
        self.accel.uncut(self.scene, (old, new), visit);
    }

    /// The first thing on the ray through raster position (x, y): a surface's sample and the point it lies on, or the
    /// background's.
    fn first_hit(
        &self,
        eye: &Eye,
        x: f64,
        y: f64,
        rays: &mut RayCounts,
    ) -> (SurfaceSample, Option<SurfacePoint<'a>>) {
        rays.primary += 1;
        let ray = eye.ray(self.accel, x, y);
        let Some(hit) = self.accel.intersect(self.scene, &ray, Sides::Visible) else {
            return (SurfaceSample::background(ray.direction.normalize_or(Vec3::NEG_Z)), None);
        };
        let point = SurfacePoint::new(self.scene, self.accel, hit.surface, Side::Front(hit.front));
        (self.sample(hit.surface, &point), Some(point))
    }

    /// The sample of a point on a surface, which must not be the background, seen from its front or its back.
    pub fn sample_at(&self, surface: SurfaceRef, front: bool) -> SurfaceSample {
        self.sample(surface, &SurfacePoint::new(self.scene, self.accel, surface, Side::Front(front)))
    }

    fn sample(&self, surface: SurfaceRef, point: &SurfacePoint) -> SurfaceSample {
        SurfaceSample {
            position: point.position,
            surface,
            object: self.scene.instances[surface.instance as usize].object,
            normal: PackedNormal::new(point.geometric),
        }
    }

    /// Casts rays to each light about which there is an `inquiry`, given what is believed, and that could shine on the
    /// point, and to the world.
    fn look_for_lights(
        &self,
        point: &SurfacePoint,
        inquiry: impl Fn(Field, &[u32]) -> Option<Inquiry>,
        lit: &mut [u32],
        rays: &mut RayCounts,
    ) {
        let looks = !point.material.unlit;
        for (number, &field) in self.layout.lights.iter().enumerate() {
            let Some(inquiry) = inquiry(field, lit) else { continue };
            let share =
                if looks { self.light_share(point, number, inquiry, || rays.shadow += 1) } else { 0.0 };
            field.set(lit, share);
        }
        if let Some(field) = self.layout.ambient
            && let Some(inquiry) = inquiry(field, lit)
        {
            let share = if looks { self.world_share(point, inquiry, || rays.ambient += 1) } else { 0.0 };
            field.set(lit, share);
        }
    }

    /// Unit shading normal of a sample, normal map applied, turned to the side from which it was seen. Zero for
    /// the background.
    pub fn shading_normal(&self, eye: &Eye, sample: &SurfaceSample) -> Vec3 {
        if sample.surface.is_background() {
            return Vec3::ZERO;
        }
        let (toward, beam) = eye.seen_from(sample.position);
        self.interaction(&self.point_of(sample), toward, beam).normal
    }

    /// The part of a sample's diffuse radiance that light number `light` brings, as far as it reaches it by `lit`.
    pub fn light_diffuse(&self, eye: &Eye, sample: &SurfaceSample, lit: &[u32], light: usize) -> Vec3 {
        let share = self.layout.lights.get(light).map_or(0.0, |field| field.share(lit));
        if sample.surface.is_background() || share == 0.0 {
            return Vec3::ZERO;
        }
        let (toward, beam) = eye.seen_from(sample.position);
        let point = self.point_of(sample);
        let it = self.interaction(&point, toward, beam);
        let Some(unshadowed) = self.lights[light].unshadowed(it.point.position, it.normal) else {
            return Vec3::ZERO;
        };
        let mut room = None;
        let surface = self.surface(&it, &mut room);
        let irradiance = unshadowed.irradiance * share;
        let leaving = surface.albedo * irradiance * FRAC_1_PI * self.coverage(surface, 0);
        finite(leaving * eye.lets_through(sample.position))
    }

    fn point_of(&self, sample: &SurfaceSample) -> SurfacePoint<'a> {
        SurfacePoint::new(self.scene, self.accel, sample.surface, Side::Towards(sample.normal.direction()))
    }

    #[inline]
    fn interaction<'b>(
        &'b self,
        point: &'b SurfacePoint<'b>,
        toward: Vec3,
        beam: Beam,
    ) -> SurfaceInteraction<'b> {
        let mut it = SurfaceInteraction::geometric(self.scene, point);
        let cosine = point.geometric.dot(toward);
        self.look_up(&mut it, footprints(Vec4::splat(beam.width), Vec4::splat(cosine)).x);
        it
    }

    /// Finds what is known at a point besides its geometry.
    #[inline]
    fn look_up(&self, it: &mut SurfaceInteraction, footprint: f32) {
        it.look_up(self.accel, self.material(it).is_textured, footprint);
    }

    /// What the material says at a point; `room` holds what is not the same everywhere.
    fn surface<'b>(&'b self, it: &SurfaceInteraction, room: &'b mut Option<Surface>) -> &'b Surface {
        self.material(it).surface(it, room)
    }

    fn material(&self, it: &SurfaceInteraction) -> &ShadingMaterial {
        &self.materials[it.point.mesh.material]
    }

    /// What arrives from the world, of which `share` reaches the point.
    fn skylight(&self, it: &SurfaceInteraction, share: f32) -> Incoming {
        if self.world.is_black() {
            return Incoming::default();
        }
        let openness = occlusion(it) * share;
        Incoming { irradiance: self.world.irradiance(it.normal) * openness, openness, ..Incoming::default() }
    }
}

/// Words of 32 shadow bits that a sample of `scene` needs: a bit for each light; eight, a share, for each that has a size if
/// several rays are cast to it; and eight for the world if any is cast to that.
pub fn lit_words(scene: &Scene, options: TraceOptions) -> usize {
    Layout::new(scene, options).words
}
