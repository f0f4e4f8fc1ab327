//! What a material says at a point: the inputs of the shading model, textures applied.

use super::ggx::{dielectric_weight, schlick};
use super::interaction::SurfaceInteraction;
use crate::scene::{AlphaMode, MIRROR_ROUGHNESS, Material, TextureRef};
use glam::{Vec3, Vec4};

/// Up to this roughness a surface mirrors in full; from here to [`MIRROR_ROUGHNESS`] the mirror image fades.
const FULL_MIRROR_ROUGHNESS: f32 = 0.1;

/// Highlights are no sharper than this roughness, so that lights without size have some that are finite.
const MIN_HIGHLIGHT_ROUGHNESS: f32 = 0.08;

/// Reflectance at normal incidence of the usual index of refraction, 1.5.
const USUAL_REFLECTANCE: f32 = {
    let root: f32 = (1.5 - 1.0) / (1.5 + 1.0);
    root * root
};

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
            albedo: color * ((1.0 - metallic) * (1.0 - transmission) * scattered(dielectric_f0)),
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
        match self.eta.map(|eta| dielectric_weight(cos, eta)) {
            // Schlick's fit knows no total reflection.
            Some(weight) if weight < 1.0 => self.f0.lerp(Vec3::splat(self.f90), weight),
            Some(_) => Vec3::ONE,
            None => schlick(self.f0, self.f90, cos),
        }
    }

    /// The reflectances between which the Fresnel term lies.
    #[inline]
    pub fn reflectances(&self) -> [Vec3; 2] {
        [self.f0, Vec3::splat(self.f90)]
    }

    /// Whether lights have highlights on it: not inside a solid, nor where nothing is reflected.
    pub fn has_highlights(&self) -> bool {
        self.f90 != 0.0 && self.eta.is_none_or(|eta| eta >= 1.0)
    }
}

/// Share of the light that a dielectric scatters of what it would with the usual reflectance: what is mirrored is not
/// scattered. It does not depend on the eye, as the Fresnel term does, and colours are chosen with the usual one in mind.
fn scattered(f0: Vec3) -> f32 {
    ((1.0 - f0.max_element()) / (1.0 - USUAL_REFLECTANCE)).min(1.0)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Wrap;
    use glam::Affine2;

    fn albedo(material: &Material, texture: Vec4) -> Vec3 {
        Surface::new(material, true, Vec4::ONE, |_| texture).albedo
    }

    #[test]
    fn what_is_mirrored_is_not_scattered() {
        let color = Vec3::new(0.9, 0.5, 0.1);
        let with = |ior: f32, specular_color: Vec3| Material {
            ior,
            specular_color,
            ..Material::dielectric(color, 0.5)
        };
        // The usual reflectance and less change nothing, to the bit.
        for material in [with(1.5, Vec3::ONE), with(1.0, Vec3::ONE), with(1.5, Vec3::splat(0.5))] {
            assert_eq!(albedo(&material, Vec4::ONE), color);
        }
        // All light is mirrored, or half of it in the channel that has the most.
        assert!(albedo(&with(1e6, Vec3::ONE), Vec4::ONE).max_element() < 1e-5);
        let half = albedo(&with(1e6, Vec3::new(0.1, 0.5, 0.2)), Vec4::ONE);
        assert!((half - color * (0.5 / 0.96)).length() < 1e-4, "{half}");
        // The same reflectance by the specular colour alone is the same surface.
        let tinted = albedo(&with(1.5, Vec3::new(0.1, 0.5, 0.2) / 0.04), Vec4::ONE);
        assert!((half - tinted).length() < 1e-4, "{half} {tinted}");
    }

    #[test]
    fn textures_of_the_specular_colour_count_too() {
        let texture = TextureRef {
            image: 0,
            uv_set: 0,
            transform: Affine2::IDENTITY,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            nearest: true,
        };
        let material = Material {
            ior: 1e6,
            specular_color_texture: Some(texture),
            ..Material::dielectric(Vec3::ONE, 0.5)
        };
        let bright = albedo(&material, Vec4::new(0.0, 0.04, 0.0, 1.0));
        assert!((bright - Vec3::ONE).length() < 1e-4, "{bright}");
        let dark = albedo(&material, Vec4::new(0.0, 1.0, 0.0, 1.0));
        assert!(dark.max_element() < 1e-5, "{dark}");
    }
}
