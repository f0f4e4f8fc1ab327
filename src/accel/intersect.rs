//! Rays through both levels of trees.

use super::bounds::Bounds;
use super::opacity::{self, CULL_BACK, EYE_PASS, EYE_TEST, MIRRORED, SHADOW_PASS, SHADOW_TEST};
use super::placed_shape::PlacedShape;
use super::ray::{LocalRay, PreparedRay, Ray, RayHit, Sides};
use super::triangle::{ShearedRay, TriangleHit};
use super::wide::{Pending, SlabRay};
use super::{Accel, KnownTriangles, Placed, PlacedTree};
use crate::frame::{FourPoints, SurfaceRef};
use crate::scene::{Mesh, Scene};
use glam::{Vec3, Vec4};

/// The nearest hit so far.
struct Nearest {
    hit: TriangleHit,
    instance: u32,
    primitive: u32,
}

impl Accel {
    /// The nearest surface on the ray. Holes cut by alpha are not met. Where two surfaces are equally near, the one with
    /// the lower numbers is met, whatever the trees look like.
    pub fn intersect(&self, scene: &Scene, ray: &Ray, sides: Sides) -> Option<RayHit> {
        let hit = TriangleHit { t: ray.t_max, u: 0.0, v: 0.0, front: true };
        let mut nearest = Nearest { hit, instance: SurfaceRef::NONE, primitive: 0 };
        for shape in &self.endless {
            self.nearest_on(scene, shape, &LocalRay::whole(ray), sides, &mut nearest);
        }
        let ray = LocalRay::whole(ray).approaching(&self.bounds);
        self.with_pending(|pending| {
            // Scenes that stand still are one tree: there is nothing to choose from.
            if let [Placed::Tree(only)] = self.placed.as_slice() {
                return self.nearest_in(scene, only, &ray, sides, &mut nearest, pending);
            }
            let slabs = SlabRay::new(ray.origin, ray.direction, ray.t_min);
            self.upper.nearest(&slabs, nearest.hit.t - ray.start, pending, |leaf, _, pending| {
                for placed in &self.placed[self.upper_leaves[leaf].clone()] {
                    match placed {
                        Placed::Tree(tree) => {
                            self.nearest_in(scene, tree, &ray, sides, &mut nearest, pending);
                        }
                        Placed::Shape(shape) => self.nearest_on(scene, shape, &ray, sides, &mut nearest),
                    }
                }
                nearest.hit.t - ray.start
            });
        });
        (nearest.instance != SurfaceRef::NONE).then_some(RayHit {
            t: nearest.hit.t,
            surface: SurfaceRef {
                instance: nearest.instance,
                primitive: nearest.primitive,
                u: nearest.hit.u,
                v: nearest.hit.v,
            },
            front: nearest.hit.front,
        })
    }

    /// Where a ray meets one known triangle, if it does, holes cut by alpha considered. Which side it meets does not
    /// matter; nothing else is looked at. Of a known shape, the nearest point that the eye would see is met. `known` are triangles
    /// that were asked for before.
    pub fn meet(
        &self,
        scene: &Scene,
        ray: &PreparedRay,
        surface: SurfaceRef,
        known: &mut KnownTriangles,
    ) -> Option<RayHit> {
        let PreparedRay { ray, sheared } = ray;
        let index = surface.instance as usize;
        let mesh = &scene.meshes[scene.instances[index].mesh];
        if mesh.shape.is_some() {
            let shape = PlacedShape::new(scene, surface.instance, self.placement(index))?;
            return shape.meet(scene, &LocalRay::whole(ray), ray.t_max, Sides::Visible);
        }
        let known = known.learn(self, scene, mesh, surface);
        let hit = known.meet(sheared, ray.t_min, ray.t_max)?;
        let present =
            !known.has_holes() || opacity::is_present_at(scene, mesh, surface.primitive, hit.u, hit.v);
        let surface = SurfaceRef { u: hit.u, v: hit.v, ..surface };
        present.then_some(RayHit { t: hit.t, surface, front: hit.front })
    }

    /// Where four rays from `origin`, of which `directions` has each axis, meet one known triangle as [`Accel::meet`] does; none
    /// where they cannot be looked at together.
    pub fn meet_four(
        &self,
        scene: &Scene,
        (origin, directions): (Vec3, [Vec4; 3]),
        [t_min, t_max]: [f32; 2],
        surface: SurfaceRef,
        known: &mut KnownTriangles,
    ) -> Option<FourPoints> {
        let rays = ShearedRay::four(origin, directions)?;
        let mesh = &scene.meshes[scene.instances[surface.instance as usize].mesh];
        if mesh.shape.is_some() {
            return None;
        }
        let known = known.learn(self, scene, mesh, surface);
        (!known.has_holes()).then(|| known.meet_four(&rays, t_min, t_max))
    }

