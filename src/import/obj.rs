//! Wavefront OBJ files with their MTL materials, as static geometry.

use super::{
    budget::Pictures,
    document::read_file,
    image,
    uri::{self, Source},
};
use crate::{
    Error, Result,
    scene::{
        AlphaMode, ColorSpace, Ignored, Instance, Material, Mesh, Node, NormalTexture, Scene, TextureRef,
        Volume, Wrap,
    },
};
use glam::{Affine2, DAffine3, Vec2, Vec3, Vec4};
use std::{
    cell::RefCell,
    collections::{HashMap, hash_map::Entry},
    path::{Path, PathBuf},
};

/// Adds the models of `file` to the scene, under one node of its name.
pub(super) fn add(file: &Path, pictures: &Pictures, scene: &mut Scene) -> Result<()> {
    let bytes = read_file(file)?;
    let folder = uri::folder_of(file)?;
    let place = Place { file, folder: &folder, pictures };
    check_faces(file, &bytes)?;
    let missing = RefCell::new(Vec::new());
    let options =
        tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let load_library = |path: &Path| {
        let library = match uri::in_folder(&folder, &path.to_string_lossy()) {
            Ok(Source::File(path)) => read_file(&path).ok(),
            _ => None,
        };
        match library {
            Some(library) => tobj::load_mtl_buf(&mut whole_colors(&library).as_bytes()),
            None => {
                missing.borrow_mut().push(path.to_path_buf());
                Ok(Default::default())
            }
        }
    };
    let loaded = tobj::load_obj_buf(&mut bytes.as_slice(), &options, load_library);
    let failed =
        |e: tobj::LoadError| Error::input(file, "OBJ", format!("cannot be read ({e}); export it again"));
    let (models, materials) = loaded.map_err(failed)?;
    // An unreadable library costs the materials, not the geometry.
    let materials = materials.unwrap_or_else(|_| {
        missing.borrow_mut().push(PathBuf::from("mtllib"));
        Vec::new()
    });
    for library in missing.into_inner() {
        note(
            scene,
            file,
            format!("{} is missing or cannot be read", library.display()),
            "materials are grey",
        );
    }
    let file_node = scene.nodes.len();
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    scene.nodes.push(Node { name, ..Node::default() });
    let first_material = scene.materials.len();
    let mut images = HashMap::new();
    for material in &materials {
        let material = convert(material, &place, scene, &mut images)?;
        scene.materials.push(material);
    }
    let mut default_material = None;
    let mut object = scene.instances.iter().map(|i| i.object).max().unwrap_or(0);
    for model in models {
        let id = model.mesh.material_id.filter(|&m| m < materials.len()).map(|m| first_material + m);
        let material = id.unwrap_or_else(|| {
            *default_material.get_or_insert_with(|| {
                let grey = Vec4::new(0.8, 0.8, 0.8, 1.0);
                scene.materials.push(Material {
                    base_color: grey,
                    metallic: 0.0,
                    double_sided: true,
                    ..Material::default()
                });
                scene.materials.len() - 1
            })
        });
        let textured = scene.materials[material].has_textures();
        note_what_is_no_number(&model.mesh, file, scene);
        if let Some(mesh) = mesh(model, material, textured) {
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
    Ok(())
}

/// Refuses faces whose indices cannot be, by line. `tobj` names no line, and computes with such indices unchecked.
fn check_faces(file: &Path, bytes: &[u8]) -> Result<()> {
    let mut counts = [0_i64; 3];
    for (number, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => counts[0] += 1,
            Some("vt") => counts[1] += 1,
            Some("vn") => counts[2] += 1,
            Some("f" | "l" | "p") => {
                for (part, count) in words.flat_map(|word| word.split('/').zip(counts)) {
                    // Positive indices may name what comes later, negative ones count back from here.
                    let index: i64 = if part.is_empty() { continue } else { part.parse().unwrap_or(0) };
                    if index == 0 || index < -count || index > i64::from(u32::MAX) {
                        let message =
                            format!("`{part}` is no vertex: {count} stand before it; export the file again");
                        return Err(Error::input(file, format!("line {}", number + 1), message));
                    }
                }
            }
            _ => {}
        }
    }
    if counts[0] == 0 {
        let message = "there is no vertex in it (`v` lines); is it an OBJ file?";
        return Err(Error::input(file, "OBJ", message));
    }
    Ok(())
}

/// An MTL file whose colours all have three numbers: `Kd 0.5` is short for three times 0.5 and legal, but `tobj`
/// panics on it. Colours in other forms (`spectral`, `xyz`) are left out.
fn whole_colors(library: &[u8]) -> String {
    let text = String::from_utf8_lossy(library);
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if let Some(key @ ("Ka" | "Kd" | "Ks" | "Ke")) = words.next() {
            let numbers: Vec<f32> = words.map_while(|w| w.parse().ok()).collect();
            let Some(&red) = numbers.first() else { continue };
            let part = |i: usize| numbers.get(i).copied().unwrap_or(red);
            out.push_str(&format!("{key} {red} {} {}", part(1), part(2)));
        } else {
            out.push_str(line);
        }
        out.push('\n');
    }
    out
}

