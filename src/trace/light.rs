//! What arrives from lights: punctual ones as `KHR_lights_punctual` has them, and those that have a size.

use super::form_factor::disc_share;
use super::lanes::Vec3x4;
use super::panel::Panel;
use super::parts::{GRID, Middles, SkyDisc};
use super::sequence::{MIDDLE, cone};
use crate::frame::Way;
use crate::scene::{LightKind, PosedLight};
use glam::{DVec3, Vec2, Vec3, Vec4};
use std::f32::consts::{PI, TAU};

/// Nearer than this a light without size grows no brighter, metres: the inverse square would overflow. Far less than what
/// is seen of a scene that is a millionth of a metre across.
pub(super) const MIN_DISTANCE: f32 = 1e-10;

/// A spot's cone that changes less than this over its sphere, before it is squared, is taken at the sphere's middle.
pub(super) const LEVEL_CONE: f32 = 0.05;

/// A light prepared for many points.
#[derive(Debug, Clone)]
pub(super) struct Emitter {
    pub shape: Shape,
    /// W/sr or W/m2; zero for a light that is out.
    pub intensity: Vec3,
    /// One over the range; 0 where it is not limited.
    pub per_range: f32,
}

#[derive(Debug, Clone)]
pub(super) enum Shape {
    Sphere {
        position: Vec3,
        /// 0 for a light without size.
        radius: f32,
        cone: Option<Cone>,
    },
    Directional {
        to_light: Vec3,
        /// Sine of half the angle that its disc fills.
        sin: f32,
    },
    Panel(Box<Panel>),
}

/// A spot's cone: intensity falls as `(cos * scale + offset)^2`, clamped to [0, 1].
#[derive(Debug, Clone, Copy)]
pub(super) struct Cone {
    pub direction: Vec3,
    pub scale: f32,
    pub offset: f32,
}

/// Light from one point of an emitter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arriving {
    /// Unit, from the point to the light.
    pub to_light: Vec3,
    /// Metres; infinite for directional lights.
    pub distance: f32,
    /// Irradiance on a surface that faces the light, W/m2, if all of the light were like this point of it.
    pub irradiance: Vec3,
}

/// What a light brings to a surface where nothing stands in its way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unshadowed {
    /// Of the whole light, Lambert's cosine included.
    pub irradiance: Vec3,
    /// Unit direction to its middle.
    pub to_light: Vec3,
}

impl Emitter {
    /// No light.
    pub const DARK: Self = Self {
        shape: Shape::Directional { to_light: Vec3::ZERO, sin: 0.0 },
        intensity: Vec3::ZERO,
        per_range: 0.0,
    };

    /// `light` relative to `origin`.
    pub fn new(light: &PosedLight, origin: DVec3) -> Self {
        let position = (light.position - origin).as_vec3();
        let direction = light.direction.as_vec3();
        let radius = light.size;
        let shape = match light.kind {
            LightKind::Point => Shape::Sphere { position, radius, cone: None },
            LightKind::Spot { inner_cone, outer_cone } => {
                let scale = 1.0 / (inner_cone.cos() - outer_cone.cos()).max(0.001);
                let cone = Cone { direction, scale, offset: -outer_cone.cos() * scale };
                Shape::Sphere { position, radius, cone: Some(cone) }
            }
            LightKind::Directional => {
                Shape::Directional { to_light: -direction, sin: (light.size.min(PI) / 2.0).sin() }
            }
            LightKind::Area { outline, size } => {
                Shape::Panel(Box::new(Panel::new(light, position, outline, size)))
            }
        };
        let per_range = match light.range {
            Some(range) if range > 0.0 && range.is_finite() => 1.0 / range,
            _ => 0.0,
        };
        let usable = light.intensity.is_finite() && position.is_finite() && light.size.is_finite();
        Self { shape, intensity: if usable { light.intensity } else { Vec3::ZERO }, per_range }
    }

    /// Whether its shadows are soft.
    pub fn has_size(&self) -> bool {
        match self.shape {
            Shape::Sphere { radius, .. } => radius > 0.0,
            Shape::Directional { sin, .. } => sin > 0.0,
            Shape::Panel(_) => true,
        }
    }

