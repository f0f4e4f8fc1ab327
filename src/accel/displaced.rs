//! Where surface points are at another time: what motion vectors ask for.

use super::deform::{Deformed, Shape, is_deformable};
use super::{Accel, Placement, interpolate, place_group};
use crate::frame::SurfaceRef;
use crate::scene::{Mesh, Pose, Scene};
use glam::{Vec3, Vec3A};

/// The scene's surfaces in another pose than the one that rays meet, in the same render space.
pub struct Displaced {
    placements: Vec<Placement>,
    deformed: Vec<Option<Deformed>>,
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
        let deformed = scene.instances.iter().map(|instance| {
            let shape = is_deformable(scene, instance).then(|| Shape::of(scene, pose, instance, self.origin));
            shape.map(|shape| Deformed::new(&scene.meshes[instance.mesh], shape))
        });
        Displaced { placements, deformed: deformed.collect() }
    }

    /// The triangles of an instance, relative to the origin; none of one that is not placed.
    pub fn triangles<'a>(
        &'a self,
        scene: &'a Scene,
        instance: usize,
    ) -> impl Iterator<Item = [Vec3; 3]> + Clone + use<'a> {
        let mesh = &scene.meshes[scene.instances[instance].mesh];
        triangles(mesh, self.positions(instance, mesh), &self.placements[instance])
    }
}

/// Triangles of an instance of `mesh` that stands at `placement`.
fn triangles<'a>(
    mesh: &'a Mesh,
    positions: &'a [Vec3],
    placement: &'a Placement,
) -> impl Iterator<Item = [Vec3; 3]> + Clone + use<'a> {
    let numbers = if placement.present { mesh.triangles.as_slice() } else { &[] };
    let render_from_object = placement.render_from_object;
    numbers.iter().map(move |t| t.map(|i| render_from_object.transform_point3(positions[i as usize])))
}

impl Displaced {
    /// Where the surface point is, relative to the render space's origin. `surface` is not the background.
    pub fn point(&self, scene: &Scene, surface: SurfaceRef) -> Vec3 {
        let [a, b, c] = self.corners(scene, surface);
        let placement = &self.placements[surface.instance as usize];
        placement.render_from_object.transform_point3a(interpolate(a, b, c, surface)).into()
    }

    /// Whether the front of the surface faces against `direction`. It is not the background.
    pub fn is_front(&self, scene: &Scene, surface: SurfaceRef, direction: Vec3) -> bool {
        let [a, b, c] = self.corners(scene, surface);
        let placement = &self.placements[surface.instance as usize];
        let [ab, ac] = [b - a, c - a].map(|edge| placement.render_from_object.transform_vector3a(edge));
        ab.cross(ac).dot(Vec3A::from(direction)) * placement.winding <= 0.0
    }

    /// See [`Accel::triangles`].
    pub fn triangles<'a>(
        &'a self,
        scene: &'a Scene,
        instance: usize,
    ) -> impl Iterator<Item = [Vec3; 3]> + Clone + use<'a> {
        let mesh = &scene.meshes[scene.instances[instance].mesh];
        triangles(mesh, self.positions(instance, mesh), &self.placements[instance])
    }

    /// Corners of the triangle that a point lies on, as the instance has them before it is placed.
    fn corners(&self, scene: &Scene, surface: SurfaceRef) -> [Vec3A; 3] {
        let index = surface.instance as usize;
        let mesh = &scene.meshes[scene.instances[index].mesh];
        let positions = self.positions(index, mesh);
        mesh.triangles[surface.primitive as usize].map(|i| Vec3A::from(positions[i as usize]))
    }

    fn positions<'a>(&'a self, instance: usize, mesh: &'a Mesh) -> &'a [Vec3] {
        self.deformed[instance].as_ref().map_or(&mesh.positions, |d| &d.positions)
    }
}
