//! Lights that have a size, cut in equal parts: four at a time, as those without size are looked at.

use super::lanes::{LANES, Lanes, Vec3x4};
use super::light::{Emitter, Shape, height};
use super::sequence::{MIDDLE, disc};
use glam::{Vec2, Vec3, Vec4};
use std::array;
use std::sync::LazyLock;

/// Rows of the finest grid over a light by which its cone, or a highlight, is averaged.
pub(super) const GRID: u32 = 4;

/// The middles of up to four of the parts of a square or a disc, one to a lane.
pub(super) struct Middles {
    /// On a square of which each half side is 1.
    pub square: [Vec4; 2],
    /// On a disc of radius 1.
    pub disc: [Vec4; 2],
    /// The lanes that hold one.
    present: Lanes,
}

impl Middles {
    /// Those of `rows` x `rows` parts, from 1 to [`GRID`] rows.
    pub fn of(rows: u32) -> &'static [Self] {
        static GRIDS: LazyLock<[Vec<Middles>; GRID as usize]> = LazyLock::new(|| {
            array::from_fn(|i| {
                let rows = i as u32 + 1;
                let part = |i: u32| Vec2::new((i % rows) as f32, (i / rows) as f32) + MIDDLE;
                let parts: Vec<_> = (0..rows * rows).map(|i| part(i) / rows as f32).collect();
                parts.chunks(LANES).map(Middles::new).collect()
            })
        });
        // What extreme input makes no number of is 0.
        &GRIDS[rows.clamp(1, GRID) as usize - 1]
    }

    /// Of points of the unit square.
    fn new(points: &[Vec2]) -> Self {
        let lanes = |place: fn(Vec2) -> Vec2| {
            let at = |lane: usize| points.get(lane).map_or(Vec2::ZERO, |&u| place(u));
            [Vec4::from_array(array::from_fn(|i| at(i).x)), Vec4::from_array(array::from_fn(|i| at(i).y))]
        };
        let present = Lanes::of(|lane| lane < points.len());
        Self { square: lanes(|u| 2.0 * u - Vec2::ONE), disc: lanes(disc), present }
    }
}

/// Four parts of a light, as they are seen from a point.
pub(super) struct Parts {
    /// Unit directions to them.
    pub to_lights: Vec3x4,
    /// Cosines to the normal of the surface there.
    pub cosines: Vec4,
    /// What they bring to it, relative to each other: 0 where that is nothing.
    pub weights: Vec4,
}

/// A disc in the sky, which a sphere is seen as, too.
#[derive(Clone, Copy)]
pub(super) struct SkyDisc {
    axis: Vec3x4,
    right: Vec3x4,
    up: Vec3x4,
    /// 1 less the cosine of its half angle.
    height: Vec4,
}

impl SkyDisc {
    /// Around `axis`; `sin` is the sine of its half angle.
    pub fn new(axis: Vec3, sin: f32) -> Self {
        let (right, up) = axis.any_orthonormal_pair();
        let [axis, right, up] = [axis, right, up].map(Vec3x4::splat);
        Self { axis, right, up, height: Vec4::splat(height(sin)) }
    }

    /// Unit directions to four of its parts, as [`cone`](super::sequence::cone) has them.
    pub fn directions(&self, middles: &Middles) -> Vec3x4 {
        let [x, y] = middles.disc;
        let fall = (x * x + y * y) * self.height;
        let spread = (self.height * (2.0 - fall)).sqrt();
        self.axis * (1.0 - fall) + (self.right * x + self.up * y) * spread
    }
}

