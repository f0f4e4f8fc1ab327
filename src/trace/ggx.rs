//! The specular half of glTF 2.0's material model (Appendix B): GGX, height-correlated Smith, Fresnel.

use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use std::f32::consts::PI;

/// Schlick's Fresnel term.
#[inline]
pub(super) fn schlick(f0: Vec3, f90: f32, cos: f32) -> Vec3 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    let x2 = x * x;
    f0 + (Vec3::splat(f90) - f0) * (x2 * x2 * x)
}

/// The Fresnel term of a smooth dielectric for unpolarised light; `eta` is the index of refraction on the far side over
/// that on the near side. 1 where everything is reflected.
pub(super) fn dielectric(cos: f32, eta: f32) -> f32 {
    let sin2 = (1.0 - cos * cos).max(0.0) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let inner = (1.0 - sin2).sqrt();
    let parallel = (eta * cos - inner) / (eta * cos + inner);
    let perpendicular = (cos - eta * inner) / (cos + eta * inner);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
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
pub(super) fn density(nh2: f32, a2: f32) -> f32 {
    let d = nh2 * (a2 - 1.0) + 1.0;
    a2 / (PI * d * d)
}

/// BRDF without its Fresnel term, and the cosine between view and half vector that the term needs.
/// `None` where the lobe has less than `min` of density.
#[inline]
pub(super) fn lobe(normal: Vec3, view: Vec3, light: Vec3, alpha: f32, min: f32) -> Option<(f32, f32)> {
    let half = view + light;
    let (square, along) = (half.length_squared(), normal.dot(half).max(0.0));
    let a2 = alpha * alpha;
    let density = density((along * along / square).min(1.0), a2);
    // Opposite directions have no half vector: NaN.
    if density.is_nan() || density < min {
        return None;
    }
    let half = half / square.sqrt();
    let nl = normal.dot(light).clamp(0.0, 1.0);
    let nv = normal.dot(view).abs().max(1e-4);
    let shadowing = nl * (nv * nv * (1.0 - a2) + a2).sqrt() + nv * (nl * nl * (1.0 - a2) + a2).sqrt();
    Some((density * 0.5 / shadowing.max(1e-6), view.dot(half).clamp(0.0, 1.0)))
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
