//! What arrives from lights: punctual ones as `KHR_lights_punctual` has them, and those that have a size.

use super::form_factor::{MOST_CORNERS, disc_share, polygon};
use super::sequence::{MIDDLE, cone, disc};
use crate::frame::Way;
use crate::scene::{LightKind, Outline, PosedLight};
use glam::{DVec3, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Nearer than this a light without size grows no brighter, metres: the inverse square would overflow. Far less than what
/// is seen of a scene that is a millionth of a metre across.
pub(super) const MIN_DISTANCE: f32 = 1e-10;

/// An area light that covers less than this, in steradians, shines as if from its middle.
const POINT_LIKE: f32 = 1e-6;

/// A spot's cone that changes less than this over its sphere, before it is squared, is taken at the sphere's middle.
const LEVEL_CONE: f32 = 0.05;

/// Rows of the finest grid over a light by which its cone, or a highlight, is averaged.
pub(super) const GRID: u32 = 4;

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

/// A flat light that shines from one side.
#[derive(Debug, Clone)]
pub(super) struct Panel {
    middle: Vec3,
    /// Half of its width and half of its height.
    right: Vec3,
    up: Vec3,
    facing: Vec3,
    /// Square metres.
    area: f32,
    outline: Outline,
    /// Around the middle; those of a polygon of the same area for an ellipse.
    corners: [DVec3; MOST_CORNERS],
    corner_count: usize,
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
                    Some(cone) if cone.scale * sin > LEVEL_CONE => {
                        let part = |u| sphere_part(u, axis, distance, *radius).0;
                        strength *= cone.mean(normal, grid(GRID).map(part));
                    }
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

    /// The mean of `value`, which is given directions to the light, over a grid of `rows` x `rows` parts of it, each
    /// weighed by what it brings.
    pub fn mean(&self, point: Vec3, normal: Vec3, rows: u32, value: impl Fn(Vec3) -> Vec3) -> Vec3 {
        let (mut sum, mut all) = (Vec3::ZERO, 0.0);
        for arriving in grid(rows).filter_map(|u| self.arriving(point, u)) {
            let weight = arriving.irradiance.max_element() * normal.dot(arriving.to_light);
            if weight > 0.0 {
                sum += weight * value(arriving.to_light);
                all += weight;
            }
        }
        if all > 0.0 { sum / all } else { Vec3::ZERO }
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

    /// The mean over parts of a sphere, given as directions to them, each weighed by its cosine.
    fn mean(&self, normal: Vec3, parts: impl Iterator<Item = Vec3>) -> f32 {
        let (mut sum, mut all) = (0.0, 0.0);
        for to_light in parts {
            let cos = normal.dot(to_light).max(0.0);
            sum += cos * self.at(to_light);
            all += cos;
        }
        if all > 0.0 { sum / all } else { 0.0 }
    }
}

impl Panel {
    fn new(light: &PosedLight, middle: Vec3, outline: Outline, size: Vec2) -> Self {
        let right = light.right * f64::from(size.x) / 2.0;
        let up = light.right.cross(light.direction) * f64::from(size.y) / 2.0;
        let mut corners = [DVec3::ZERO; MOST_CORNERS];
        let (corner_count, area) = match outline {
            Outline::Rectangle => {
                corners[..4].copy_from_slice(&[right + up, up - right, -right - up, right - up]);
                (4, size.x * size.y)
            }
            Outline::Ellipse => {
                let step = std::f64::consts::TAU / MOST_CORNERS as f64;
                // A polygon inside a circle has less than its area.
                let reach = (step / step.sin()).sqrt();
                for (i, corner) in corners.iter_mut().enumerate() {
                    let (sin, cos) = (step * i as f64).sin_cos();
                    *corner = (right * cos + up * sin) * reach;
                }
                (MOST_CORNERS, size.x * size.y * PI / 4.0)
            }
        };
        let (right, up, facing) = (right.as_vec3(), up.as_vec3(), light.direction.as_vec3());
        Self { middle, right, up, facing, area, outline, corners, corner_count }
    }

    fn at(&self, u: Vec2) -> Vec3 {
        let p = match self.outline {
            Outline::Rectangle => 2.0 * u - Vec2::ONE,
            Outline::Ellipse => disc(u),
        };
        self.middle + self.right * p.x + self.up * p.y
    }

    /// Irradiance for 1 W/sr straight ahead.
    fn irradiance(&self, point: Vec3, normal: Vec3) -> f32 {
        let along = self.middle - point;
        let height = -self.facing.dot(along);
        if height <= 0.0 {
            return 0.0;
        }
        let square = along.length_squared().max(MIN_DISTANCE * MIN_DISTANCE);
        if self.area < POINT_LIKE * square {
            // cos cos / d^2, neither cosine divided by its length yet.
            return height * normal.dot(along).max(0.0) / (square * square);
        }
        let middle = along.as_dvec3();
        let corners = self.corners[..self.corner_count].iter().map(|c| middle + c);
        polygon(corners, normal.as_dvec3()) as f32 / self.area
    }
}

/// The middles of `rows` x `rows` parts of the unit square.
fn grid(rows: u32) -> impl Iterator<Item = Vec2> {
    (0..rows * rows).map(move |i| (Vec2::new((i % rows) as f32, (i / rows) as f32) + MIDDLE) / rows as f32)
}

/// 1 less the cosine of the angle with this sine.
fn height(sin: f32) -> f32 {
    sin * sin / (1.0 + (1.0 - sin * sin).sqrt())
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
