//! Finding what a ray meets: a two-level bounding volume hierarchy over instances.
//!
//! The lower level has one tree for all that stands still, and one for every other set of meshes that share a
//! transform: the materials of one glTF mesh are one tree, and instances of it share the tree. The upper level is a
//! tree over the placed ones, in *render space*: world axes, metres, single precision, relative to an origin near the
//! eye, so that a scene far from the world's origin keeps its precision. `obvhs` builds both levels; rays walk them in
//! a form of their own. An analytic shape stands in the upper tree by itself; one that is infinite, beside it.
//!
//! Static scenes build their lower trees once; [`Accel::place`] then costs one small tree over the instances, and nothing
//! at all when neither the origin nor an instance has moved.

mod bounds;
mod convex;
mod deform;
mod displaced;
mod frustum;
mod fused;
mod intersect;
mod known;
mod opacity;
mod placed_shape;
mod ray;
mod shape;
mod tree;
mod triangle;
mod turned;
mod uncut;
mod wide;

use crate::frame::SurfaceRef;
use crate::scene::{Mesh, Pose, Scene};
use bounds::Bounds;
use deform::{Deformed, affine, is_deformable};
pub use displaced::{Displaced, Posed};
pub use frustum::Frustum;
use fused::Fused;
use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec3, Vec3A, Vec4};
pub use known::KnownTriangles;
use placed_shape::PlacedShape;
pub use ray::{PreparedRay, Ray, RayHit, Sides};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;
pub(crate) use tree::scrambled;
use tree::{Built, Part, Tree, build};
use wide::WideTree;

/// The scene as rays meet it. See the [module](self).
pub struct Accel {
    origin: DVec3,
    /// Lower trees: shared ones first, then one for each group that is deformed.
    trees: Vec<Arc<Tree>>,
    groups: Vec<Group>,
    /// The boxes around the meshes' own vertices.
    bounds_of_meshes: Vec<Bounds>,
    /// What stands still, in one tree.
    fused: Fused,
    /// The groups that were fused, whether they are visible or not.
    still: Vec<usize>,
    /// For each instance: its posed vertices, where it is deformed.
    deformed: Vec<Option<Arc<Deformed>>>,
    /// For each instance: where it stands.
    placements: Vec<Placement>,
    /// What can be met, in the order of the upper tree.
    placed: Vec<Placed>,
    /// Shapes that no box can hold.
    endless: Vec<PlacedShape>,
    upper: WideTree,
    /// What is in each leaf of the upper tree.
    upper_leaves: Vec<Range<usize>>,
    /// Entries that a ray may have pending at once in both levels.
    pending: usize,
    bounds: Bounds,
}

/// Instances that share a transform and a tree.
struct Group {
    tree: usize,
    node: usize,
    node_from_object: DAffine3,
    /// Their numbers; all of one node.
    instances: Vec<u32>,
    /// Skinned or morphed: it is one instance, posed before it has a tree. Skinned vertices stand in render space already.
    deformable: bool,
    /// A single analytic shape.
    is_shape: bool,
}

/// What the upper tree holds.
enum Placed {
    Tree(PlacedTree),
    Shape(PlacedShape),
}

/// A tree where it stands.
struct PlacedTree {
    /// A group; none for the fused ones.
    group: Option<usize>,
    object_from_render: Affine3A,
}

/// Where an instance stands in render space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    pub render_from_object: Affine3A,
    /// Inverse transposed; normals come out unnormalised.
    pub normals: Mat3A,
    /// -1 where the transform mirrors, so that triangles wind the other way; otherwise 1.
    pub winding: f32,
    /// Whether it can be met: visible and with a volume to stand in.
    pub present: bool,
    /// The largest coordinate that a point of it has where rays meet it, if that is not in its own object's space.
    pub fused_reach: f32,
}

impl Default for Placement {
    fn default() -> Self {
        let render_from_object = Affine3A::IDENTITY;
        Self { render_from_object, normals: Mat3A::IDENTITY, winding: 1.0, present: false, fused_reach: 0.0 }
    }
}

