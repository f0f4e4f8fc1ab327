//! Punctual lights (`KHR_lights_punctual`), four at a time, those among them that have a size: spheres, and discs in the sky. They
//! bring what [`Emitter::unshadowed`] says, but for rounding: nearly all lights of most scenes are such, and every point asks
//! all of them.

use super::form_factor::disc_shares;
use super::lanes::{LANES, Lanes, Vec3x4};
use super::light::{Cone, Emitter, LEVEL_CONE, MIN_DISTANCE, Shape, heights};
use super::visibility::Field;
use glam::{Vec3, Vec4};
use std::array;

/// Punctual lights, one to a lane: four of them, or the same in all lanes, for four points.
#[derive(Debug, Clone)]
pub(super) struct PunctualLights {
    lanes: [Lane; LANES],
    /// Positions; of directional lights, directions to them.
    places: Vec3x4,
    /// -1 for a light that stands at a position, 0 for a directional one.
    stands: Vec4,
    /// Radii of spheres; of directional lights, the sine of half the angle that each fills.
    radii: Vec4,
    /// Whether any has a size.
    has_size: bool,
    /// One over the distance within which a light grows no brighter.
    most_near: Vec4,
    /// The square of one over the range; 0 where it is not limited.
    per_range2: Vec4,
    /// Against the directions in which spots point.
    cone_axes: Vec3x4,
    cone_scales: Vec4,
    cone_offsets: Vec4,
    /// The largest channel of each light's intensity, W/sr or W/m2; 0 in a lane without a light.
    intensities: Vec4,
    /// Each light's colour for an intensity of 1.
    pub colors: Vec3x4,
}

/// What lights bring to surfaces where nothing stands in their way, lane by lane.
pub(super) struct Unshadowed4 {
    /// Irradiance in the largest channel, W/m2, Lambert's cosine included; 0 where nothing arrives.
    pub strengths: Vec4,
    /// Unit directions to the lights' middles.
    pub to_lights: Vec3x4,
    /// Their cosines to the normals.
    pub cosines: Vec4,
    /// How far the lights are spread over the sky: 1 less the cosine of half the angle that each fills.
    pub heights: Vec4,
}

/// One light, or none, as it goes into a lane.
#[derive(Debug, Clone)]
struct Lane {
    number: usize,
    light: Emitter,
}

/// Shines all around.
const ALL_AROUND: Cone = Cone { direction: Vec3::ZERO, scale: 0.0, offset: 1.0 };

impl Lane {
    fn place(&self) -> Vec3 {
        match self.light.shape {
            Shape::Sphere { position, .. } => position,
            Shape::Directional { to_light, .. } => to_light,
            Shape::Panel(_) => Vec3::ZERO,
        }
    }

    fn is_sphere(&self) -> bool {
        matches!(self.light.shape, Shape::Sphere { .. })
    }

    fn radius(&self) -> f32 {
        match self.light.shape {
            Shape::Sphere { radius, .. } => radius,
            Shape::Directional { sin, .. } => sin,
            Shape::Panel(_) => 0.0,
        }
    }

    fn cone(&self) -> Cone {
        match self.light.shape {
            Shape::Sphere { cone, .. } => cone.unwrap_or(ALL_AROUND),
            _ => ALL_AROUND,
        }
    }
}

/// Whether a light is one of those here.
pub(super) fn is_punctual(light: &Emitter) -> bool {
    !matches!(light.shape, Shape::Panel(_))
}

impl PunctualLights {
    /// The punctual ones of `lights`, four at a time.
    pub fn groups(lights: &[Emitter]) -> Vec<Self> {
        let dark = Lane { number: 0, light: Emitter::DARK };
        let lanes: Vec<_> = punctual(lights).collect();
        let group = |group: &[Lane]| array::from_fn(|lane| group.get(lane).unwrap_or(&dark).clone());
        lanes.chunks(LANES).map(|lanes| Self::new(group(lanes))).collect()
    }

    /// Each of the punctual ones of `lights` by itself, in all lanes, with the field of its shadow bits.
    pub fn singles(lights: &[Emitter], fields: &[Field]) -> Vec<(Field, Self)> {
        let single = |lane: Lane| (fields[lane.number], Self::new(array::from_fn(|_| lane.clone())));
        punctual(lights).map(single).collect()
    }

    fn new(lanes: [Lane; LANES]) -> Self {
        let each = |value: fn(&Lane) -> f32| Vec4::from_array(lanes.each_ref().map(value));
        let color = |lane: &Lane| match lane.light.intensity.max_element() {
            most if most > 0.0 => lane.light.intensity / most,
            _ => Vec3::ZERO,
        };
        Self {
            places: Vec3x4::of(|lane| lanes[lane].place()),
            stands: each(|lane| if lane.is_sphere() { -1.0 } else { 0.0 }),
            radii: each(Lane::radius),
            has_size: lanes.iter().any(|lane| lane.light.has_size()),
            most_near: each(|lane| {
                1.0 / if lane.is_sphere() { lane.radius().max(MIN_DISTANCE) } else { 1.0 }
            }),
            per_range2: each(|lane| if lane.is_sphere() { lane.light.per_range.powi(2) } else { 0.0 }),
            cone_axes: Vec3x4::of(|lane| -lanes[lane].cone().direction),
            cone_scales: each(|lane| lane.cone().scale),
            cone_offsets: each(|lane| lane.cone().offset),
            intensities: each(|lane| lane.light.intensity.max_element().max(0.0)),
            colors: Vec3x4::of(|lane| color(&lanes[lane])),
            lanes,
        }
    }

