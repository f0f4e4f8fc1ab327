//! Triangle meshes, their instances, and what deforms them.

use super::Shape;
use glam::{DAffine3, DMat4, Vec2, Vec3, Vec4};

/// A triangle mesh in object space, or an analytic shape that stands for one.
///
/// Attribute arrays are either empty or as long as `positions`. An empty `normals` means flat shading.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// For messages and mattes.
    pub name: String,
    /// Vertex positions, metres.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, or empty: flat.
    pub normals: Vec<Vec3>,
    /// Unit tangents with the bitangent's sign in w, or empty.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets; (0,0) is the image's upper left corner.
    pub uvs: Vec<Vec<Vec2>>,
    /// Linear vertex colours, or empty.
    pub colors: Vec<Vec4>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// What is rendered instead of triangles; then all arrays here are empty.
    pub shape: Option<Shape>,
    /// Index into [`super::Scene::materials`].
    pub material: usize,
    /// Morph targets, displacements added by weight.
    pub morph_targets: Vec<MorphTarget>,
    /// Up to any number of joint influences a vertex, four a set; empty where not skinned.
    pub joints: Vec<Vec<[u16; 4]>>,
    /// The weights that go with `joints`.
    pub joint_weights: Vec<Vec<[f32; 4]>>,
}

/// Displacements of one morph target; empty arrays displace nothing.
#[derive(Debug, Clone, Default)]
pub struct MorphTarget {
    /// Added to positions.
    pub positions: Vec<Vec3>,
    /// Added to normals before they are normalised.
    pub normals: Vec<Vec3>,
    /// Added to the tangents' xyz.
    pub tangents: Vec<Vec3>,
}

/// A skeleton.
#[derive(Debug, Clone, Default)]
pub struct Skin {
    /// Joint nodes.
    pub joints: Vec<usize>,
    /// `joint_from_mesh` for each joint at rest.
    pub inverse_bind: Vec<DMat4>,
}

/// A mesh placed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instance {
    /// The node that places it.
    pub node: usize,
    /// Index into [`super::Scene::meshes`].
    pub mesh: usize,
    /// Index into [`super::Scene::skins`]; a skinned instance ignores its node's transform (glTF 2.0, 3.7.3.1).
    pub skin: Option<usize>,
    /// Placement under the node (`EXT_mesh_gpu_instancing`); identity otherwise.
    pub node_from_object: DAffine3,
    /// The object tag (the paper's id_tag): positive, one for each node or GPU instance, shared by the meshes
    /// (materials) of one glTF mesh. 0 is the background.
    pub object: u32,
}
