//! Lights without size (pbrt's delta lights), four at a time. They bring what [`Emitter::unshadowed`] says, but for
//! rounding: nearly all lights of most scenes are such, and every point asks all of them.

use super::lanes::{LANES, Vec3x4};
use super::light::{Cone, Emitter, MIN_DISTANCE, Shape};
use super::visibility::Field;
use glam::{Vec3, Vec4};
use std::array;

/// Lights without size, one to a lane: four of them, or the same in all lanes, for four points.
#[derive(Debug, Clone)]
pub(super) struct DeltaLights {
    /// The light of each lane.
    numbers: [usize; LANES],
    /// Positions; of directional lights, directions to them.
    places: Vec3x4,
    /// -1 for a light that stands at a position, 0 for a directional one.
    stands: Vec4,
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
    /// Unit directions to the lights.
    pub to_lights: Vec3x4,
    /// Their cosines to the normals.
    pub cosines: Vec4,
}

/// One light, or none, as it goes into a lane.
#[derive(Clone, Copy)]
struct Lane {
    number: usize,
    place: Vec3,
    stands: f32,
    per_range: f32,
    cone: Cone,
    intensity: Vec3,
}

impl Lane {
    const EMPTY: Self = Self {
        number: 0,
        place: Vec3::ZERO,
        stands: 0.0,
        per_range: 0.0,
        // Shines all around.
        cone: Cone { direction: Vec3::ZERO, scale: 0.0, offset: 1.0 },
        intensity: Vec3::ZERO,
    };

    fn of(number: usize, light: &Emitter) -> Self {
        let intensity = light.intensity;
        match light.shape {
            Shape::Sphere { position, cone, .. } => Self {
                number,
                place: position,
                stands: -1.0,
                per_range: light.per_range,
                cone: cone.unwrap_or(Self::EMPTY.cone),
                intensity,
            },
            Shape::Directional { to_light, .. } => Self { number, place: to_light, intensity, ..Self::EMPTY },
            Shape::Panel(_) => Self::EMPTY,
        }
    }
}

/// Whether a light has no size, and its bit says all of its shadow: one that has a size at another time has a share.
pub(super) fn is_delta(light: &Emitter, field: Field) -> bool {
    !light.has_size() && !field.is_share()
}

/// Those of `lights` that have no size, with their numbers.
fn delta<'l>(lights: &'l [Emitter], fields: &[Field]) -> impl Iterator<Item = (usize, &'l Emitter)> {
    let all = lights.iter().enumerate().zip(fields);
    all.filter(|&((_, light), &field)| is_delta(light, field)).map(|(light, _)| light)
}

impl DeltaLights {
    /// Those of `lights` that have no size, four at a time.
    pub fn groups(lights: &[Emitter], fields: &[Field]) -> Vec<Self> {
        let delta: Vec<_> = delta(lights, fields).map(|(number, light)| Lane::of(number, light)).collect();
        let lanes = |group: &[Lane]| array::from_fn(|lane| group.get(lane).copied().unwrap_or(Lane::EMPTY));
        delta.chunks(LANES).map(|group| Self::new(lanes(group))).collect()
    }

    /// Each of `lights` that has no size by itself, in all lanes, with the field of its shadow bit.
    pub fn singles(lights: &[Emitter], fields: &[Field]) -> Vec<(Field, Self)> {
        let single = |(number, light)| (fields[number], Self::new([Lane::of(number, light); LANES]));
        delta(lights, fields).map(single).collect()
    }

    fn new(lanes: [Lane; LANES]) -> Self {
        let each = |value: fn(&Lane) -> f32| Vec4::from_array(lanes.each_ref().map(value));
        let color = |lane: Lane| match lane.intensity.max_element() {
            most if most > 0.0 => lane.intensity / most,
            _ => Vec3::ZERO,
        };
        Self {
            numbers: lanes.map(|lane| lane.number),
            places: Vec3x4::of(|lane| lanes[lane].place),
            stands: each(|lane| lane.stands),
            per_range2: each(|lane| lane.per_range * lane.per_range),
            cone_axes: Vec3x4::of(|lane| -lanes[lane].cone.direction),
            cone_scales: each(|lane| lane.cone.scale),
            cone_offsets: each(|lane| lane.cone.offset),
            intensities: each(|lane| lane.intensity.max_element().max(0.0)),
            colors: Vec3x4::of(|lane| color(lanes[lane])),
        }
    }

    /// The light of a lane.
    pub fn number(&self, lane: usize) -> usize {
        self.numbers[lane]
    }

    /// What the lights bring to surfaces at `points` with unit `normals`.
    #[inline]
    pub fn unshadowed(&self, points: Vec3x4, normals: Vec3x4) -> Unshadowed4 {
        let along = points * self.stands + self.places;
        let square = along.length_squared();
        let per_distance = Vec4::ONE / square.sqrt();
        let to_lights = along * per_distance;
        let near = per_distance.min(Vec4::splat(1.0 / MIN_DISTANCE));
        let relative = square * self.per_range2;
        let window = (Vec4::ONE - relative * relative).clamp(Vec4::ZERO, Vec4::ONE);
        let cone = to_lights.dot(self.cone_axes) * self.cone_scales + self.cone_offsets;
        let cone = cone.clamp(Vec4::ZERO, Vec4::ONE);
        let cosines = to_lights.dot(normals);
        let strengths = self.intensities * (near * near) * window * (cone * cone) * cosines;
        // A light that stands on the point itself has no direction: NaN, which is not above 0.
        let strengths = Vec4::select(strengths.cmpgt(Vec4::ZERO), strengths, Vec4::ZERO);
        Unshadowed4 { strengths, to_lights, cosines }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Way;
    use crate::scene::{LightKind, Scene};
    use crate::trace::TraceOptions;
    use crate::trace::visibility::Layout;
    use glam::{DAffine3, DVec3};

    /// Lights of all kinds, more than one group of them, among which one has a size.
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
        scene.lights[3].size = 0.2;
        scene
    }

    /// As they are lit with soft shadows.
    fn prepared() -> (Vec<Emitter>, Layout, Vec<DeltaLights>) {
        let scene = scene();
        let layout = Layout::new(&scene, TraceOptions { light_samples: 4, ..TraceOptions::default() });
        let pose = scene.pose(0.0);
        let lights: Vec<_> = pose.lights.iter().map(|l| Emitter::new(l, DVec3::ZERO)).collect();
        let groups = DeltaLights::groups(&lights, &layout.lights);
        (lights, layout, groups)
    }

    #[test]
    fn four_lights_bring_what_each_of_them_brings() {
        let (lights, layout, groups) = prepared();
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
            let delta = lights.iter().zip(&layout.lights).filter(|&(light, &field)| is_delta(light, field));
            let each = delta.filter_map(|(light, _)| light.unshadowed(point, normal));
            let expected: Vec3 = each.map(|unshadowed| unshadowed.irradiance).sum();
            assert!((sum - expected).length() <= 1e-5 * expected.length(), "{sum} {expected}");
            shining += u32::from(expected != Vec3::ZERO);
        }
        assert!(shining > 500 && groups.len() == 2);
    }

    #[test]
    fn a_light_on_the_point_itself_brings_nothing() {
        let (lights, _, groups) = prepared();
        let Way::From(place, _) = lights[0].way(false) else { panic!("a point light") };
        let Unshadowed4 { strengths, .. } =
            groups[0].unshadowed(Vec3x4::splat(place), Vec3x4::splat(Vec3::X));
        assert!(strengths.x == 0.0 && strengths.w > 0.0, "{strengths}");
    }
}
