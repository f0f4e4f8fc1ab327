//! The specular half of glTF 2.0's material model (Appendix B): GGX, height-correlated Smith, Fresnel.

use super::lanes::{Lanes, Vec3x4};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use std::f32::consts::FRAC_1_PI;

/// Schlick's Fresnel term.
#[inline]
pub(super) fn schlick(f0: Vec3, f90: f32, cos: f32) -> Vec3 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    let x2 = x * x;
    f0 + (Vec3::splat(f90) - f0) * (x2 * x2 * x)
}

/// How far Schlick's term is from normal incidence (0) to grazing (1).
#[inline]
pub(super) fn schlick_weights(cosines: Vec4) -> Vec4 {
    let x = (Vec4::ONE - cosines).clamp(Vec4::ZERO, Vec4::ONE);
    let x2 = x * x;
    x2 * x2 * x
}

/// How far the Fresnel term of a smooth dielectric for unpolarised light is from normal incidence (0) to 1, where all is reflected; `eta` is
/// the index of refraction on the far side over that on the near side.
pub(super) fn dielectric_weight(cos: f32, eta: f32) -> f32 {
    let normal = ((eta - 1.0) / (eta + 1.0)).powi(2);
    (dielectric(cos, eta) - normal) / (1.0 - normal)
}

/// That term itself.
fn dielectric(cos: f32, eta: f32) -> f32 {
    let sin2 = (1.0 - cos * cos).max(0.0) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let inner = (1.0 - sin2).sqrt();
    let parallel = (eta * cos - inner) / (eta * cos + inner);
    let perpendicular = (cos - eta * inner) / (cos + eta * inner);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// How far the Fresnel term is from the first of [`Surface::reflectances`](super::surface::Surface::reflectances) to the second, for
/// four cosines between view and half vector.
pub(super) fn grazing(cosines: Vec4, eta: Option<f32>) -> Vec4 {
    match eta {
        Some(eta) => cosines.map(|cos| dielectric_weight(cos, eta)),
        None => schlick_weights(cosines),
    }
}

/// `incident` (unit, towards the surface) bent at a surface with unit `normal` against it; `None` where everything is
/// reflected.
pub(super) fn refract(incident: Vec3, normal: Vec3, eta: f32) -> Option<Vec3> {
    let cos = -incident.dot(normal);
    let sin2 = (1.0 - cos * cos).max(0.0) / (eta * eta);
    (sin2 < 1.0).then(|| incident / eta + normal * (cos / eta - (1.0 - sin2).sqrt()))
}

/// GGX's density of half vectors, 1/sr; `nh2` is the square of their cosine to the normal, `a2` that of alpha.
#[inline]
pub(super) fn density(nh2: Vec4, a2: Vec4) -> Vec4 {
    let d = nh2 * (a2 - 1.0) + Vec4::ONE;
    a2 * FRAC_1_PI / (d * d)
}

/// BRDF without its Fresnel term for four pairs of a light and a point, given as unit directions to the lights with their
/// cosines to the normals, and the cosines between view and half vector that the term needs. 0 in lanes that are not
/// `asked` for or have less than `min` of density; `None` where all are.
#[inline]
pub(super) fn lobes(
    normals: Vec3x4,
    views: Vec3x4,
    (to_lights, cosines): (Vec3x4, Vec4),
    a2: Vec4,
    min: f32,
    asked: Lanes,
) -> Option<(Vec4, Vec4)> {
    let half = to_lights + views;
    let square = half.length_squared();
    let nv = normals.dot(views);
    let along = (cosines + nv).max(Vec4::ZERO);
    // Opposite directions have no half vector: NaN, which `min` gives back only as its second argument.
    let density = density(Vec4::ONE.min(along * along / square), a2);
    let counted = Lanes::above_zero(asked.select(density) - Vec4::splat(min));
    if counted.is_empty() {
        return None;
    }
    let nl = cosines.clamp(Vec4::ZERO, Vec4::ONE);
    let nv = nv.abs().max(Vec4::splat(1e-4));
    let masked = (nl * nl * (1.0 - a2) + a2).sqrt();
    let shadowing = nl * (nv * nv * (1.0 - a2) + a2).sqrt() + nv * masked;
    let lobes = density * 0.5 / shadowing.max(Vec4::splat(1e-6));
    // Half of the half vector's length: both unit vectors lean from it alike.
    let cos = (square.sqrt() * 0.5).min(Vec4::ONE);
    Some((counted.select(lobes), cos))
}

/// Share of evenly lit surroundings that a rough surface mirrors: the split-sum scale and bias of `f0` and `f90`, in
/// Karis' fit (*Physically Based Shading on Mobile*, 2014).
pub(super) fn environment_share(f0: Vec3, f90: f32, roughness: f32, cos: f32) -> Vec3 {
    let c0 = Vec4::new(-1.0, -0.0275, -0.572, 0.022);
    let c1 = Vec4::new(1.0, 0.0425, 1.04, -0.04);
    let r = c0 * roughness + c1;
    let a004 = (r.x * r.x).min((-9.28 * cos).exp2()) * r.x + r.y;
    let ab = Vec2::new(-1.04, 1.04) * a004 + r.zw();
    f0 * ab.x + Vec3::splat(f90 * ab.y.max(0.0))
}
