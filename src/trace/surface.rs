//! What a material says at a point: the inputs of the shading model, textures applied.

use super::ggx::{dielectric, schlick};
use super::interaction::SurfaceInteraction;
use crate::scene::{AlphaMode, MIRROR_ROUGHNESS, Material, TextureRef};
use glam::{Vec3, Vec4};

/// Up to this roughness a surface mirrors in full; from here to [`MIRROR_ROUGHNESS`] the mirror image fades.
const FULL_MIRROR_ROUGHNESS: f32 = 0.1;

/// Highlights are no sharper than this roughness, so that lights without size have some that are finite.
const MIN_HIGHLIGHT_ROUGHNESS: f32 = 0.08;

/// A material's parameters at a point.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    /// Base colour of the part that scatters, not that which mirrors or transmits.
    pub albedo: Vec3,
    pub emission: Vec3,
    /// 1, or less where the material is blended with what is behind.
    pub coverage: f32,
    pub roughness: f32,
    /// GGX's alpha for highlights.
    pub alpha: f32,
    /// Share of the reflection that is a mirror image; the rest is blurred.
    pub mirror: f32,
    /// Reflectance at normal incidence and at grazing.
    pub f0: Vec3,
    pub f90: f32,
    /// What passes through of what is not reflected.
    pub transmittance: Vec3,
    /// Index of refraction on the far side over that on the near side, where light is bent.
    pub eta: Option<f32>,
}

/// A material prepared for many points.
#[derive(Debug)]
pub(super) struct ShadingMaterial {
    /// Whether any of its inputs is a texture.
    pub is_textured: bool,
    /// The surface where textures and vertex colours are white: from the front, and from the back.
    plain: [Surface; 2],
}

impl ShadingMaterial {
    pub fn new(material: &Material) -> Self {
        let plain = |front| Surface::new(material, front, Vec4::ONE, |_| Vec4::ONE);
        Self { is_textured: material.has_textures(), plain: [plain(true), plain(false)] }
    }

    /// The surface at a point; `room` holds it where it is not the same everywhere.
    #[inline]
    pub fn surface<'a>(&'a self, it: &SurfaceInteraction, room: &'a mut Option<Surface>) -> &'a Surface {
        *room = self.own_surface(it);
        room.as_ref().unwrap_or_else(|| self.plain_surface(it.point.front))
    }

    /// The surface at a point where it is not the same everywhere.
    #[inline]
    pub fn own_surface(&self, it: &SurfaceInteraction) -> Option<Surface> {
        let is_plain = !self.is_textured && it.point.mesh.colors.is_empty();
        let own = || Surface::new(it.point.material, it.point.front, it.vertex_color(), |t| it.texture(t));
        (!is_plain).then(own)
    }

    /// The surface where it is the same everywhere, from the front or from the back.
    #[inline]
    pub fn plain_surface(&self, front: bool) -> &Surface {
        &self.plain[usize::from(!front)]
    }
}

impl Surface {
    /// The surface where vertex colours and textures have these values, seen from the front or from the back.
    fn new(
        material: &Material,
        front: bool,
        vertex_color: Vec4,
        texture: impl Fn(&TextureRef) -> Vec4,
    ) -> Self {
        let texture = |t: &Option<TextureRef>| t.as_ref().map_or(Vec4::ONE, &texture);
        let base = material.base_color * texture(&material.base_color_texture) * vertex_color;
        let color = base.truncate();
        let coverage = if material.alpha_mode == AlphaMode::Blend { base.w.clamp(0.0, 1.0) } else { 1.0 };
        if material.unlit {
            return Self {
                albedo: Vec3::ZERO,
                emission: color,
                coverage,
                roughness: 1.0,
                alpha: 1.0,
                mirror: 0.0,
                f0: Vec3::ZERO,
                f90: 0.0,
                transmittance: Vec3::ZERO,
                eta: None,
            };
        }
        let rough_metal = texture(&material.metallic_roughness_texture);
        let metallic = (material.metallic * rough_metal.z).clamp(0.0, 1.0);
        let roughness = (material.roughness * rough_metal.y).clamp(0.0, 1.0);
        let mut emission = material.emissive;
        if emission != Vec3::ZERO {
            emission *= texture(&material.emissive_texture).truncate();
        }
        let mut transmission = material.transmission;
        if transmission > 0.0 {
            transmission = (transmission * texture(&material.transmission_texture).x).clamp(0.0, 1.0);
        }
        let specular = (material.specular * texture(&material.specular_texture).w).clamp(0.0, 1.0);
        let tint = material.specular_color * texture(&material.specular_color_texture).truncate();
        let reflectance = ((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
        let dielectric_f0 = (tint * reflectance).min(Vec3::ONE) * specular;
        let ior = material.ior.max(1.0);
        let bends = material.volume.is_some() && transmission > 0.0 && metallic < 1.0;
        Self {
            albedo: color * ((1.0 - metallic) * (1.0 - transmission)),
            emission,
            coverage,
            roughness,
            alpha: roughness.max(MIN_HIGHLIGHT_ROUGHNESS).powi(2),
            mirror: mirror(roughness),
            f0: dielectric_f0.lerp(color, metallic),
            f90: specular + (1.0 - specular) * metallic,
            transmittance: color * ((1.0 - metallic) * transmission),
            eta: bends.then_some(if front { ior } else { 1.0 / ior }),
        }
    }

    /// Share of the light that is reflected, for a cosine between view and normal (or half vector).
    pub fn fresnel(&self, cos: f32) -> Vec3 {
        match self.eta {
            // Schlick's fit knows no total reflection. A solid reflects by its index alone.
            Some(eta) => Vec3::splat(dielectric(cos, eta)),
            None => schlick(self.f0, self.f90, cos),
        }
    }

    /// The reflectances between which the Fresnel term lies.
    #[inline]
    pub fn reflectances(&self) -> [Vec3; 2] {
        match self.eta {
            Some(_) => [Vec3::ZERO, Vec3::ONE],
            None => [self.f0, Vec3::splat(self.f90)],
        }
    }

    /// Whether lights have highlights on it: not inside a solid, nor where nothing is reflected.
    pub fn has_highlights(&self) -> bool {
        self.f90 != 0.0 && self.eta.is_none_or(|eta| eta >= 1.0)
    }
}

/// Share of the reflection that is a mirror image.
fn mirror(roughness: f32) -> f32 {
    let t = (MIRROR_ROUGHNESS - roughness) / (MIRROR_ROUGHNESS - FULL_MIRROR_ROUGHNESS);
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Ambient light that occlusion leaves, 0 to 1.
pub(super) fn occlusion(it: &SurfaceInteraction) -> f32 {
    let Material { occlusion_texture, .. } = it.point.material;
    occlusion_texture
        .as_ref()
        .map_or(1.0, |(texture, strength)| 1.0 + strength * (it.texture(texture).x - 1.0))
}
