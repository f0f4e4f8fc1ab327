//! What surrounds the scene: the background, and the light that comes from everywhere.

use crate::scene::{Image, Scene, TextureRef, Wrap};
use glam::{Affine2, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Rows of the grid from which the irradiance of an image is summed; columns are twice as many.
const ROWS: u32 = 32;

/// The world, prepared for many rays.
pub(super) struct Surroundings<'a> {
    color: Vec3,
    image: Option<&'a Image>,
    texture: TextureRef,
    /// Sine and cosine of the image's rotation.
    rotation: Vec2,
    /// Irradiance in spherical harmonics up to the second order, the cosine lobe multiplied in.
    irradiance: [Vec3; 9],
}

impl<'a> Surroundings<'a> {
    pub fn new(scene: &'a Scene) -> Self {
        let world = &scene.world;
        let color = if world.color.is_finite() { world.color } else { Vec3::ZERO };
        let texture = TextureRef {
            image: 0,
            uv_set: 0,
            transform: Affine2::IDENTITY,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Clamp,
            nearest: false,
        };
        let image = world.image.and_then(|i| scene.images.get(i)).filter(|_| color != Vec3::ZERO);
        let rotation = Vec2::from(world.rotation.sin_cos());
        let mut this = Self { color, image, texture, rotation, irradiance: [Vec3::ZERO; 9] };
        if this.image.is_some() {
            this.irradiance = this.project();
        }
        this
    }

    /// True where there is nothing but black.
    pub fn is_black(&self) -> bool {
        self.color == Vec3::ZERO
    }

    /// Radiance from the unit `direction`, averaged over about `angle` radians.
    pub fn radiance(&self, direction: Vec3, angle: f32) -> Vec3 {
        let Some(image) = self.image else { return self.color };
        let Vec3 { x, y, z } = direction;
        let Vec2 { x: sin, y: cos } = self.rotation;
        let (x, z) = (x * cos - z * sin, x * sin + z * cos);
        let uv = Vec2::new(0.5 + z.atan2(x) / TAU, 0.5 - y.clamp(-1.0, 1.0).asin() / PI);
        // An image has 2 pi by pi radians: on average, the square root of their product to a unit of uv.
        let footprint = angle / (PI * std::f32::consts::SQRT_2);
        self.color * image.sample(&self.texture, uv, footprint).truncate()
    }

    /// Irradiance on a surface with unit `normal`, nothing in the way.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        if self.image.is_none() {
            return self.color * PI;
        }
        let basis = basis(normal);
        let sum = self.irradiance.iter().zip(basis).fold(Vec3::ZERO, |sum, (&c, y)| sum + c * y);
        sum.max(Vec3::ZERO)
    }

    /// The irradiance's coefficients (Ramamoorthi and Hanrahan, SIGGRAPH 2001).
    fn project(&self) -> [Vec3; 9] {
        let mut sum = [Vec3::ZERO; 9];
        let step = PI / ROWS as f32;
        for row in 0..ROWS {
            let polar = (row as f32 + 0.5) * step;
            // The exact solid angle of the row's cells.
            let area = step * ((row as f32 * step).cos() - ((row + 1) as f32 * step).cos());
            for column in 0..2 * ROWS {
                let azimuth = (column as f32 + 0.5) * step;
                let (sin, cos) = polar.sin_cos();
                let direction = Vec3::new(sin * azimuth.cos(), cos, sin * azimuth.sin());
                let light = self.radiance(direction, step) * area;
                sum.iter_mut().zip(basis(direction)).for_each(|(c, y)| *c += light * y);
            }
        }
        let lobe = [PI, TAU / 3.0, TAU / 3.0, TAU / 3.0, PI / 4.0, PI / 4.0, PI / 4.0, PI / 4.0, PI / 4.0];
        std::array::from_fn(|i| sum[i] * lobe[i])
    }
}

/// Real spherical harmonics up to the second order.
fn basis(Vec3 { x, y, z }: Vec3) -> [f32; 9] {
    [
        0.282_095,
        0.488_603 * y,
        0.488_603 * z,
        0.488_603 * x,
        1.092_548 * x * y,
        1.092_548 * y * z,
        0.315_392 * (3.0 * z * z - 1.0),
        1.092_548 * x * z,
        0.546_274 * (x * x - y * y),
    ]
}
