//! Punctual lights (`KHR_lights_punctual`) in radiometric units, and the world around the scene.

use glam::{DVec3, Vec3};

/// A light and the node that carries it.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// The light's or its node's name.
    pub name: String,
    /// The node that places it; it shines along -Z.
    pub node: usize,
    /// What shape its light has.
    pub kind: LightKind,
    /// Linear Rec.709 colour.
    pub color: Vec3,
    /// Point and spot: W/sr. Directional: W/m2 on a surface that faces it.
    pub intensity: f32,
    /// Distance in metres beyond which it does not shine (`KHR_lights_punctual` window), where given.
    pub range: Option<f32>,
}

/// The three kinds of `KHR_lights_punctual`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Shines equally to all sides.
    Point,
    /// Shines within a cone.
    Spot {
        /// Half angle within which it is at full strength, radians.
        inner_cone: f32,
        /// Half angle beyond which it is dark, radians.
        outer_cone: f32,
    },
    /// Infinitely far away.
    Directional,
}

/// A light as one frame sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct PosedLight {
    /// The kind and cones at this time.
    pub kind: LightKind,
    /// World position.
    pub position: DVec3,
    /// Unit direction in which it shines.
    pub direction: DVec3,
    /// Colour times intensity; zero while its node is hidden.
    pub intensity: Vec3,
    /// See [`Light::range`].
    pub range: Option<f32>,
}

/// What surrounds the scene: the background, and an ambient light on every surface.
#[derive(Debug, Clone, PartialEq)]
pub struct World {
    /// Radiance, or a factor on the image.
    pub color: Vec3,
    /// Equirectangular radiance: index into [`super::Scene::images`].
    pub image: Option<usize>,
    /// Rotation of the image about +Y, radians, counter-clockwise seen from above.
    pub rotation: f32,
}

impl Default for World {
    fn default() -> Self {
        Self { color: Vec3::ZERO, image: None, rotation: 0.0 }
    }
}
