//! Lights without size (pbrt's delta lights), four at a time. They bring what [`Emitter::unshadowed`] says, but for
//! rounding: nearly all lights of most scenes are such, and every point asks all of them.

use super::lanes::{LANES, Lanes, Vec3x4};
use super::light::{Cone, Emitter, MIN_DISTANCE, Shape};
use super::visibility::Field;
use glam::{Mat4, Vec3, Vec4};

/// Four lights whose shadow bits stand side by side.
#[derive(Debug, Clone)]
pub(super) struct DeltaLights {
    /// The light of each lane.
    numbers: [usize; LANES],
    /// The word that holds the shadow bits, and where they start in it.
    word: usize,
    shift: usize,
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
    /// In each column, a light's colour for an intensity of 1.
    colors: Mat4,
}

/// What four lights bring to a surface where nothing stands in their way.
pub(super) struct Unshadowed4 {
    /// Irradiance in the largest channel, W/m2, Lambert's cosine included; 0 where nothing arrives.
    pub strengths: Vec4,
    /// Unit directions to the lights.
    pub to_lights: Vec3x4,
    /// Their cosines to the normal.
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

impl DeltaLights {
    /// Those of `lights` that have no size, by the places of their shadow bits.
    pub fn groups(lights: &[Emitter], fields: &[Field]) -> Vec<Self> {
        let mut groups: Vec<(usize, usize, [Lane; LANES])> = Vec::new();
        for (number, (light, &field)) in lights.iter().zip(fields).enumerate() {
            if !is_delta(light, field) {
                continue;
            }
            let (word, bits) = field.bits_at();
            let bit = bits.trailing_zeros() as usize;
            let shift = bit - bit % LANES;
            let at = groups.iter().position(|&(w, s, _)| (w, s) == (word, shift)).unwrap_or_else(|| {
                groups.push((word, shift, [Lane::EMPTY; LANES]));
                groups.len() - 1
            });
            groups[at].2[bit % LANES] = Lane::of(number, light);
        }
        groups.into_iter().map(|(word, shift, lanes)| Self::new(word, shift, lanes)).collect()
    }

    fn new(word: usize, shift: usize, lanes: [Lane; LANES]) -> Self {
        let each = |value: fn(&Lane) -> f32| Vec4::from_array(lanes.each_ref().map(value));
        let color = |lane: Lane| match lane.intensity.max_element() {
            most if most > 0.0 => (lane.intensity / most).extend(0.0),
            _ => Vec4::ZERO,
        };
        let [a, b, c, d] = lanes.map(color);
        Self {
            numbers: lanes.map(|lane| lane.number),
            word,
            shift,
            places: Vec3x4::new(lanes.map(|lane| lane.place)),
            stands: each(|lane| lane.stands),
            per_range2: each(|lane| lane.per_range * lane.per_range),
            cone_axes: Vec3x4::new(lanes.map(|lane| -lane.cone.direction)),
            cone_scales: each(|lane| lane.cone.scale),
            cone_offsets: each(|lane| lane.cone.offset),
            intensities: each(|lane| lane.intensity.max_element().max(0.0)),
            colors: Mat4::from_cols(a, b, c, d),
        }
    }

    /// The light of a lane.
    pub fn number(&self, lane: usize) -> usize {
        self.numbers[lane]
    }

    /// The lights that reach a sample, as its shadow words say.
    #[inline]
    pub fn lit(&self, words: &[u32]) -> Lanes {
        Lanes::from_bits(words.get(self.word).map_or(0, |word| word >> self.shift))
    }

    /// What the lights bring to a surface at `point` with unit `normal`.
    #[inline]
    pub fn unshadowed(&self, point: Vec3, normal: Vec3) -> Unshadowed4 {
        let along = Vec3x4::splat(point) * self.stands + self.places;
        let square = along.length_squared();
        let per_distance = Vec4::ONE / square.sqrt();
        let to_lights = along * per_distance;
        let near = per_distance.min(Vec4::splat(1.0 / MIN_DISTANCE));
        let relative = square * self.per_range2;
        let window = (Vec4::ONE - relative * relative).clamp(Vec4::ZERO, Vec4::ONE);
        let cone = to_lights.dot(self.cone_axes) * self.cone_scales + self.cone_offsets;
        let cone = cone.clamp(Vec4::ZERO, Vec4::ONE);
        let cosines = to_lights.dot(Vec3x4::splat(normal));
        let strengths = self.intensities * (near * near) * window * (cone * cone) * cosines;
        // A light that stands on the point itself has no direction: NaN, which is not above 0.
        let strengths = Vec4::select(strengths.cmpgt(Vec4::ZERO), strengths, Vec4::ZERO);
        Unshadowed4 { strengths, to_lights, cosines }
    }

    /// The sum of the lights' colours, each times its strength.
    #[inline]
    pub fn sum(&self, strengths: Vec4) -> Vec3 {
        (self.colors * strengths).truncate()
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
        let mut words = vec![0; layout.words];
        layout.lights.iter().for_each(|field| field.set(&mut words, 1.0));
        let mut shining = 0;
        for i in 0..1000u32 {
            let part = |step: u32| (i * step % 97) as f32 / 48.5 - 1.0;
            let point = Vec3::new(part(7), part(11), part(13)) * 3.0;
            let normal = Vec3::new(part(17), part(23), 0.5).normalize();
            let mut sum = Vec3::ZERO;
            for group in &groups {
                let Unshadowed4 { strengths, .. } = group.unshadowed(point, normal);
                sum += group.sum(group.lit(&words).select(strengths));
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
        let Unshadowed4 { strengths, .. } = groups[0].unshadowed(place, Vec3::X);
        assert!(strengths.x == 0.0 && strengths.w > 0.0, "{strengths}");
    }
}
