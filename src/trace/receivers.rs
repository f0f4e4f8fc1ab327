//! Four points under punctual lights: one light for each of them, or four lights for one that is there four times.

use super::ggx::{dielectric_weight, lobes, schlick_weights};
use super::highlight::{Cut, Glossy, MIN_LOBE};
use super::interaction::SurfaceInteraction;
use super::lanes::{LANES, Lanes, Vec3x4};
use super::punctual::{PunctualLights, Unshadowed4};
use super::surface::Surface;
use glam::{Vec3, Vec4};
use std::array;

/// Four points on surfaces, one to a lane, as lights see them.
pub(super) struct Receivers {
    positions: Vec3x4,
    normals: Vec3x4,
    /// Unit directions to where they are looked at from.
    toward: Vec3x4,
    /// GGX's, for highlights.
    alpha: Vec4,
    /// The reflectances between which the Fresnel term lies.
    reflectances: [Vec3x4; 2],
    /// The indices of refraction of those that bend light.
    etas: Vec4,
    bend: Lanes,
    /// Those that scatter light.
    scatter: Lanes,
    /// Those that have highlights.
    mirror: Lanes,
}

/// What lights bring to four points, lane by lane.
#[derive(Default)]
pub(super) struct Brought {
    pub irradiance: Vec3x4,
    /// Highlights where each reflectance is 1.
    highlights: [Vec3x4; 2],
}

impl Receivers {
    /// A point to each lane.
    #[inline]
    pub fn new(its: &[SurfaceInteraction; LANES], surfaces: [&Surface; LANES], toward: Vec3x4) -> Self {
        let each = |value: fn(&Surface) -> f32| {
            Vec4::new(value(surfaces[0]), value(surfaces[1]), value(surfaces[2]), value(surfaces[3]))
        };
        let reflectance = |end: usize| Vec3x4::of(|lane| surfaces[lane].reflectances()[end]);
        Self {
            positions: Vec3x4::of(|lane| its[lane].point.position),
            normals: Vec3x4::of(|lane| its[lane].normal),
            toward,
            alpha: each(|surface| surface.alpha),
            reflectances: [reflectance(0), reflectance(1)],
            etas: each(|surface| surface.eta.unwrap_or(1.0)),
            bend: Lanes::of(|lane| surfaces[lane].eta.is_some()),
            scatter: Lanes::of(|lane| surfaces[lane].albedo != Vec3::ZERO),
            mirror: Lanes::of(|lane| surfaces[lane].has_highlights()),
        }
    }

    /// The same point in all lanes.
    #[inline]
    pub fn all(it: &SurfaceInteraction, surface: &Surface, toward: Vec3) -> Self {
        let all = |is| if is { Lanes::ALL } else { Lanes::NONE };
        Self {
            positions: Vec3x4::splat(it.point.position),
            normals: Vec3x4::splat(it.normal),
            toward: Vec3x4::splat(toward),
            alpha: Vec4::splat(surface.alpha),
            reflectances: surface.reflectances().map(Vec3x4::splat),
            etas: Vec4::splat(surface.eta.unwrap_or(1.0)),
            bend: all(surface.eta.is_some()),
            scatter: all(surface.albedo != Vec3::ZERO),
            mirror: all(surface.has_highlights()),
        }
    }

    /// Adds what those of `lights` bring that are `asked` for. `reach` says which share of each reaches the point; it is not asked
    /// where they would bring nothing to the eye.
    #[inline]
    pub fn add(
        &self,
        lights: &PunctualLights,
        asked: Lanes,
        reach: impl FnOnce(Lanes) -> Vec4,
        sum: &mut Brought,
    ) {
        let unshadowed = lights.unshadowed(self.positions, self.normals);
        let shining = Lanes::above_zero(asked.select(unshadowed.strengths));
        if shining.is_empty() {
            return;
        }
        let mirrored = self.mirrored(lights, &unshadowed, shining & self.mirror);
        let highlit = mirrored.map_or(Lanes::NONE, |[a, b]| Lanes::above_zero(a + b));
        let asked = shining & self.scatter | highlit;
        let light = asked.select(unshadowed.strengths) * reach(asked);
        sum.irradiance += lights.colors * light;
        if let Some([at_normal, at_grazing]) = mirrored {
            sum.highlights[0] += lights.colors * (light * at_normal);
            sum.highlights[1] += lights.colors * (light * at_grazing);
        }
    }

    /// How much of what comes from `lights` that are `asked` for is mirrored, 1/sr: where the reflectance at normal incidence is 1,
    /// and where that at grazing is. `None` where nothing is.
    #[inline]
    fn mirrored(&self, lights: &PunctualLights, from: &Unshadowed4, mut asked: Lanes) -> Option<[Vec4; 2]> {
        let (mut squares, mut single, mut parted) = (self.alpha * self.alpha, asked, Lanes::NONE);
        if lights.has_size() {
            let seen = (from.to_lights, from.heights, (2.0 * from.heights).sqrt());
            let cut = Cut::new((self.normals, self.toward, self.alpha), seen);
            (squares, asked) = (cut.squares, asked & cut.count);
            parted = asked & Lanes::above_zero(cut.rows - Vec4::ONE);
            single = asked.without(parted) & Lanes::above_zero(from.cosines);
        }
        let to_lights = (from.to_lights, from.cosines);
        let whole = lobes(self.normals, self.toward, to_lights, squares, MIN_LOBE, single);
        let mut mirrored = whole.map(|(lobes, cosines)| {
            let at_grazing = lobes * self.grazing(cosines);
            [lobes - at_grazing, at_grazing]
        });
        if !parted.is_empty() {
            let [at_normal, at_grazing] = mirrored.get_or_insert_default();
            for lane in (0..LANES).filter(|&lane| parted.has(lane)) {
                [at_normal[lane], at_grazing[lane]] =
                    self.glossy(lane).mirrored(lights.light(lane), from.to_lights.lane(lane));
            }
        }
        mirrored
    }

    /// The point of a lane.
    fn glossy(&self, lane: usize) -> Glossy {
        Glossy {
            position: self.positions.lane(lane),
            normal: self.normals.lane(lane),
            toward: self.toward.lane(lane),
            alpha: self.alpha[lane],
            eta: self.bend.has(lane).then_some(self.etas[lane]),
        }
    }

    /// The highlights of what was brought.
    #[inline]
    pub fn highlights(&self, brought: &Brought) -> Vec3x4 {
        brought.highlights[0] * self.reflectances[0] + brought.highlights[1] * self.reflectances[1]
    }

    /// How far the Fresnel term is from the first of the reflectances to the second, for the cosines between view and half
    /// vectors.
    #[inline]
    fn grazing(&self, cosines: Vec4) -> Vec4 {
        let weights = schlick_weights(cosines);
        if self.bend.is_empty() {
            return weights;
        }
        let bent = array::from_fn(|lane| dielectric_weight(cosines[lane], self.etas[lane]));
        self.bend.choose(Vec4::from_array(bent), weights)
    }
}
