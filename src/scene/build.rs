//! Scenes made in memory: a few shapes, and adding things one after the other.
//!
//! Importers fill [`Scene`]'s fields themselves. These are for programs and tests that have no file.

use super::{
    Camera, Instance, Lens, Light, LightKind, LocalTransform, Material, Mesh, Node, Projection, Scene, Shape,
};
use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

impl Mesh {
    /// An analytic shape.
    pub fn analytic(shape: Shape, material: usize) -> Self {
        Self { name: "shape".to_owned(), shape: Some(shape), material, ..Self::default() }
    }

    /// A square in the XZ plane, seen from +Y, from -`half` to `half` metres on both axes. Texture coordinates go from
    /// 0 to 1 along +X and +Z.
    pub fn plane(half: f32, material: usize) -> Self {
        let uvs = vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X];
        Self {
            name: "plane".to_owned(),
            positions: uvs
                .iter()
                .map(|uv| Vec3::new(2.0 * uv.x - 1.0, 0.0, 2.0 * uv.y - 1.0) * half)
                .collect(),
            normals: vec![Vec3::Y; 4],
            uvs: vec![uvs],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material,
            ..Self::default()
        }
    }

    /// A smooth sphere around the origin with `rings` rows of faces from pole to pole and twice as many around.
    pub fn uv_sphere(radius: f32, rings: u32, material: usize) -> Self {
        let rings = rings.max(2);
        let columns = 2 * rings;
        let (mut normals, mut uvs) = (Vec::new(), Vec::new());
        for row in 0..=rings {
            for column in 0..=columns {
                let uv = Vec2::new(column as f32 / columns as f32, row as f32 / rings as f32);
                let ((sin, cos), around) = ((uv.y * PI).sin_cos(), Vec2::from_angle(-uv.x * TAU));
                normals.push(Vec3::new(sin * around.x, cos, sin * around.y));
                uvs.push(uv);
            }
        }
        let mut triangles = Vec::new();
        for row in 0..rings {
            for column in 0..columns {
                let a = row * (columns + 1) + column;
                let b = a + columns + 1;
                if row > 0 {
                    triangles.push([a, a + 1, b + 1]);
                }
                if row + 1 < rings {
                    triangles.push([a, b + 1, b]);
                }
            }
        }
        // Columns run clockwise seen from above, so that the texture is not mirrored seen from outside.
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
        Self {
            name: "sphere".to_owned(),
            positions: normals.iter().map(|&n| n * radius).collect(),
            normals,
            uvs: vec![uvs],
            triangles,
            material,
            ..Self::default()
        }
    }
}

impl Material {
    /// A dielectric of the given colour and roughness.
    pub fn dielectric(color: Vec3, roughness: f32) -> Self {
        Self { base_color: color.extend(1.0), metallic: 0.0, roughness, ..Self::default() }
    }
}

impl Scene {
    /// Adds a node without parent; returns its number.
    pub fn add_node(&mut self, name: &str, world_from_node: DAffine3) -> usize {
        let (scale, rotation, translation) = world_from_node.to_scale_rotation_translation();
        let trs = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
        // Only translation, rotation and scale can be animated; a sheared matrix is kept whole.
        let transform = if trs.abs_diff_eq(world_from_node, 1e-9) {
            LocalTransform::Trs { translation, rotation, scale }
        } else {
            LocalTransform::Matrix(world_from_node)
        };
        self.nodes.push(Node { name: name.to_owned(), transform, ..Node::default() });
        self.nodes.len() - 1
    }

    /// Adds a material; returns its number.
    pub fn add_material(&mut self, material: Material) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a mesh; returns its number. Its material must be there.
    pub fn add_mesh(&mut self, mesh: Mesh) -> usize {
        self.meshes.push(mesh);
        self.meshes.len() - 1
    }

    /// Places a mesh on a node of its own, as an object of its own; returns the instance's number.
    pub fn add_instance(&mut self, mesh: usize, world_from_object: DAffine3) -> usize {
        let node = self.add_node("", world_from_object);
        let object = self.instances.iter().map(|i| i.object).max().unwrap_or(0) + 1;
        let node_from_object = DAffine3::IDENTITY;
        self.instances.push(Instance { node, mesh, skin: None, node_from_object, object });
        self.instances.len() - 1
    }

    /// Adds a white light of `intensity` (W/sr, or W/m2 if directional) that shines along -Z of its node; returns its
    /// number.
    pub fn add_light(&mut self, kind: LightKind, intensity: f32, world_from_light: DAffine3) -> usize {
        let node = self.add_node("", world_from_light);
        let name = format!("Light{}", self.lights.len());
        let (color, size, range) = (Vec3::ONE, 0.0, None);
        self.lights.push(Light { name, node, kind, color, intensity, size, range });
        self.lights.len() - 1
    }

    /// Adds a perspective camera at `eye` that looks at `target`, +Y up, with a vertical field of view in radians;
    /// returns its number.
    pub fn add_camera(&mut self, eye: DVec3, target: DVec3, yfov: f64) -> usize {
        let forward = (target - eye).normalize_or(DVec3::NEG_Z);
        let right = forward.cross(DVec3::Y).normalize_or(DVec3::X);
        let axes = DMat3::from_cols(right, right.cross(forward), -forward);
        let node = self.add_node("", DAffine3::from_mat3_translation(axes, eye));
        let projection = Projection::Perspective { yfov };
        let lens =
            Lens { projection, shift: DVec2::ZERO, near: 0.0, far: f64::INFINITY, sensor_height: None };
        let name = format!("Camera{}", self.cameras.len());
        self.cameras.push(Camera { name, node, lens, elsewhere: false });
        self.cameras.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_wound_outwards() {
        let plane = Mesh::plane(2.0, 0);
        let sphere = Mesh::uv_sphere(2.0, 8, 0);
        for (mesh, center) in [(plane, Vec3::NEG_Y), (sphere, Vec3::ZERO)] {
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
                assert!((b - a).cross(c - a).dot(a + b + c - center * 3.0) > 0.0, "{triangle:?}");
            }
        }
    }
}
