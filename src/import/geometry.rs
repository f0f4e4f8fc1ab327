//! Meshes: primitives of the file into triangle meshes.

use super::{
    accessor::{Accessors, Integers},
    document::Element,
    ignored::Notes,
    primitive,
};
use crate::{
    Error, Result,
    scene::{Mesh, MorphTarget},
};
use glam::{Vec2, Vec3, Vec4};
use std::{collections::HashMap, rc::Rc};

/// Compressed meshes; read only where the same mesh stands beside it as it is.
const DRACO: &str = "KHR_draco_mesh_compression";

/// Reads primitives; arrays that several primitives share are decoded once.
pub(super) struct Geometry<'a> {
    pub accessors: Accessors<'a>,
    pub notes: &'a Notes,
    uses: HashMap<usize, usize>,
    shared: HashMap<usize, Rc<Decoded>>,
}

/// A decoded accessor.
struct Decoded {
    values: Vec<f32>,
    width: usize,
}

/// The vertices of a mesh that its triangles use.
struct Picked {
    /// Vertices that the accessors have.
    count: usize,
    /// Which of them are kept, in rising order; none: all.
    keep: Option<Vec<u32>>,
}

/// A primitive as the scene wants it, its material still the file's.
pub(super) struct Primitive {
    /// `material` and the missing texture coordinates are to be filled in.
    pub mesh: Mesh,
    /// The file's material.
    pub material: Option<usize>,
    /// Joints that a skin needs for it.
    pub joints: usize,
}

impl<'a> Geometry<'a> {
    /// Counts how often each accessor is used by meshes.
    pub fn new(accessors: Accessors<'a>, notes: &'a Notes) -> Result<Self> {
        let mut uses = HashMap::new();
        for mesh in accessors.document.elements("meshes")? {
            for primitive in mesh.items("primitives")? {
                let targets = primitive.items("targets")?;
                for attributes in primitive.get("attributes").iter().chain(&targets) {
                    for (_, accessor) in attributes.members() {
                        *uses.entry(accessor.as_index()?).or_insert(0) += 1;
                    }
                }
            }
        }
        Ok(Self { accessors, notes, uses, shared: HashMap::new() })
    }

    /// The primitives of a mesh that have area.
    pub fn mesh(&mut self, mesh: &Element<'a>) -> Result<Vec<Primitive>> {
        let mut out = Vec::new();
        for primitive in mesh.items("primitives")? {
            if let Some(mut read) = self.primitive(&primitive)? {
                read.mesh.name = mesh.name();
                out.push(read);
            }
        }
        Ok(out)
    }

    fn primitive(&mut self, element: &Element<'a>) -> Result<Option<Primitive>> {
        let Some(mode) = primitive::mode(element, self.notes)? else { return Ok(None) };
        let attributes = element.get("attributes");
        let Some(position) = attributes.as_ref().and_then(|a| a.get("POSITION")) else {
            if element.extension(DRACO).is_some() {
                return Err(draco_alone(element));
            }
            self.notes.add("primitive without POSITION", &element.place, "nothing is drawn for it");
            return Ok(None);
        };
        let indices = element.get("indices");
        if element.extension(DRACO).is_some() {
            for user in [Some(&position), indices.as_ref()].into_iter().flatten() {
                if !self.has_data(user)? {
                    return Err(draco_alone(element));
                }
            }
        }
        let positions = self.decode(&position, &[3], Integers::AsDeclared)?;
        let count = positions.values.len() / 3;
        let indices = match indices {
            None => None,
            Some(e) => Some(self.accessors.whole_numbers(e.as_index()?, &e.place, 1)?),
        };
        let budget = &self.accessors.buffers.budget;
        let corners = indices.as_ref().map_or(count, Vec::len);
        budget.take(corners, size_of::<[u32; 3]>(), |message| element.error(message))?;
        if let Some(bad) = indices.iter().flatten().find(|&&i| i as usize >= count) {
            let message =
                format!("vertex index {bad}, but there are {count} vertices; export the file again");
            return Err(element.error(message));
        }
        let mut triangles = primitive::triangles(mode, indices, count);
        let whole = |i: &u32| positions.values[*i as usize * 3..][..3].iter().all(|v| v.is_finite());
        let before = triangles.len();
        triangles.retain(|t| t.iter().all(whole));
        if triangles.len() < before {
            self.notes.add(
                "non-finite positions",
                &position.place,
                "triangles with such corners are left out",
            );
        }
        if triangles.is_empty() {
            self.notes.add("primitive without triangles", &element.place, "nothing is drawn for it");
            return Ok(None);
        }
        let picked = primitive::keep_used(&mut triangles, count);
        let picked = Picked { count, keep: picked };
        let mut mesh = Mesh { triangles, ..Mesh::default() };
        mesh.positions = vec3s(&self.pick(&positions, &picked, &position)?);
        if let Some(attributes) = attributes {
            self.attributes(&mut mesh, &attributes, &picked)?;
        }
        for target in element.items("targets")? {
            mesh.morph_targets.push(self.morph_target(&target, &picked)?);
        }
        primitive::mend_normals(&mut mesh);
        let highest = mesh.joints.iter().flatten().flatten().max();
        let joints = highest.map_or(0, |&joint| usize::from(joint) + 1);
        Ok(Some(Primitive { mesh, material: element.index("material")?, joints }))
    }