    /// The way on which its light comes to any point: from all of it, or from its middle.
    pub fn way(&self, all: bool) -> Way {
        let size = |size: f32| if all { size } else { 0.0 };
        match &self.shape {
            Shape::Sphere { position, radius, .. } => Way::From(*position, size(*radius)),
            Shape::Directional { to_light, sin } => {
                Way::Along(*to_light, size(sin / (1.0 - sin * sin).max(f32::MIN_POSITIVE).sqrt()))
            }
            Shape::Panel(panel) => Way::From(panel.middle, size((panel.right + panel.up).length())),
        }
    }

    /// What arrives at `point` from the part of the light that `u`, a point of the unit square, is mapped to; nothing in
    /// between. `None` where nothing does. Evenly spread `u` fill the solid angle of a sphere or disc evenly, and the
    /// surface of an area light.
    #[inline]
    pub fn arriving(&self, point: Vec3, u: Vec2) -> Option<Arriving> {
        let arriving = match &self.shape {
            Shape::Directional { to_light, sin } => {
                let to_light = if *sin > 0.0 { cone(u, *to_light, height(*sin)).0 } else { *to_light };
                Arriving { to_light, distance: f32::INFINITY, irradiance: self.intensity }
            }
            Shape::Sphere { position, radius, cone: spot } => {
                let along = *position - point;
                let distance = along.length();
                let axis = along / distance;
                let mut strength = self.falloff(distance, *radius);
                let (to_light, reach) =
                    if *radius > 0.0 { sphere_part(u, axis, distance, *radius) } else { (axis, distance) };
                if let Some(spot) = spot {
                    strength *= spot.at(to_light);
                }
                Arriving { to_light, distance: reach, irradiance: self.intensity * strength }
            }
            Shape::Panel(panel) => {
                let along = panel.at(u) - point;
                let distance = along.length();
                let to_light = along / distance;
                let slant = -panel.facing.dot(to_light);
                let strength = self.falloff(distance, 0.0) * slant.max(0.0);
                Arriving { to_light, distance, irradiance: self.intensity * strength }
            }
        };
        // A light that stands on the point itself has no direction: NaN, which is not above 0.
        let shines = arriving.irradiance.max_element() > 0.0 && arriving.to_light.x.is_finite();
        shines.then_some(arriving)
    }

    /// What a surface at `point` with unit `normal` gets from the whole light; `None` where that is nothing.
    pub fn unshadowed(&self, point: Vec3, normal: Vec3) -> Option<Unshadowed> {
        if !self.has_size() {
            let Arriving { to_light, irradiance, .. } = self.arriving(point, MIDDLE)?;
            let cos = normal.dot(to_light);
            return (cos > 0.0).then(|| Unshadowed { irradiance: irradiance * cos, to_light });
        }
        let (strength, to_light) = match &self.shape {
            Shape::Directional { to_light, sin } => (disc_share(normal.dot(*to_light), *sin), *to_light),
            Shape::Sphere { position, radius, cone } => {
                let along = *position - point;
                let distance = along.length();
                let axis = along / distance;
                let mut strength = self.falloff(distance, *radius);
                let sin = (radius / distance).min(1.0);
                strength *= disc_share(normal.dot(axis), sin);
                match cone {
                    Some(cone) if cone.scale * sin > LEVEL_CONE => strength *= cone.mean(normal, axis, sin),
                    Some(cone) => strength *= cone.at(axis),
                    None => {}
                }
                (strength, axis)
            }
            Shape::Panel(panel) => {
                let along = panel.middle - point;
                let distance = along.length();
                let window = self.window(distance);
                (panel.irradiance(point, normal) * window, along / distance)
            }
        };
        let irradiance = self.intensity * strength;
        (irradiance.max_element() > 0.0 && to_light.x.is_finite())
            .then_some(Unshadowed { irradiance, to_light })
    }

