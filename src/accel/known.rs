//! Triangles that rays ask for by name, again and again.

use super::triangle::{ShearedRay, TriangleHit};
use super::{Accel, interpolate, opacity};
use crate::frame::{FourPoints, SurfaceRef};
use crate::scene::{Mesh, Scene};
use glam::{Affine3A, Mat3A, Vec3, Vec3A, Vec4};

/// Triangles that were asked for last: the next pixel mostly shows one of them. Neighbours in a mesh mostly have neighbouring
/// numbers, so that each finds a place of its own.
#[derive(Debug, Clone, Copy, Default)]
pub struct KnownTriangles([KnownTriangle; Self::PLACES]);

impl KnownTriangles {
    const PLACES: usize = 8;

    /// The triangle on which `surface` lies, of an instance of `mesh`.
    pub(super) fn learn(
        &mut self,
        accel: &Accel,
        scene: &Scene,
        mesh: &Mesh,
        surface: SurfaceRef,
    ) -> &KnownTriangle {
        let known = &mut self.0[surface.primitive as usize % Self::PLACES];
        if !known.is(surface) {
            *known = KnownTriangle::new(accel, scene, mesh, surface);
        }
        known
    }

    /// The point that has the barycentrics of `surface`, relative to the origin; none if its triangle is not known.
    pub fn point(&self, surface: SurfaceRef) -> Option<Vec3> {
        let known = &self.0[surface.primitive as usize % Self::PLACES];
        known.is(surface).then(|| known.point(surface))
    }
}

/// A triangle as rays meet it that ask for it alone.
#[derive(Debug, Clone, Copy)]
pub(super) struct KnownTriangle {
    instance: u32,
    primitive: u32,
    /// For each axis of render space: the coordinates of its corners.
    axes: [Vec4; 3],
    /// Its corners in its object's space.
    corners: [Vec3A; 3],
    render_from_object: Affine3A,
    /// Whether rays meet its front where they meet its back by its winding.
    mirrored: bool,
    /// Whether alpha may cut holes into it.
    has_holes: bool,
}

impl Default for KnownTriangle {
    /// None yet.
    fn default() -> Self {
        Self {
            instance: SurfaceRef::NONE,
            primitive: 0,
            axes: [Vec4::NAN; 3],
            corners: [Vec3A::NAN; 3],
            render_from_object: Affine3A::IDENTITY,
            mirrored: false,
            has_holes: false,
        }
    }
}

impl KnownTriangle {
    fn new(accel: &Accel, scene: &Scene, mesh: &Mesh, surface: SurfaceRef) -> Self {
        let index = surface.instance as usize;
        let (positions, placement) = (accel.positions(index, mesh), accel.placement(index));
        let corners = mesh.triangles[surface.primitive as usize].map(|i| Vec3A::from(positions[i as usize]));
        let [a, b, c] = corners.map(|p| placement.render_from_object.transform_point3a(p));
        Self {
            instance: surface.instance,
            primitive: surface.primitive,
            axes: [0, 1, 2].map(|axis| Vec4::new(a[axis], b[axis], c[axis], 0.0)),
            corners,
            render_from_object: placement.render_from_object,
            mirrored: placement.winding < 0.0,
            has_holes: !opacity::is_alpha_uniform(scene, mesh),
        }
    }

    /// Where the ray meets it, if it does; holes are not looked for.
    pub fn meet(&self, ray: &ShearedRay, t_min: f32, t_max: f32) -> Option<TriangleHit> {
        let hit = ray.meet(&self.axes, t_min, t_max)?;
        Some(TriangleHit { front: hit.front ^ self.mirrored, ..hit })
    }

    /// Where four rays meet it; neither holes nor its sides are looked for.
    pub fn meet_four(&self, rays: &ShearedRay, t_min: f32, t_max: f32) -> FourPoints {
        let corner = |number: usize| self.axes.map(|axis| Vec4::splat(axis[number]));
        let (met, u, v) = rays.meet_all(&[corner(0), corner(1), corner(2)], t_min, t_max).weights();
        // To the last bit as [`Self::point`].
        let ([a, b, c], Affine3A { matrix3, translation }) = (self.corners, self.render_from_object);
        let rest = Vec4::ONE - u - v;
        let [x, y, z] = [0, 1, 2].map(|axis| rest * a[axis] + u * b[axis] + v * c[axis]);
        let Mat3A { x_axis, y_axis, z_axis } = matrix3;
        let position = [0, 1, 2].map(|axis| {
            let turned = x * x_axis[axis] + y * y_axis[axis] + z * z_axis[axis];
            (turned + translation[axis]).to_array()
        });
        FourPoints { met, position, u: u.to_array(), v: v.to_array() }
    }

    /// Whether alpha may cut holes into it.
    pub fn has_holes(&self) -> bool {
        self.has_holes
    }

    /// The point that has the barycentrics of `surface`, relative to the origin.
    pub fn point(&self, surface: SurfaceRef) -> Vec3 {
        let [a, b, c] = self.corners;
        self.render_from_object.transform_point3a(interpolate(a, b, c, surface)).into()
    }

    fn is(&self, surface: SurfaceRef) -> bool {
        (self.instance, self.primitive) == (surface.instance, surface.primitive)
    }
}