    fn attributes(&mut self, mesh: &mut Mesh, attributes: &Element<'a>, picked: &Picked) -> Result<()> {
        for (semantic, accessor) in attributes.members() {
            let (name, set) = semantic.rsplit_once('_').unwrap_or((semantic, ""));
            let set: Option<usize> = set.parse().ok().filter(|s| *s < 64);
            match (semantic, name, set) {
                ("POSITION", ..) => {}
                ("NORMAL", ..) => {
                    let values = self.floats(&accessor, &[3], Integers::AsDeclared, picked)?;
                    mesh.normals = vec3s(&values);
                }
                ("TANGENT", ..) => {
                    let values = self.floats(&accessor, &[4], Integers::AsDeclared, picked)?;
                    mesh.tangents = vec4s(&values);
                }
                (_, "TEXCOORD", Some(set)) => {
                    let values = self.floats(&accessor, &[2], Integers::AsDeclared, picked)?;
                    self.note_what_is_no_number(&values, "texture coordinates", &accessor);
                    let finite = |v: &[f32; 2]| Vec2::from(v.map(|c| if c.is_finite() { c } else { 0.0 }));
                    if mesh.uvs.len() <= set {
                        mesh.uvs.resize(set + 1, Vec::new());
                    }
                    mesh.uvs[set] = values.as_chunks().0.iter().map(finite).collect();
                }
                ("COLOR_0", ..) => {
                    let index = accessor.as_index()?;
                    let wide =
                        self.accessors.document.element("accessors", index, &accessor.place)?.text("type")?
                            == Some("VEC4");
                    let width = if wide { 4 } else { 3 };
                    let values = self.floats(&accessor, &[width], Integers::Normalized, picked)?;
                    self.note_what_is_no_number(&values, "vertex colours", &accessor);
                    let color = |c: &[f32]| {
                        let part =
                            |i: usize| c.get(i).map_or(1.0, |v| if v.is_finite() { v.max(0.0) } else { 0.0 });
                        Vec4::new(part(0), part(1), part(2), part(3))
                    };
                    mesh.colors = values.chunks_exact(width).map(color).collect();
                }
                (_, "JOINTS", Some(set)) => {
                    let joints = self.accessors.whole_numbers(accessor.as_index()?, &accessor.place, 4)?;
                    self.check_count(joints.len() / 4, &accessor, picked)?;
                    let joints: Vec<[u16; 4]> = joints
                        .as_chunks::<4>()
                        .0
                        .iter()
                        .map(|j| j.map(|joint| u16::try_from(joint).unwrap_or(u16::MAX)))
                        .collect();
                    put(&mut mesh.joints, set, gather(&joints, picked));
                }
                (_, "WEIGHTS", Some(set)) => {
                    let weights = self.floats(&accessor, &[4], Integers::Normalized, picked)?;
                    put(&mut mesh.joint_weights, set, weights.as_chunks().0.to_vec());
                }
                (_, "COLOR", Some(_)) => {
                    self.notes.add(semantic, &accessor.place, "only the first set of vertex colours is used");
                }
                // Application-specific attributes begin with an underscore and mean nothing to us.
                _ => {}
            }
        }
        primitive::mend_joints(mesh);
        Ok(())
    }