    /// Solid angle, about.
    pub fn solid_angle(&self, point: Vec3) -> f32 {
        match &self.shape {
            Shape::Directional { sin, .. } => TAU * height(*sin),
            Shape::Sphere { position, radius, .. } => {
                TAU * height((radius / position.distance(point)).min(1.0))
            }
            Shape::Panel(panel) => {
                let along = panel.middle - point;
                let slant = -panel.facing.dot(along.normalize_or_zero()).min(0.0);
                // Right from afar, and never more than what is in front.
                panel.area * slant / (along.length_squared() + panel.area / TAU)
            }
        }
    }

    /// Length of the difference between the unit directions to its middle and to any other part, at most.
    pub fn chord(&self, point: Vec3) -> f32 {
        match &self.shape {
            Shape::Directional { sin, .. } => (2.0 * height(*sin)).sqrt(),
            Shape::Sphere { position, radius, .. } => {
                (2.0 * height((radius / position.distance(point)).min(1.0))).sqrt()
            }
            // As of a sphere around it.
            Shape::Panel(panel) => {
                let sin = (panel.right.length() + panel.up.length()) / panel.middle.distance(point);
                if sin < 1.0 { (2.0 * height(sin)).sqrt() } else { 2.0 }
            }
        }
    }

    /// The inverse square and the range's window. A sphere is no brighter inside than on its surface.
    fn falloff(&self, distance: f32, radius: f32) -> f32 {
        1.0 / distance.max(MIN_DISTANCE).max(radius).powi(2) * self.window(distance)
    }

    fn window(&self, distance: f32) -> f32 {
        if self.per_range > 0.0 {
            let relative = (distance * self.per_range).powi(2);
            (1.0 - relative * relative).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }
}

impl Cone {
    /// Share of the intensity that leaves against `to_light`.
    fn at(&self, to_light: Vec3) -> f32 {
        let angular = (-self.direction.dot(to_light) * self.scale + self.offset).clamp(0.0, 1.0);
        angular * angular
    }

    /// [`Cone::at`] for four directions.
    pub fn at_four(&self, to_lights: Vec3x4) -> Vec4 {
        let cosines = -to_lights.dot(Vec3x4::splat(self.direction));
        let angular = (cosines * self.scale + self.offset).clamp(Vec4::ZERO, Vec4::ONE);
        angular * angular
    }

    /// The mean over parts of a sphere around `axis`, `sin` the sine of the half angle that it fills, each weighed by its cosine.
    pub fn mean(&self, normal: Vec3, axis: Vec3, sin: f32) -> f32 {
        // Most spheres lie within the inner cone, or outside of the outer one.
        let middle = -self.direction.dot(axis) * self.scale + self.offset;
        let most = self.scale * (2.0 * height(sin)).sqrt();
        if middle - most >= 1.0 {
            return 1.0;
        }
        if middle + most <= 0.0 {
            return 0.0;
        }
        let disc = SkyDisc::new(axis, sin);
        let (mut sum, mut all) = (Vec4::ZERO, Vec4::ZERO);
        for middles in Middles::of(GRID) {
            let to_lights = disc.directions(middles);
            let cosines = to_lights.dot(Vec3x4::splat(normal)).max(Vec4::ZERO);
            sum += cosines * self.at_four(to_lights);
            all += cosines;
        }
        let (sum, all) = (sum.element_sum(), all.element_sum());
        if all > 0.0 { sum / all } else { 0.0 }
    }
}

/// 1 less the cosine of the angle with this sine.
pub(super) fn height(sin: f32) -> f32 {
    sin * sin / (1.0 + (1.0 - sin * sin).sqrt())
}

/// [`height`] for four sines.
#[inline]
pub(super) fn heights(sines: Vec4) -> Vec4 {
    let squares = sines * sines;
    squares / (Vec4::ONE + (Vec4::ONE - squares).sqrt())
}

/// The direction to a part of a sphere, and how far away its surface is there. From inside, where light comes from all
/// around, it is here.
fn sphere_part(u: Vec2, axis: Vec3, distance: f32, radius: f32) -> (Vec3, f32) {
    let (to_light, fall) = cone(u, axis, height((radius / distance).min(1.0)));
    // Square of the sine between axis and direction.
    let sin2 = fall * (2.0 - fall);
    let half_chord = (radius * radius - distance * distance * sin2).max(0.0).sqrt();
    (to_light, (distance * (1.0 - fall) - half_chord).max(0.0))
}
