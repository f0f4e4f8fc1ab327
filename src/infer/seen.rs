//! Past the paper: the light on what is mirrored, where the eye sees that directly too.
//!
//! A light reaches a point or it does not, whoever looks. So a mirrored or refracted ray that ends on something that is in the
//! image as well need not ask the lights again.

use super::around::Tangent;
use super::buzz_buffer::BuzzBuffer;
use super::cell::Cell;
use super::projector::Projector;
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
        let cell = Cell::at(buffer, Vec2::new(at.x, at.y) - 0.5)?;
        let (tangent, lit) = (Tangent::new(*point, &self.view), buffer.lit(cell.nearest()));
        let is_seen = |&pixel: &usize| tangent.is_one_thing_with(&buffer.sample(pixel));
        let agrees = |&pixel: &usize| agree(lit, buffer.lit(pixel));
        (cell.corners.iter().all(is_seen) && cell.corners.iter().all(agrees)).then_some(lit)
    }
}