    /// True if light passes from `from` along `direction` as far as `t_max` lengths of it: nothing there has an
    /// opacity, alpha x (1 - transmission), of one half or more. Both sides of every surface block it.
    pub fn unoccluded(&self, scene: &Scene, from: Vec3, direction: Vec3, t_max: f32) -> bool {
        let whole = LocalRay::whole(&Ray { origin: from, direction, t_min: 0.0, t_max });
        if self.endless.iter().any(|shape| shape.blocks(scene, &whole, t_max)) {
            return false;
        }
        let ray = whole.approaching(&self.bounds);
        !self.with_pending(|pending| {
            if let [Placed::Tree(only)] = self.placed.as_slice() {
                return self.blocks_in(scene, only, &ray, t_max, pending);
            }
            let slabs = SlabRay::new(ray.origin, ray.direction, ray.t_min);
            self.upper.any(
                |node| slabs.meet(node, t_max - ray.start).1,
                pending,
                |leaf, pending| {
                    self.placed[self.upper_leaves[leaf].clone()].iter().any(|placed| match placed {
                        Placed::Tree(tree) => self.blocks_in(scene, tree, &ray, t_max, pending),
                        Placed::Shape(shape) => shape.blocks(scene, &ray, t_max - ray.start),
                    })
                },
            )
        })
    }

    /// Calls `traverse` with room for what a ray has pending in both levels.
    #[inline(always)]
    pub(super) fn with_pending<T>(&self, traverse: impl FnOnce(&mut [Pending]) -> T) -> T {
        // Deeper trees are rare, and theirs are degenerate scenes.
        const USUAL: usize = 128;
        if self.pending <= USUAL {
            traverse(&mut [(0, 0.0); USUAL])
        } else {
            traverse(&mut vec![(0, 0.0); self.pending])
        }
    }

    /// Looks for something nearer in one placed group.
    #[inline]
    fn nearest_in(
        &self,
        scene: &Scene,
        placed: &PlacedTree,
        ray: &LocalRay,
        sides: Sides,
        nearest: &mut Nearest,
        pending: &mut [Pending],
    ) {
        let (tree, instances) = self.lower(placed);
        let local = placed.local(ray, &tree.bounds);
        let (slabs, sheared) = local.prepare();
        let start = local.start;
        tree.wide.nearest(&slabs, nearest.hit.t - start, pending, |leaf, mut t_max, _| {
            let pack = &tree.leaves[leaf];
            for (lane, mut hit) in sheared.intersect(pack, local.t_min, t_max) {
                let t = hit.t;
                hit.t += start;
                let found = (instances[pack.part(lane) as usize], pack.primitive(lane));
                if t > t_max || hit.t >= nearest.hit.t && found >= (nearest.instance, nearest.primitive) {
                    continue;
                }
                let flags = pack.flags(lane);
                hit.front ^= flags & MIRRORED != 0;
                let culled = sides == Sides::Visible && !hit.front && flags & CULL_BACK != 0;
                if culled || flags & EYE_PASS != 0 {
                    continue;
                }
                if flags & EYE_TEST != 0
                    && !opacity::is_present_at(scene, mesh_of(scene, found.0), found.1, hit.u, hit.v)
                {
                    continue;
                }
                *nearest = Nearest { hit, instance: found.0, primitive: found.1 };
                t_max = t;
            }
            t_max
        });
    }

    /// True if anything in one placed group blocks light before `t_max` of the whole ray.
    #[inline]
    fn blocks_in(
        &self,
        scene: &Scene,
        placed: &PlacedTree,
        ray: &LocalRay,
        t_max: f32,
        pending: &mut [Pending],
    ) -> bool {
        let (tree, instances) = self.lower(placed);
        let local = placed.local(ray, &tree.bounds);
        let (slabs, sheared) = local.prepare();
        let t_max = t_max - local.start;
        tree.wide.any(
            |node| slabs.meet(node, t_max).1,
            pending,
            |leaf, _| {
                let pack = &tree.leaves[leaf];
                sheared.intersect(pack, local.t_min, t_max).any(|(lane, hit)| {
                    let flags = pack.flags(lane);
                    let mesh = || mesh_of(scene, instances[pack.part(lane) as usize]);
                    let asks =
                        |mesh| opacity::casts_shadow_at(scene, mesh, pack.primitive(lane), hit.u, hit.v);
                    flags & (SHADOW_TEST | SHADOW_PASS) == 0 || flags & SHADOW_TEST != 0 && asks(mesh())
                })
            },
        )
    }

    /// Looks for something nearer on one shape.
    fn nearest_on(
        &self,
        scene: &Scene,
        placed: &PlacedShape,
        ray: &LocalRay,
        sides: Sides,
        nearest: &mut Nearest,
    ) {
        let t_max = nearest.hit.t - ray.start;
        let Some(RayHit { t, surface, front }) = placed.meet(scene, ray, t_max, sides) else {
            return;
        };
        let SurfaceRef { instance, primitive, u, v } = surface;
        let hit = TriangleHit { t: t + ray.start, u, v, front };
        let is_nearer =
            hit.t < nearest.hit.t || (instance, primitive) < (nearest.instance, nearest.primitive);
        if is_nearer {
            *nearest = Nearest { hit, instance, primitive };
        }
    }
}

fn mesh_of(scene: &Scene, instance: u32) -> &Mesh {
    &scene.meshes[scene.instances[instance as usize].mesh]
}

impl PlacedTree {
    /// The ray in the group's own space.
    #[inline]
    fn local(&self, ray: &LocalRay, bounds: &Bounds) -> LocalRay {
        let origin = Vec3::from(self.object_from_render.transform_point3a(ray.origin.into()));
        let direction = Vec3::from(self.object_from_render.transform_vector3a(ray.direction.into()));
        LocalRay { origin, direction, ..*ray }.approaching(bounds)
    }
}
