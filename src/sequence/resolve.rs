//! From samples to a frame's layers: the paper's enhancement of every pixel, traced or reused alike.

use super::antialias::Antialias;
use super::mattes::MatteNames;
use super::{Observer, Settings};
use crate::accel::Displaced;
use crate::frame::{Aov, Frame, FrameKind, FrameStats, RayCounts, SurfaceSample, Window};
use crate::infer::BuzzBuffer;
use crate::scene::{Scene, View};
use crate::trace::{Eye, KnownLight, Radiance, SHADED_AT_ONCE, Shader, Tracer};
use glam::{DMat4, DVec3, Vec3, Vec4};
use rayon::iter::Either;
use rayon::prelude::*;

/// Everything that a pixel's final values depend on besides its sample.
pub(super) struct Resolver<'a> {
    pub scene: &'a Scene,
    pub settings: &'a Settings,
    /// What the settings' exposure multiplies radiance by.
    pub gain: f32,
    pub tracer: &'a Tracer<'a>,
    /// Of the shot's view.
    pub eye: Eye,
    /// Asked after every few pixels whether to go on.
    pub observer: &'a dyn Observer,
    /// Sample positions are relative to this.
    pub origin: DVec3,
    /// The frame after, where motion is asked for and there is one.
    pub next: Option<Neighbour>,
    /// The frame before.
    pub previous: Option<Neighbour>,
    /// What mirrored rays need not ask of light; none where all of them ask.
    pub known: Option<&'a KnownLight<'a>>,
    /// Names for mattes; none where not asked for.
    pub names: Option<&'a MatteNames>,
}

/// The layers of one pixel that come from shading.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pixel {
    color: [f32; 4],
    diffuse: Vec3,
    specular: Vec3,
    emission: Vec3,
}

impl Pixel {
    /// Adds a share of another.
    pub fn add(&mut self, other: &Self, weight: f32) {
        self.color.iter_mut().zip(other.color).for_each(|(sum, value)| *sum += weight * value);
        self.diffuse += weight * other.diffuse;
        self.specular += weight * other.specular;
        self.emission += weight * other.emission;
    }

    /// The colour as a display shows it: clipped, and close to evenly spaced to the eye.
    pub fn encoded(&self) -> Vec4 {
        Vec4::from_array(self.color).clamp(Vec4::ZERO, Vec4::ONE).map(f32::sqrt)
    }
}

impl<'a> Resolver<'a> {
    /// A shader for the samples of one thread.
    pub(super) fn shader(&self) -> Shader<'a, 'a> {
        self.tracer.shader().knowing(self.known)
    }

    /// Fills the layers that the settings ask for; returns the rays that reflection and refraction took.
    pub fn resolve(&self, buffer: &BuzzBuffer, antialias: &mut Antialias, frame: &mut Frame) -> RayCounts {
        let window = self.settings.window;
        frame.window = window;
        let pixels = window.pixels();
        frame.color.resize(pixels, [0.0; 4]);
        let wants = |aov| self.settings.aovs.contains(aov);
        let size = |aov| if wants(aov) { pixels } else { 0 };
        frame.diffuse.resize(size(Aov::Diffuse), [0.0; 3]);
        frame.specular.resize(size(Aov::Specular), [0.0; 3]);
        frame.emission.resize(size(Aov::Emission), [0.0; 3]);
        let counts = match self.settings.aa {
            ..2 => self.shade(buffer, frame),
            _ => self.shade_subpixels(buffer, antialias, frame),
        };

        self.fill(&mut frame.depth, size(Aov::Depth), |i| finite_depth(buffer.z[i]));
        self.fill(&mut frame.class, size(Aov::Class), |i| buffer.class[i] as u8);
        self.fill(&mut frame.object, size(Aov::Object), |i| buffer.object[i]);
        self.fill(&mut frame.normal, size(Aov::Normal), |i| {
            self.on_surface(buffer, i, |s| self.tracer.shading_normal(&self.eye, s))
        });
        self.fill(&mut frame.position, size(Aov::Position), |i| {
            self.on_surface(buffer, i, |s| (s.position.as_dvec3() + self.origin).as_vec3())
        });
        self.fill(&mut frame.forward, size(Aov::Motion), |i| {
            self.motion(&buffer.sample(i), self.next.as_ref())
        });
        self.fill(&mut frame.backward, size(Aov::Motion), |i| {
            self.motion(&buffer.sample(i), self.previous.as_ref())
        });
        let lights = if wants(Aov::Lights) { self.scene.lights.len() } else { 0 };
        frame.lights.resize_with(lights, Default::default);
        for (number, (name, layer)) in frame.lights.iter_mut().enumerate() {
            name.clone_from(&self.scene.lights[number].name);
            self.fill(layer, pixels, |i| match self.settings.aa {
                ..2 => self.on_surface(buffer, i, |s| {
                    self.tracer.light_diffuse(&self.eye, s, buffer.lit(i), number) * self.gain
                }),
                _ => self.mean_light(buffer, antialias, i, number).map(|value| value * self.gain),
            });
        }
        self.fill_mattes(buffer, antialias, &mut frame.mattes);
        counts
    }