impl Accel {
    /// Builds the meshes' trees, in parallel, once for the scene. Nothing is met before [`Accel::place`].
    pub fn new(scene: &Scene) -> Self {
        let (groups, meshes) = group(scene);
        let mut uses = vec![0; meshes.len()];
        groups.iter().for_each(|g| uses[g.tree] += 1);
        // Many instances may share a mesh.
        let bounds_of_meshes: Vec<Bounds> =
            scene.meshes.par_iter().map(|mesh| Bounds::of(&mesh.positions)).collect();
        let fused = Fused::new(scene, &groups, &uses, &bounds_of_meshes);
        fused.groups().for_each(|g| uses[groups[g].tree] -= 1);
        let trees = meshes.par_iter().zip(uses).map(|(meshes, uses)| {
            // Trees that only fused groups would use are not needed.
            let meshes = if uses > 0 { meshes.as_slice() } else { &[] };
            Arc::new(Tree::new(scene, meshes.iter().map(|&m| Part::of(m, &scene.meshes[m].positions))))
        });
        Self {
            origin: DVec3::ZERO,
            trees: trees.collect(),
            still: fused.groups().collect(),
            bounds_of_meshes,
            fused,
            groups,
            deformed: scene.instances.iter().map(|_| None).collect(),
            placements: vec![Placement::default(); scene.instances.len()],
            placed: Vec::new(),
            endless: Vec::new(),
            upper: WideTree::default(),
            upper_leaves: Vec::new(),
            pending: 0,
            bounds: Bounds::default(),
        }
    }

    /// Places the instances as `pose` has them, relative to `origin`, and poses skinned and morphed meshes (their
    /// trees are rebuilt where their shape has changed; those of static ones never).
    ///
    /// Instances that are hidden, or whose transform leaves no more than a line of them, are not placed.
    pub fn place(&mut self, scene: &Scene, pose: &Pose, origin: DVec3) {
        self.origin = origin;
        let deformed = self.deform(scene, pose);
        let mut moved = self.fused.follow(scene, &self.groups, pose, &self.still) || deformed;
        let mut reach = vec![0.0; scene.instances.len()];
        for (&i, &r) in self.fused.instances.iter().zip(&self.fused.reach) {
            reach[i as usize] = r;
        }
        for group in &self.groups {
            let mut placement = place_group(scene, group, pose, origin);
            for &instance in &group.instances {
                placement.fused_reach = reach[instance as usize];
                let old = &mut self.placements[instance as usize];
                moved |= *old != placement;
                *old = placement;
            }
        }
        if moved {
            self.build_upper(scene);
        }
    }

    fn build_upper(&mut self, scene: &Scene) {
        self.endless.clear();
        let mut bounds = Vec::new();
        let mut placed = Vec::new();
        for (number, group) in self.groups.iter().enumerate() {
            let tree = &self.trees[group.tree];
            let placement = group.instances.first().map(|&i| self.placements[i as usize]).unwrap_or_default();
            let shape = group.instances.first().filter(|_| group.is_shape);
            if let Some(shape) = shape.and_then(|&i| PlacedShape::new(scene, i, &placement)) {
                match shape.bounds(scene) {
                    Some(bound) => {
                        bounds.push(bound.transformed(&placement.render_from_object));
                        placed.push(Placed::Shape(shape));
                    }
                    None => self.endless.push(shape),
                }
                continue;
            }
            if !placement.present || tree.bounds.is_empty() || self.still.binary_search(&number).is_ok() {
                continue;
            }
            bounds.push(tree.bounds.transformed(&placement.render_from_object));
            placed.push(Placed::Tree(PlacedTree {
                group: Some(number),
                object_from_render: placement.render_from_object.inverse(),
            }));
        }
        if !self.fused.tree.bounds.is_empty() {
            let anchor = (self.fused.anchor - self.origin).as_vec3();
            let Bounds { min, max } = self.fused.tree.bounds;
            bounds.push(Bounds { min: min + anchor, max: max + anchor });
            let object_from_render = Affine3A::from_translation(-anchor);
            placed.push(Placed::Tree(PlacedTree { group: None, object_from_render }));
        }
        self.bounds = bounds.iter().fold(Bounds::default(), |mut all, b| {
            all.include(b.min);
            all.include(b.max);
            all
        });
        let Built { tree: upper, order, leaves } = build(&bounds, self.bounds.reach(), 1);
        let lower = placed.iter().filter_map(|placed| match placed {
            Placed::Tree(tree) => Some(self.lower(tree).0.wide.pending()),
            Placed::Shape(_) => None,
        });
        let lower = lower.max();
        self.pending = upper.pending() + lower.unwrap_or(0);
        (self.upper, self.upper_leaves) = (upper, leaves);
        let mut slots: Vec<Option<Placed>> = placed.into_iter().map(Some).collect();
        self.placed = order.iter().filter_map(|&i| slots[i as usize].take()).collect();
    }

