//! Projection of the old samples into the new view: the nearest hit on a pixel wins.

use super::buzz_buffer::{BuzzBuffer, UNKNOWN};
use super::marks::Marks;
use super::projector::{Projected, Projector};
use crate::frame::PixelClass;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Depth and old pixel of the nearest sample that landed on a pixel, as one number that a single atomic minimum can
/// decide: the depth's bits (positive floats order like integers) above the old pixel's number, and below that whether it
/// landed away from the pixel's centre. Ties go to the lower number, so the result depends on neither the order of pixels
/// nor the number of threads.
#[derive(Debug, Default)]
pub struct Landings(Vec<AtomicU64>);

/// Nothing landed.
const EMPTY: u64 = u64::MAX;

/// A sample that landed this near to its pixel's centre, in pixels, is as good as at it.
pub(super) const AT_CENTRE: f32 = 1.0 / 256.0;

impl Landings {
    /// Empties all pixels ("all z values = HUGE and id_tag to -2").
    pub fn clear(&mut self, pixels: usize) {
        self.0.resize_with(pixels, AtomicU64::default);
        self.0.par_iter_mut().with_min_len(1 << 14).for_each(|l| *l.get_mut() = EMPTY);
    }

    /// Number of pixels.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Lands old sample `i` on the pixel that holds it; marks the pixel if another is there.
    pub(super) fn land(&self, pixel: usize, at: Projected, i: usize, marks: &Marks) {
        // Within the window the integer part is the floor, for which there would be a call.
        let is_away = |raster: f32| (raster - raster as i32 as f32 - 0.5).abs() >= AT_CENTRE;
        if self.land_at(pixel, at.z, i, is_away(at.x) || is_away(at.y)) {
            marks.set(pixel, PixelClass::Overlapped);
        }
    }

    /// Lands a sample at depth `z`, `away` from the pixel's centre or not, and says whether another is there.
    pub(super) fn land_at(&self, pixel: usize, z: f32, i: usize, away: bool) -> bool {
        let landing = u64::from(z.to_bits()) << 32 | (i as u64) << 1 | u64::from(away);
        self.0[pixel].fetch_min(landing, Relaxed) != EMPTY
    }

    /// Planar depth of what landed on the pixel, metres; none where nothing did.
    pub fn z(&self, pixel: usize) -> Option<f32> {
        let landing = self.0[pixel].load(Relaxed);
        (landing != EMPTY).then(|| f32::from_bits((landing >> 32) as u32))
    }

    /// The old pixel whose sample landed here; none where nothing did.
    pub fn source(&self, pixel: usize) -> Option<usize> {
        self.landed(pixel).map(|(i, _)| i)
    }

    /// The old pixel whose sample landed here, and whether it did so away from the centre.
    pub(super) fn landed(&self, pixel: usize) -> Option<(usize, bool)> {
        let landing = self.0[pixel].load(Relaxed);
        (landing != EMPTY).then_some((landing as u32 as usize >> 1, landing & 1 != 0))
    }
}

/// Projects every old sample, keeps the nearest on each pixel, and marks pixels on which several landed.
///
/// Returns the least depth of all that is before the new eye, in the window or not.
pub fn project(old: &BuzzBuffer, new_view: &Projector, landings: &Landings, marks: &Marks) -> Option<f32> {
    let width = old.width();
    let project_row = |y: usize| {
        let mut nearest = f32::INFINITY;
        let row = y * width..(y + 1) * width;
        let (object, surface) = (&old.object[row.clone()], &old.surface[row.clone()]);
        let places = old.position[row.clone()].iter().zip(&old.normal[row.clone()]);
        for (i, ((object, surface), (&position, normal))) in row.zip(object.iter().zip(surface).zip(places)) {
            if *object == UNKNOWN {
                continue;
            }
            let Some(p) = new_view.project(position, normal.direction(), surface.is_background()) else {
                continue;
            };
            nearest = nearest.min(p.z);
            let Some(pixel) = new_view.pixel(p.x, p.y) else { continue };
            landings.land(pixel, p, i, marks);
        }
        nearest
    };
    let nearest =
        (0..old.height()).into_par_iter().with_min_len(8).map(project_row).reduce(|| f32::INFINITY, f32::min);
    nearest.is_finite().then_some(nearest)
}

/// Moves the winners' data into the new buffer. Pixels that nothing reached, or whose sample something may hide,
/// are left unknown.
pub fn gather(old: &BuzzBuffer, landings: &Landings, marks: &Marks, new: &mut BuzzBuffer) {
    let width = old.width();
    new.rows_mut().enumerate().for_each(|(y, mut row)| {
        for x in 0..width {
            let pixel = y * width + x;
            let mark = marks.get(pixel);
            row.class[x] = match (landings.source(pixel), mark) {
                (_, Some(PixelClass::Entering)) => PixelClass::Entering,
                (None, _) => PixelClass::Missed,
                (_, Some(class)) => class,
                (Some(_), None) => PixelClass::Good,
            };
            let Some(i) = landings.source(pixel).filter(|_| row.class[x].is_reused()) else {
                row.object[x] = UNKNOWN;
                continue;
            };
            row.z[x] = landings.z(pixel).unwrap_or(f32::INFINITY);
            row.position[x] = old.position[i];
            row.object[x] = old.object[i];
            row.surface[x] = old.surface[i];
            row.normal[x] = old.normal[i];
            row.put_lit(x, old.lit(i));
        }
    });
}
