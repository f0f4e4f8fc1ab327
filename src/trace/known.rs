//! Rays that ask for surfaces that are known already: no ray is cast into the scene for them, and none is counted.

use super::{Eye, Tracer};
use crate::accel::{KnownTriangles, PreparedRay};
use crate::frame::{FourPoints, PackedNormal, SurfaceRef, SurfaceSample};
use glam::{Vec3, Vec4};

impl Tracer<'_> {
    /// What the ray through raster position (x, y) meets first if it can meet nothing but the triangles and shapes
    /// of `candidates`; no ray is cast into the scene, and none is counted. Where the candidates are the background, that.
    /// `known` is remembered from one call to the next.
    pub fn nearest_of(
        &self,
        eye: &Eye,
        x: f64,
        y: f64,
        candidates: impl Iterator<Item = SurfaceSample>,
        known: &mut KnownTriangles,
    ) -> Option<SurfaceSample> {
        let ray = eye.ray(self.accel, x, y);
        let mut prepared = PreparedRay::new(ray);
        let mut nearest = None;
        for candidate in candidates {
            if candidate.surface.is_background() {
                return Some(SurfaceSample::background(ray.direction.normalize_or(Vec3::NEG_Z)));
            }
            let Some(hit) = self.accel.meet(self.scene, &prepared, candidate.surface, known) else {
                continue;
            };
            prepared.end_at(hit.t);
            nearest = Some((hit, candidate));
        }
        let (hit, candidate) = nearest?;
        if let Some(position) = known.point(hit.surface) {
            // A triangle looks the same way everywhere, as it was seen before.
            return Some(SurfaceSample { position, surface: hit.surface, ..candidate });
        }
        let position = self.accel.surface_point(self.scene, hit.surface);
        let outward = self.accel.shape_normal(self.scene, hit.surface);
        let seen = outward.map(|n| PackedNormal::new(if hit.front { n } else { -n }));
        let normal = seen.unwrap_or(candidate.normal);
        Some(SurfaceSample { position, surface: hit.surface, normal, ..candidate })
    }

    /// Where the rays through raster positions (x, y) meet the triangle that `surface` lies on, and nothing else; to the last
    /// bit what [`Tracer::nearest_of`] finds. None if they have to be looked at one by one.
    pub fn four_on(
        &self,
        eye: &Eye,
        (x, y): ([f64; 4], f64),
        surface: SurfaceRef,
        known: &mut KnownTriangles,
    ) -> Option<FourPoints> {
        if !eye.perspective || surface.is_background() {
            return None;
        }
        let [a, b, c, d] = x.map(|x| eye.ray(self.accel, x, y).direction);
        let directions = [0, 1, 2].map(|axis| Vec4::new(a[axis], b[axis], c[axis], d[axis]));
        let reach = [eye.near, eye.far];
        self.accel.meet_four(self.scene, (eye.position, directions), reach, surface, known)
    }
}
