//! The full record of a point on a surface: where it is, how it is turned, what its textures say.

use crate::accel::{Accel, interpolate};
use crate::frame::SurfaceRef;
use crate::scene::{Material, Mesh, NormalTexture, Scene, TextureRef};
use glam::{Vec2, Vec3, Vec3A};

/// How far a ray starts from its surface, in roundings of the coordinates that the point was computed from. A point
/// is off by about ten of them, and the tree's own transform of the ray adds as many.
const OFFSET_ROUNDINGS: f32 = 32.0;

/// A shading normal is never nearer to the surface than this cosine.
const MIN_NORMAL_COSINE: f32 = 0.01;

/// The width of a pixel's beam: where it is, and how it grows along the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beam {
    /// Metres.
    pub width: f32,
    /// Metres of width a metre of path.
    pub spread: f32,
}

impl Beam {
    /// The beam `distance` further on.
    pub fn after(self, distance: f32) -> Self {
        Self { width: self.width + self.spread * distance, spread: self.spread }
    }
}

/// A point on a surface, in render space.
pub(super) struct SurfaceInteraction<'a> {
    scene: &'a Scene,
    mesh: &'a Mesh,
    pub material: &'a Material,
    corners: [usize; 3],
    weights: [f32; 3],
    /// The triangle's edges from its first corner.
    edges: [Vec3; 2],
    pub position: Vec3,
    /// Unit geometric normal on the side that is seen.
    pub geometric: Vec3,
    /// Unit shading normal on the side that is seen, normal map applied.
    pub normal: Vec3,
    /// Whether the side that is seen is the front.
    pub front: bool,
    /// Metres to stay away from the surface.
    offset: f32,
    /// Side of the square over which textures are averaged, metres.
    footprint: f32,
    /// The first set of texture coordinates, and how many units of it there are to a metre.
    uv: (Vec2, f32),
}

/// Which side of a surface is looked at.
pub(super) enum Side {
    /// The front if true.
    Front(bool),
    /// The side to which this points.
    Towards(Vec3),
}

impl<'a> SurfaceInteraction<'a> {
    /// The record of `surface`, which must be on a surface; `view` is the unit direction to the eye, which decides how
    /// far a slanted footprint reaches.
    pub fn new(
        scene: &'a Scene,
        accel: &'a Accel,
        surface: SurfaceRef,
        side: Side,
        view: Vec3,
        beam: Beam,
    ) -> Self {
        let index = surface.instance as usize;
        let mesh = &scene.meshes[scene.instances[index].mesh];
        let material = &scene.materials[mesh.material];
        let placement = accel.placement(index);
        let corners = mesh.triangles[surface.primitive as usize].map(|i| i as usize);
        let positions = accel.positions(index, mesh);
        let [a, b, c] = corners.map(|i| Vec3A::from(positions[i]));
        let weights = [1.0 - surface.u - surface.v, surface.u, surface.v];

        let m = &placement.render_from_object;
        let position: Vec3 = m.transform_point3a(interpolate(a, b, c, surface)).into();
        let edges = [b - a, c - a].map(|e| Vec3::from(m.transform_vector3a(e)));
        let cross = edges[0].cross(edges[1]);
        let outward = cross.normalize_or(Vec3::Y) * placement.winding;
        let front = match side {
            Side::Front(front) => front,
            Side::Towards(direction) => outward.dot(direction) >= 0.0,
        };
        let geometric = if front { outward } else { -outward };

        let magnitude = m.matrix3.abs()
            * (a.abs() * weights[0] + b.abs() * weights[1] + c.abs() * weights[2])
            + m.translation.abs();
        let offset =
            (magnitude.max_element() + placement.fused_reach) * (OFFSET_ROUNDINGS * f32::EPSILON * 0.5);

        // Seen at a slant, the footprint is an ellipse; a square of the same area stands for it.
        let slant = geometric.dot(view).abs().max(0.05);
        let mut this = Self {
            scene,
            mesh,
            material,
            corners,
            weights,
            edges,
            position,
            geometric,
            normal: geometric,
            front,
            offset,
            footprint: beam.width / slant.sqrt(),
            uv: (Vec2::ZERO, 0.0),
        };
        if !mesh.uvs.is_empty() && material.has_textures() {
            this.uv = this.coordinates(0);
        }
        let normals = accel.normals(index, mesh);
        if !normals.is_empty() {
            let [a, b, c] = corners.map(|i| Vec3A::from(normals[i]));
            let normal = placement.normals * interpolate(a, b, c, surface);
            this.normal = this.facing(Vec3::from(normal).normalize_or(geometric));
        }
        if let Some(map) = &material.normal_texture {
            let tangents = accel.tangents(index, mesh);
            let tangent = (!tangents.is_empty()).then(|| {
                let [a, b, c] = corners.map(|i| tangents[i]);
                let t = a * weights[0] + b * weights[1] + c * weights[2];
                (Vec3::from(m.transform_vector3a(Vec3A::from_vec4(t))), t.w * placement.winding)
            });
            this.normal = this.mapped(map, tangent);
        }
        this
    }

