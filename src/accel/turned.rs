//! Surfaces that open to the eye between two views.

use super::uncut::Plane;
use super::{Accel, Group, opacity};
use crate::scene::{Scene, Shape, View};
use glam::{Affine3A, DAffine3, DVec3, Mat3, Vec3, Vec3A};
use rayon::prelude::*;

/// Triangles that one task looks at.
const CHUNK: usize = 8192;

/// So far outside of a view, of its largest coordinate, a point surely is outside after all rounding.
const MARGIN: f64 = 1e-5;

impl Accel {
    /// Visits, in any order, the corners, relative to the origin, of every triangle, those of flat shapes too, whose plane the eye crosses between two
    /// views to look at a visible side, or from which it moves away by as much as it was before it at first: the old view
    /// showed it as a line, or through its culled back not at all. Instances that the new view surely shows nothing of are left out.
    pub fn turned(&self, scene: &Scene, (old, new): (&View, &View), visit: &(dyn Fn([Vec3; 3]) + Sync)) {
        let eyes = [old, new].map(|view| self.eye_of(view));
        let [top, right, bottom, left] = self.sides(new);
        let planes = [top, right, bottom, left, self.behind(new, new.lens.near.min(0.0))];
        let eye = (new.eye - self.origin).abs().max_element();
        let of_instance = |index: usize| {
            let instance = &scene.instances[index];
            let placement = self.placement(index);
            let mesh = &scene.meshes[instance.mesh];
            let culled = opacity::culls_back(scene, mesh);
            // A front is a front in the object's own space, whatever its placement mirrors; skinned vertices have left that.
            let front = if instance.skin.is_some() { placement.winding } else { 1.0 };
            let object_from_render = placement.render_from_object.inverse();
            let [old, new] = eyes.map(|(at, w)| {
                let at = if w > 0.0 {
                    object_from_render.transform_point3a(at)
                } else {
                    object_from_render.transform_vector3a(at)
                };
                (at, w)
            });
            let positions = self.positions(index, mesh);
            let look = |[a, b, c]: [Vec3A; 3]| {
                let normal = (b - a).cross(c - a);
                let before = |(at, w): (Vec3A, f32)| normal.dot(at - a * w);
                let (was, is) = (before(old), before(new));
                let side = if culled { front } else { is.signum() };
                if is * side > 0.0 && was * side <= 0.5 * is * side {
                    visit([a, b, c].map(|p| placement.render_from_object.transform_point3a(p).into()));
                }
            };
            if placement.present {
                let corners = |triangle: &[u32; 3]| triangle.map(|i| Vec3A::from(positions[i as usize]));
                mesh.triangles.par_iter().with_min_len(CHUNK).map(corners).for_each(look);
                mesh.shape.iter().flat_map(Shape::sheet).map(|t| t.map(Vec3A::from)).for_each(look);
            }
        };
        self.groups.par_iter().for_each(|group| {
            let instances = group.instances.par_iter().map(|&index| index as usize);
            instances
                .filter(|&index| !self.is_outside(scene, (group, index), &planes, eye))
                .for_each(of_instance);
        });
    }

    /// True if it is certain that no triangle of an instance in its group reaches inside of all `planes` of a view, whose eye's largest
    /// coordinate is `eye`.
    fn is_outside(&self, scene: &Scene, (group, index): (&Group, usize), planes: &[Plane], eye: f64) -> bool {
        let bounds = match &self.deformed[index] {
            Some(_) => self.trees[group.tree].bounds,
            None => self.bounds_of_meshes[scene.instances[index].mesh],
        };
        if bounds.is_empty() {
            return false;
        }
        let Affine3A { matrix3, translation } = self.placement(index).render_from_object;
        let reach = matrix3.abs() * Vec3A::splat(bounds.reach()) + translation.abs();
        let margin = MARGIN * eye.max(reach.max_element().into());
        let render_from_object =
            DAffine3 { matrix3: Mat3::from(matrix3).as_dmat3(), translation: translation.as_dvec3() };
        let corners = bounds.corners().map(|corner| render_from_object.transform_point3(corner.as_dvec3()));
        planes.iter().any(|plane| corners.iter().all(|&corner| plane.distance(corner) < -margin))
    }

    /// The eye of a view, or the direction towards it for parallel rays (weight 0).
    fn eye_of(&self, view: &View) -> (Vec3A, f32) {
        if view.is_perspective() {
            ((view.eye - self.origin).as_vec3a(), 1.0)
        } else {
            ((DVec3::ZERO - view.forward).as_vec3a(), 0.0)
        }
    }
}