    /// The number of the light of a lane.
    pub fn number(&self, lane: usize) -> usize {
        self.lanes[lane].number
    }

    /// The light of a lane.
    pub fn light(&self, lane: usize) -> &Emitter {
        &self.lanes[lane].light
    }

    /// Whether any of them has a size.
    pub fn has_size(&self) -> bool {
        self.has_size
    }

    /// What the lights bring to surfaces at `points` with unit `normals`.
    #[inline]
    pub fn unshadowed(&self, points: Vec3x4, normals: Vec3x4) -> Unshadowed4 {
        let along = points * self.stands + self.places;
        let square = along.length_squared();
        let per_distance = Vec4::ONE / square.sqrt();
        let to_lights = along * per_distance;
        let near = per_distance.min(self.most_near);
        let relative = square * self.per_range2;
        let window = (Vec4::ONE - relative * relative).clamp(Vec4::ZERO, Vec4::ONE);
        let angular = to_lights.dot(self.cone_axes) * self.cone_scales + self.cone_offsets;
        let cone = angular.clamp(Vec4::ZERO, Vec4::ONE);
        let cosines = to_lights.dot(normals);
        let (mut shares, mut cone, mut spread) = (cosines, cone * cone, Vec4::ZERO);
        if self.has_size {
            let sines = (self.radii * per_distance).min(Vec4::ONE);
            spread = heights(sines);
            shares = disc_shares(cosines, sines);
            // Most spheres lie within the inner cone, or outside of the outer one.
            let most = self.cone_scales * (2.0 * spread).sqrt();
            let changes = Lanes::above_zero(self.cone_scales * sines - LEVEL_CONE)
                & Lanes::above_zero(most + 1.0 - angular)
                & Lanes::above_zero(most + angular);
            let mean = |lane: usize| {
                self.lanes[lane].cone().mean(normals.lane(lane), to_lights.lane(lane), sines[lane])
            };
            cone = changes.replace(cone, mean);
        }
        let strengths = self.intensities * (near * near) * window * cone * shares;
        // A light that stands on the point itself has no direction: NaN, which is not above 0.
        let strengths = Lanes::above_zero(strengths).select(strengths);
        Unshadowed4 { strengths, to_lights, cosines, heights: spread }
    }
}

/// The punctual ones of `lights`.
fn punctual(lights: &[Emitter]) -> impl Iterator<Item = Lane> {
    let all = lights.iter().enumerate().filter(|(_, light)| is_punctual(light));
    all.map(|(number, light)| Lane { number, light: light.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Way;
    use crate::scene::{LightKind, Outline, Scene};
    use glam::{DAffine3, DVec3, Vec2};

    /// Lights of all kinds, more than one group of them, half of which have a size.
    fn scene() -> Scene {
        let mut scene = Scene::default();
        let spot = LightKind::Spot { inner_cone: 0.3, outer_cone: 0.9 };
        let kinds =
            [LightKind::Point, spot, LightKind::Directional, LightKind::Point, LightKind::Point, spot];
        for (i, kind) in kinds.into_iter().enumerate() {
            let place = DAffine3::from_translation(DVec3::new(i as f64 - 2.0, 0.5, 1.5 + 0.1 * i as f64));
            let light = scene.add_light(kind, 3.0 + i as f32, place);
            scene.lights[light].color = Vec3::new(1.0, 0.5, 0.25 * i as f32);
        }
        scene.lights[0].range = Some(4.0);
        for (light, size) in [(0, 0.3), (2, 0.4), (5, 0.5)] {
            scene.lights[light].size = size;
        }
        let panel = LightKind::Area { outline: Outline::Rectangle, size: Vec2::ONE };
        scene.add_light(panel, 2.0, DAffine3::IDENTITY);
        scene
    }

    fn prepared() -> (Vec<Emitter>, Vec<PunctualLights>) {
        let pose = scene().pose(0.0);
        let lights: Vec<_> = pose.lights.iter().map(|l| Emitter::new(l, DVec3::ZERO)).collect();
        let groups = PunctualLights::groups(&lights);
        (lights, groups)
    }

    #[test]
    fn four_lights_bring_what_each_of_them_brings() {
        let (lights, groups) = prepared();
        let mut shining = 0;
        for i in 0..1000u32 {
            let part = |step: u32| (i * step % 97) as f32 / 48.5 - 1.0;
            let point = Vec3::new(part(7), part(11), part(13)) * 3.0;
            let normal = Vec3::new(part(17), part(23), 0.5).normalize();
            let mut sum = Vec3::ZERO;
            for group in &groups {
                let Unshadowed4 { strengths, .. } =
                    group.unshadowed(Vec3x4::splat(point), Vec3x4::splat(normal));
                sum += (group.colors * strengths).sum();
            }
            let each = lights.iter().filter(|l| is_punctual(l)).filter_map(|l| l.unshadowed(point, normal));
            let expected: Vec3 = each.map(|unshadowed| unshadowed.irradiance).sum();
            assert!((sum - expected).length() <= 1e-5 * expected.length(), "{sum} {expected}");
            shining += u32::from(expected != Vec3::ZERO);
        }
        assert!(shining > 500 && groups.len() == 2);
    }

    #[test]
    fn a_light_on_the_point_itself_brings_nothing() {
        let (lights, groups) = prepared();
        let Way::From(place, _) = lights[0].way(false) else { panic!("a point light") };
        let Unshadowed4 { strengths, .. } =
            groups[0].unshadowed(Vec3x4::splat(place), Vec3x4::splat(Vec3::X));
        assert!(strengths.x == 0.0 && strengths.w > 0.0, "{strengths}");
    }
}