fn note(scene: &mut Scene, file: &Path, feature: String, effect: &str) {
    let entry = Ignored { feature, place: file.display().to_string(), effect: effect.into() };
    if !scene.ignored.contains(&entry) {
        scene.ignored.push(entry);
    }
}

fn note_what_is_no_number(mesh: &tobj::Mesh, file: &Path, scene: &mut Scene) {
    let parts = [
        (&mesh.positions, "positions", "triangles with such corners are left out"),
        (&mesh.texcoords, "texture coordinates", "they count as 0"),
        (&mesh.vertex_color, "vertex colours", "they count as 0"),
    ];
    for (_, what, effect) in parts.into_iter().filter(|(values, ..)| values.iter().any(|v| !v.is_finite())) {
        note(scene, file, format!("non-finite {what}"), effect);
    }
}

/// The triangles of a model that are whole; none if there is none.
fn mesh(model: tobj::Model, material: usize, textured: bool) -> Option<Mesh> {
    let tobj::Mesh { positions, normals, texcoords, vertex_color, indices, .. } = model.mesh;
    let positions: Vec<Vec3> = positions.as_chunks().0.iter().map(|&p| Vec3::from_array(p)).collect();
    let count = positions.len();
    let whole = |&i: &u32| positions.get(i as usize).is_some_and(|p| p.is_finite());
    let mut triangles = indices.as_chunks::<3>().0.to_vec();
    triangles.retain(|t| t.iter().all(whole) && t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
    if triangles.is_empty() {
        return None;
    }
    let mut mesh = Mesh { name: model.name, positions, triangles, material, ..Mesh::default() };
    for position in mesh.positions.iter_mut().filter(|p| !p.is_finite()) {
        *position = Vec3::ZERO;
    }
    if normals.len() == count * 3 {
        mesh.normals = normals.as_chunks().0.iter().map(|&n| Vec3::from_array(n)).collect();
        super::primitive::mend_normals(&mut mesh);
    }
    if vertex_color.len() == count * 3 {
        let color = |c: &[f32; 3]| {
            Vec3::from_array(c.map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 })).extend(1.0)
        };
        mesh.colors = vertex_color.as_chunks().0.iter().map(color).collect();
    }
    if textured {
        // v grows upwards in OBJ.
        let uv =
            |t: &[f32; 2]| Vec2::from_array([t[0], 1.0 - t[1]].map(|v| if v.is_finite() { v } else { 0.0 }));
        // If only some corners have them, `tobj` does not say which.
        let whole = texcoords.len() == count * 2;
        mesh.uvs.push(if whole {
            texcoords.as_chunks().0.iter().map(uv).collect()
        } else {
            vec![Vec2::ZERO; count]
        });
    }
    Some(mesh)
}