    /// The tree of what is placed, and the instances that are its parts.
    fn lower(&self, placed: &PlacedTree) -> (&Tree, &[u32]) {
        match placed.group {
            Some(group) => (&self.trees[self.groups[group].tree], &self.groups[group].instances),
            None => (&self.fused.tree, &self.fused.instances),
        }
    }

    /// World position of render space's origin.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// A point on a surface, deformed meshes considered, metres relative to the [origin](Self::origin). For the background: zero.
    pub fn surface_point(&self, scene: &Scene, surface: SurfaceRef) -> Vec3 {
        let Some(instance) = scene.instances.get(surface.instance as usize) else { return Vec3::ZERO };
        let index = surface.instance as usize;
        let mesh = &scene.meshes[instance.mesh];
        if let Some(shape) = &mesh.shape {
            return self.placements[index].render_from_object.transform_point3(shape.point(surface).0);
        }
        let positions = self.positions(index, mesh);
        let Some(triangle) = mesh.triangles.get(surface.primitive as usize) else { return Vec3::ZERO };
        let [a, b, c] = triangle.map(|i| Vec3A::from(positions[i as usize]));
        self.placements[index].render_from_object.transform_point3a(interpolate(a, b, c, surface)).into()
    }

    /// The unit normal of an analytic shape, outwards; none on triangles.
    pub(crate) fn shape_normal(&self, scene: &Scene, surface: SurfaceRef) -> Option<Vec3> {
        let index = surface.instance as usize;
        let shape = scene.meshes[scene.instances[index].mesh].shape.as_ref()?;
        Some((self.placements[index].normals * shape.point(surface).1).normalize_or(Vec3::Y))
    }

    /// The lowest and the highest corner of the box around everything that has an end, metres relative to the [origin](Self::origin);
    /// nothing where nothing such is placed.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        (!self.bounds.is_empty()).then_some((self.bounds.min, self.bounds.max))
    }

    /// Memory that the trees and posed vertices take.
    pub fn memory_bytes(&self) -> u64 {
        let trees: usize = unique(&self.trees).map(Tree::memory_bytes).sum();
        let deformed: usize = unique(self.deformed.iter().flatten()).map(Deformed::memory_bytes).sum();
        let upper = self.upper.memory_bytes() + size_of_val(self.placed.as_slice());
        (trees + self.fused.tree.memory_bytes() + deformed + upper) as u64
    }

    /// Where instance number `instance` stands.
    pub(crate) fn placement(&self, instance: usize) -> &Placement {
        &self.placements[instance]
    }

    /// Posed positions of an instance of `mesh`.
    pub(crate) fn positions<'a>(&'a self, instance: usize, mesh: &'a Mesh) -> &'a [Vec3] {
        self.deformed[instance].as_ref().map_or(&mesh.positions, |d| &d.positions)
    }

    /// Posed normals of an instance of `mesh`.
    pub(crate) fn normals<'a>(&'a self, instance: usize, mesh: &'a Mesh) -> &'a [Vec3] {
        self.deformed[instance].as_ref().map_or(&mesh.normals, |d| &d.normals)
    }

    /// Posed tangents of an instance of `mesh`.
    pub(crate) fn tangents<'a>(&'a self, instance: usize, mesh: &'a Mesh) -> &'a [Vec4] {
        self.deformed[instance].as_ref().map_or(&mesh.tangents, |d| &d.tangents)
    }
}

