//! Area lights: flat, and shining from one side as a diffuse surface does.

use super::form_factor::{MOST_PANEL_CORNERS, polygon};
use super::lanes::{LANES, Vec3x4, angles};
use super::light::MIN_DISTANCE;
use super::parts::Middles;
use super::sequence::disc;
use crate::scene::{Outline, PosedLight};
use glam::{DVec3, Vec2, Vec3, Vec4};
use std::f32::consts::PI;

/// An area light that covers less than this, in steradians, shines as if from its middle.
const POINT_LIKE: f32 = 1e-6;

/// One that covers less than this is so small that its edges' terms nearly cancel: single precision is not enough.
const SMALL: f32 = 1e-4;

/// A flat light that shines from one side.
#[derive(Debug, Clone)]
pub(super) struct Panel {
    pub middle: Vec3,
    /// Half of its width and half of its height.
    pub right: Vec3,
    pub up: Vec3,
    pub facing: Vec3,
    /// Square metres.
    pub area: f32,
    outline: Outline,
    /// Around the middle; those of a polygon of the same area for an ellipse.
    corners: [DVec3; MOST_PANEL_CORNERS],
    corner_count: usize,
    /// The same corners, and the edges from them to the next ones, four at a time.
    edges: [[Vec3x4; 2]; MOST_PANEL_CORNERS / LANES],
}

impl Panel {
    pub fn new(light: &PosedLight, middle: Vec3, outline: Outline, size: Vec2) -> Self {
        let right = light.right * f64::from(size.x) / 2.0;
        let up = light.right.cross(light.direction) * f64::from(size.y) / 2.0;
        let mut corners = [DVec3::ZERO; MOST_PANEL_CORNERS];
        let (corner_count, area) = match outline {
            Outline::Rectangle => {
                corners[..4].copy_from_slice(&[right + up, up - right, -right - up, right - up]);
                (4, size.x * size.y)
            }
            Outline::Ellipse => {
                let step = std::f64::consts::TAU / MOST_PANEL_CORNERS as f64;
                // A polygon inside a circle has less than its area.
                let reach = (step / step.sin()).sqrt();
                for (i, corner) in corners.iter_mut().enumerate() {
                    let (sin, cos) = (step * i as f64).sin_cos();
                    *corner = (right * cos + up * sin) * reach;
                }
                (MOST_PANEL_CORNERS, size.x * size.y * PI / 4.0)
            }
        };
        let edges = std::array::from_fn(|group| {
            let corner = |lane: usize| corners[(group * LANES + lane) % corner_count];
            let edge = |lane: usize| corner(lane + 1) - corner(lane);
            [Vec3x4::of(|lane| corner(lane).as_vec3()), Vec3x4::of(|lane| edge(lane).as_vec3())]
        });
        let (right, up, facing) = (right.as_vec3(), up.as_vec3(), light.direction.as_vec3());
        Self { middle, right, up, facing, area, outline, corners, corner_count, edges }
    }

    /// The point of it to which `u`, a point of the unit square, is mapped.
    pub fn at(&self, u: Vec2) -> Vec3 {
        let p = match self.outline {
            Outline::Rectangle => 2.0 * u - Vec2::ONE,
            Outline::Ellipse => disc(u),
        };
        self.middle + self.right * p.x + self.up * p.y
    }

    /// Unit directions from `point` to four of its parts, and what arrives from each where 1 W/sr leave straight ahead.
    pub fn seen_from(&self, point: Vec3, middles: &Middles, per_range: f32) -> (Vec3x4, Vec4) {
        let [x, y] = match self.outline {
            Outline::Rectangle => middles.square,
            Outline::Ellipse => middles.disc,
        };
        let along = Vec3x4::splat(self.middle - point);
        let along = along + Vec3x4::splat(self.right) * x + Vec3x4::splat(self.up) * y;
        let square = along.length_squared();
        let per_distance = Vec4::ONE / square.sqrt();
        let to_lights = along * per_distance;
        let near = per_distance.min(Vec4::splat(1.0 / MIN_DISTANCE));
        let relative = square * (per_range * per_range);
        let window = (Vec4::ONE - relative * relative).clamp(Vec4::ZERO, Vec4::ONE);
        let slant = -to_lights.dot(Vec3x4::splat(self.facing));
        (to_lights, slant.max(Vec4::ZERO) * (near * near) * window)
    }

