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
#[derive(Clone)]
pub(super) struct SurfacePoint<'a> {
    pub mesh: &'a Mesh,
    pub material: &'a Material,
    /// The triangle's corners, as vertex numbers, and their barycentric weights here. A shape has none, and no attributes
    /// that would be asked for at them.
    pub corners: [usize; 3],
    pub weights: [f32; 3],
    /// The triangle's edges from its first corner.
    pub edges: [Vec3; 2],
    /// Area of the parallelogram that the edges span.
    pub area: f32,
    pub position: Vec3,
    /// Unit geometric normal on the side that is seen.
    pub geometric: Vec3,
    /// Whether the side that is seen is the front.
    pub front: bool,
    pub placement: &'a Placement,
    /// The triangle's corners in object space; of a shape, the point itself.
    positions: [Vec3A; 3],
    /// Unit geometric normal on the front.
    outward: Vec3,
    /// Metres to stay away from the surface; most points that are only shaded are never asked.
    offset: OnceCell<f32>,
    pub surface: SurfaceRef,
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
        let placement = accel.placement(index);
        let m = &placement.render_from_object;
        let (corners, positions, edges, area, outward);
        if let Some(shape) = &mesh.shape {
            (corners, edges, area) = ([0; 3], [Vec3::ZERO; 2], 0.0);
            positions = [shape.point(surface).0.into(); 3];
            outward = accel.shape_normal(scene, surface).unwrap_or(Vec3::Y);
        } else {
            corners = mesh.triangles[surface.primitive as usize].map(|i| i as usize);
            let posed = accel.positions(index, mesh);
            positions = corners.map(|i| Vec3A::from(posed[i]));
            let [a, b, c] = positions;
            edges = [b - a, c - a].map(|e| Vec3::from(m.transform_vector3a(e)));
            let across = edges[0].cross(edges[1]);
            area = across.length();
            outward = across.normalize_or(Vec3::Y) * placement.winding;
        }
        let mut this = Self {
            mesh,
            material: &scene.materials[mesh.material],
            corners,
            weights: [1.0, 0.0, 0.0],
            edges,
            area,
            position: Vec3::ZERO,
            geometric: outward,
            front: true,
            placement,
            positions,
            outward,
            offset: OnceCell::new(),
            surface,
        };
        this.place(surface, side);
        this
    }

    /// Whether `surface` is on the same triangle, so that [`SurfacePoint::place`] will do.
    #[inline]
    pub fn shares_triangle(&self, surface: SurfaceRef) -> bool {
        let primitive = |s: &SurfaceRef| (s.instance, s.primitive);
        primitive(&surface) == primitive(&self.surface) && self.mesh.shape.is_none()
    }

    /// Moves to another point of the same triangle. It is then what [`SurfacePoint::new`] gives, for less work. Points of shapes
    /// stay where they are.
    #[inline]
    pub fn place(&mut self, surface: SurfaceRef, side: Side) {
        let [a, b, c] = self.positions;
        let mut local = a;
        if self.mesh.shape.is_none() {
            self.weights = [1.0 - surface.u - surface.v, surface.u, surface.v];
            local = interpolate(a, b, c, surface);
        }
        self.position = self.placement.render_from_object.transform_point3a(local).into();
        self.front = side.is_front(self.outward);
        self.geometric = if self.front { self.outward } else { -self.outward };
        self.surface = surface;
        self.offset = OnceCell::new();
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
            let [[a, b, c], [wa, wb, wc]] = [self.positions.map(Vec3A::abs), self.weights.map(Vec3A::splat)];
            let magnitude = m.matrix3.abs() * (a * wa + b * wb + c * wc) + m.translation.abs();
            let roundings = OFFSET_ROUNDINGS * f32::EPSILON * 0.5;
            (magnitude.max_element() + self.placement.fused_reach) * roundings
        });
        let side = if direction.dot(self.geometric) < 0.0 { -offset } else { offset };
        self.position + self.geometric * side
    }
}
