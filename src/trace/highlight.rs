//! Highlights of lights that have a size, which may be larger than a surface's lobe.

use super::ggx::{density, grazing, lobes};
use super::interaction::SurfaceInteraction;
use super::lanes::{Lanes, Vec3x4};
use super::light::{Emitter, Unshadowed};
use super::parts::GRID;
use super::surface::Surface;
use glam::{Vec3, Vec4};
use std::f32::consts::TAU;

/// A highlight is left out where its lobe has less density than this, 1/sr: but for grazing angles it would add less
/// than 1e-4 of what a white diffuse surface does.
pub(super) const MIN_LOBE: f32 = 1e-4;

/// A point that may have a highlight.
pub(super) struct Glossy {
    pub position: Vec3,
    /// Unit.
    pub normal: Vec3,
    /// Unit direction to where it is looked at from.
    pub toward: Vec3,
    /// GGX's.
    pub alpha: f32,
    /// Index of refraction on the far side over that on the near side, where light is bent.
    pub eta: Option<f32>,
}

impl Surface {
    /// The highlight of a light that has a size, nothing in its way.
    pub fn highlight(
        &self,
        it: &SurfaceInteraction,
        toward: Vec3,
        light: &Emitter,
        unshadowed: &Unshadowed,
    ) -> Vec3 {
        if !self.has_highlights() {
            return Vec3::ZERO;
        }
        let (position, normal) = (it.point.position, it.normal);
        let point = Glossy { position, normal, toward, alpha: self.alpha, eta: self.eta };
        let [at_normal, at_grazing] = point.mirrored(light, unshadowed.to_light);
        let [normal, grazing] = self.reflectances();
        unshadowed.irradiance * (normal * at_normal + grazing * at_grazing)
    }
}

impl Glossy {
    /// How much of the irradiance of a light that has a size is mirrored, 1/sr, nothing in its way: where the reflectance at normal
    /// incidence is 1, and where that at grazing is. `middle` is the unit direction to its middle.
    pub fn mirrored(&self, light: &Emitter, middle: Vec3) -> [f32; 2] {
        let &Self { position, normal, toward, .. } = self;
        let [normals, views, middles] = [normal, toward, middle].map(Vec3x4::splat);
        let [alpha, spread, chord] =
            [self.alpha, light.solid_angle(position) / TAU, light.chord(position)].map(Vec4::splat);
        let Cut { rows, squares, count } = Cut::new((normals, views, alpha), (middles, spread, chord));
        if !count.has(0) {
            return [0.0; 2];
        }
        let (mut sums, mut all) = ([Vec4::ZERO; 2], Vec4::ZERO);
        let mut add = |to_lights: Vec3x4, cosines: Vec4, weights: Vec4| {
            all += weights;
            let shining = Lanes::above_zero(weights);
            let to_lights = (to_lights, cosines);
            if let Some((lobes, cosines)) = lobes(normals, views, to_lights, squares, MIN_LOBE, shining) {
                let mirrored = weights * lobes;
                let at_grazing = mirrored * grazing(cosines, self.eta);
                sums[0] += mirrored - at_grazing;
                sums[1] += at_grazing;
            }
        };
        if rows.x == 1.0 {
            let cosines = Vec4::splat(normal.dot(middle));
            add(middles, cosines, Lanes::above_zero(cosines).select(Vec4::X));
        } else {
            light.parts(position, normal, rows.x as u32).for_each(|p| add(p.to_lights, p.cosines, p.weights));
        }
        let all = all.element_sum();
        if all > 0.0 { sums.map(|sum| sum.element_sum() / all) } else { [0.0; 2] }
    }
}

/// How four lights are cut into parts, so that highlights are as if of the whole.
///
/// Parts are narrower than lobes, as far as a few will do, and lobes are widened by the parts' size, so that parts run into one another. A
/// light that is far out on its lobe's slope, for its size, is not cut: there lobes change slowly.
pub(super) struct Cut {
    /// Rows of the grid over each.
    pub rows: Vec4,
    /// Squares of the lobes' alpha.
    pub squares: Vec4,
    /// Those of which any part may have a lobe that counts.
    pub count: Lanes,
}

/// So many times as far from its lobe's middle as it is wide, a light's highlight is that of its middle: within 1 %, as lobes fall with
/// the fourth power there.
const FAR_OUT: f32 = 8.0;