    /// Computes a layer of `size` pixels in parallel.
    fn fill<T: Send + Clone + Default>(
        &self,
        layer: &mut Vec<T>,
        size: usize,
        value: impl Fn(usize) -> T + Sync,
    ) {
        layer.resize(size, T::default());
        layer.par_chunks_mut(FILLED_AT_ONCE).enumerate().for_each(|(chunk, texels)| {
            if self.observer.stop_requested().is_none() {
                let first = chunk * FILLED_AT_ONCE;
                texels.iter_mut().zip(first..).for_each(|(texel, i)| *texel = value(i));
            }
        });
    }

    fn shade(&self, buffer: &BuzzBuffer, frame: &mut Frame) -> RayCounts {
        let shader = || self.shader();
        self.fill_rows(frame, buffer.width(), shader, |shader, first, pixels, counts| {
            self.shade_pixels(shader, buffer, first, pixels, counts);
        })
    }

    /// Shades a few pixels of a buffer, from number `first` on.
    pub(super) fn shade_pixels(
        &self,
        shader: &mut Shader<'_, '_>,
        buffer: &BuzzBuffer,
        first: usize,
        pixels: &mut [Pixel],
        counts: &mut RayCounts,
    ) {
        let mut samples = [SurfaceSample::background(Vec3::ZERO); SHADED_AT_ONCE];
        let mut lit = [[].as_slice(); SHADED_AT_ONCE];
        for (k, i) in (first..first + pixels.len()).enumerate() {
            samples[k] = buffer.sample(i);
            lit[k] = buffer.lit(i);
        }
        self.shade_four(shader, &self.eye, &samples[..pixels.len()], lit, pixels, counts);
    }

    /// Fills the layers that come from shading, row by row and a few pixels of a row at a time; each row has a `state` of
    /// its own.
    pub(super) fn fill_rows<S>(
        &self,
        frame: &mut Frame,
        width: usize,
        state: impl Fn() -> S + Sync,
        values: impl Fn(&mut S, usize, &mut [Pixel], &mut RayCounts) + Sync,
    ) -> RayCounts {
        let fill_row = |y: usize, row: Row<'_>| {
            let mut counts = RayCounts::default();
            if self.observer.stop_requested().is_some() {
                return counts;
            }
            let mut state = state();
            let mut pixels = [Pixel::default(); SHADED_AT_ONCE];
            for (k, color) in row.color.chunks_mut(SHADED_AT_ONCE).enumerate() {
                let (x, pixels) = (k * SHADED_AT_ONCE, &mut pixels[..color.len()]);
                values(&mut state, y * width + x, pixels, &mut counts);
                color.iter_mut().zip(&*pixels).for_each(|(texel, pixel)| *texel = pixel.color);
                for (layer, value) in [
                    (&mut *row.diffuse, (|pixel| pixel.diffuse) as fn(&Pixel) -> Vec3),
                    (&mut *row.specular, |pixel| pixel.specular),
                    (&mut *row.emission, |pixel| pixel.emission),
                ] {
                    let layer = layer.iter_mut().skip(x);
                    layer.zip(&*pixels).for_each(|(texel, pixel)| *texel = value(pixel).to_array());
                }
            }
            counts
        };
        rows(frame, width).enumerate().map(|(y, row)| fill_row(y, row)).sum()
    }

    /// Shades samples, under their shadow bits, of pixels or sub-pixels as wide as `eye` has them.
    pub(super) fn shade_four(
        &self,
        shader: &mut Shader<'_, '_>,
        eye: &Eye,
        samples: &[SurfaceSample],
        lit: [&[u32]; SHADED_AT_ONCE],
        pixels: &mut [Pixel],
        counts: &mut RayCounts,
    ) {
        let mut radiance = Default::default();
        shader.shade_four(eye, samples, lit, counts, &mut radiance);
        for (pixel, radiance) in pixels.iter_mut().zip(&radiance[..samples.len()]) {
            *pixel = self.pixel(radiance);
        }
    }

    fn pixel(&self, radiance: &Radiance) -> Pixel {
        let (diffuse, specular, emission) =
            (radiance.diffuse * self.gain, radiance.specular * self.gain, radiance.emission * self.gain);
        let rgb = diffuse + specular + emission;
        Pixel { color: rgb.extend(radiance.alpha).to_array(), diffuse, specular, emission }
    }

    /// A value of a pixel that shows a surface; 0 for the background.
    fn on_surface(&self, buffer: &BuzzBuffer, i: usize, value: impl Fn(&SurfaceSample) -> Vec3) -> [f32; 3] {
        let sample = buffer.sample(i);
        if sample.surface.is_background() { [0.0; 3] } else { value(&sample).to_array() }
    }

    /// Pixels, x right and y up, from where the sample is on the image to where it is in the `other` frame.
    fn motion(&self, sample: &SurfaceSample, other: Option<&Neighbour>) -> [f32; 2] {
        let Some(other) = other else { return [0.0; 2] };
        let here = sample.position.as_dvec3();
        let (here, there) = if sample.surface.is_background() {
            (here.extend(0.0), here.extend(0.0))
        } else {
            let there =
                other.surfaces.as_ref().map_or(sample.position, |s| s.point(self.scene, sample.surface));
            (here.extend(1.0), there.as_dvec3().extend(1.0))
        };
        let (a, b) = (other.raster[0] * here, other.raster[1] * there);
        // What has come behind the other eye has left the image on its way: it moves towards where it passed the eye.
        let near = NEAREST * a.w;
        let b = if b.w < near && a.w > b.w { a.lerp(b, (a.w - near) / (a.w - b.w)) } else { b };
        if a.w > 0.0 && b.w > 0.0 {
            [(b.x / b.w - a.x / a.w) as f32, (a.y / a.w - b.y / b.w) as f32]
        } else {
            [0.0; 2]
        }
    }
}

