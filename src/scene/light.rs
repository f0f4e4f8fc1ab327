//! Lights (`KHR_lights_punctual`, and their sizes from `docs/extras.md`) in radiometric units, and the world around the
//! scene.

use super::{Material, Scene, Target};
use glam::{DVec3, Vec2, Vec3};

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
    /// Point and spot: W/sr from afar. Area: W/sr straight ahead. Directional: W/m2 on a surface that faces it.
    pub intensity: f32,
    /// Point and spot: radius of its sphere, metres. Directional: the angle that its disc fills in the sky, radians.
    /// 0 for a light without size; an area light has its size in its kind.
    pub size: f32,
    /// Distance in metres beyond which it does not shine (`KHR_lights_punctual` window), where given.
    pub range: Option<f32>,
}

/// The three kinds of `KHR_lights_punctual`, and what `extras.area` makes of a spot.
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
    /// Flat, in the node's XY plane; shines from one side, as a diffuse surface does.
    Area {
        /// What it is bounded by.
        outline: Outline,
        /// Extent along the node's X and Y, metres.
        size: Vec2,
    },
}

/// Bounds of an area light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outline {
    /// As wide and high as the size says.
    Rectangle,
    /// The size's two numbers are its axes.
    Ellipse,
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
    /// Unit direction of its node's X; only area lights care.
    pub right: DVec3,
    /// Colour times intensity; zero while its node is hidden.
    pub intensity: Vec3,
    /// See [`Light::size`].
    pub size: f32,
    /// See [`Light::range`].
    pub range: Option<f32>,
}

impl PosedLight {
    /// A light at rest at the origin, dark.
    pub(super) fn new(light: &Light) -> Self {
        let Light { kind, size, range, .. } = *light;
        let (position, direction, right) = (DVec3::ZERO, DVec3::NEG_Z, DVec3::X);
        Self { kind, position, direction, right, intensity: Vec3::ZERO, size, range }
    }
}

impl Scene {
    /// True if nothing shines: no light, no world, no material.
    pub fn is_dark(&self) -> bool {
        let glows = |m: &Material| m.emissive != Vec3::ZERO || m.unlit;
        self.lights.is_empty() && self.world.color == Vec3::ZERO && !self.materials.iter().any(glows)
    }

    /// True if light number `light` has a size, now or at some time: its shadows are soft.
    pub fn light_has_size(&self, light: usize) -> bool {
        let Light { kind, size, .. } = self.lights[light];
        let grows = || self.channels.iter().any(|c| c.target == Target::LightSize(light));
        matches!(kind, LightKind::Area { .. }) || size > 0.0 || grows()
    }
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
