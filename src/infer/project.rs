//! Projection of the old samples into the new view: the nearest hit on a pixel wins.

use super::Marks;
use super::buzz_buffer::{BuzzBuffer, Projector, UNKNOWN};
use crate::frame::PixelClass;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Depth and old pixel of the nearest sample that landed on a pixel, as one number that a single atomic minimum can
/// decide: the depth's bits (positive floats order like integers) above the old pixel's number. Ties go to the
/// lower number, so the result depends on neither the order of pixels nor the number of threads.
#[derive(Debug, Default)]
pub struct Landings(Vec<AtomicU64>);

/// Nothing landed.
const EMPTY: u64 = u64::MAX;

impl Landings {
    /// Empties all pixels ("all z values = HUGE and id_tag to -2").
    pub fn clear(&mut self, pixels: usize) {
        self.0.resize_with(pixels, AtomicU64::default);
        self.0.par_iter_mut().with_min_len(1 << 14).for_each(|l| *l.get_mut() = EMPTY);
    }

    /// Lands old sample `i` at depth `z` on a pixel; marks the pixel if another is there.
    pub(super) fn land(&self, pixel: usize, z: f32, i: usize, marks: &Marks) {
        if self.land_beside(pixel, z, i) {
            marks.set(pixel, PixelClass::Overlapped);
        }
    }

    /// Lands a sample at depth `z` and says whether another is there.
    pub(super) fn land_beside(&self, pixel: usize, z: f32, i: usize) -> bool {
        let landing = u64::from(z.to_bits()) << 32 | i as u64;
        self.0[pixel].fetch_min(landing, Relaxed) != EMPTY
    }

    /// Depth of what landed on the pixel; none where nothing did.
    pub fn z(&self, pixel: usize) -> Option<f32> {
        let landing = self.0[pixel].load(Relaxed);
        (landing != EMPTY).then(|| f32::from_bits((landing >> 32) as u32))
    }

    /// The old pixel whose sample landed here; none where nothing did.
    pub fn source(&self, pixel: usize) -> Option<usize> {
        let landing = self.0[pixel].load(Relaxed);
        (landing != EMPTY).then_some(landing as u32 as usize)
    }
}

/// Projects every old sample, keeps the nearest on each pixel, and marks pixels on which several landed.
///
/// Returns the least depth of all that is before the new eye, in the window or not.
pub fn project(old: &BuzzBuffer, new_view: &Projector, landings: &Landings, marks: &Marks) -> Option<f32> {
    let width = old.width();
    let project_row = |y: usize| {
        let mut nearest = f32::INFINITY;
        for i in y * width..(y + 1) * width {
            if old.object[i] == UNKNOWN {
                continue;
            }
            let background = old.surface[i].is_background();
            let Some(p) = new_view.project(old.position[i], old.normal[i].get(), background) else {
                continue;
            };
            nearest = nearest.min(p.z);
            let Some(pixel) = new_view.pixel(p.x, p.y) else { continue };
            landings.land(pixel, p.z, i, marks);
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
    new.rows_mut().enumerate().for_each(|(y, row)| {
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
            row.lit[x * row.lit_words..][..row.lit_words].copy_from_slice(old.lit(i));
        }
    });
}
