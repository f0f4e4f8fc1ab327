//! Where surface points are at another time: what motion vectors ask for.

use super::deform::{Deformed, Shape, is_deformable};
use super::{Accel, Placement, interpolate, place_group};
use crate::frame::SurfaceRef;
use crate::scene::{Pose, Scene};
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
}

impl Displaced {
    /// Where the surface point is, relative to the render space's origin. `surface` is not the background.
    pub fn point(&self, scene: &Scene, surface: SurfaceRef) -> Vec3 {
        let index = surface.instance as usize;
        let mesh = &scene.meshes[scene.instances[index].mesh];
        if let Some(shape) = &mesh.shape {
            return self.placements[index].render_from_object.transform_point3(shape.point(surface).0);
        }
        let positions = self.deformed[index].as_ref().map_or(&mesh.positions, |d| &d.positions);
        let [a, b, c] =
            mesh.triangles[surface.primitive as usize].map(|i| Vec3A::from(positions[i as usize]));
        self.placements[index].render_from_object.transform_point3a(interpolate(a, b, c, surface)).into()
    }
}
