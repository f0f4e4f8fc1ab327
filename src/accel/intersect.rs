//! Rays through both levels of trees.

use super::opacity::{self, CULL_BACK, EYE_PASS, EYE_TEST, SHADOW_PASS, SHADOW_TEST};
use super::tree::{Bounds, Tree};
use super::triangle::{ShearedRay, TreeTriangle, TriangleHit};
use super::{Accel, Placed};
use crate::frame::SurfaceRef;
use crate::scene::{Mesh, Scene};
use glam::{Vec3, Vec3A};
use obvhs::ray::{Ray, RayHit as TreeHit};

/// What a ray meets: the little that is needed to go on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayHit {
    /// In lengths of the ray's direction.
    pub t: f32,
    /// Where it is on which surface.
    pub surface: SurfaceRef,
    /// True on the side from which the triangle is wound counter-clockwise (clockwise where its instance is mirrored).
    pub front: bool,
}

/// Which sides of surfaces a ray meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// What the eye sees: no back faces of materials that are neither double-sided nor transmissive.
    Visible,
    /// Everything.
    Both,
}

/// The nearest hit so far, in the trees' unit of length.
struct Nearest {
    hit: TriangleHit,
    instance: u32,
    primitive: u32,
}

impl Accel {
    /// The nearest surface with `t_min <= t <= t_max`. Holes cut by alpha are not met. Where two surfaces are
    /// equally near, the one with the lower numbers is met, whatever the trees look like.
    ///
    /// `origin` is relative to [`Accel::origin`]; `direction` may have any length.
    pub fn intersect(
        &self,
        scene: &Scene,
        origin: Vec3,
        direction: Vec3,
        t_min: f32,
        t_max: f32,
        sides: Sides,
    ) -> Option<RayHit> {
        let hit = TriangleHit { t: t_max / self.unit, u: 0.0, v: 0.0, front: true };
        let mut nearest = Nearest { hit, instance: SurfaceRef::NONE, primitive: 0 };
        let (ray, start) = self.upper_ray(origin, direction, t_min, t_max);
        self.upper.ray_traverse(ray, &mut TreeHit::none(), |ray, slot| {
            self.nearest_in(scene, &self.placed[slot], ray, start, sides, &mut nearest);
            nearest.hit.t - start
        });
        (nearest.instance != SurfaceRef::NONE).then_some(RayHit {
            t: nearest.hit.t * self.unit,
            surface: SurfaceRef {
                instance: nearest.instance,
                primitive: nearest.primitive,
                u: nearest.hit.u,
                v: nearest.hit.v,
            },
            front: nearest.hit.front,
        })
    }

    /// True if light passes from `from` along `direction` as far as `t_max` lengths of it: nothing there has an
    /// opacity, alpha x (1 - transmission), of one half or more. Both sides of every surface block it.
    pub fn unoccluded(&self, scene: &Scene, from: Vec3, direction: Vec3, t_max: f32) -> bool {
        let (ray, _) = self.upper_ray(from, direction, 0.0, t_max);
        self.upper.ray_traverse_miss(ray, |ray, slot| {
            let placed = &self.placed[slot];
            let group = &self.groups[placed.group];
            let tree = &self.trees[group.tree];
            let (local, sheared, _) = placed.local(ray, &tree.bounds);
            let missed = tree.bvh.ray_traverse_miss(local, |ray, i| {
                let triangle = &tree.triangles[i];
                match sheared.intersect(triangle, ray.tmin, ray.tmax) {
                    Some(hit)
                        if blocks(scene, self.mesh(scene, &group.instances, triangle), triangle, &hit) =>
                    {
                        f32::NEG_INFINITY
                    }
                    _ => f32::INFINITY,
                }
            });
            if missed { f32::INFINITY } else { f32::NEG_INFINITY }
        })
    }

