//! A glTF file into a scene: the order in which its parts are read.

use super::{
    ImportOptions,
    accessor::{Accessors, Integers},
    animation::{self, Animations, Targets},
    budget::Pictures,
    buffers::Buffers,
    document::{Document, Element},
    extras::{self, CutEntry, Extras},
    geometry::{Geometry, Primitive},
    ignored::{self, Notes},
    image::{self, Images, Wanted},
    light_camera, material,
    nodes::{self, Nodes},
    shape::Shapes,
};
use crate::{
    Result,
    scene::{Camera, Cut, Instance, Material, Rational, Scene, Skin, Timing, World},
};
use glam::{DAffine3, DMat4, DQuat, DVec3, Vec2};
use std::{collections::HashMap, path::Path};

/// Frames that a scene may be long; more would keep a renderer busy for ever over a broken key time.
const LONGEST: i64 = 10_000_000;

/// Reads a `.gltf` or `.glb`; without its meshes unless `geometry`.
pub(super) fn read(
    file: &Path,
    options: &ImportOptions,
    pictures: &Pictures,
    geometry: bool,
) -> Result<Scene> {
    let document = Document::read(file)?;
    let notes = Notes::default();
    ignored::check_extensions(&document, &notes)?;
    let buffers = Buffers::load(&document)?;
    let accessors = Accessors { document: &document, buffers: &buffers };
    let mut nodes = nodes::read(&document)?;
    let mut scene = Scene::default();
    if geometry {
        read_geometry(accessors, pictures, &mut nodes, &mut scene, &notes)?;
    }
    let cameras = light_camera::cameras(&document, &nodes, &notes)?;
    let lights = light_camera::lights(&document, &nodes, &notes)?;
    let targets = Targets { nodes: &mut nodes, cameras: &cameras, lights: &lights };
    let animations = animation::read(accessors, targets, &notes)?;
    let mut extras = Extras::default();
    if let Some(place) = &nodes.scene_place {
        let index = place.rsplit('/').next().and_then(|i| i.parse().ok()).unwrap_or(0);
        let element = document.element("scenes", index, "/scene")?;
        extras = extras::read(&element, &notes)?;
        scene.name = element.name();
    }
    scene.timing = timing(&document, &extras, &animations, options)?;
    scene.cuts = cuts(&document, &extras, &nodes, &cameras.items, &scene.timing)?;
    if let Some(world) = extras.world {
        scene.world = World { color: world.color, image: None, rotation: world.rotation };
        if let Some((uri, place)) = world.image {
            scene.world.image = Some(scene.images.len());
            scene.images.push(image::load_world(&document, &uri, &place, pictures)?);
        }
    }
    scene.cameras = cameras.items;
    scene.lights = lights.items;
    scene.channels = animations.channels;
    scene.nodes = nodes.nodes;
    scene.ignored = notes.into_entries();
    scene.files = document.folder.into_files();
    Ok(scene)
}

/// Meshes, materials, images, skins and instances of the scene to render.
fn read_geometry(
    accessors: Accessors,
    pictures: &Pictures,
    nodes: &mut Nodes,
    scene: &mut Scene,
    notes: &Notes,
) -> Result<()> {
    let document = accessors.document;
    let mut geometry = Geometry::new(accessors, notes)?;
    let mut primitives: Vec<Primitive> = Vec::new();
    let mut shapes = Shapes::default();
    let mut mesh_ranges: HashMap<usize, std::ops::Range<usize>> = HashMap::new();
    let mut skins: HashMap<usize, usize> = HashMap::new();
    for (i, node) in document.elements("nodes")?.iter().enumerate().filter(|(i, _)| nodes.in_scene[*i]) {
        let shape = shapes.of(node, &mut primitives)?;
        let range = match (shape, node.index("mesh")?) {
            // The mesh beside a shape is for readers that do not know shapes.
            (Some(shape), _) => shape..shape + 1,
            (None, None) => continue,
            (None, Some(index)) => {
                let element = document.element("meshes", index, &node.place)?;
                let range = match mesh_ranges.get(&index) {
                    Some(range) => range.clone(),
                    None => {
                        let start = primitives.len();
                        primitives.extend(geometry.mesh(&element)?);
                        mesh_ranges.insert(index, start..primitives.len());
                        start..primitives.len()
                    }
                };
                let targets = primitives[range.clone()].iter().map(|p| p.mesh.morph_targets.len());
                let targets = targets.max().unwrap_or(0);
                accessors.buffers.budget.take(targets, size_of::<f32>(), |message| node.error(message))?;
                nodes.nodes[nodes.scene_node[i]].weights = weights(node, &element, targets)?;
                range
            }
        };
        let skin = match node.index("skin")?.filter(|_| shape.is_none()) {
            None => None,
            Some(index) => Some(match skins.get(&index) {
                Some(&skin) => skin,
                None => {
                    scene.skins.push(skin(accessors, index, node, nodes)?);
                    skins.insert(index, scene.skins.len() - 1);
                    scene.skins.len() - 1
                }
            }),
        };
        for node_from_object in placements(accessors, node)? {
            let object = scene.instances.last().map_or(0, |i: &Instance| i.object).saturating_add(1);
            for mesh in range.clone() {
                let used = primitives[mesh].joints;
                let skin = skin.filter(|_| used > 0);
                if let Some(joints) =
                    skin.map(|s| scene.skins[s].joints.len()).filter(|joints| *joints < used)
                {
                    let message =
                        format!("its mesh uses {used} joints, its skin has {joints}; export the file again");
                    return Err(node.error(message));
                }
                accessors.buffers.budget.take(1, size_of::<Instance>(), |message| node.error(message))?;
                let node = nodes.scene_node[i];
                scene.instances.push(Instance { node, mesh, skin, node_from_object, object });
            }
        }
    }
    read_materials(accessors, pictures, primitives, scene, notes)
}

