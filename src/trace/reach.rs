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
use super::visibility::Inquiry;
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, TAU};

/// Weights of linear Rec.709 in luminance.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Of all rays, so many are cast to see whether they settle a share: one in so many, but no fewer than the least. In a
/// sequence that fills a square evenly, the first two lie in opposite quarters, and the first four in one each.
const CONFIRMING: Few = Few { one_in: 8, least: 2 };
const SETTLING: Few = Few { one_in: 4, least: 4 };

struct Few {
    one_in: u32,
    least: u32,
}

impl Few {
    fn of(&self, rays: u32) -> u32 {
        (rays / self.one_in).clamp(self.least.min(rays), rays)
    }
}

/// A share that a few rays find speaks against one that is believed if they are this many standard deviations apart.
const DOUBT: f32 = 2.0;

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

    /// None where nothing has been added.
    fn share(&self) -> Option<f32> {
        (self.all > 0.0).then(|| self.seen / self.all)
    }
}

impl Inquiry {
    /// Finds a share by up to so many rays: `cast` casts one and adds what it finds. None where no part weighs anything.
    fn answer(self, rays: u32, mut cast: impl FnMut(u32, &mut Ratio)) -> Option<f32> {
        let (mut ratio, mut next) = (Ratio::default(), 0);
        let mut cast_until = |end: u32| {
            (next..end).for_each(|i| cast(i, &mut ratio));
            next = end;
            ratio.share()
        };
        if let Self::Part(part) = self {
            return cast_until(((part * rays as f32).ceil() as u32).clamp(1, rays));
        }
        if let Self::Confirm(believed) = self {
            let few = CONFIRMING.of(rays);
            let deviation = (believed * (1.0 - believed) / few as f32).sqrt();
            if let Some(found) = cast_until(few)
                && (found - believed).abs() <= DOUBT * deviation
            {
                // As if these rays were cast in place of as many of those by which it was found.
                return Some(believed + (found - believed) * few as f32 / rays as f32);
            }
        }
        let found = cast_until(SETTLING.of(rays));
        if found == Some(0.0) || found == Some(1.0) { found } else { cast_until(rays) }
    }
}

impl Tracer<'_> {
    /// The share of light number `number` that reaches the point, by rays to those parts of it that could shine there:
    /// in range, within the cone, and in front of the surface itself. Whether a bumped or smoothed normal faces it does
    /// not matter here: what reaches the point must not depend on what textures say under one eye's beam.
    ///
    /// A single ray goes to the light's middle. Calls `count` for each ray.
    pub(super) fn light_share(
        &self,
        point: &SurfacePoint,
        number: usize,
        inquiry: Inquiry,
        mut count: impl FnMut(),
    ) -> f32 {
        let light = &self.lights[number];
        let samples = if light.has_size() { self.options.light_samples.max(1) } else { 1 };
        let seed = hash(point.seed(), number as u32);
        let share = inquiry.answer(samples, |i, ratio| {
            let u = if samples == 1 { MIDDLE } else { sobol(i, seed) };
            let Some(arriving) = light.arriving(point.position, u) else { return };
            let cos = point.geometric.dot(arriving.to_light);
            ratio.add(arriving.irradiance.max_element() * cos, || {
                count();
                self.reaches(point, &arriving)
            });
        });
        share.unwrap_or(0.0)
    }

    /// The share of the world's light that reaches the point, by rays all around, denser along the normal; calls `count`
    /// for each. All of it, where those that were cast found a black sky.
    pub(super) fn world_share(&self, point: &SurfacePoint, inquiry: Inquiry, mut count: impl FnMut()) -> f32 {
        let samples = self.options.ambient_samples;
        // Most points see all of a light or nothing of it, but hardly any all of the sky: no few rays settle that.
        let inquiry = if inquiry == Inquiry::Anew { Inquiry::Part(1.0) } else { inquiry };
        // Lights have the numbers before.
        let seed = hash(point.seed(), self.lights.len() as u32);
        // What one ray stands for.
        let angle = (TAU / samples as f32).sqrt().min(FRAC_PI_2);
        let share = inquiry.answer(samples, |i, ratio| {
            let direction = cosine_hemisphere(sobol(i, seed), point.geometric);
            ratio.add(self.world.radiance(direction, angle).dot(LUMINANCE), || {
                count();
                self.accel.unoccluded(self.scene, point.start(direction), direction, f32::INFINITY)
            });
        });
        share.unwrap_or(1.0)
    }

    /// Whether nothing stands in the light's way. Stops a little before the light, which may itself stand on a surface.
    fn reaches(&self, point: &SurfacePoint, arriving: &Arriving) -> bool {
        let from = point.start(arriving.to_light);
        self.accel.unoccluded(self.scene, from, arriving.to_light, arriving.distance * (1.0 - 1e-4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The answer where only the rays with these numbers pass, and how many are cast.
    fn answer(inquiry: Inquiry, rays: u32, passes: impl Fn(u32) -> bool) -> (Option<f32>, u32) {
        let mut count = 0;
        let share = inquiry.answer(rays, |i, ratio| {
            assert_eq!(i, count);
            count += 1;
            ratio.add(1.0, || passes(i));
        });
        (share, count)
    }

    #[test]
    fn a_part_of_the_rays_is_at_least_one_and_at_most_all() {
        for (part, expected) in [(0.0, 1), (0.04, 1), (0.26, 5), (1.0, 16), (1.5, 16)] {
            assert_eq!(answer(Inquiry::Part(part), 16, |_| true), (Some(1.0), expected), "{part}");
        }
    }

    #[test]
    fn rays_that_agree_settle_it_and_others_do_not() {
        assert_eq!(answer(Inquiry::Anew, 16, |_| false), (Some(0.0), 4));
        assert_eq!(answer(Inquiry::Anew, 64, |_| true), (Some(1.0), 16));
        assert_eq!(answer(Inquiry::Anew, 16, |i| i < 3), (Some(3.0 / 16.0), 16));
        assert_eq!(answer(Inquiry::Anew, 2, |_| true), (Some(1.0), 2));
    }

    #[test]
    fn what_is_believed_stands_until_it_is_contradicted() {
        assert_eq!(answer(Inquiry::Confirm(1.0), 16, |_| true), (Some(1.0), 2));
        assert_eq!(answer(Inquiry::Confirm(0.5), 16, |_| true), (Some(0.5 + 0.5 / 8.0), 2));
        assert_eq!(answer(Inquiry::Confirm(1.0), 16, |_| false), (Some(0.0), 4));
        assert_eq!(answer(Inquiry::Confirm(1.0), 16, |i| i % 2 == 0), (Some(0.5), 16));
    }

    #[test]
    fn nothing_is_said_of_a_light_that_cannot_shine_there() {
        for inquiry in [Inquiry::Part(1.0), Inquiry::Anew, Inquiry::Confirm(0.5)] {
            assert_eq!(inquiry.answer(16, |_, _| {}), None, "{inquiry:?}");
        }
    }
}
