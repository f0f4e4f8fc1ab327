//! Past the paper: the light on what is mirrored, where the eye sees that directly too.
//!
//! A light reaches a point or it does not, whoever looks. So a mirrored or refracted ray that ends on something that is in the
//! image as well need not ask the lights again.

use super::around::Tangent;
use super::buzz_buffer::{BuzzBuffer, Projector};
use crate::frame::SurfaceSample;
use crate::scene::View;
use glam::{DVec3, Vec2};

/// The samples of a view, to be asked about points anywhere.
pub struct SeenLight<'a> {
    buffer: &'a BuzzBuffer,
    view: Projector,
}

impl<'a> SeenLight<'a> {
    /// Of `buffer`, the samples of `view`, in positions relative to `origin`; it must be complete.
    pub fn new(buffer: &'a BuzzBuffer, view: &View, origin: DVec3) -> Self {
        Self { buffer, view: Projector::new(view, origin) }
    }

    /// The shadow bits of any point of a surface, if the four pixels between whose centres the eye would see it lie on that
    /// surface and `agree`; then those of the nearest.
    pub fn lit(&self, point: &SurfaceSample, agree: impl Fn(&[u32], &[u32]) -> bool) -> Option<&'a [u32]> {
        let buffer = self.buffer;
        let at = self.view.project(point.position, point.normal.direction(), false)?;
        let place = Vec2::new(at.x, at.y) - 0.5;
        let last = Vec2::new(buffer.width() as f32, buffer.height() as f32) - 1.0;
        if !(place.cmpge(Vec2::ZERO).all() && place.cmplt(last).all()) {
            return None;
        }
        let first = place.y as usize * buffer.width() + place.x as usize;
        let corners = [first, first + 1, first + buffer.width(), first + buffer.width() + 1];
        let tangent = Tangent::new(*point, &self.view);
        let is_seen = |&pixel: &usize| {
            let (surface, own) = (buffer.surface[pixel], point.surface);
            let is_same_face = surface.primitive == own.primitive && buffer.normal[pixel] == point.normal;
            surface.instance == own.instance && (is_same_face || tangent.may_lend(&buffer.sample(pixel)))
        };
        if !corners.iter().all(is_seen) {
            return None;
        }
        let offset = place.fract();
        let nearest = corners[2 * usize::from(offset.y >= 0.5) + usize::from(offset.x >= 0.5)];
        let lit = buffer.lit(nearest);
        corners.iter().all(|&pixel| agree(lit, buffer.lit(pixel))).then_some(lit)
    }
}