/// The materials that the primitives use, with their images; then the meshes.
fn read_materials(
    accessors: Accessors,
    pictures: &Pictures,
    primitives: Vec<Primitive>,
    scene: &mut Scene,
    notes: &Notes,
) -> Result<()> {
    let document = accessors.document;
    let mut order: Vec<Option<usize>> = Vec::new();
    let mut place: HashMap<Option<usize>, usize> = HashMap::new();
    let mut elements: Vec<Option<Element>> = Vec::new();
    let mut wanted: Vec<Wanted> = Vec::new();
    for primitive in &primitives {
        if place.contains_key(&primitive.material) {
            continue;
        }
        let element = primitive.material.map(|m| document.element("materials", m, "/meshes")).transpose()?;
        if let Some(element) = &element {
            wanted.extend(material::wanted_images(element, notes)?);
        }
        place.insert(primitive.material, order.len());
        order.push(primitive.material);
        elements.push(element);
    }
    let images = Images::load(accessors, notes, pictures, &wanted)?;
    for element in &elements {
        scene.materials.push(match element {
            Some(element) => material::read(element, &images, notes)?,
            None => Material::default(),
        });
    }
    scene.images = images.images;
    for Primitive { mut mesh, material, .. } in primitives {
        mesh.material = place.get(&material).copied().unwrap_or(0);
        let sets = uv_sets(&scene.materials[mesh.material]);
        let vertices = mesh.positions.len();
        if mesh.uvs.len() < sets || mesh.uvs.iter().take(sets).any(Vec::is_empty) {
            let where_ = material.map_or("/materials".into(), |m| format!("/materials/{m}"));
            notes.add("texture without texture coordinates", where_, "one texel is used everywhere");
        }
        // Sets that no texture uses are not carried.
        mesh.uvs.resize(sets, Vec::new());
        for set in mesh.uvs.iter_mut().filter(|set| set.is_empty()) {
            accessors.buffers.budget.take(vertices, 8, |message| document.error("/meshes", message))?;
            set.resize(vertices, Vec2::ZERO);
        }
        scene.meshes.push(mesh);
    }
    Ok(())
}

/// How many sets of texture coordinates a material needs.
fn uv_sets(material: &Material) -> usize {
    let normal = material.normal_texture.as_ref().map(|n| &n.texture);
    let occlusion = material.occlusion_texture.as_ref().map(|o| &o.0);
    [
        material.base_color_texture.as_ref(),
        material.metallic_roughness_texture.as_ref(),
        normal,
        occlusion,
        material.emissive_texture.as_ref(),
        material.specular_texture.as_ref(),
        material.specular_color_texture.as_ref(),
        material.transmission_texture.as_ref(),
    ]
    .into_iter()
    .flatten()
    .map(|texture| texture.uv_set + 1)
    .max()
    .unwrap_or(0)
}

/// A node's morph weights at rest: its own, else the mesh's, else zeros.
fn weights(node: &Element, mesh: &Element, targets: usize) -> Result<Vec<f32>> {
    let source = if node.get("weights").is_some() { node } else { mesh };
    let mut weights = Vec::with_capacity(targets);
    for item in source.items("weights")? {
        weights.push(item.as_number()? as f32);
    }
    weights.resize(targets, 0.0);
    Ok(weights)
}

fn skin(accessors: Accessors, index: usize, user: &Element, nodes: &Nodes) -> Result<Skin> {
    let element = accessors.document.element("skins", index, &user.place)?;
    let mut joints = Vec::new();
    for item in element.items("joints")? {
        let joint = item.as_index()?;
        let node = nodes.scene_node.get(joint);
        joints.push(
            *node.ok_or_else(|| item.error(format!("there is no node {joint}; export the file again")))?,
        );
    }
    let mut inverse_bind = vec![DMat4::IDENTITY; joints.len()];
    if let Some(matrices) = element.get("inverseBindMatrices") {
        let values = accessors.arrays::<16>(matrices.as_index()?, &matrices.place, Integers::AsDeclared)?;
        if values.len() < joints.len() {
            let message =
                format!("{} matrices for {} joints; export the file again", values.len(), joints.len());
            return Err(matrices.error(message));
        }
        for (slot, value) in
            inverse_bind.iter_mut().zip(values).filter(|(_, v)| v.iter().all(|c| c.is_finite()))
        {
            *slot = DMat4::from_cols_array(&value.map(f64::from));
        }
    }
    Ok(Skin { joints, inverse_bind })
}

