//! Where surface points are at another time: what motion vectors ask for.

use super::deform::{Deformed, Shape, is_deformable};
use super::{Accel, Placement, interpolate, place_group};
use crate::frame::SurfaceRef;
use crate::scene::{Mesh, Pose, Scene};
use glam::{DVec3, Vec3, Vec3A};
use std::sync::Arc;

/// The scene's surfaces in another pose than the one that rays meet, in the same render space.
pub struct Displaced {
    placements: Vec<Placement>,
    deformed: Vec<Option<Arc<Deformed>>>,
}

impl Accel {
    /// The surfaces as `pose` has them, relative to [`Accel::origin`]; rays still meet them where they were placed.
    pub fn displaced(&self, scene: &Scene, pose: &Pose) -> Displaced {
        let mut placements = self.placements.clone();
        for group in &self.groups {
            for &instance in &group.instances {
                placements[instance as usize] = place_group(scene, group, pose, self.origin);
            }
        }
        let deformed = scene.instances.iter().zip(&self.deformed).map(|(instance, now)| {
            let shape =
                is_deformable(scene, instance).then(|| Shape::of(scene, pose, instance, self.origin))?;
            Some(match now {
                Some(now) if now.shape == shape => Arc::clone(now),
                _ => Arc::new(Deformed::new(&scene.meshes[instance.mesh], shape)),
            })
        });
        Displaced { placements, deformed: deformed.collect() }
    }

    /// An instance as rays meet it.
    pub fn posed<'a>(&'a self, scene: &'a Scene, instance: usize) -> Posed<'a> {
        let mesh = &scene.meshes[scene.instances[instance].mesh];
        Posed { mesh, positions: self.positions(instance, mesh), placement: &self.placements[instance] }
    }
}

/// An instance in one pose.
#[derive(Clone, Copy)]
pub struct Posed<'a> {
    mesh: &'a Mesh,
    positions: &'a [Vec3],
    placement: &'a Placement,
}

impl<'a> Posed<'a> {
    /// Its triangles, relative to the origin; of a shape, those of the box around it. None if it is not placed.
    pub fn triangles(self) -> impl Iterator<Item = [Vec3; 3]> + Clone + use<'a> {
        let Self { mesh, positions, placement } = self;
        let numbers = if placement.present { mesh.triangles.as_slice() } else { &[] };
        let bounds = mesh.shape.as_ref().filter(|_| placement.present).map(|shape| shape.bounds());
        let object = numbers.iter().map(|t| t.map(|i| positions[i as usize]));
        let render_from_object = placement.render_from_object;
        object
            .chain(bounds.into_iter().flat_map(sides))
            .map(move |t| t.map(|p| render_from_object.transform_point3(p)))
    }

    /// Whether it is a shape that is placed: its surface is not that of its triangles, but within them.
    pub fn is_shape(self) -> bool {
        self.mesh.shape.is_some() && self.placement.present
    }

    /// Says of balls, given by their middles relative to the origin and their radii, whether the surface of a shape may pass them.
    pub fn may_pass(self) -> impl Fn(Vec3, f32) -> bool + use<'a> {
        let object_from_render = self.placement.render_from_object.inverse();
        let axes = object_from_render.matrix3;
        let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis].map(Vec3A::length_squared);
        // No vector grows by more.
        let growth = (x + y + z).sqrt();
        move |middle, radius| {
            let middle = object_from_render.transform_point3(middle).as_dvec3();
            self.mesh.shape.as_ref().is_some_and(|shape| shape.may_pass(middle, f64::from(radius * growth)))
        }
    }
}

/// Farther away than this a shape without end is taken to end, metres: voxels around it are as coarse as its box is large.
const ENDLESS: f64 = 1e6;

/// The triangles of a box.
fn sides(bounds: [DVec3; 2]) -> impl Iterator<Item = [Vec3; 3]> + Clone {
    let bounds = bounds.map(|p| p.clamp(DVec3::splat(-ENDLESS), DVec3::splat(ENDLESS)).as_vec3());
    let corner = move |i: usize| Vec3::new(bounds[i & 1].x, bounds[i >> 1 & 1].y, bounds[i >> 2].z);
    let faces = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 4, 5], [2, 3, 6, 7], [0, 2, 4, 6], [1, 3, 5, 7]];
    faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [b, c, d]]).map(move |t| t.map(corner))
}

impl Displaced {
    /// Where the surface point is, relative to the render space's origin. `surface` is not the background.
    pub fn point(&self, scene: &Scene, surface: SurfaceRef) -> Vec3 {
        let (index, mesh) = mesh_of(scene, surface);
        let placement = &self.placements[index];
        if let Some(shape) = &mesh.shape {
            return placement.render_from_object.transform_point3(shape.point(surface).0);
        }
        let [a, b, c] = self.corners(index, mesh, surface);
        placement.render_from_object.transform_point3a(interpolate(a, b, c, surface)).into()
    }

    /// Whether the front of the surface faces against `direction`. It is not the background.
    pub fn is_front(&self, scene: &Scene, surface: SurfaceRef, direction: Vec3) -> bool {
        let (index, mesh) = mesh_of(scene, surface);
        let placement = &self.placements[index];
        let outward = match &mesh.shape {
            Some(shape) => placement.normals * Vec3A::from(shape.point(surface).1),
            None => {
                let [a, b, c] = self.corners(index, mesh, surface);
                let edges = [b - a, c - a].map(|edge| placement.render_from_object.transform_vector3a(edge));
                edges[0].cross(edges[1]) * placement.winding
            }
        };
        outward.dot(Vec3A::from(direction)) <= 0.0
    }

    /// An instance in this pose.
    pub fn posed<'a>(&'a self, scene: &'a Scene, instance: usize) -> Posed<'a> {
        let mesh = &scene.meshes[scene.instances[instance].mesh];
        Posed { mesh, positions: self.positions(instance, mesh), placement: &self.placements[instance] }
    }

    /// Corners of the triangle that a point lies on, as the instance has them before it is placed.
    fn corners(&self, index: usize, mesh: &Mesh, surface: SurfaceRef) -> [Vec3A; 3] {
        let positions = self.positions(index, mesh);
        mesh.triangles[surface.primitive as usize].map(|i| Vec3A::from(positions[i as usize]))
    }

    fn positions<'a>(&'a self, instance: usize, mesh: &'a Mesh) -> &'a [Vec3] {
        self.deformed[instance].as_ref().map_or(&mesh.positions, |d| &d.positions)
    }
}

/// The instance that a point lies on, and its mesh.
fn mesh_of(scene: &Scene, surface: SurfaceRef) -> (usize, &Mesh) {
    let index = surface.instance as usize;
    (index, &scene.meshes[scene.instances[index].mesh])
}
