//! Metallic-roughness materials (glTF 2.0, 3.9, and the KHR_materials extensions that are rendered).

use super::TextureRef;
use glam::Vec3;
use glam::Vec4;

/// What a surface does with light. See `docs/shading.md` for how it is evaluated.
#[derive(Debug, Clone)]
pub struct Material {
    /// For messages and mattes.
    pub name: String,
    /// Linear base colour and alpha, multiplied into the texture and the vertex colour.
    pub base_color: Vec4,
    /// sRGB base colour and alpha.
    pub base_color_texture: Option<TextureRef>,
    /// 0 dielectric, 1 metal.
    pub metallic: f32,
    /// Perceptual roughness; GGX alpha is its square.
    pub roughness: f32,
    /// Roughness in G, metalness in B.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normal map.
    pub normal_texture: Option<NormalTexture>,
    /// Occlusion in R, and its strength; it dims the world's ambient light only.
    pub occlusion_texture: Option<(TextureRef, f32)>,
    /// Emitted radiance, `emissiveStrength` included.
    pub emissive: Vec3,
    /// sRGB factor on `emissive`.
    pub emissive_texture: Option<TextureRef>,
    /// How alpha is used.
    pub alpha_mode: AlphaMode,
    /// Seen from both sides; otherwise back faces are not there for rays from the eye.
    pub double_sided: bool,
    /// Base colour is the radiance (`KHR_materials_unlit`).
    pub unlit: bool,
    /// Index of refraction.
    pub ior: f32,
    /// Strength of the dielectric reflection (`KHR_materials_specular`).
    pub specular: f32,
    /// In A, a factor on `specular`.
    pub specular_texture: Option<TextureRef>,
    /// Colour of the dielectric reflection at normal incidence.
    pub specular_color: Vec3,
    /// sRGB factor on `specular_color`.
    pub specular_color_texture: Option<TextureRef>,
    /// Share of the light that is not reflected that passes through (`KHR_materials_transmission`).
    pub transmission: f32,
    /// In R, a factor on `transmission`.
    pub transmission_texture: Option<TextureRef>,
    /// A refracting inside; without it transmission is thin-walled.
    pub volume: Option<Volume>,
}

/// The inside of a refracting solid (`KHR_materials_volume`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// Distance in metres after which light has `attenuation_color`; infinite: no attenuation.
    pub attenuation_distance: f32,
    /// What remains of white light after that distance.
    pub attenuation_color: Vec3,
}

/// A normal map and how strongly it applies.
#[derive(Debug, Clone)]
pub struct NormalTexture {
    /// The map; linear.
    pub texture: TextureRef,
    /// Factor on x and y.
    pub scale: f32,
}

/// How a material's alpha is used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Present where alpha is at least the cutoff.
    Mask(f32),
    /// Mixed with what is behind.
    Blend,
}

impl Default for Material {
    /// glTF's default material: white, metallic 1, roughness 1 (glTF 2.0, 3.9.6).
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            occlusion_texture: None,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            volume: None,
        }
    }
}

impl Material {
    /// True if any of its inputs is a texture.
    pub fn has_textures(&self) -> bool {
        self.base_color_texture.is_some()
            || self.metallic_roughness_texture.is_some()
            || self.normal_texture.is_some()
            || self.occlusion_texture.is_some()
            || self.emissive_texture.is_some()
            || self.specular_texture.is_some()
            || self.specular_color_texture.is_some()
            || self.transmission_texture.is_some()
    }
}