impl Cut {
    /// For the unit directions to the `lights`' middles; they fill `spreads` of half the sky, and their other parts are in directions within
    /// `chords` of these.
    #[inline]
    pub fn new(
        (normals, views, alpha): (Vec3x4, Vec3x4, Vec4),
        (lights, spreads, chords): (Vec3x4, Vec4, Vec4),
    ) -> Self {
        let half = views + lights;
        let per_length = Vec4::ONE / half.length_squared().sqrt();
        let cosines = (normals.dot(half) * per_length).min(Vec4::ONE);
        let sines2 = (Vec4::ONE - cosines * cosines).max(Vec4::ZERO);
        let far = Lanes::above_zero(sines2 - FAR_OUT * FAR_OUT * chords * chords)
            & Lanes::above_zero(normals.dot(lights) - chords);
        let rows = (4.0 * spreads.sqrt() / alpha).ceil().clamp(Vec4::ONE, Vec4::splat(GRID as f32));
        let (rows, parts) = (far.choose(Vec4::ONE, rows), far.choose(Vec4::ZERO, spreads / (rows * rows)));
        // Beside what mirrors the light, lobes are no wider than they are. (The half vector turns half as far as the light's direction.)
        let square = alpha * alpha;
        let beside = (sines2.sqrt() - 0.5 * chords).max(Vec4::ZERO);
        let squares = square + parts * (square + parts) / (square + parts + beside * beside);

        // The half vector moves by no more than the light does: so far at most does it turn. What is no number is as far as can be.
        let turn = (chords * per_length).min(Vec4::ONE);
        let turned = (Vec4::ONE - turn * turn).sqrt();
        let nearest = (cosines * turned + sines2.sqrt() * turn).max(Vec4::ZERO);
        let nearest = Vec4::select(cosines.cmplt(turned), nearest, Vec4::ONE);
        let count = Lanes::above_zero(density(nearest * nearest, squares) - Vec4::splat(MIN_LOBE));
        Self { rows, squares, count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LightKind, Scene};
    use glam::{DAffine3, DVec3, Vec2};

    /// What a surface mirrors of a light, summed over its parts, a hundred a side.
    fn by_summing(point: &Glossy, light: &Emitter) -> f32 {
        let [normals, views] = [point.normal, point.toward].map(Vec3x4::splat);
        let (mut sum, mut all) = (0.0, 0.0);
        for i in 0..10_000 {
            let u = (Vec2::new((i % 100) as f32, (i / 100) as f32) + Vec2::splat(0.5)) / 100.0;
            let to_light = light.arriving(point.position, u).unwrap().to_light;
            let cosine = point.normal.dot(to_light).max(0.0);
            let to_lights = (Vec3x4::splat(to_light), Vec4::splat(cosine));
            let squares = Vec4::splat(point.alpha * point.alpha);
            let lobe =
                lobes(normals, views, to_lights, squares, 0.0, Lanes::ALL).map_or(0.0, |(lobes, _)| lobes.x);
            (sum, all) = (sum + cosine * lobe, all + cosine);
        }
        sum / all
    }

    /// A sphere of a radius, a metre away in direction z.
    fn sphere(radius: f32) -> Emitter {
        let mut scene = Scene::default();
        let place = DAffine3::from_translation(DVec3::Z);
        let light = scene.add_light(LightKind::Point, 1.0, place);
        scene.lights[light].size = radius;
        Emitter::new(&scene.pose(0.0).lights[0], DVec3::ZERO)
    }

    /// `tilt` is how far the normal is from the light's middle, where it is looked at from, in the light's radii.
    fn error(radius: f32, alpha: f32, tilt: f32) -> f32 {
        let (sin, cos) = (tilt * radius).sin_cos();
        let normal = Vec3::new(sin, 0.0, cos);
        let point = Glossy { position: Vec3::ZERO, normal, toward: Vec3::Z, alpha, eta: None };
        let light = sphere(radius);
        let found: f32 = point.mirrored(&light, Vec3::Z).iter().sum();
        let expected = by_summing(&point, &light);
        if expected < 1e-3 { found - expected } else { found / expected - 1.0 }
    }

    #[test]
    fn highlights_are_as_if_of_the_whole_light() {
        let tilts = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 7.9, 8.1, 12.0, 16.0];
        for (radius, alpha) in
            [0.01f32, 0.03, 0.1].into_iter().flat_map(|r| [0.0064f32, 0.02, 0.06, 0.2].map(|a| (r, a)))
        {
            for tilt in tilts.into_iter().filter(|tilt| tilt * radius < 0.7) {
                let error = error(radius, alpha, tilt);
                // Where lobes are much narrower than a part they show about what is there, but nothing far beside it.
                let most = match radius / alpha {
                    ..2.0 => 0.025,
                    ..6.0 if tilt < 1.5 => 0.11,
                    6.0.. if tilt < 3.0 => 0.8,
                    _ => 0.02,
                };
                assert!(error.abs() < most, "{radius} {alpha} {tilt}: {error}");
            }
        }
    }
}
