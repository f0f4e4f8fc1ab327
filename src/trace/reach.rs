//! What reaches a point of lights and the world: the rays that find it out.
//!
//! Of a light that has a size, the share is found that reaches the point; what all of it would bring is known in closed
//! form. The share is a ratio of two sums over the same parts of the light, those that are seen over all, so it has no
//! noise where nothing or everything is in the way (Heitz, Hill and McGuire 2018, *Combining Analytic Direct Illumination
//! and Stochastic Shadows*).

use super::Tracer;
use super::light::Arriving;
use super::point::SurfacePoint;
use super::sequence::{MIDDLE, cosine_hemisphere, hash, sobol};
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, TAU};

/// Weights of linear Rec.709 in luminance.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// A sum of what is seen over a sum of all.
#[derive(Default)]
struct Ratio {
    seen: f32,
    all: f32,
}

impl Ratio {
    /// Adds a part of this weight, and asks whether it is seen unless it weighs nothing.
    fn add(&mut self, weight: f32, is_seen: impl FnOnce() -> bool) {
        if weight > 0.0 {
            self.all += weight;
            self.seen += if is_seen() { weight } else { 0.0 };
        }
    }

    fn share(&self) -> f32 {
        if self.all > 0.0 { self.seen / self.all } else { 0.0 }
    }
}

impl Tracer<'_> {
    /// The share of light number `number` that reaches the point, by rays to those parts of it that could shine there:
    /// in range, within the cone, and in front of the surface itself. Whether a bumped or smoothed normal faces it does
    /// not matter here: what reaches the point must not depend on what textures say under one eye's beam.
    ///
    /// A single ray goes to the light's middle. Calls `count` for each ray.
    pub(super) fn light_share(&self, point: &SurfacePoint, number: usize, mut count: impl FnMut()) -> f32 {
        let light = &self.lights[number];
        let samples = if light.has_size() { self.options.light_samples } else { 1 };
        let seed = hash(point.seed(), number as u32);
        let mut ratio = Ratio::default();
        for i in 0..samples {
            let u = if samples == 1 { MIDDLE } else { sobol(i, seed) };
            let Some(arriving) = light.arriving(point.position, u) else { continue };
            let cos = point.geometric.dot(arriving.to_light);
            ratio.add(arriving.irradiance.max_element() * cos, || {
                count();
                self.reaches(point, &arriving)
            });
        }
        ratio.share()
    }

    /// The share of the world's light that reaches the point, by rays all around, denser along the normal; calls `count`
    /// for each. All of it, where no rays are asked for or those that were cast found a black sky.
    pub(super) fn world_share(&self, point: &SurfacePoint, mut count: impl FnMut()) -> f32 {
        let samples = self.options.ambient_samples;
        // Lights have the numbers before.
        let seed = hash(point.seed(), self.lights.len() as u32);
        // What one ray stands for.
        let angle = (TAU / samples as f32).sqrt().min(FRAC_PI_2);
        let mut ratio = Ratio::default();
        for i in 0..samples {
            let direction = cosine_hemisphere(sobol(i, seed), point.geometric);
            ratio.add(self.world.radiance(direction, angle).dot(LUMINANCE), || {
                count();
                self.accel.unoccluded(self.scene, point.start(direction), direction, f32::INFINITY)
            });
        }
        if ratio.all > 0.0 { ratio.share() } else { 1.0 }
    }

    /// Whether nothing stands in the light's way. Stops a little before the light, which may itself stand on a surface.
    fn reaches(&self, point: &SurfacePoint, arriving: &Arriving) -> bool {
        let from = point.start(arriving.to_light);
        self.accel.unoccluded(self.scene, from, arriving.to_light, arriving.distance * (1.0 - 1e-4))
    }
}
