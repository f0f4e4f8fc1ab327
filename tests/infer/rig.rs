//! Scenes of spheres over a ground plane, under one light, whose answers a closed form knows.

use buzz::frame::{PackedNormal, PixelClass, RayCounts, SurfaceRef, SurfaceSample};
use buzz::infer::{BuzzBuffer, CastCentres, CastRays, Inference, Lattice, Move, Projector, Trust};
use buzz::scene::{Lens, Projection, View};
use glam::{DMat3, DVec2, DVec3};
use proptest::prelude::*;

/// A camera at `eye` that looks along -Z (turned by `yaw` to the left), one unit a pixel at depth 1.
pub fn view(eye: DVec3, yaw: f64, width: u32, height: u32) -> View {
    let turn = DMat3::from_rotation_y(yaw);
    let yfov = 2.0 * (0.5 * f64::from(height)).atan();
    View {
        eye,
        right: turn * DVec3::X,
        up: DVec3::Y,
        forward: turn * DVec3::NEG_Z,
        lens: Lens {
            projection: Projection::Perspective { yfov },
            shift: DVec2::ZERO,
            near: 0.01,
            far: f64::INFINITY,
            sensor_height: None,
        },
        width,
        height,
        pixel_aspect: 1.0,
    }
}

/// Spheres and a ground plane, traced in double precision.
#[derive(Debug, Clone)]
pub struct Spheres(pub Vec<(DVec3, f64)>);

impl Spheres {
    pub fn trace(&self, origin: DVec3, direction: DVec3) -> SurfaceSample {
        let direction = direction.normalize();
        let mut best = (f64::INFINITY, 0u32, DVec3::ZERO);
        for (i, &(centre, radius)) in self.0.iter().enumerate() {
            let to = centre - origin;
            let along = to.dot(direction);
            let d2 = to.length_squared() - along * along;
            if d2 < radius * radius {
                let t = along - (radius * radius - d2).sqrt();
                if t > 1e-6 && t < best.0 {
                    best = (t, i as u32 + 2, (origin + direction * t - centre) / radius);
                }
            }
        }
        let ground = (-1.0 - origin.y) / direction.y;
        if ground > 1e-6 && ground < best.0 {
            best = (ground, 1, DVec3::Y);
        }
        if best.0.is_infinite() {
            return SurfaceSample::background(direction.as_vec3());
        }
        SurfaceSample {
            position: (origin + direction * best.0).as_vec3(),
            surface: SurfaceRef { instance: best.1, primitive: 0, u: 0.0, v: 0.0 },
            object: best.1,
            normal: PackedNormal::new(best.2.as_vec3()),
        }
    }
}

/// Where the only light stands.
const LIGHT: DVec3 = DVec3::new(2.0, 5.0, 0.0);

impl Spheres {
    /// What the ray meets if nothing is there but the surface of `object`.
    pub fn trace_only(&self, object: u32, origin: DVec3, direction: DVec3) -> Option<SurfaceSample> {
        let mut alone = self.clone();
        for (i, sphere) in alone.0.iter_mut().enumerate() {
            if i as u32 + 2 != object {
                sphere.1 = 0.0;
            }
        }
        Some(alone.trace(origin, direction)).filter(|s| s.object == object)
    }

    /// Whether the light reaches a sample; none where its surface faces away, and no ray has to be cast.
    pub fn lit(&self, sample: &SurfaceSample) -> Option<bool> {
        let (point, normal) = (sample.position.as_dvec3(), sample.normal.get().as_dvec3());
        let to_light = LIGHT - point;
        if sample.surface.is_background() || to_light.dot(normal) <= 0.0 {
            return None;
        }
        let hit = self.trace(point + normal * 1e-4, to_light);
        let until = (hit.position.as_dvec3() - point).length();
        Some(hit.surface.is_background() || until > to_light.length())
    }
}

/// The eye of a view among spheres; asked by pixels, or by the positions of a lattice.
pub struct Eye<'a>(pub &'a Spheres, pub &'a View, pub Option<Lattice>);

impl<'a> Eye<'a> {
    /// One that is asked by pixels.
    pub fn of(scene: &'a Spheres, view: &'a View) -> Self {
        Self(scene, view, None)
    }

    fn ray(&self, x: usize, y: usize) -> (DVec3, DVec3) {
        let place = |at: usize| self.2.map_or(at as f64 + 0.5, |lattice| lattice.to_raster(at as u32));
        let ray = self.1.ray(place(x), place(y));
        (ray.origin, ray.direction)
    }
}

impl CastRays for Eye<'_> {
    fn cast(&self, x: usize, y: usize, lit: &mut [u32], counts: &mut RayCounts) -> SurfaceSample {
        let sample = self.hit(x, y, counts);
        self.recast(&sample, &[1], lit, counts);
        sample
    }
}