    fn morph_target(&mut self, target: &Element<'a>, picked: &Picked) -> Result<MorphTarget> {
        let mut out = MorphTarget::default();
        for (semantic, accessor) in target.members() {
            let slot = match semantic {
                "POSITION" => &mut out.positions,
                "NORMAL" => &mut out.normals,
                "TANGENT" => &mut out.tangents,
                _ => {
                    let feature = format!("morph target {semantic}");
                    self.notes.add(
                        feature,
                        &accessor.place,
                        "only positions, normals and tangents are morphed",
                    );
                    continue;
                }
            };
            let values = self.floats(&accessor, &[3], Integers::AsDeclared, picked)?;
            self.note_what_is_no_number(&values, "morph targets", &accessor);
            *slot = vec3s(&values);
            for v in slot.iter_mut().filter(|v| !v.is_finite()) {
                *v = Vec3::ZERO;
            }
        }
        Ok(out)
    }

    fn note_what_is_no_number(&self, values: &[f32], what: &str, accessor: &Element<'a>) {
        if values.iter().any(|value| !value.is_finite()) {
            self.notes.add(format!("non-finite {what}"), &accessor.place, "they count as 0");
        }
    }

    /// The numbers of an accessor for the vertices that are kept.
    fn floats(
        &mut self,
        e: &Element<'a>,
        widths: &[usize],
        integers: Integers,
        picked: &Picked,
    ) -> Result<Vec<f32>> {
        let decoded = self.decode(e, widths, integers)?;
        self.pick(&decoded, picked, e)
    }

    fn decode(&mut self, e: &Element<'a>, widths: &[usize], integers: Integers) -> Result<Rc<Decoded>> {
        let index = e.as_index()?;
        if let Some(decoded) = self.shared.get(&index).filter(|d| widths.contains(&d.width)) {
            return Ok(decoded.clone());
        }
        let numbers = self.accessors.numbers(index, &e.place, widths, integers)?;
        let decoded = Rc::new(Decoded { values: numbers.values, width: numbers.width });
        if self.uses.get(&index).is_some_and(|&n| n > 1) {
            self.shared.insert(index, decoded.clone());
        }
        Ok(decoded)
    }

    /// Whether an accessor has data of its own: one without is all zeros, which stand for what Draco holds.
    fn has_data(&self, user: &Element) -> Result<bool> {
        let accessor = self.accessors.document.element("accessors", user.as_index()?, &user.place)?;
        Ok(accessor.get("bufferView").or_else(|| accessor.get("sparse")).is_some())
    }

    fn pick(&self, decoded: &Decoded, picked: &Picked, user: &Element) -> Result<Vec<f32>> {
        let Decoded { values, width } = decoded;
        self.check_count(values.len() / width, user, picked)?;
        let kept = picked.keep.as_ref().map_or(picked.count, Vec::len);
        self.accessors.buffers.budget.take(kept * width, size_of::<f32>(), |message| user.error(message))?;
        Ok(match &picked.keep {
            None => values.clone(),
            Some(keep) => {
                keep.iter().flat_map(|&i| &values[i as usize * width..][..*width]).copied().collect()
            }
        })
    }

    fn check_count(&self, count: usize, user: &Element, picked: &Picked) -> Result<()> {
        if count == picked.count {
            return Ok(());
        }
        Err(user.error(format!("has {count} elements for {} vertices; export the file again", picked.count)))
    }
}

fn draco_alone(primitive: &Element) -> Error {
    primitive.error(format!("{DRACO} is not supported; export without Draco compression"))
}

fn put<T: Clone>(sets: &mut Vec<Vec<T>>, set: usize, values: Vec<T>) {
    if sets.len() <= set {
        sets.resize(set + 1, Vec::new());
    }
    sets[set] = values;
}

fn gather<T: Copy>(values: &[T], picked: &Picked) -> Vec<T> {
    match &picked.keep {
        None => values.to_vec(),
        Some(keep) => keep.iter().map(|&i| values[i as usize]).collect(),
    }
}

fn vec3s(values: &[f32]) -> Vec<Vec3> {
    values.as_chunks().0.iter().map(|&v| Vec3::from_array(v)).collect()
}

fn vec4s(values: &[f32]) -> Vec<Vec4> {
    values.as_chunks().0.iter().map(|&v| Vec4::from_array(v)).collect()
}
