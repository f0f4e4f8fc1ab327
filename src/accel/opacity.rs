//! Which hits count: culled back faces, holes cut by alpha, and what lets light through.
//!
//! A material that is the same everywhere is decided once, so that only rays that meet a surface whose alpha or
//! transmission comes from a texture pay for a lookup.

use crate::scene::{AlphaMode, Material, Mesh, Scene, Shape};
use glam::Vec2;

/// Back faces are not there for rays from the eye.
pub(super) const CULL_BACK: u32 = 1;
/// Rays from the eye must ask for alpha.
pub(super) const EYE_TEST: u32 = 2;
/// Rays from the eye pass everywhere.
pub(super) const EYE_PASS: u32 = 4;
/// Shadow rays must ask for opacity.
pub(super) const SHADOW_TEST: u32 = 8;
/// Light passes everywhere.
pub(super) const SHADOW_PASS: u32 = 16;
/// The corners are wound the other way, because a mirroring transform has been applied to them.
pub(super) const MIRRORED: u32 = 32;

/// Below this alpha a blended surface is not there.
const MIN_ALPHA: f32 = 1.0 / 255.0;
/// From this opacity on a surface casts a shadow.
const SHADOW_OPACITY: f32 = 0.5;

/// True if the eye looks through the back of a surface of `mesh`.
pub(super) fn culls_back(scene: &Scene, mesh: &Mesh) -> bool {
    let material = &scene.materials[mesh.material];
    let double_sided = material.double_sided || mesh.shape.as_ref().is_some_and(Shape::is_double_sided);
    !double_sided && material.transmission == 0.0
}

/// True if alpha does not differ from place to place, so that nobody has to ask for it.
pub(super) fn is_alpha_uniform(scene: &Scene, mesh: &Mesh) -> bool {
    let material = &scene.materials[mesh.material];
    material.alpha_mode == AlphaMode::Opaque
        || (material.base_color_texture.is_none() && mesh.colors.is_empty())
}

/// The flags of triangles of `mesh`, or of its shape.
pub(super) fn flags(scene: &Scene, mesh: &Mesh) -> u32 {
    let material = &scene.materials[mesh.material];
    let mut flags = 0;
    if culls_back(scene, mesh) {
        flags |= CULL_BACK;
    }
    let uniform_alpha = is_alpha_uniform(scene, mesh);
    if !uniform_alpha {
        flags |= EYE_TEST;
    } else if !is_present(material, material.base_color.w) {
        flags |= EYE_PASS;
    }
    if !uniform_alpha || (material.transmission > 0.0 && material.transmission_texture.is_some()) {
        flags |= SHADOW_TEST;
    } else if !casts_shadow(material, material.base_color.w, material.transmission) {
        flags |= SHADOW_PASS;
    }
    flags
}

/// True if a ray from the eye meets `mesh` at a point that needs testing.
pub(super) fn is_present_at(scene: &Scene, mesh: &Mesh, primitive: u32, u: f32, v: f32) -> bool {
    let material = &scene.materials[mesh.material];
    is_present(material, alpha(scene, mesh, material, primitive, u, v))
}

/// True if `mesh` blocks light at a point that needs testing.
pub(super) fn casts_shadow_at(scene: &Scene, mesh: &Mesh, primitive: u32, u: f32, v: f32) -> bool {
    let material = &scene.materials[mesh.material];
    let mut transmission = material.transmission;
    if let (true, Some(texture)) = (transmission > 0.0, &material.transmission_texture) {
        let uv = texture.transform.transform_point2(uv_at(mesh, texture.uv_set, primitive, u, v));
        transmission *= scene.images[texture.image].sample(texture, uv, 0.0).x;
    }
    casts_shadow(material, alpha(scene, mesh, material, primitive, u, v), transmission)
}

fn is_present(material: &Material, alpha: f32) -> bool {
    match material.alpha_mode {
        AlphaMode::Opaque => true,
        AlphaMode::Mask(cutoff) => alpha >= cutoff,
        AlphaMode::Blend => alpha >= MIN_ALPHA,
    }
}

fn casts_shadow(material: &Material, alpha: f32, transmission: f32) -> bool {
    let coverage = match material.alpha_mode {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Mask(cutoff) => f32::from(alpha >= cutoff),
        AlphaMode::Blend => alpha,
    };
    coverage * (1.0 - transmission) >= SHADOW_OPACITY
}

/// Alpha of the base colour, from the full-size texture: a shadow must not depend on where the eye is.
fn alpha(scene: &Scene, mesh: &Mesh, material: &Material, primitive: u32, u: f32, v: f32) -> f32 {
    let mut alpha = material.base_color.w;
    if let Some(texture) = &material.base_color_texture {
        let uv = texture.transform.transform_point2(uv_at(mesh, texture.uv_set, primitive, u, v));
        alpha *= scene.images[texture.image].sample(texture, uv, 0.0).w;
    }
    if !mesh.colors.is_empty() {
        let [a, b, c] = mesh.triangles[primitive as usize].map(|i| mesh.colors[i as usize].w);
        alpha *= a * (1.0 - u - v) + b * u + c * v;
    }
    alpha
}

fn uv_at(mesh: &Mesh, set: usize, primitive: u32, u: f32, v: f32) -> Vec2 {
    let Some(uvs) = mesh.uvs.get(set).filter(|uvs| !uvs.is_empty()) else { return Vec2::ZERO };
    let [a, b, c] = mesh.triangles[primitive as usize].map(|i| uvs[i as usize]);
    a * (1.0 - u - v) + b * u + c * v
}