impl CastCentres for Eye<'_> {
    type Memory = ();

    fn hit(&self, x: usize, y: usize, counts: &mut RayCounts) -> SurfaceSample {
        counts.primary += 1;
        let (origin, direction) = self.ray(x, y);
        self.0.trace(origin, direction)
    }

    fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts) {
        if ask[0] & 1 != 0 {
            let reached = self.0.lit(sample);
            counts.shadow += u64::from(reached.is_some());
            lit[0] = u32::from(reached == Some(true));
        }
    }

    fn nearest_of(
        &self,
        x: usize,
        y: usize,
        candidates: impl Iterator<Item = SurfaceSample>,
        (): &mut (),
    ) -> Option<SurfaceSample> {
        let (origin, direction) = self.ray(x, y);
        candidates.filter_map(|c| self.0.trace_only(c.object, origin, direction)).min_by(|a, b| {
            let far = |sample: &SurfaceSample| (sample.position.as_dvec3() - origin).length();
            far(a).total_cmp(&far(b))
        })
    }

    fn is_hidden(&self, sample: &SurfaceSample, counts: &mut RayCounts) -> bool {
        counts.visibility += 1;
        is_hidden(self.0, self.1, sample)
    }
}

/// True if something stands between the eye and the sample.
pub fn is_hidden(scene: &Spheres, view: &View, sample: &SurfaceSample) -> bool {
    if sample.surface.is_background() {
        return !scene.trace(view.eye, sample.position.as_dvec3()).surface.is_background();
    }
    let to = sample.position.as_dvec3() - view.eye;
    let seen = scene.trace(view.eye, to);
    let distance = (seen.position.as_dvec3() - view.eye).length();
    !seen.surface.is_background() && distance < to.length() * (1.0 - 1e-3)
}

/// How far from its pixel's centre the sample of pixel `i` lies, in pixels: the larger of both directions.
pub fn off_centre(view: &View, buffer: &BuzzBuffer, i: usize) -> f64 {
    let sample = buffer.sample(i);
    let w = if sample.surface.is_background() { 0.0 } else { 1.0 };
    let r = view.raster_from_world(DVec3::ZERO) * sample.position.as_dvec3().extend(w);
    let (x, y) = ((i % buffer.width()) as f64 + 0.5, (i / buffer.width()) as f64 + 0.5);
    (r.x / r.w - x).abs().max((r.y / r.w - y).abs())
}

/// Pixels of a frame that are reused; fails if the classes do not add up.
pub fn reused(buffer: &BuzzBuffer) -> Result<u64, TestCaseError> {
    let counts = buffer.count_classes();
    prop_assert_eq!(counts.iter().sum::<u64>(), buffer.class.len() as u64);
    prop_assert_eq!(counts[PixelClass::Traced as usize], 0);
    Ok(PixelClass::ALL.iter().filter(|c| c.is_reused()).map(|&c| counts[c as usize]).sum())
}

/// Four spheres over the ground.
pub fn four_spheres() -> Spheres {
    Spheres(vec![
        (DVec3::new(-1.0, 0.0, -5.0), 0.8),
        (DVec3::new(0.6, -0.2, -3.0), 0.5),
        (DVec3::new(1.5, 0.5, -8.0), 1.0),
        (DVec3::new(0.0, 0.3, -4.0), 0.2),
    ])
}

pub fn camera(eye: DVec3, yaw: f64) -> View {
    let mut v = view(eye, yaw, 48, 32);
    v.lens.projection = Projection::Perspective { yfov: 0.9 };
    v
}

/// A chain of `steps` inferred frames, centred if `trust` says how; calls `check` on each.
pub fn chain(
    scene: &Spheres,
    trust: Option<Trust>,
    step: DVec3,
    turn: f64,
    steps: usize,
    mut check: impl FnMut(&View, &BuzzBuffer, RayCounts) -> Result<(), TestCaseError>,
) -> Result<(), TestCaseError> {
    let mut from = camera(DVec3::ZERO, 0.0);
    let (mut old, mut new) = (BuzzBuffer::new(48, 32, 1), BuzzBuffer::new(48, 32, 1));
    old.cast_unknown(&Projector::new(&from, DVec3::ZERO), &Eye::of(scene, &from));
    let mut inference = Inference::default();
    for i in 1..=steps {
        let to = camera(step * i as f64, turn * i as f64);
        let (source, target, rays) = ((&old, &from), (&mut new, &to), Eye::of(scene, &to));
        let cost = match trust {
            None => inference.infer(Move::Camera, source, target, DVec3::ZERO, &rays),
            Some(trust) => inference.infer_centred(Move::Camera, source, target, DVec3::ZERO, trust, &rays),
        };
        check(&to, &new, cost.rays)?;
        std::mem::swap(&mut old, &mut new);
        from = to;
    }
    Ok(())
}

pub fn spheres() -> impl Strategy<Value = Spheres> {
    let sphere = (-3.0..3.0f64, -1.0..2.0f64, -12.0..-2.0f64, 0.1..1.2f64);
    prop::collection::vec(sphere.prop_map(|(x, y, z, r)| (DVec3::new(x, y, z), r)), 1..8).prop_map(Spheres)
}

pub fn small_step() -> impl Strategy<Value = DVec3> {
    (-0.1..0.1f64, -0.05..0.05f64, -0.15..0.15f64).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}