    /// Irradiance for 1 W/sr straight ahead, of a surface at `point` with unit `normal`.
    pub fn irradiance(&self, point: Vec3, normal: Vec3) -> f32 {
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
        if self.area > SMALL * square
            && let Some(integral) = self.above_horizon(along, normal)
        {
            return integral / self.area;
        }
        let middle = along.as_dvec3();
        let corners = self.corners[..self.corner_count].iter().map(|c| middle + c);
        polygon(corners, normal.as_dvec3()) as f32 / self.area
    }

    /// What [`polygon`] says, its terms four at a time; none if a corner is below the horizon. `along` goes to the middle.
    fn above_horizon(&self, along: Vec3, normal: Vec3) -> Option<f32> {
        // Angles are the same at any scale, and squares of squares neither overflow nor vanish at this one.
        let scale = Vec4::splat(1.0 / along.length());
        let (along, normal) = (Vec3x4::splat(along), Vec3x4::splat(normal));
        let mut sum = Vec4::ZERO;
        for &[corners, edges] in &self.edges[..self.corner_count / LANES] {
            let (a, edge) = ((along + corners) * scale, edges * scale);
            if a.dot(normal).cmplt(Vec4::ZERO).any() {
                return None;
            }
            // That with the edge is the cross product with the next corner, but for what would cancel.
            let cross = a.cross(edge);
            let length = cross.length_squared().sqrt();
            let angle = angles(length, a.length_squared() + a.dot(edge));
            let term = angle * cross.dot(normal) / length;
            sum += Vec4::select(length.cmpgt(Vec4::ZERO), term, Vec4::ZERO);
        }
        Some(sum.element_sum().abs() / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LightKind, Scene};
    use glam::DAffine3;

    #[test]
    fn four_edges_at_a_time_are_as_exact_as_one_by_one() {
        let part = |i: u32, step: u32| (i * step % 997) as f32 / 498.5 - 1.0;
        for (outline, scale) in
            [(Outline::Rectangle, 1.0f32), (Outline::Ellipse, 1.0), (Outline::Rectangle, 1e-6)]
        {
            let (mut scene, size) = (Scene::default(), Vec2::new(0.8, 0.3) * scale);
            scene.add_light(LightKind::Area { outline, size }, 1.0, DAffine3::IDENTITY);
            let light = scene.pose(0.0).lights[0].clone();
            let panel = Panel::new(&light, Vec3::ZERO, outline, size);
            let (mut compared, mut worst) = (0, 0f32);
            for i in 0..5000 {
                let point =
                    Vec3::new(part(i, 7), part(i, 11), part(i, 13) - 1.1) * (10f32.powf(part(i, 29)) * scale);
                let normal = Vec3::new(part(i, 17), part(i, 23), 0.3).normalize();
                let along = panel.middle - point;
                if panel.area < SMALL * along.length_squared() || panel.facing.dot(along) > 0.0 {
                    continue;
                }
                if let Some(fast) = panel.above_horizon(along, normal) {
                    let corners = panel.corners[..panel.corner_count].iter().map(|c| along.as_dvec3() + c);
                    let exact = polygon(corners, normal.as_dvec3()) as f32;
                    worst = worst
                        .max((fast - exact).abs() / exact.max(1e-3 * panel.area / along.length_squared()));
                    compared += 1;
                }
            }
            assert!(compared > 500 && worst < 1e-4, "{compared} {worst}");
        }
    }
}