/// Where a node's mesh stands under it: once, or as `EXT_mesh_gpu_instancing` says.
fn placements(accessors: Accessors, node: &Element) -> Result<Vec<DAffine3>> {
    let Some(extension) = node.extension("EXT_mesh_gpu_instancing") else {
        return Ok(vec![DAffine3::IDENTITY]);
    };
    let attributes = extension.get("attributes");
    let attribute = |name: &str| attributes.as_ref().and_then(|a| a.get(name));
    let mut count = None;
    for name in ["TRANSLATION", "ROTATION", "SCALE"] {
        let Some(e) = attribute(name) else { continue };
        let found = accessors.count(e.as_index()?, &e.place)?;
        if count.is_some_and(|c| c != found) {
            return Err(e.error("the attributes of instances differ in count; export the file again"));
        }
        count = Some(found);
    }
    let Some(count) = count else { return Ok(vec![DAffine3::IDENTITY]) };
    let vectors = |name: &str, default: f32| -> Result<Vec<[f32; 3]>> {
        match attribute(name) {
            Some(e) => accessors.arrays(e.as_index()?, &e.place, Integers::AsDeclared),
            None => Ok(vec![[default; 3]; count]),
        }
    };
    accessors.buffers.budget.take(count, size_of::<Instance>(), |message| extension.error(message))?;
    let (translations, scales) = (vectors("TRANSLATION", 0.0)?, vectors("SCALE", 1.0)?);
    let rotations: Vec<[f32; 4]> = match attribute("ROTATION") {
        Some(e) => accessors.arrays(e.as_index()?, &e.place, Integers::Normalized)?,
        None => vec![[0.0, 0.0, 0.0, 1.0]; count],
    };
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let each = translations.into_iter().zip(rotations).zip(scales);
    let placements = each.map(|((translation, rotation), scale)| {
        let rotation = DQuat::from_array(rotation.map(f64::from));
        let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
        DAffine3::from_scale_rotation_translation(vector(scale), rotation, vector(translation))
    });
    Ok(placements.filter(DAffine3::is_finite).collect())
}

fn timing(
    document: &Document,
    extras: &Extras,
    animations: &Animations,
    options: &ImportOptions,
) -> Result<Timing> {
    let own_fps = extras.fps.unwrap_or(Timing::default().fps);
    let fps = options.fps.unwrap_or(own_fps);
    let frame_start = extras.frame_start.unwrap_or(0);
    let mut timing = Timing {
        fps,
        frame_start,
        first: frame_start,
        last: frame_start,
        resolution: extras.resolution,
        pixel_aspect: extras.pixel_aspect.unwrap_or(1.0),
    };
    if let Some((first, last)) = animations.range {
        for time in [first, last] {
            if (f64::from(time) * fps.value()).abs() > LONGEST as f64 {
                let message =
                    format!("a key at {time} s is more than {LONGEST} frames away; correct its time");
                return Err(document.error("/animations", message));
            }
        }
        timing.last = timing.frame_at(f64::from(last));
        if extras.frame_start.is_none() {
            timing.first = timing.frame_at(f64::from(first));
        }
    }
    if let Some(end) = extras.frame_end {
        timing.last = at_rate(end, frame_start, own_fps, fps);
    }
    timing.last = timing.last.max(timing.first);
    Ok(timing)
}

/// The number of the frame that stands where `frame` stood at the file's own rate: a new rate samples the same
/// movement, it does not change its speed.
fn at_rate(frame: i64, frame_start: i64, own: Rational, fps: Rational) -> i64 {
    if own == fps {
        return frame;
    }
    frame_start + ((frame - frame_start) as f64 * fps.value() / own.value()).round() as i64
}

fn cuts(
    document: &Document,
    extras: &Extras,
    nodes: &Nodes,
    cameras: &[Camera],
    timing: &Timing,
) -> Result<Vec<Cut>> {
    let own_fps = extras.fps.unwrap_or(Timing::default().fps);
    let mut cuts: Vec<Cut> = Vec::new();
    // In reverse, so that the first of several wins.
    let by_node: HashMap<usize, usize> = cameras.iter().enumerate().rev().map(|(i, c)| (c.node, i)).collect();
    let by_name: HashMap<&str, usize> =
        cameras.iter().enumerate().rev().map(|(i, c)| (c.name.as_str(), i)).collect();
    for CutEntry { frame, camera: name, node, place } in &extras.cuts {
        let node = node.and_then(|node| nodes.scene_node.get(node));
        let camera = node.and_then(|node| by_node.get(node));
        let camera = camera.or_else(|| name.as_deref().and_then(|name| by_name.get(name)));
        let Some(&camera) = camera else {
            return Err(
                document.error(place.clone(), "there is no camera on that node or of that name; export it")
            );
        };
        // Two neighbouring entries with one camera are no cut.
        if cuts.last().is_none_or(|last| last.camera != camera) {
            let frame = at_rate(*frame, timing.frame_start, own_fps, timing.fps);
            cuts.push(Cut { frame, camera });
        }
    }
    Ok(cuts)
}
