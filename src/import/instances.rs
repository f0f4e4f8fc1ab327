//! What stands in the scene: meshes, shapes and skins where nodes place them, and the materials that these use.

use super::{
    accessor::{Accessors, Integers},
    budget::Pictures,
    document::Element,
    geometry::{Geometry, Primitive},
    ignored::Notes,
    image::{Images, Wanted},
    material,
    nodes::Nodes,
    shape::Shapes,
};
use crate::{
    Result,
    scene::{Instance, Material, Scene, Skin},
};
use glam::{DAffine3, DMat4, DQuat, DVec3, Vec2};
use std::{collections::HashMap, ops::Range};

/// Reads meshes, materials, images, skins and instances of the scene to render.
pub(super) fn read(
    accessors: Accessors,
    pictures: &Pictures,
    nodes: &mut Nodes,
    scene: &mut Scene,
    notes: &Notes,
) -> Result<()> {
    let mut reader = Reader {
        accessors,
        geometry: Geometry::new(accessors, notes)?,
        primitives: Vec::new(),
        shapes: Shapes::default(),
        meshes: HashMap::new(),
        skins: HashMap::new(),
    };
    let elements = accessors.document.elements("nodes")?;
    for (i, node) in elements.iter().enumerate().filter(|(i, _)| nodes.in_scene[*i]) {
        // The mesh beside a shape is for readers that do not know shapes.
        let placed = if let Some(shape) = reader.shapes.of(node, &mut reader.primitives)? {
            (shape..shape + 1, None)
        } else if let Some(index) = node.index("mesh")? {
            let mesh = accessors.document.element("meshes", index, &node.place)?;
            let primitives = reader.mesh(index, &mesh)?;
            nodes.nodes[nodes.scene_node[i]].weights = reader.weights(node, &mesh, primitives.clone())?;
            (primitives, reader.skin(node, nodes, scene)?)
        } else {
            continue;
        };
        reader.place(node, nodes.scene_node[i], placed, scene)?;
    }
    read_materials(accessors, pictures, reader.primitives, scene, notes)
}

/// Reads nodes one after the other; what several of them use, once.
struct Reader<'a> {
    accessors: Accessors<'a>,
    geometry: Geometry<'a>,
    /// Of all meshes and shapes so far; they become the scene's meshes.
    primitives: Vec<Primitive>,
    shapes: Shapes,
    /// For each mesh of the file that has been read, its primitives.
    meshes: HashMap<usize, Range<usize>>,
    /// For each skin of the file that has been read, its index in the scene.
    skins: HashMap<usize, usize>,
}

impl<'a> Reader<'a> {
    /// The primitives of a mesh of the file.
    fn mesh(&mut self, index: usize, mesh: &Element<'a>) -> Result<Range<usize>> {
        if let Some(known) = self.meshes.get(&index) {
            return Ok(known.clone());
        }
        let start = self.primitives.len();
        self.primitives.extend(self.geometry.mesh(mesh)?);
        self.meshes.insert(index, start..self.primitives.len());
        Ok(start..self.primitives.len())
    }

    /// A node's morph weights at rest: its own, else its mesh's, else zeros.
    fn weights(&self, node: &Element, mesh: &Element, primitives: Range<usize>) -> Result<Vec<f32>> {
        let targets = self.primitives[primitives].iter().map(|p| p.mesh.morph_targets.len()).max();
        let targets = targets.unwrap_or(0);
        let budget = &self.accessors.buffers.budget;
        budget.take(targets, size_of::<f32>(), |message| node.error(message))?;
        let source = if node.get("weights").is_some() { node } else { mesh };
        let mut weights = Vec::with_capacity(targets);
        for item in source.items("weights")? {
            weights.push(item.as_number()? as f32);
        }
        weights.resize(targets, 0.0);
        Ok(weights)
    }

    /// The index in the scene of a node's skin, if it has one.
    fn skin(&mut self, node: &Element, nodes: &Nodes, scene: &mut Scene) -> Result<Option<usize>> {
        let Some(index) = node.index("skin")? else { return Ok(None) };
        if let Some(&known) = self.skins.get(&index) {
            return Ok(Some(known));
        }
        scene.skins.push(read_skin(self.accessors, index, node, nodes)?);
        self.skins.insert(index, scene.skins.len() - 1);
        Ok(Some(scene.skins.len() - 1))
    }

    /// Adds the instances that a node makes of its primitives and their skin.
    fn place(
        &self,
        element: &Element,
        node: usize,
        (primitives, skin): (Range<usize>, Option<usize>),
        scene: &mut Scene,
    ) -> Result<()> {
        for node_from_object in placements(self.accessors, element)? {
            let object = scene.instances.last().map_or(0, |i| i.object).saturating_add(1);
            for mesh in primitives.clone() {
                let used = self.primitives[mesh].joints;
                let skin = skin.filter(|_| used > 0);
                if let Some(joints) =
                    skin.map(|s| scene.skins[s].joints.len()).filter(|joints| *joints < used)
                {
                    let message =
                        format!("its mesh uses {used} joints, its skin has {joints}; export the file again");
                    return Err(element.error(message));
                }
                let budget = &self.accessors.buffers.budget;
                budget.take(1, size_of::<Instance>(), |message| element.error(message))?;
                scene.instances.push(Instance { node, mesh, skin, node_from_object, object });
            }
        }
        Ok(())
    }
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

fn read_skin(accessors: Accessors, index: usize, user: &Element, nodes: &Nodes) -> Result<Skin> {
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
