//! A point on a surface: where it is and which way the surface lies, before any texture is asked.

use super::sequence::hash;
use crate::accel::{Accel, Placement, interpolate};
use crate::frame::SurfaceRef;
use crate::scene::{Material, Mesh, Scene};
use glam::{Vec3, Vec3A};
use std::cell::OnceCell;

/// How far a ray starts from its surface, in roundings of the coordinates that the point was computed from. A point
/// is off by about ten of them, and the tree's own transform of the ray adds as many.
const OFFSET_ROUNDINGS: f32 = 32.0;

/// A point on a surface, in render space.
pub(super) struct SurfacePoint<'a> {
    pub mesh: &'a Mesh,
    pub material: &'a Material,
    /// The triangle's corners, as vertex numbers, and their barycentric weights here. A shape has none, and no attributes
    /// that would be asked for at them.
    pub corners: [usize; 3],
    pub weights: [f32; 3],
    /// The triangle's edges from its first corner.
    pub edges: [Vec3; 2],
    pub position: Vec3,
    /// Unit geometric normal on the side that is seen.
    pub geometric: Vec3,
    /// Whether the side that is seen is the front.
    pub front: bool,
    placement: &'a Placement,
    /// How large the object's coordinates were that it was computed from.
    magnitude: Vec3A,
    /// Metres to stay away from the surface; most points that are only shaded are never asked.
    offset: OnceCell<f32>,
    surface: SurfaceRef,
}

/// Which side of a surface is looked at.
pub(super) enum Side {
    /// The front if true.
    Front(bool),
    /// The side to which this points.
    Towards(Vec3),
}

impl Side {
    /// Whether it is the front of a surface that looks this way.
    fn is_front(&self, outward: Vec3) -> bool {
        match self {
            Self::Front(front) => *front,
            Self::Towards(direction) => outward.dot(*direction) >= 0.0,
        }
    }
}

impl<'a> SurfacePoint<'a> {
    /// The point at `surface`, which must not be the background.
    pub fn new(scene: &'a Scene, accel: &'a Accel, surface: SurfaceRef, side: Side) -> Self {
        let index = surface.instance as usize;
        let mesh = &scene.meshes[scene.instances[index].mesh];
        let material = &scene.materials[mesh.material];
        let placement = accel.placement(index);
        let m = &placement.render_from_object;
        let (corners, weights, edges, position, outward, magnitude);
        if let Some(shape) = &mesh.shape {
            let (local, _) = shape.point(surface);
            (corners, weights, edges) = ([0; 3], [0.0; 3], [Vec3::ZERO; 2]);
            position = m.transform_point3(local);
            outward = accel.shape_normal(scene, surface).unwrap_or(Vec3::Y);
            magnitude = local.abs().into();
        } else {
            corners = mesh.triangles[surface.primitive as usize].map(|i| i as usize);
            let positions = accel.positions(index, mesh);
            let [a, b, c] = corners.map(|i| Vec3A::from(positions[i]));
            weights = [1.0 - surface.u - surface.v, surface.u, surface.v];
            position = m.transform_point3a(interpolate(a, b, c, surface)).into();
            edges = [b - a, c - a].map(|e| Vec3::from(m.transform_vector3a(e)));
            outward = edges[0].cross(edges[1]).normalize_or(Vec3::Y) * placement.winding;
            magnitude = a.abs() * weights[0] + b.abs() * weights[1] + c.abs() * weights[2];
        }
        let front = side.is_front(outward);
        Self {
            mesh,
            material,
            corners,
            weights,
            edges,
            position,
            geometric: if front { outward } else { -outward },
            front,
            placement,
            magnitude,
            offset: OnceCell::new(),
            surface,
        }
    }

    /// A number that says nothing but which point this is: what is left to chance here is decided by it, and so the
    /// same in every frame that shows the point.
    pub fn seed(&self) -> u32 {
        let SurfaceRef { instance, primitive, u, v } = self.surface;
        [primitive, u.to_bits(), v.to_bits()].into_iter().fold(instance, hash)
    }

    /// Where a ray in `direction` starts so that rounding does not make it meet its own surface.
    pub fn start(&self, direction: Vec3) -> Vec3 {
        let offset = *self.offset.get_or_init(|| {
            let m = &self.placement.render_from_object;
            let magnitude = m.matrix3.abs() * self.magnitude + m.translation.abs();
            let roundings = OFFSET_ROUNDINGS * f32::EPSILON * 0.5;
            (magnitude.max_element() + self.placement.fused_reach) * roundings
        });
        let side = if direction.dot(self.geometric) < 0.0 { -offset } else { offset };
        self.position + self.geometric * side
    }
}
