//! Phong materials as metallic-roughness.

use super::{super::ignored::Notes, textures::Textures};
use crate::{
    Result,
    scene::{AlphaMode, ColorSpace, Material, Volume},
};
use glam::{Vec3, Vec4};

/// Statements that `tobj` has no field for, and that are read, or that change nothing by themselves.
const READ: &[&str] = &["Tr", "Pr", "Pm", "map_Ke", "norm", "sharpness", "map_aat", "Pcr", "anisor"];

/// Statements that are left out, the numbers with which they change nothing, and what is seen instead.
const LEFT_OUT: &[(&str, Option<f32>, &str)] = &[
    ("Pc", Some(0.0), "the clear coat is left out"),
    ("Ps", Some(0.0), "the sheen is left out"),
    ("aniso", Some(0.0), "highlights are round"),
    ("Tf", Some(1.0), "what shines through keeps its colour"),
    ("disp", None, "the surface stays as smooth as it is"),
    ("refl", None, "the scene itself is mirrored"),
    ("decal", None, "the texture is left out"),
];

/// What has no material.
pub(super) fn grey() -> Material {
    Material {
        base_color: Vec4::new(0.8, 0.8, 0.8, 1.0),
        metallic: 0.0,
        double_sided: true,
        ..Material::default()
    }
}

/// The material of an MTL file; what is not read of it is noted at `place`.
pub(super) fn convert(mtl: &tobj::Material, textures: &mut Textures, place: &str) -> Result<Material> {
    note_what_is_left_out(mtl, textures.notes, place);
    let unknown = |key: &str| mtl.unknown_param.get(key).map(String::as_str);
    let number =
        |key: &str| unknown(key).and_then(|v| v.trim().parse::<f32>().ok()).filter(|v| v.is_finite());
    let diffuse_map = mtl.diffuse_texture.as_deref();
    let cut_out = match mtl.dissolve_texture.as_deref() {
        Some(mask) => textures.cut_out(diffuse_map, mask, place)?,
        None => None,
    };
    let opacity = mtl.dissolve.or_else(|| number("Tr").map(|t| 1.0 - t)).unwrap_or(1.0).clamp(0.0, 1.0);
    // Models 4, 6, 7 and 9 are glass: what is not opaque refracts. The others let through straight on.
    let glass = opacity < 1.0 && matches!(mtl.illumination_model, Some(4 | 6 | 7 | 9));
    let alpha_mode = match cut_out {
        _ if opacity < 1.0 && !glass => AlphaMode::Blend,
        Some((_, mode)) => mode,
        None => AlphaMode::Opaque,
    };
    let is_opaque = alpha_mode == AlphaMode::Opaque;
    let space = if is_opaque { ColorSpace::Srgb } else { ColorSpace::SrgbCutOut };
    let base_color_texture = match (cut_out, diffuse_map) {
        (Some((texture, _)), _) => Some(texture),
        (None, Some(map)) => textures.color(map, place, space)?,
        (None, None) => None,
    };
    let glow = unknown("map_Ke").map(|map| textures.color(map, place, ColorSpace::Srgb));
    let emissive_texture = glow.transpose()?.flatten();
    let normal_map = unknown("norm").or(mtl.normal_texture.as_deref());
    let normal_texture = normal_map.map(|map| textures.normals(map, place)).transpose()?.flatten();
    let color = |c: Option<[f32; 3]>, default: f32| {
        Vec3::from_array(c.unwrap_or([default; 3]).map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 }))
    };
    // A texture without Kd is meant to be seen as it is.
    let diffuse = color(mtl.diffuse, if base_color_texture.is_some() { 1.0 } else { 0.8 });
    let shininess = mtl.shininess.filter(|s| s.is_finite() && *s >= 0.0);
    let ior = mtl.optical_density.filter(|n| n.is_finite() && *n > 1.0);
    let emits = emissive_texture.is_some() && mtl.emissive.is_none();
    Ok(Material {
        name: mtl.name.clone(),
        base_color: diffuse.extend(if glass { 1.0 } else { opacity }),
        base_color_texture,
        metallic: number("Pm").unwrap_or(0.0).clamp(0.0, 1.0),
        // The exponent whose lobe is as wide as GGX's: alpha^2 = 2 / (Ns + 2), roughness^2 = alpha.
        roughness: number("Pr")
            .or(shininess.map(|s| (2.0 / (s + 2.0)).powf(0.25)))
            .unwrap_or(1.0)
            .clamp(0.0, 1.0),
        normal_texture,
        emissive: if emits { Vec3::ONE } else { color(mtl.emissive, 0.0) },
        emissive_texture,
        alpha_mode,
        double_sided: !glass,
        ior: ior.unwrap_or(1.5),
        specular: color(mtl.specular, 1.0).max_element().min(1.0),
        transmission: if glass { 1.0 - opacity } else { 0.0 },
        volume: (glass && ior.is_some())
            .then_some(Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE }),
        ..Material::default()
    })
}

fn note_what_is_left_out(mtl: &tobj::Material, notes: &Notes, place: &str) {
    let known = [("map_Ks", &mtl.specular_texture), ("map_Ns", &mtl.shininess_texture)];
    let known = known.into_iter().filter_map(|(key, value)| Some((key, value.as_deref()?)));
    let unknown = mtl.unknown_param.iter().map(|(key, value)| (key.as_str(), value.as_str()));
    let mut all: Vec<(&str, &str)> = known.chain(unknown.filter(|(key, _)| !READ.contains(key))).collect();
    all.sort_unstable();
    for (key, value) in all {
        let effect = match LEFT_OUT.iter().find(|(left_out, ..)| *left_out == key) {
            Some((_, Some(neutral), _)) if value.split_whitespace().all(|v| v.parse() == Ok(*neutral)) => {
                continue;
            }
            Some((_, _, effect)) => effect,
            None if key.starts_with("map_") => "the texture is left out",
            None => "unknown; left out",
        };
        notes.add(key, place, effect);
    }
}