impl Emitter {
    /// Its `rows` x `rows` parts, evenly spread over the solid angle of a sphere or disc, or over the surface of an area light, as a
    /// surface at `point` with unit `normal` sees them.
    pub fn parts(&self, point: Vec3, normal: Vec3, rows: u32) -> impl Iterator<Item = Parts> {
        let disc = match &self.shape {
            Shape::Directional { to_light, sin } => Some(SkyDisc::new(*to_light, *sin)),
            Shape::Sphere { position, radius, .. } => {
                let along = *position - point;
                let distance = along.length();
                Some(SkyDisc::new(along / distance, (radius / distance).min(1.0)))
            }
            Shape::Panel(_) => None,
        };
        let normal = Vec3x4::splat(normal);
        Middles::of(rows).iter().map(move |middles| {
            let (to_lights, strengths) = match (&self.shape, &disc) {
                (Shape::Sphere { cone: Some(cone), .. }, Some(disc)) => {
                    let to_lights = disc.directions(middles);
                    (to_lights, cone.at_four(to_lights))
                }
                (Shape::Panel(panel), _) => panel.seen_from(point, middles, self.per_range),
                (_, Some(disc)) => (disc.directions(middles), Vec4::ONE),
                (_, None) => (Vec3x4::default(), Vec4::ZERO),
            };
            let cosines = to_lights.dot(normal);
            let weights = strengths * cosines;
            // A light that stands on the point itself has no direction: NaN, which is not above 0.
            let shining = middles.present & Lanes::above_zero(weights);
            Parts { to_lights, cosines, weights: shining.select(weights) }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LightKind, Outline, Scene};
    use glam::{DAffine3, DVec3};

    /// Lights of every kind that has a size.
    fn emitters() -> Vec<Emitter> {
        let mut scene = Scene::default();
        let size = Vec2::new(0.6, 0.9);
        let kinds = [
            LightKind::Point,
            LightKind::Spot { inner_cone: 0.2, outer_cone: 0.7 },
            LightKind::Directional,
            LightKind::Area { outline: Outline::Rectangle, size },
            LightKind::Area { outline: Outline::Ellipse, size },
        ];
        for (i, kind) in kinds.into_iter().enumerate() {
            let light =
                scene.add_light(kind, 3.0, DAffine3::from_translation(DVec3::new(0.2, 0.1 * i as f64, 1.5)));
            (scene.lights[light].size, scene.lights[light].range) = (0.4, Some(6.0));
        }
        scene.pose(0.0).lights.iter().map(|light| Emitter::new(light, DVec3::ZERO)).collect()
    }

    #[test]
    fn four_parts_bring_what_each_of_them_brings() {
        let part = |i: u32, step: u32| (i * step % 97) as f32 / 48.5 - 1.0;
        for (light, rows) in emitters().iter().flat_map(|light| (1..=GRID).map(move |rows| (light, rows))) {
            let mut shining = 0;
            for i in 0..200 {
                let point = Vec3::new(part(i, 7), part(i, 11), part(i, 13) - 0.5);
                let normal = Vec3::new(part(i, 17), part(i, 23), 0.5).normalize();
                let parts: Vec<_> = light.parts(point, normal, rows).collect();
                let lane = |i: u32| (&parts[i as usize / LANES], i as usize % LANES);
                let weights: f32 = parts.iter().map(|part| part.weights.element_sum()).sum();
                let single = |i: u32| {
                    let u = (Vec2::new((i % rows) as f32, (i / rows) as f32) + MIDDLE) / rows as f32;
                    let arriving = light.arriving(point, u)?;
                    let weight = arriving.irradiance.max_element() * normal.dot(arriving.to_light);
                    (weight > 0.0).then_some((arriving.to_light, weight))
                };
                let all: f32 = (0..rows * rows).filter_map(single).map(|(_, weight)| weight).sum();
                assert_eq!(all > 0.0, weights > 0.0);
                for i in 0..rows * rows {
                    let (part, lane) = lane(i);
                    let share = if all > 0.0 { part.weights[lane] / weights } else { 0.0 };
                    let (to_light, weight) = single(i).unwrap_or((part.to_lights.lane(lane), 0.0));
                    assert!(
                        (share - weight / all.max(f32::MIN_POSITIVE)).abs() < 1e-4,
                        "{share} {weight} {all}"
                    );
                    assert!((part.to_lights.lane(lane) - to_light).length() < 1e-5);
                    shining += u32::from(weight > 0.0);
                }
                let beyond: f32 =
                    (rows * rows..parts.len() as u32 * 4).map(|i| lane(i).0.weights[lane(i).1]).sum();
                assert_eq!(beyond, 0.0);
            }
            assert!(shining > 50, "{light:?}");
        }
    }

    #[test]
    fn a_light_around_the_point_or_on_it_brings_no_nonsense() {
        for light in emitters() {
            for point in [Vec3::new(0.2, 0.0, 1.5), Vec3::new(0.2, 0.1, 1.5), Vec3::new(0.2, 0.3, 1.5)] {
                for part in light.parts(point, Vec3::Z, GRID) {
                    assert!(
                        part.weights.is_finite() && part.weights.min_element() >= 0.0,
                        "{light:?} {point}"
                    );
                }
            }
        }
    }
}
