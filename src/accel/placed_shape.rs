//! An analytic shape where it stands in render space.

use super::Placement;
use super::bounds::Bounds;
use super::opacity::{self, CULL_BACK, EYE_PASS, EYE_TEST, SHADOW_PASS, SHADOW_TEST};
use super::ray::{LocalRay, RayHit, Sides};
use crate::frame::SurfaceRef;
use crate::scene::{Mesh, Scene};
use glam::{DAffine3, DVec3, Mat3, Vec3};

/// See the [module](self).
pub(super) struct PlacedShape {
    instance: u32,
    mesh: usize,
    /// See [`opacity`].
    flags: u32,
    /// The inverse, in double precision, of just what the shape's points are placed by.
    object_from_render: DAffine3,
}

impl PlacedShape {
    /// The shape of an instance; none where that cannot be met, or has no shape.
    pub fn new(scene: &Scene, instance: u32, placement: &Placement) -> Option<Self> {
        let mesh = scene.instances[instance as usize].mesh;
        if !placement.present || scene.meshes[mesh].shape.is_none() {
            return None;
        }
        let m = placement.render_from_object;
        let matrix3 = Mat3::from(m.matrix3).as_dmat3();
        let render_from_object = DAffine3 { matrix3, translation: Vec3::from(m.translation).as_dvec3() };
        let flags = opacity::flags(scene, &scene.meshes[mesh]);
        Some(Self { instance, mesh, flags, object_from_render: render_from_object.inverse() })
    }

    /// The box around it in its own space; none where it is infinite.
    pub fn bounds(&self, scene: &Scene) -> Option<Bounds> {
        let [min, max] = self.mesh(scene).shape.as_ref()?.bounds().map(|corner| corner.as_vec3());
        (min.is_finite() && max.is_finite()).then_some(Bounds { min, max })
    }

    // Not inlined, here and below: the loops over triangles that ask are hot, and are compiled better alone.

    /// The nearest of its points on the ray, no farther than `t_max`. Where alpha makes a hole of it, nothing.
    #[inline(never)]
    pub fn meet(&self, scene: &Scene, ray: &LocalRay, t_max: f32, sides: Sides) -> Option<RayHit> {
        let hole = self.flags & EYE_PASS != 0
            || self.flags & EYE_TEST != 0 && !opacity::is_present_at(scene, self.mesh(scene), 0, 0.0, 0.0);
        if hole {
            return None;
        }
        let both = sides == Sides::Both || self.flags & CULL_BACK == 0;
        let (origin, direction) = self.local(ray);
        let range = (f64::from(ray.t_min), f64::from(t_max));
        let hit = self.mesh(scene).shape.as_ref()?.intersect(origin, direction, range, both)?;
        let surface = SurfaceRef { instance: self.instance, primitive: hit.primitive, u: hit.u, v: hit.v };
        Some(RayHit { t: hit.t as f32, surface, front: hit.front })
    }

    /// Whether it keeps light from passing along the ray as far as `t_max`.
    #[inline(never)]
    pub fn blocks(&self, scene: &Scene, ray: &LocalRay, t_max: f32) -> bool {
        let mesh = self.mesh(scene);
        let opaque = self.flags & (SHADOW_TEST | SHADOW_PASS) == 0
            || self.flags & SHADOW_TEST != 0 && opacity::casts_shadow_at(scene, mesh, 0, 0.0, 0.0);
        let (origin, direction) = self.local(ray);
        let range = (f64::from(ray.t_min), f64::from(t_max));
        let meets = || mesh.shape.as_ref().and_then(|s| s.intersect(origin, direction, range, true));
        opaque && meets().is_some()
    }

    fn mesh<'a>(&self, scene: &'a Scene) -> &'a Mesh {
        &scene.meshes[self.mesh]
    }

    fn local(&self, ray: &LocalRay) -> (DVec3, DVec3) {
        let m = &self.object_from_render;
        (m.transform_point3(ray.origin.as_dvec3()), m.transform_vector3(ray.direction.as_dvec3()))
    }
}
