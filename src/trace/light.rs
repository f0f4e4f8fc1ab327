//! What arrives from punctual lights, as `KHR_lights_punctual` has it.

use crate::scene::{LightKind, PosedLight};
use glam::{DVec3, Vec3};

/// Nearer than this a point light grows no brighter, metres: the inverse square would overflow.
const MIN_DISTANCE: f32 = 1e-4;

/// A light prepared for many points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Emitter {
    shape: Shape,
    /// W/sr or W/m2; zero for a light that is out.
    intensity: Vec3,
    /// One over the range; 0 where it is not limited.
    per_range: f32,
}

#[derive(Debug, Clone, Copy)]
enum Shape {
    Point {
        position: Vec3,
    },
    Spot {
        position: Vec3,
        direction: Vec3,
        /// Intensity falls as `(cos * scale + offset)^2`, clamped to [0, 1].
        scale: f32,
        offset: f32,
    },
    Directional {
        to_light: Vec3,
    },
}

/// A light as a point sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arriving {
    /// Unit, from the point to the light.
    pub to_light: Vec3,
    /// Metres; infinite for directional lights.
    pub distance: f32,
    /// Irradiance on a surface that faces the light, W/m2.
    pub irradiance: Vec3,
}

impl Emitter {
    /// `light` relative to `origin`.
    pub fn new(light: &PosedLight, origin: DVec3) -> Self {
        let position = (light.position - origin).as_vec3();
        let direction = light.direction.as_vec3();
        let shape = match light.kind {
            LightKind::Point => Shape::Point { position },
            LightKind::Spot { inner_cone, outer_cone } => {
                let scale = 1.0 / (inner_cone.cos() - outer_cone.cos()).max(0.001);
                Shape::Spot { position, direction, scale, offset: -outer_cone.cos() * scale }
            }
            LightKind::Directional => Shape::Directional { to_light: -direction },
        };
        let per_range = match light.range {
            Some(range) if range > 0.0 && range.is_finite() => 1.0 / range,
            _ => 0.0,
        };
        let usable = light.intensity.is_finite() && position.is_finite();
        Self { shape, intensity: if usable { light.intensity } else { Vec3::ZERO }, per_range }
    }

    /// What arrives at `point`, nothing in between; `None` where nothing does.
    #[inline]
    pub fn arriving(&self, point: Vec3) -> Option<Arriving> {
        let (position, cone) = match self.shape {
            Shape::Directional { to_light } => {
                let arriving = Arriving { to_light, distance: f32::INFINITY, irradiance: self.intensity };
                return (self.intensity.max_element() > 0.0).then_some(arriving);
            }
            Shape::Point { position } => (position, None),
            Shape::Spot { position, direction, scale, offset } => {
                (position, Some((direction, scale, offset)))
            }
        };
        let along = position - point;
        let distance = along.length();
        let to_light = along / distance;
        let mut strength = 1.0 / distance.max(MIN_DISTANCE).powi(2);
        if self.per_range > 0.0 {
            let relative = (distance * self.per_range).powi(2);
            strength *= (1.0 - relative * relative).clamp(0.0, 1.0);
        }
        if let Some((direction, scale, offset)) = cone {
            let angular = (-direction.dot(to_light) * scale + offset).clamp(0.0, 1.0);
            strength *= angular * angular;
        }
        let irradiance = self.intensity * strength;
        // A light that stands on the point itself has no direction: NaN, which is not above 0.
        (irradiance.max_element() > 0.0 && to_light.x.is_finite()).then_some(Arriving {
            to_light,
            distance,
            irradiance,
        })
    }
}