/// The point of a triangle that has the barycentrics of `surface`. A weighted sum of all three corners: the same error
/// everywhere on the triangle, and none at the corners.
pub(crate) fn interpolate(a: Vec3A, b: Vec3A, c: Vec3A, surface: SurfaceRef) -> Vec3A {
    let SurfaceRef { u, v, .. } = surface;
    a * (1.0 - u - v) + b * u + c * v
}

/// Each of what may be shared, once.
fn unique<'a, T: 'a>(all: impl IntoIterator<Item = &'a Arc<T>>) -> impl Iterator<Item = &'a T> {
    let mut known = HashSet::new();
    all.into_iter().filter(move |&one| known.insert(Arc::as_ptr(one))).map(Arc::as_ref)
}

/// Sorts instances into groups that share a transform, and finds the sets of meshes that need a tree.
fn group(scene: &Scene) -> (Vec<Group>, Vec<Vec<usize>>) {
    let mut groups: Vec<Group> = Vec::new();
    let mut rigid: HashMap<(usize, [u64; 12]), usize> = HashMap::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let is_shape = scene.meshes[instance.mesh].shape.is_some();
        let deformable = !is_shape && is_deformable(scene, instance);
        let new = groups.len();
        let key = (instance.node, instance.node_from_object.to_cols_array().map(f64::to_bits));
        let number = if deformable || is_shape { new } else { *rigid.entry(key).or_insert(new) };
        if number == new {
            let (node, node_from_object) = (instance.node, instance.node_from_object);
            groups.push(Group {
                tree: 0,
                node,
                node_from_object,
                instances: Vec::new(),
                deformable,
                is_shape,
            });
        }
        groups[number].instances.push(i as u32);
    }
    let mut trees: Vec<Vec<usize>> = Vec::new();
    let mut shared: HashMap<Vec<usize>, usize> = HashMap::new();
    for group in &mut groups {
        let meshes: Vec<usize> = group.instances.iter().map(|&i| scene.instances[i as usize].mesh).collect();
        let new = trees.len();
        // A deformable group's tree is built when it is posed.
        let (tree, meshes) = if group.deformable {
            (new, Vec::new())
        } else {
            (*shared.entry(meshes.clone()).or_insert(new), meshes)
        };
        if tree == new {
            trees.push(meshes);
        }
        group.tree = tree;
    }
    (groups, trees)
}

/// How thick what is flat becomes, of how large it is: single precision can still invert that.
const THIN: f64 = 1e-6;

/// Where a group stands in the world. What a scale of 0 has made flat is thin, so that it can be met; what is a line or a point is not.
fn world_from_object(group: &Group, pose: &Pose) -> DAffine3 {
    let mut m = pose.world_from_node[group.node] * group.node_from_object;
    let DMat3 { x_axis, y_axis, z_axis } = m.matrix3;
    // Of a flat one these are the area that it gives to a square, times the normals of both.
    let cofactors = DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis));
    let area =
        DVec3::new(cofactors.x_axis.length(), cofactors.y_axis.length(), cofactors.z_axis.length()).length();
    let longest = x_axis.length().max(y_axis.length()).max(z_axis.length());
    let (volume, side) = (m.matrix3.determinant(), area.sqrt());
    if area > THIN * longest * longest && volume.abs() < THIN * area * side {
        m.matrix3 += cofactors * (THIN / side * if volume < 0.0 { -1.0 } else { 1.0 });
    }
    m
}

fn place_group(scene: &Scene, group: &Group, pose: &Pose, origin: DVec3) -> Placement {
    let visible = pose.visible.get(group.node).copied().unwrap_or(false);
    let skinned = group.instances.first().is_some_and(|&i| scene.instances[i as usize].skin.is_some());
    let mut m = world_from_object(group, pose);
    let winding = if m.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
    if skinned {
        return Placement { present: visible, winding, ..Placement::default() };
    }
    m.translation -= origin;
    let render_from_object = affine(m);
    let object_from_render = render_from_object.inverse();
    let regular = render_from_object.is_finite() && object_from_render.is_finite();
    Placement {
        render_from_object,
        normals: object_from_render.matrix3.transpose(),
        winding,
        present: visible && regular,
        fused_reach: 0.0,
    }
}
