//! Reverse reprojection (Nehab et al. 2007) without a second projection: where in the old image the point was that is at a
//! pixel's centre now.
//!
//! A sample nearby says how its surface has moved over the image, and how it has grown there. Between two frames an image hardly
//! turns, so the point at the centre has moved alike, and was between four old pixels: its *cell*. An outline, or the edge of a
//! shadow, is known to lie between two old pixels; so where all four say the same, neither passes here.

use super::buzz_buffer::BuzzBuffer;
use super::projector::Projector;
use super::rays::CastCentres;
use glam::Vec2;

/// Four old pixels, in rows, and where between their centres a point lies.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub corners: [usize; 4],
    /// From the first corner, in pixels, 0 to 1 on either axis.
    offset: Vec2,
}

/// Where in the old image, in pixels from the middle of its first one, was what has come to the centre of pixel (x, y) of
/// the view with the surface of old sample `i`. None if that sample is not seen there.
pub(super) fn place_before(
    old: &BuzzBuffer,
    view: &Projector,
    i: usize,
    (x, y): (usize, usize),
) -> Option<Vec2> {
    let landed = view.project(old.position[i], old.normal[i].direction(), old.surface[i].is_background())?;
    let was = Vec2::new((i % old.width()) as f32, (i / old.width()) as f32);
    let beside = Vec2::new(x as f32, y as f32) + 0.5 - Vec2::new(landed.x, landed.y);
    Some(was + beside * growth(old, view, i, landed.z))
}

/// How many old pixels as wide as one of the view's is where the surface of old sample `i` is seen, now at depth `z`.
pub(super) fn growth(old: &BuzzBuffer, view: &Projector, i: usize, z: f32) -> f32 {
    let nearer = if view.is_perspective() && z.is_finite() { z / old.z[i] } else { 1.0 };
    let growth = nearer * view.side() / old.side;
    if growth.is_finite() { growth } else { 1.0 }
}

impl Cell {
    /// The cell of [`place_before`]; none where that was outside of the image.
    pub fn of(old: &BuzzBuffer, view: &Projector, i: usize, pixel: (usize, usize)) -> Option<Self> {
        Self::at(old, place_before(old, view, i, pixel)?)
    }

    /// The cell around a place, in pixels from the middle of the first one; none outside of the outermost pixels' centres.
    pub fn at(buffer: &BuzzBuffer, place: Vec2) -> Option<Self> {
        let (width, height) = (buffer.width(), buffer.height());
        let last = Vec2::new(width as f32, height as f32) - 1.0;
        (place.cmpge(Vec2::ZERO).all() && place.cmplt(last).all()).then(|| {
            let first = place.y as usize * width + place.x as usize;
            Self { corners: [first, first + 1, first + width, first + width + 1], offset: place.fract() }
        })
    }

    /// The corner to which the place is nearest.
    pub fn nearest(&self) -> usize {
        let [right, down] = self.offset.to_array().map(|offset| usize::from(offset >= 0.5));
        self.corners[2 * down + right]
    }

    /// Takes over into `lit` the shadow bits of the nearest corner, and sets in `ask` those on which the corners disagree.
    pub fn lend(&self, old: &BuzzBuffer, rays: &impl CastCentres, lit: &mut [u32], ask: &mut [u32]) {
        let nearest = self.nearest();
        lit.copy_from_slice(old.lit(nearest));
        ask.fill(0);
        for other in self.corners.into_iter().filter(|&other| !old.is_lit_alike(nearest, other)) {
            rays.differ(old.lit(nearest), old.lit(other), ask);
        }
    }
}