/// Images already loaded: by the name in the MTL and whether it is a colour.
type Loaded = HashMap<(String, bool), Option<usize>>;

/// Where the pictures of a file are, and what they may take.
struct Place<'a> {
    file: &'a Path,
    folder: &'a Path,
    pictures: &'a Pictures,
}

/// A Phong material as metallic-roughness.
fn convert(
    mtl: &tobj::Material,
    place: &Place<'_>,
    scene: &mut Scene,
    images: &mut Loaded,
) -> Result<Material> {
    let mut texture = |name: Option<&str>, space: ColorSpace| -> Result<Option<TextureRef>> {
        let Some(name) = name else { return Ok(None) };
        let image = match images.entry((name.to_owned(), matches!(space, ColorSpace::Srgb))) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(new) => *new.insert(load(name, space, place, scene)?),
        };
        Ok(image.map(|image| TextureRef {
            image,
            uv_set: 0,
            transform: Affine2::IDENTITY,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            nearest: false,
        }))
    };
    let unknown = |key: &str| mtl.unknown_param.get(key).map(String::as_str);
    let number =
        |key: &str| unknown(key).and_then(|v| v.trim().parse::<f32>().ok()).filter(|v| v.is_finite());
    let base_color_texture = texture(mtl.diffuse_texture.as_deref(), ColorSpace::Srgb)?;
    let emissive_texture = texture(unknown("map_Ke"), ColorSpace::Srgb)?;
    let normal_name = unknown("norm").or(mtl.normal_texture.as_deref());
    let normal_texture =
        texture(normal_name, ColorSpace::Linear)?.map(|texture| NormalTexture { texture, scale: 1.0 });
    let color = |c: Option<[f32; 3]>, default: f32| {
        Vec3::from_array(c.unwrap_or([default; 3]).map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 }))
    };
    // A texture without Kd is meant to be seen as it is.
    let diffuse = color(mtl.diffuse, if base_color_texture.is_some() { 1.0 } else { 0.8 });
    let shininess = mtl.shininess.filter(|s| s.is_finite() && *s >= 0.0);
    let opacity = mtl.dissolve.or_else(|| number("Tr").map(|t| 1.0 - t)).unwrap_or(1.0).clamp(0.0, 1.0);
    let ior = mtl.optical_density.filter(|n| n.is_finite() && *n > 1.0);
    // Models 4, 6, 7 and 9 are glass: what is not opaque refracts. The others let through straight on.
    let glass = opacity < 1.0 && matches!(mtl.illumination_model, Some(4 | 6 | 7 | 9));
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
        alpha_mode: if opacity < 1.0 && !glass { AlphaMode::Blend } else { AlphaMode::Opaque },
        double_sided: !glass,
        ior: ior.unwrap_or(1.5),
        specular: color(mtl.specular, 1.0).max_element().min(1.0),
        transmission: if glass { 1.0 - opacity } else { 0.0 },
        volume: (glass && ior.is_some())
            .then_some(Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE }),
        ..Material::default()
    })
}

/// Loads a picture; none, and noted, if it cannot be had.
fn load(name: &str, space: ColorSpace, place: &Place<'_>, scene: &mut Scene) -> Result<Option<usize>> {
    // Options (`-s 1 1 1 wood.png`) stand before the name.
    let path =
        if name.starts_with('-') { name.rsplit(char::is_whitespace).next().unwrap_or(name) } else { name };
    let data = match uri::in_folder(place.folder, path) {
        Ok(Source::File(path)) => read_file(&path).map_err(|_| "it cannot be read".to_owned()),
        Ok(_) => Err("it is missing".to_owned()),
        Err(why) => Err(why),
    };
    let image = match data {
        Ok(data) => image::load_file(path, &data, space, place.pictures)?,
        Err(why) => Err(why),
    };
    Ok(match image {
        Ok(image) => {
            scene.images.push(image);
            Some(scene.images.len() - 1)
        }
        Err(why) => {
            note(scene, place.file, format!("image {path}: {why}"), "its material has its colour alone");
            None
        }
    })
}
