//! Materials and their textures.

use super::{
    document::{Document, Element},
    ignored::Notes,
    image::{self, Images, Wanted},
};
use crate::{
    Result,
    scene::{AlphaMode, ColorSpace, Material, NormalTexture, TextureRef, Volume, Wrap},
};
use glam::{Affine2, Vec2, Vec3, Vec4};

/// Every texture slot that is rendered: the path to its `textureInfo`, and how its image's values are meant
/// where alpha is used.
const SLOTS: &[(&[&str], ColorSpace)] = &[
    (&["pbrMetallicRoughness", "baseColorTexture"], ColorSpace::SrgbCutOut),
    (&["pbrMetallicRoughness", "metallicRoughnessTexture"], ColorSpace::Linear),
    (&["normalTexture"], ColorSpace::Linear),
    (&["occlusionTexture"], ColorSpace::Linear),
    (&["emissiveTexture"], ColorSpace::Srgb),
    (&["extensions", "KHR_materials_specular", "specularTexture"], ColorSpace::Linear),
    (&["extensions", "KHR_materials_specular", "specularColorTexture"], ColorSpace::Srgb),
    (&["extensions", "KHR_materials_transmission", "transmissionTexture"], ColorSpace::Linear),
    (&["extensions", SPECULAR_GLOSSINESS, "diffuseTexture"], ColorSpace::SrgbCutOut),
    (&["extensions", SPECULAR_GLOSSINESS, "specularGlossinessTexture"], ColorSpace::Srgb),
];

/// The older of the two material models; archived, and still met.
const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";
/// Reflectance at normal incidence of the default index of refraction.
const F0: f32 = 0.04;

/// The images that a material of the file uses.
pub(super) fn wanted_images(material: &Element, notes: &Notes) -> Result<Vec<Wanted>> {
    let alpha_mode = alpha_mode(material)?;
    let mut wanted = Vec::new();
    for (path, space) in SLOTS {
        let info = path.iter().try_fold(material.clone(), |element, key| element.get(key));
        if let Some(info) = info
            && let Some(image) = image_of(&info, notes)?
        {
            wanted.push((image, meant(*space, alpha_mode)));
        }
    }
    Ok(wanted)
}

/// How an image's values are meant in a material that uses alpha or, being opaque, does not.
fn meant(space: ColorSpace, alpha_mode: AlphaMode) -> ColorSpace {
    match (space, alpha_mode) {
        (ColorSpace::SrgbCutOut, AlphaMode::Opaque) => ColorSpace::Srgb,
        _ => space,
    }
}

fn alpha_mode(material: &Element) -> Result<AlphaMode> {
    Ok(match material.text("alphaMode")? {
        None | Some("OPAQUE") => AlphaMode::Opaque,
        Some("MASK") => AlphaMode::Mask(material.f32("alphaCutoff", 0.5)?),
        Some("BLEND") => AlphaMode::Blend,
        Some(other) => {
            return Err(material.error(format!("unknown alphaMode {other}; export the file again")));
        }
    })
}

/// The file's image that a `textureInfo` leads to.
fn image_of(info: &Element, notes: &Notes) -> Result<Option<usize>> {
    let texture = info.document.element("textures", info.required_index("index")?, &info.place)?;
    let webp = texture.extension("EXT_texture_webp").map(|e| e.index("source")).transpose()?.flatten();
    let source = match (webp, texture.index("source")?) {
        (Some(webp), Some(beside)) => match image::missing(info.document, webp)? {
            Some(name) => {
                let feature = format!("image {name} is missing");
                notes.add(feature, format!("/images/{webp}"), "the PNG or JPEG beside it is used");
                Some(beside)
            }
            None => Some(webp),
        },
        (webp, beside) => webp.or(beside),
    };
    if source.is_none() {
        let named = texture.get("extensions").and_then(|e| e.members().next().map(|(name, _)| name));
        let feature = named.unwrap_or("texture without an image");
        notes.add(
            feature,
            texture.place.clone(),
            "the texture has no PNG, JPEG or WebP; the factor alone is used",
        );
    }
    Ok(source)
}

