//! The full record of a point on a surface: how it is turned, what its textures say.

use super::point::SurfacePoint;
use crate::accel::{Accel, interpolate};
use crate::scene::{NormalTexture, Scene, TextureRef};
use glam::{Vec2, Vec3, Vec3A, Vec4};

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

/// Sides of the squares over which textures are averaged, for beams so wide that meet surfaces at so steep an angle.
#[inline]
pub(super) fn footprints(widths: Vec4, cosines: Vec4) -> Vec4 {
    // Seen at a slant, the footprint is an ellipse; a square of the same area stands for it.
    widths / cosines.abs().max(Vec4::splat(0.05)).sqrt()
}

/// A point on a surface with what its textures say, in render space.
pub(super) struct SurfaceInteraction<'a> {
    scene: &'a Scene,
    /// The point itself.
    pub point: &'a SurfacePoint<'a>,
    /// Unit shading normal on the side that is seen, normal map applied.
    pub normal: Vec3,
    /// Side of the square over which textures are averaged, metres.
    footprint: f32,
    /// The first set of texture coordinates, where textures are asked.
    uv: TextureCoordinates,
}

/// Texture coordinates at a point.
#[derive(Clone, Copy, Default)]
struct TextureCoordinates {
    uv: Vec2,
    /// By how much they grow along the triangle's edges.
    along: [Vec2; 2],
    /// How many units of them there are to a metre.
    density: f32,
}

impl<'a> SurfaceInteraction<'a> {
    /// The record of `point` before anything is looked up.
    #[inline]
    pub fn geometric(scene: &'a Scene, point: &'a SurfacePoint<'a>) -> Self {
        Self { scene, point, normal: point.geometric, footprint: 0.0, uv: TextureCoordinates::default() }
    }

    /// Finds the shading normal and the texture coordinates; those only if the material `is_textured`.
    #[inline]
    pub fn look_up(&mut self, accel: &Accel, is_textured: bool, footprint: f32) {
        let SurfacePoint { mesh, surface, placement, corners, weights, .. } = *self.point;
        if is_textured {
            self.footprint = footprint;
            self.uv = self.coordinates(0);
        }
        let index = surface.instance as usize;
        let normals = accel.normals(index, mesh);
        if !normals.is_empty() {
            let [a, b, c] = corners.map(|i| Vec3A::from(normals[i]));
            let normal = placement.normals * interpolate(a, b, c, surface);
            self.normal = self.facing(Vec3::from(normal).normalize_or(self.point.geometric));
        }
        if let Some(map) = &self.point.material.normal_texture {
            let tangents = accel.tangents(index, mesh);
            let tangent = (!tangents.is_empty()).then(|| {
                let [a, b, c] = corners.map(|i| tangents[i]);
                let [wa, wb, wc] = weights;
                let t = a * wa + b * wb + c * wc;
                let m = &placement.render_from_object;
                (Vec3::from(m.transform_vector3a(Vec3A::from_vec4(t))), t.w * placement.winding)
            });
            self.normal = self.mapped(map, tangent);
        }
    }

    /// `normal` turned to the side that is seen. Vertex normals that point into the surface are taken as meant for
    /// its other side.
    fn facing(&self, normal: Vec3) -> Vec3 {
        let cos = normal.dot(self.point.geometric);
        if cos < 0.0 { -normal } else { normal }
    }

    /// The shading normal that the normal map says; `tangent` has the sign of the bitangent beside it.
    // As [`Self::coordinates`], which it asks for, and as much is handed on.
    #[inline(always)]
    fn mapped(&self, map: &NormalTexture, tangent: Option<(Vec3, f32)>) -> Vec3 {
        let sampled = self.texture(&map.texture);
        let x = (sampled.x * 2.0 - 1.0) * map.scale;
        let y = (sampled.y * 2.0 - 1.0) * map.scale;
        let z = sampled.z * 2.0 - 1.0;
        // Maps are meant for the front; from behind, the frame is the front's, mirrored as a whole.
        let normal = if self.point.front { self.normal } else { -self.normal };
        let (tangent, sign) = tangent.unwrap_or_else(|| self.tangent(map.texture.uv_set, normal));
        let tangent = (tangent - normal * normal.dot(tangent)).try_normalize();
        let tangent = tangent.unwrap_or_else(|| normal.any_orthonormal_vector());
        let bitangent = normal.cross(tangent) * if sign < 0.0 { -1.0 } else { 1.0 };
        let mapped = (tangent * x + bitangent * y + normal * z).normalize_or(normal);
        let mapped = if self.point.front { mapped } else { -mapped };
        let cos = mapped.dot(self.point.geometric);
        if cos >= MIN_NORMAL_COSINE {
            return mapped;
        }
        (mapped + self.point.geometric * (MIN_NORMAL_COSINE - cos)).normalize_or(self.point.geometric)
    }

    /// Where u grows on the triangle, and the sign of the bitangent. Images hang with v downwards while normal maps
    /// have +Y up, so the bitangent is against v.
    fn tangent(&self, set: usize, normal: Vec3) -> (Vec3, f32) {
        let TextureCoordinates { along: [d1, d2], .. } = self.coordinates_of(set);
        let side = if d1.perp_dot(d2) < 0.0 { -1.0 } else { 1.0 };
        let along_u = (self.point.edges[0] * d2.y - self.point.edges[1] * d1.y) * side;
        let along_v = (self.point.edges[1] * d1.x - self.point.edges[0] * d2.x) * side;
        (along_u, if normal.cross(along_u).dot(along_v) > 0.0 { -1.0 } else { 1.0 })
    }

    #[inline]
    fn coordinates_of(&self, set: usize) -> TextureCoordinates {
        if set == 0 { self.uv } else { self.coordinates(set) }
    }

    /// A set of texture coordinates; all zero where the mesh has no such set.
    // What is handed on in memory, in parts, is waited for.
    #[inline(always)]
    fn coordinates(&self, set: usize) -> TextureCoordinates {
        let Some(uvs) = self.point.mesh.uvs.get(set).filter(|uvs| !uvs.is_empty()) else {
            return TextureCoordinates::default();
        };
        let [a, b, c] = self.point.corners.map(|i| uvs[i]);
        let [wa, wb, wc] = self.point.weights;
        let along = [b - a, c - a];
        let density = (along[0].perp_dot(along[1]).abs() / self.point.area).sqrt();
        let density = if density.is_finite() { density } else { 0.0 };
        TextureCoordinates { uv: a * wa + b * wb + c * wc, along, density }
    }

    /// The texture at this point, averaged over its footprint.
    pub fn texture(&self, texture: &TextureRef) -> Vec4 {
        let TextureCoordinates { uv, density, .. } = self.coordinates_of(texture.uv_set);
        let scale = texture.transform.matrix2.determinant().abs();
        let scale = if scale == 1.0 { 1.0 } else { scale.sqrt() };
        let uv = texture.transform.transform_point2(uv);
        self.scene.images[texture.image].sample(texture, uv, self.footprint * density * scale)
    }

    /// The interpolated vertex colour; white where the mesh has none.
    pub fn vertex_color(&self) -> Vec4 {
        if self.point.mesh.colors.is_empty() {
            return Vec4::ONE;
        }
        let [a, b, c] = self.point.corners.map(|i| self.point.mesh.colors[i]);
        a * self.point.weights[0] + b * self.point.weights[1] + c * self.point.weights[2]
    }
}
