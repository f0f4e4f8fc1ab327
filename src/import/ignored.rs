//! What a file holds and the renderer leaves out, and what it requires and cannot have.

use super::document::{Document, Element};
use crate::{Error, Result, scene::Ignored};
use std::{
    cell::RefCell,
    collections::{HashMap, HashSet},
    path::Path,
};

/// Extensions that are read. Everything else in `extensionsRequired` is refused.
const READ: &[&str] = &[
    "BUZZ_analytic_shape",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_implicit_shapes",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_transform",
    // Say nothing about the picture.
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Extensions that are known and not rendered, and what is seen instead.
const NOT_RENDERED: &[(&str, &str)] = &[
    ("KHR_materials_clearcoat", "the clear coat is left out"),
    ("KHR_materials_sheen", "the sheen is left out"),
    ("KHR_materials_iridescence", "reflections keep their colour"),
    ("KHR_materials_anisotropy", "highlights are round"),
    ("KHR_materials_dispersion", "all colours refract alike"),
    ("KHR_materials_diffuse_transmission", "no light shines through"),
    ("KHR_materials_volume_scatter", "the inside is clear"),
    ("KHR_materials_variants", "the default materials are used"),
    ("KHR_draco_mesh_compression", "the uncompressed data beside it is used"),
    ("KHR_texture_basisu", "the PNG or JPEG beside it is used, if there is one"),
    ("MSFT_texture_dds", "the PNG or JPEG beside it is used, if there is one"),
    ("MSFT_lod", "the highest level of detail is used"),
    ("EXT_lights_image_based", "the light is left out; set a world in extras.buzz"),
    ("EXT_lights_ies", "the light has the punctual shape"),
    ("EXT_lights_area", "the light is left out or a spot"),
    ("KHR_audio_emitter", "no sound is written"),
    ("KHR_interactivity", "nothing reacts"),
    ("KHR_physics_rigid_bodies", "nothing is simulated"),
    ("KHR_gaussian_splatting", "splats are left out"),
    ("EXT_structural_metadata", "metadata is left out"),
];

/// Collects [`Ignored`] entries, each feature once.
#[derive(Default)]
pub(super) struct Notes {
    entries: RefCell<Vec<Ignored>>,
    known: RefCell<HashSet<(String, String)>>,
}

impl Notes {
    /// Notes that `feature`, first met at `place`, is not rendered.
    pub fn add(&self, feature: impl Into<String>, place: impl Into<String>, effect: impl Into<String>) {
        let entry = Ignored { feature: feature.into(), place: place.into(), effect: effect.into() };
        if self.known.borrow_mut().insert((entry.feature.clone(), entry.effect.clone())) {
            self.entries.borrow_mut().push(entry);
        }
    }

    /// All entries, in the order they were met.
    pub fn into_entries(self) -> Vec<Ignored> {
        self.entries.into_inner()
    }
}

/// Refuses the file if it requires what is not read; notes what it uses and is not rendered.
pub(super) fn check_extensions(document: &Document, notes: &Notes) -> Result<()> {
    for item in document.root().items("extensionsRequired")? {
        let name = item.value.as_str().ok_or_else(|| item.error("must be a string"))?;
        if !READ.contains(&name) {
            let advice = match name {
                "KHR_draco_mesh_compression" => "export without Draco compression",
                "KHR_texture_basisu" => "export with PNG, JPEG or WebP textures",
                _ => "export without it",
            };
            return Err(item.error(format!("the file requires {name}, which is not supported; {advice}")));
        }
    }
    let met = first_uses(document)?;
    let places: HashMap<&str, &String> = met.iter().map(|(name, place)| (*name, place)).collect();
    let mut listed = HashSet::new();
    for item in document.root().items("extensionsUsed")? {
        let Some(name) = item.value.as_str() else { continue };
        let place = places.get(name).map_or(item.place, |place| (*place).clone());
        note_unless_read(name, place, notes);
        listed.insert(name);
    }
    // Some tools forget to declare what they write.
    for (name, place) in met.iter().filter(|(name, _)| !listed.contains(name)) {
        note_unless_read(name, place.clone(), notes);
    }
    Ok(())
}

fn note_unless_read(name: &str, place: String, notes: &Notes) {
    if !READ.contains(&name) {
        let known = NOT_RENDERED.iter().find(|(known, _)| *known == name);
        notes.add(name, place, known.map_or("unknown; left out", |(_, effect)| effect));
    }
}

/// Each extension that is used, once, and where first: the pointer that helps to find it in the authoring tool.
fn first_uses<'a>(document: &'a Document) -> Result<Vec<(&'a str, String)>> {
    let (mut met, mut known) = (Vec::new(), HashSet::new());
    let mut meet = |name: &'a str, place: &str| {
        if known.insert(name) {
            met.push((name, place.to_owned()));
        }
    };
    for array in ["materials", "nodes", "textures", "images", "cameras", "scenes"] {
        for element in document.elements(array)? {
            extensions(&element).for_each(|(name, _)| meet(name, &element.place));
        }
    }
    for mesh in document.elements("meshes")? {
        for primitive in mesh.items("primitives")? {
            extensions(&primitive).for_each(|(name, _)| meet(name, &primitive.place));
        }
    }
    extensions(&document.root()).for_each(|(name, element)| meet(name, &element.place));
    Ok(met)
}

/// The extensions of an element.
fn extensions<'a>(element: &Element<'a>) -> impl Iterator<Item = (&'a str, Element<'a>)> + use<'a> {
    element.get("extensions").into_iter().flat_map(|extensions| extensions.members())
}

/// With `--strict`, anything left out is an error.
pub(super) fn refuse_if_strict(file: &Path, ignored: &[Ignored]) -> Result<()> {
    let Some(first) = ignored.first() else { return Ok(()) };
    let more = match ignored.len() {
        1 => String::new(),
        n => format!(" (and {} more; see `buzz-convert inspect`)", n - 1),
    };
    let message = format!("{}: {}{more}; mend it, or leave out --strict", first.feature, first.effect);
    Err(Error::input(file, first.place.clone(), message))
}