    /// The ray for the upper tree, in its unit, and how far along the given one it starts.
    fn upper_ray(&self, origin: Vec3, direction: Vec3, t_min: f32, t_max: f32) -> (Ray, f32) {
        let direction = direction * self.unit;
        let start = self.bounds.approach(origin, direction);
        let (t_min, t_max) = (t_min / self.unit - start, t_max / self.unit - start);
        (tree_ray(origin + direction * start, direction, t_min, t_max), start)
    }

    /// Looks for something nearer in one placed group; `start` is how far along the whole ray `ray` starts.
    fn nearest_in(
        &self,
        scene: &Scene,
        placed: &Placed,
        ray: &Ray,
        start: f32,
        sides: Sides,
        nearest: &mut Nearest,
    ) {
        let group = &self.groups[placed.group];
        let tree: &Tree = &self.trees[group.tree];
        let (local, sheared, on) = placed.local(ray, &tree.bounds);
        let start = start + on;
        tree.bvh.ray_traverse(local, &mut TreeHit::none(), |ray, i| {
            let triangle = &tree.triangles[i];
            let Some(mut hit) = sheared.intersect(triangle, ray.tmin, nearest.hit.t - start) else {
                return f32::INFINITY;
            };
            let t = hit.t;
            hit.t += start;
            let instance = group.instances[triangle.part() as usize];
            let found = (instance, triangle.primitive());
            if hit.t >= nearest.hit.t && found >= (nearest.instance, nearest.primitive) {
                return f32::INFINITY;
            }
            let flags = triangle.flags();
            let culled = sides == Sides::Visible && !hit.front && flags & CULL_BACK != 0;
            if culled || flags & EYE_PASS != 0 {
                return f32::INFINITY;
            }
            if flags & EYE_TEST != 0 {
                let mesh = self.mesh(scene, &group.instances, triangle);
                if !opacity::is_present_at(scene, mesh, triangle.primitive(), hit.u, hit.v) {
                    return f32::INFINITY;
                }
            }
            *nearest = Nearest { hit, instance: found.0, primitive: found.1 };
            t
        });
    }

    fn mesh<'a>(&self, scene: &'a Scene, instances: &[u32], triangle: &TreeTriangle) -> &'a Mesh {
        &scene.meshes[scene.instances[instances[triangle.part() as usize] as usize].mesh]
    }
}

fn blocks(scene: &Scene, mesh: &Mesh, triangle: &TreeTriangle, hit: &TriangleHit) -> bool {
    let flags = triangle.flags();
    if flags & (SHADOW_TEST | SHADOW_PASS) == 0 {
        return true;
    }
    flags & SHADOW_TEST != 0 && opacity::casts_shadow_at(scene, mesh, triangle.primitive(), hit.u, hit.v)
}

impl Placed {
    /// The ray in the group's own space, and how far along the given one it starts. Its parameter is measured alike,
    /// since its direction is not normalised.
    #[inline]
    fn local(&self, ray: &Ray, bounds: &Bounds) -> (Ray, ShearedRay, f32) {
        let mut origin = Vec3::from(self.object_from_render.transform_point3a(ray.origin));
        let direction = Vec3::from(self.object_from_render.transform_vector3a(ray.direction));
        let start = bounds.approach(origin, direction);
        origin += direction * start;
        (
            tree_ray(origin, direction, ray.tmin - start, ray.tmax - start),
            ShearedRay::new(origin, direction),
            start,
        )
    }
}

/// A ray for `obvhs`. Its own constructor takes components below 1e-7 for 1e-7, which bends rays along an axis when
/// directions are short.
fn tree_ray(origin: Vec3, direction: Vec3, tmin: f32, tmax: f32) -> Ray {
    let inverse = direction.to_array().map(|d| {
        if d.abs() > 1e-20 {
            1.0 / d
        } else if d < 0.0 {
            -1e20
        } else {
            1e20
        }
    });
    Ray {
        origin: Vec3A::from(origin),
        direction: Vec3A::from(direction),
        inv_direction: Vec3A::from_array(inverse),
        tmin,
        tmax,
    }
}