    /// `normal` turned to the side that is seen. Vertex normals that point into the surface are taken as meant for
    /// its other side.
    fn facing(&self, normal: Vec3) -> Vec3 {
        let cos = normal.dot(self.geometric);
        if cos < 0.0 { -normal } else { normal }
    }

    /// The shading normal that the normal map says; `tangent` has the sign of the bitangent beside it.
    fn mapped(&self, map: &NormalTexture, tangent: Option<(Vec3, f32)>) -> Vec3 {
        let sampled = self.texture(&map.texture);
        let x = (sampled.x * 2.0 - 1.0) * map.scale;
        let y = (sampled.y * 2.0 - 1.0) * map.scale;
        let z = sampled.z * 2.0 - 1.0;
        // Maps are meant for the front; from behind, the frame is the front's, mirrored as a whole.
        let normal = if self.front { self.normal } else { -self.normal };
        let (tangent, sign) = tangent.unwrap_or_else(|| self.tangent(map.texture.uv_set, normal));
        let tangent = (tangent - normal * normal.dot(tangent)).normalize_or(normal.any_orthonormal_vector());
        let bitangent = normal.cross(tangent) * if sign < 0.0 { -1.0 } else { 1.0 };
        let mapped = (tangent * x + bitangent * y + normal * z).normalize_or(normal);
        let mapped = if self.front { mapped } else { -mapped };
        let cos = mapped.dot(self.geometric);
        if cos >= MIN_NORMAL_COSINE {
            return mapped;
        }
        (mapped + self.geometric * (MIN_NORMAL_COSINE - cos)).normalize_or(self.geometric)
    }

    /// Where u grows on the triangle, and the sign of the bitangent. Images hang with v downwards while normal maps
    /// have +Y up, so the bitangent is against v.
    fn tangent(&self, set: usize, normal: Vec3) -> (Vec3, f32) {
        let Some(uvs) = self.mesh.uvs.get(set).filter(|uvs| !uvs.is_empty()) else {
            return (Vec3::ZERO, 1.0);
        };
        let [a, b, c] = self.corners.map(|i| uvs[i]);
        let (d1, d2) = (b - a, c - a);
        let side = if d1.perp_dot(d2) < 0.0 { -1.0 } else { 1.0 };
        let along_u = (self.edges[0] * d2.y - self.edges[1] * d1.y) * side;
        let along_v = (self.edges[1] * d1.x - self.edges[0] * d2.x) * side;
        (along_u, if normal.cross(along_u).dot(along_v) > 0.0 { -1.0 } else { 1.0 })
    }

    /// A set of texture coordinates, and how many units of it there are to a metre.
    fn coordinates(&self, set: usize) -> (Vec2, f32) {
        let Some(uvs) = self.mesh.uvs.get(set).filter(|uvs| !uvs.is_empty()) else {
            return (Vec2::ZERO, 0.0);
        };
        let [a, b, c] = self.corners.map(|i| uvs[i]);
        let uv = a * self.weights[0] + b * self.weights[1] + c * self.weights[2];
        let area = self.edges[0].cross(self.edges[1]).length();
        let density = ((b - a).perp_dot(c - a).abs() / area).sqrt();
        (uv, if density.is_finite() { density } else { 0.0 })
    }

    /// The texture at this point, averaged over its footprint.
    pub fn texture(&self, texture: &TextureRef) -> glam::Vec4 {
        let (uv, density) = if texture.uv_set == 0 { self.uv } else { self.coordinates(texture.uv_set) };
        let scale = texture.transform.matrix2.determinant().abs();
        let scale = if scale == 1.0 { 1.0 } else { scale.sqrt() };
        let uv = texture.transform.transform_point2(uv);
        self.scene.images[texture.image].sample(texture, uv, self.footprint * density * scale)
    }

    /// The interpolated vertex colour; white where the mesh has none.
    pub fn vertex_color(&self) -> glam::Vec4 {
        if self.mesh.colors.is_empty() {
            return glam::Vec4::ONE;
        }
        let [a, b, c] = self.corners.map(|i| self.mesh.colors[i]);
        a * self.weights[0] + b * self.weights[1] + c * self.weights[2]
    }

    /// Where a ray in `direction` starts so that rounding does not make it meet its own surface.
    pub fn start(&self, direction: Vec3) -> Vec3 {
        let side = if direction.dot(self.geometric) < 0.0 { -self.offset } else { self.offset };
        self.position + self.geometric * side
    }
}