/// Reads material `element`, its images already loaded.
pub(super) fn read(element: &Element, images: &Images, notes: &Notes) -> Result<Material> {
    let texture = |parent: &Element, name: &str, space| match parent.get(name) {
        Some(info) => texture(&info, images, notes, space),
        None => Ok(None),
    };
    let alpha_mode = alpha_mode(element)?;
    let cut_out = meant(ColorSpace::SrgbCutOut, alpha_mode);
    let mut out = Material { name: element.name(), alpha_mode, ..Material::default() };
    if let Some(pbr) = element.get("pbrMetallicRoughness") {
        out.base_color = Vec4::from(pbr.f32s("baseColorFactor", [1.0; 4])?).max(Vec4::ZERO);
        out.base_color_texture = texture(&pbr, "baseColorTexture", cut_out)?;
        out.metallic = pbr.f32("metallicFactor", 1.0)?.clamp(0.0, 1.0);
        out.roughness = pbr.f32("roughnessFactor", 1.0)?.clamp(0.0, 1.0);
        out.metallic_roughness_texture = texture(&pbr, "metallicRoughnessTexture", ColorSpace::Linear)?;
    }
    if let Some(info) = element.get("normalTexture") {
        let scale = info.f32("scale", 1.0)?;
        out.normal_texture = texture(element, "normalTexture", ColorSpace::Linear)?
            .map(|texture| NormalTexture { texture, scale });
    }
    if let Some(info) = element.get("occlusionTexture") {
        let strength = info.f32("strength", 1.0)?.clamp(0.0, 1.0);
        out.occlusion_texture =
            texture(element, "occlusionTexture", ColorSpace::Linear)?.map(|texture| (texture, strength));
    }
    out.emissive = Vec3::from(element.f32s("emissiveFactor", [0.0; 3])?).max(Vec3::ZERO);
    out.emissive_texture = texture(element, "emissiveTexture", ColorSpace::Srgb)?;
    out.double_sided = element.flag("doubleSided")?.unwrap_or(false);
    out.unlit = element.extension("KHR_materials_unlit").is_some();
    if let Some(extension) = element.extension("KHR_materials_emissive_strength") {
        out.emissive *= extension.f32("emissiveStrength", 1.0)?.max(0.0);
    }
    if let Some(extension) = element.extension("KHR_materials_ior") {
        // 0 stands for infinite: a dielectric that reflects all, from specular-glossiness conversions.
        let ior = extension.f32("ior", 1.5)?;
        out.ior = if ior == 0.0 { 1e6 } else { ior.max(1.0) };
    }
    if let Some(extension) = element.extension("KHR_materials_specular") {
        out.specular = extension.f32("specularFactor", 1.0)?.clamp(0.0, 1.0);
        out.specular_texture = texture(&extension, "specularTexture", ColorSpace::Linear)?;
        out.specular_color = Vec3::from(extension.f32s("specularColorFactor", [1.0; 3])?).max(Vec3::ZERO);
        out.specular_color_texture = texture(&extension, "specularColorTexture", ColorSpace::Srgb)?;
    }
    if let Some(extension) = element.extension("KHR_materials_transmission") {
        out.transmission = extension.f32("transmissionFactor", 0.0)?.clamp(0.0, 1.0);
        out.transmission_texture = texture(&extension, "transmissionTexture", ColorSpace::Linear)?;
    }
    if let Some(extension) = element.extension("KHR_materials_volume") {
        out.volume = volume(&extension)?;
    }
    if let Some(extension) = element.extension(SPECULAR_GLOSSINESS) {
        // The same reflectance as a dielectric with a coloured specular; only the glossiness texture has no place.
        let specular = Vec3::from(extension.f32s("specularFactor", [1.0; 3])?).clamp(Vec3::ZERO, Vec3::ONE);
        out.base_color = Vec4::from(extension.f32s("diffuseFactor", [1.0; 4])?).max(Vec4::ZERO);
        out.base_color_texture = texture(&extension, "diffuseTexture", cut_out)?;
        (out.metallic, out.metallic_roughness_texture) = (0.0, None);
        out.roughness = 1.0 - extension.f32("glossinessFactor", 1.0)?.clamp(0.0, 1.0);
        out.specular_color = specular / F0;
        out.specular_color_texture = texture(&extension, "specularGlossinessTexture", ColorSpace::Srgb)?;
        if extension.get("specularGlossinessTexture").is_some() {
            notes.add(SPECULAR_GLOSSINESS, element.place.clone(), "glossiness in textures is left out");
        }
    }
    Ok(out)
}

/// The inside; none for a thickness of 0, which means thin walls.
///
/// A ray tracer measures the way through the solid itself, so the thickness says no more than that.
fn volume(extension: &Element) -> Result<Option<Volume>> {
    let thick = extension.f32("thicknessFactor", 0.0)? > 0.0;
    let distance = extension.f32("attenuationDistance", f32::INFINITY)?;
    let color = extension.f32s("attenuationColor", [1.0; 3])?;
    Ok(thick.then_some(Volume {
        attenuation_distance: if distance > 0.0 { distance } else { f32::INFINITY },
        attenuation_color: Vec3::from(color).clamp(Vec3::ZERO, Vec3::ONE),
    }))
}

fn texture(info: &Element, images: &Images, notes: &Notes, space: ColorSpace) -> Result<Option<TextureRef>> {
    let Some(image) = image_of(info, notes)?.and_then(|image| images.find(image, space)) else {
        return Ok(None);
    };
    let mut uv_set = info.index("texCoord")?.unwrap_or(0);
    let mut transform = Affine2::IDENTITY;
    if let Some(extension) = info.extension("KHR_texture_transform") {
        uv_set = extension.index("texCoord")?.unwrap_or(uv_set);
        let offset = Vec2::from(extension.f32s("offset", [0.0; 2])?);
        let scale = Vec2::from(extension.f32s("scale", [1.0; 2])?);
        // Counter-clockwise as the image is seen; v grows downwards, so the angle changes its sign.
        transform = Affine2::from_scale_angle_translation(scale, -extension.f32("rotation", 0.0)?, offset);
    }
    if uv_set > 63 {
        return Err(info.error(format!("texCoord {uv_set} is out of range; export the file again")));
    }
    let (wrap_u, wrap_v, nearest) = sampler(info.document, info)?;
    Ok(Some(TextureRef { image, uv_set, transform, wrap_u, wrap_v, nearest }))
}

fn sampler(document: &Document, info: &Element) -> Result<(Wrap, Wrap, bool)> {
    let texture = document.element("textures", info.required_index("index")?, &info.place)?;
    let Some(index) = texture.index("sampler")? else { return Ok((Wrap::Repeat, Wrap::Repeat, false)) };
    let sampler = document.element("samplers", index, &texture.place)?;
    let wrap = |key: &str| -> Result<Wrap> {
        Ok(match sampler.index(key)?.unwrap_or(10497) {
            33071 => Wrap::Clamp,
            33648 => Wrap::Mirror,
            _ => Wrap::Repeat,
        })
    };
    Ok((wrap("wrapS")?, wrap("wrapT")?, sampler.index("magFilter")? == Some(9728)))
}
