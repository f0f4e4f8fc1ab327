//! Shares of soft light, carried along with their surface.
//!
//! A sample lands beside its pixel's centre, by up to half a pixel. A bit may be taken to the centre as it is: where it is
//! not the same all around, it is asked anew. A share changes little by little, and taken as it is from frame to frame it
//! would slide over its surface. So it is interpolated at the point of the old image that has come to the centre. Besides,
//! that averages the noise of what few rays have found.

use super::around::{Tangent, Trust};
use super::buzz_buffer::BuzzBuffer;
use super::cell::place_before;
use super::projector::Projector;
use super::rays::CastCentres;
use crate::frame::SurfaceSample;

/// Interpolates into `lit` the shares of `sample`, at the centre of `pixel` (x, y), near which the sample of old pixel `i`
/// landed: between the four old pixels around that point, as far as they lie on its surface. Sets in `ask` bits of those on
/// which they disagree, and where none lies there, of all.
pub(super) fn carry(
    (old, i): (&BuzzBuffer, usize),
    view: &Projector,
    pixel: (usize, usize),
    sample: &SurfaceSample,
    rays: &impl CastCentres,
    (lit, ask): (&mut [u32], &mut [u32]),
) {
    if sample.surface.is_background() {
        return;
    }
    let Some(place) = place_before(old, view, i, pixel) else {
        return rays.confirm(ask);
    };
    let (width, height) = (old.width(), old.height());
    let [column, row] = place.to_array();
    let (left, top) = (column.floor(), row.floor());
    let weights = |offset: f32| [1.0 - offset, offset];
    let (columns, rows) = (weights(column - left), weights(row - top));
    let tangent = Tangent::new(*sample, view);
    let corners: [(usize, f32); 4] = std::array::from_fn(|step| {
        let (right, down) = (step % 2, step / 2);
        let (x, y) = (left as isize + right as isize, top as isize + down as isize);
        if x < 0 || y < 0 || x >= width as isize || y >= height as isize {
            return (i, 0.0);
        }
        let pixel = y as usize * width + x as usize;
        let weight = columns[right] * rows[down];
        (pixel, if tangent.is_one_thing_with(&old.sample(pixel)) { weight } else { 0.0 })
    });
    let mut known = corners.iter().filter(|&&(_, weight)| weight > 0.0);
    rays.blend(known.clone().map(|&(pixel, weight)| (old.lit(pixel), weight)), lit);
    match known.next() {
        Some(&(first, _)) => known.for_each(|&(other, _)| rays.differ(old.lit(first), old.lit(other), ask)),
        None => rays.confirm(ask),
    }
}

/// Asks shares to be confirmed at every other pixel only: a frame later, those of its neighbours are interpolated from it.
pub(super) fn spare((x, y): (usize, usize), trust: Trust, rays: &impl CastCentres, ask: &mut [u32]) {
    if trust == Trust::Neighbours && (x + y) % 2 == 0 {
        rays.keep_edges(ask);
    }
}