/// What comes nearer to the eye than this share of its depth is taken to have passed it.
const NEAREST: f64 = 1e-3;

/// The frame before or after, as motion needs it.
pub(super) struct Neighbour {
    /// `raster_from_world` of the shot itself and of that frame, for positions relative to the resolver's origin.
    pub raster: [DMat4; 2],
    /// Where surfaces are then; none where nothing but the camera moves.
    pub surfaces: Option<Displaced>,
}

/// One row of the layers that shading fills; empty where not asked for.
struct Row<'a> {
    color: &'a mut [[f32; 4]],
    diffuse: &'a mut [[f32; 3]],
    specular: &'a mut [[f32; 3]],
    emission: &'a mut [[f32; 3]],
}

fn rows(frame: &mut Frame, width: usize) -> impl IndexedParallelIterator<Item = Row<'_>> {
    let height = frame.color.len() / width;
    let [diffuse, specular, emission] = [&mut frame.diffuse, &mut frame.specular, &mut frame.emission]
        .map(|layer| rows_or_none(layer, width, height));
    let layers = (frame.color.par_chunks_mut(width), diffuse, specular, emission);
    layers.into_par_iter().map(|(color, diffuse, specular, emission)| Row {
        color,
        diffuse,
        specular,
        emission,
    })
}

/// The rows of a layer; as many without a pixel if it is not asked for.
fn rows_or_none<T: Send + Sync>(
    layer: &mut [T],
    width: usize,
    height: usize,
) -> impl IndexedParallelIterator<Item = &mut [T]> {
    if layer.is_empty() {
        Either::Left((0..height).into_par_iter().map(|_| Default::default()))
    } else {
        Either::Right(layer.par_chunks_mut(width))
    }
}

/// So many pixels of a layer are filled between two looks at whether to go on.
const FILLED_AT_ONCE: usize = 1 << 12;

fn finite_depth(z: f32) -> f32 {
    z.min(Frame::FAR_DEPTH)
}

/// Reused samples that something hides from the eye (the audit).
pub(super) fn count_hidden(
    tracer: &Tracer<'_>,
    observer: &dyn Observer,
    view: &View,
    buffer: &BuzzBuffer,
) -> u64 {
    let (eye, pixels) = (tracer.eye(view), (0..buffer.class.len()).into_par_iter());
    let hidden = |&i: &usize| {
        let asked = buffer.class[i].is_reused() && observer.stop_requested().is_none();
        asked && tracer.is_hidden(&eye, &buffer.sample(i))
    };
    let finer = buffer.finer.levels.iter().flat_map(|level| level.samples.iter().zip(&level.reused));
    let is_hidden = |&(sample, &reused): &(&SurfaceSample, &bool)| {
        reused && observer.stop_requested().is_none() && tracer.is_hidden(&eye, sample)
    };
    (pixels.filter(hidden).count() + finer.par_bridge().filter(is_hidden).count()) as u64
}

/// A frame without pixels.
pub(super) fn empty_frame(view: View) -> Frame {
    Frame {
        number: 0,
        eye: None,
        kind: FrameKind::Traced,
        view,
        camera: String::new(),
        window: Window { x: 0, y: 0, width: 0, height: 0 },
        color: Vec::new(),
        depth: Vec::new(),
        class: Vec::new(),
        normal: Vec::new(),
        position: Vec::new(),
        forward: Vec::new(),
        backward: Vec::new(),
        object: Vec::new(),
        diffuse: Vec::new(),
        specular: Vec::new(),
        emission: Vec::new(),
        lights: Vec::new(),
        mattes: Vec::new(),
        stats: FrameStats::default(),
    }
}
