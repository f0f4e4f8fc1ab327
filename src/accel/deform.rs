//! Skinned and morphed meshes at one time (glTF 2.0, 3.7.2.2 and 3.7.3).

use super::Accel;
use super::tree::{Part, Tree};
use crate::scene::{Instance, Mesh, Pose, Scene};
use glam::{Affine3A, DAffine3, DVec3, Mat3A, Vec3, Vec3A, Vec4};
use std::{collections::HashMap, iter, sync::Arc};

/// Vertices of a deformed instance. Skinned ones stand in render space, morphed ones in object space.
#[derive(Debug, Clone, Default)]
pub(super) struct Deformed {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec4>,
    /// What it was made from: equal shapes need no new tree.
    pub(super) shape: Shape,
}

/// What decides the shape of a deformed instance.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Shape {
    weights: Vec<f32>,
    /// `render_from_mesh` of each joint; the last is the node's own, for vertices that no joint holds.
    joints: Vec<Affine3A>,
    /// Whether its triangles are wound the other way where it stands: a skinned mesh is placed by its joints alone, but the node's
    /// own transform still decides its winding (glTF 2.0, 3.7.4).
    pub(super) mirrored: bool,
}

/// True for instances whose vertices are not simply the mesh's.
pub(super) fn is_deformable(scene: &Scene, instance: &Instance) -> bool {
    instance.skin.is_some() || !scene.meshes[instance.mesh].morph_targets.is_empty()
}

impl Shape {
    /// The shape of `instance` in `pose`, relative to `origin` where skinned.
    pub fn of(scene: &Scene, pose: &Pose, instance: &Instance, origin: DVec3) -> Self {
        let weights = pose.weights[instance.node].clone();
        let Some(skin) = instance.skin.map(|s| &scene.skins[s]) else {
            return Self { weights, ..Self::default() };
        };
        let render_from_mesh = |world_from_node: DAffine3, node_from_mesh: DAffine3| {
            let mut m = world_from_node * node_from_mesh;
            m.translation -= origin;
            affine(m)
        };
        let joints = skin.joints.iter().enumerate().map(|(i, &node)| {
            let bind = skin.inverse_bind.get(i).map_or(DAffine3::IDENTITY, |&m| DAffine3::from_mat4(m));
            render_from_mesh(pose.world_from_node[node], bind)
        });
        let own = render_from_mesh(pose.world_from_node[instance.node], instance.node_from_object);
        let mirrored = own.matrix3.determinant() < 0.0;
        Self { weights, joints: joints.chain([own]).collect(), mirrored }
    }
}

/// Single precision of a transform.
pub(super) fn affine(m: DAffine3) -> Affine3A {
    Affine3A { matrix3: Mat3A::from(m.matrix3.as_mat3()), translation: Vec3A::from(m.translation.as_vec3()) }
}

impl Accel {
    /// Poses deformable instances and rebuilds the trees of those whose shape has changed. True if any has.
    pub(super) fn deform(&mut self, scene: &Scene, pose: &Pose) -> bool {
        // Instances of a mesh that are morphed alike differ in where they stand only.
        let mut morphed = HashMap::new();
        let mut changed = false;
        for group in self.groups.iter().filter(|g| g.deformable) {
            for &i in &group.instances {
                let instance = &scene.instances[i as usize];
                let shape = Shape::of(scene, pose, instance, self.origin);
                let old = &mut self.deformed[i as usize];
                if old.as_ref().is_some_and(|d| d.shape == shape) {
                    continue;
                }
                let weights: Vec<u32> = shape.weights.iter().map(|w| w.to_bits()).collect();
                let posed = || Deformed::with_tree(scene, instance.mesh, shape);
                let (posed, tree) = match instance.skin {
                    None => morphed.entry((instance.mesh, weights)).or_insert_with(posed).clone(),
                    Some(_) => posed(),
                };
                (*old, self.trees[group.tree]) = (Some(posed), tree);
                changed = true;
            }
        }
        changed
    }
}

impl Deformed {
    fn with_tree(scene: &Scene, mesh: usize, shape: Shape) -> (Arc<Self>, Arc<Tree>) {
        let posed = Self::new(&scene.meshes[mesh], shape);
        let part = Part { mirrored: posed.shape.mirrored, ..Part::of(mesh, &posed.positions) };
        let tree = Tree::new(scene, iter::once(part));
        (Arc::new(posed), Arc::new(tree))
    }

    /// The vertices of `mesh` in `shape`: morphed first, then skinned.
    pub fn new(mesh: &Mesh, shape: Shape) -> Self {
        let mut positions = mesh.positions.clone();
        let mut normals = mesh.normals.clone();
        let mut tangents = mesh.tangents.clone();
        for (target, &weight) in mesh.morph_targets.iter().zip(&shape.weights) {
            if weight == 0.0 {
                continue;
            }
            positions.iter_mut().zip(&target.positions).for_each(|(p, &d)| *p += d * weight);
            normals.iter_mut().zip(&target.normals).for_each(|(n, &d)| *n += d * weight);
            tangents.iter_mut().zip(&target.tangents).for_each(|(t, &d)| *t += (d * weight).extend(0.0));
        }
        if let Some((&own, joints)) = shape.joints.split_last() {
            for (i, position) in positions.iter_mut().enumerate() {
                let m = blend(mesh, joints, own, i);
                *position = m.transform_point3(*position);
                if let Some(n) = normals.get_mut(i) {
                    *n = cofactor(m.matrix3) * *n;
                }
                if let Some(t) = tangents.get_mut(i) {
                    *t = m.transform_vector3(t.truncate()).extend(t.w);
                }
            }
        }
        normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
        tangents.iter_mut().for_each(|t| *t = t.truncate().normalize_or_zero().extend(t.w));
        Self { positions, normals, tangents, shape }
    }

    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.positions.as_slice())
            + size_of_val(self.normals.as_slice())
            + size_of_val(self.tangents.as_slice())
    }
}

/// Turns normals as the matrix turns surfaces, lengths aside: the inverse transposed times the absolute determinant,
/// which exists for singular matrices too.
fn cofactor(m: Mat3A) -> Mat3A {
    let Mat3A { x_axis: x, y_axis: y, z_axis: z } = m;
    let side = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    Mat3A::from_cols(y.cross(z) * side, z.cross(x) * side, x.cross(y) * side)
}

/// The weighted matrix of vertex `i`; `own` where no joint holds it.
fn blend(mesh: &Mesh, joints: &[Affine3A], own: Affine3A, i: usize) -> Affine3A {
    let mut sum = Affine3A::ZERO;
    let mut total = 0.0;
    for (indices, weights) in mesh.joints.iter().zip(&mesh.joint_weights) {
        let (Some(indices), Some(weights)) = (indices.get(i), weights.get(i)) else { continue };
        for (&joint, &weight) in indices.iter().zip(weights) {
            if let (true, Some(m)) = (weight > 0.0, joints.get(usize::from(joint))) {
                sum.matrix3 += m.matrix3 * weight;
                sum.translation += m.translation * weight;
                total += weight;
            }
        }
    }
    if total > 0.0 {
        let scale = 1.0 / total;
        Affine3A { matrix3: sum.matrix3 * scale, translation: sum.translation * scale }
    } else {
        own
    }
}
