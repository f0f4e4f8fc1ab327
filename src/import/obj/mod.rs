//! Wavefront OBJ files with their MTL materials, as static geometry.

mod library;
mod lines;
mod material;
mod mesh;
mod polygon;
mod statement;
mod survey;
mod textures;

use super::{budget::Pictures, document::read_file, folder::Folder, ignored::Notes};
use crate::{
    Result,
    scene::{Instance, Node, Scene},
};
use glam::DAffine3;
use library::Libraries;
use std::{
    cell::Cell,
    collections::{HashMap, HashSet},
    fmt::Display,
    path::Path,
};
use survey::Survey;
use textures::Textures;

/// `tobj` would make fans of all polygons.
const OPTIONS: tobj::LoadOptions =
    tobj::LoadOptions { single_index: true, triangulate: false, ignore_points: true, ignore_lines: true };

/// Adds the models of `file` to the scene, under one node of its name.
pub(super) fn add(file: &Path, pictures: &Pictures, scene: &mut Scene) -> Result<()> {
    let notes = Notes::default();
    let bytes = read_file(file)?;
    let folder = Folder::of(file)?;
    let text = lines::decode(&bytes);
    let survey = Survey::of(file, &text, &notes)?;
    let libraries = Libraries { file, folder: &folder, notes: &notes, incomplete: Cell::new(false) };
    let loaded = tobj::load_obj_buf(&mut survey.polygons.as_bytes(), &OPTIONS, |names| libraries.load(names));
    let (models, materials) = loaded.map_err(|error| survey.failure(&text, error))?;
    let materials = materials.unwrap_or_default();
    if !libraries.incomplete.get() {
        note_unknown_materials(file, &survey, &materials, &notes);
    }
    let file_node = scene.nodes.len();
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    scene.nodes.push(Node { name, ..Node::default() });
    let mut textures = Textures {
        folder: &folder,
        pictures,
        notes: &notes,
        images: &mut scene.images,
        loaded: HashMap::new(),
    };
    let mut converted = HashMap::new();
    let mut object = scene.instances.iter().map(|i| i.object).max().unwrap_or(0);
    for model in models.into_iter().filter(|model| !model.mesh.indices.is_empty()) {
        let id = model.mesh.material_id.filter(|&m| m < materials.len());
        let material = match converted.get(&id) {
            Some(&known) => known,
            None => {
                scene.materials.push(match id.map(|id| &materials[id]) {
                    Some(mtl) => {
                        let place = place(file, format_args!("material {}", mtl.name));
                        material::convert(mtl, &mut textures, &place)?
                    }
                    None => material::grey(),
                });
                converted.insert(id, scene.materials.len() - 1);
                scene.materials.len() - 1
            }
        };
        let textured = scene.materials[material].has_textures();
        let place = place(file, format_args!("object {}", model.name));
        if let Some(mesh) = mesh::mesh(model, material, textured, &notes, &place) {
            object += 1;
            // A node of its own, since objects are named after their nodes.
            scene.nodes.push(Node { name: mesh.name.clone(), parent: Some(file_node), ..Node::default() });
            let node = scene.nodes.len() - 1;
            let mesh_index = scene.meshes.len();
            scene.meshes.push(mesh);
            let node_from_object = DAffine3::IDENTITY;
            scene.instances.push(Instance { node, mesh: mesh_index, skin: None, node_from_object, object });
        }
    }
    scene.files.extend(folder.into_files());
    let of_others = scene.ignored.len();
    for entry in notes.into_entries() {
        if !scene.ignored[..of_others].contains(&entry) {
            scene.ignored.push(entry);
        }
    }
    Ok(())
}

/// Where something is: several files may be read for one scene.
fn place(file: &Path, what: impl Display) -> String {
    format!("{} {what}", file.file_name().unwrap_or_default().to_string_lossy())
}

fn note_unknown_materials(file: &Path, survey: &Survey, materials: &[tobj::Material], notes: &Notes) {
    let known: HashSet<&str> = materials.iter().map(|material| material.name.as_str()).collect();
    let mut unknown = survey.used.iter().filter(|(name, _)| !known.contains(name.as_str()));
    if let Some((name, line)) = unknown.next() {
        let more = match unknown.count() {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        let feature = format!("material {name}{more}");
        notes.add(
            feature,
            place(file, format_args!("line {line}")),
            "no library has it; what uses it is grey",
        );
    }
}
