//! What the samples that landed around a pixel say about it: whether they lie on one surface, and which lights reach it.

use super::Marks;
use super::buzz_buffer::{BuzzBuffer, Projector};
use super::centre::CastCentres;
use super::project::Landings;
use crate::frame::{PixelClass, SurfaceSample};
use rayon::prelude::*;

/// Two samples lie on one surface if either is within this many pixel widths of the other's tangent plane.
const STEP: f32 = 1.0;

/// Least cosine between normals of samples that may lend each other shadow bits.
pub(super) const SAME_FACING: f32 = 0.9;

/// So many samples on its surface must agree before a pixel that was cast borrows shadow bits from the 5x5 around it.
/// Fewer are all on one side of it, as at the foot of a wall, where a shadow begins.
pub(super) const ENOUGH_TO_LEND: usize = 6;

/// A sample that landed this near to its pixel's centre, in pixels, is as good as at it.
pub(super) const AT_CENTRE: f32 = 1.0 / 256.0;

/// Nothing landed on the pixel. The numbers of old pixels are below: an image has fewer than 2^30 pixels.
const NOTHING: u32 = (1 << 30) - 1;

/// Set where something unknown may stand before what landed on the pixel, if anything did.
const SUSPECT: u32 = 1 << 31;

/// Set where what landed on the pixel is away from its centre.
const MOVED: u32 = 1 << 30;

/// How much is believed without a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trust {
    /// Shadow bits on which all that is known around agrees; reused samples before which no line L passes, but for a few
    /// that a ray proves visible, so that nothing new stays unseen for long.
    Neighbours,
    /// Shadow bits on which the whole neighbourhood is known to agree; reused samples that a ray has proven visible.
    Proof,
}

/// For each pixel: the old pixel whose sample landed on it, and whether that is to be believed.
#[derive(Debug, Default)]
pub struct Sources(Vec<u32>);

impl Sources {
    /// Settles it for all pixels, once all lines have been walked.
    pub fn settle(&mut self, old: &BuzzBuffer, view: &Projector, landings: &Landings, marks: &Marks) {
        let width = old.width();
        self.0.resize(old.object.len(), NOTHING);
        self.0.par_chunks_mut(width).with_min_len(8).enumerate().for_each(|(y, row)| {
            for (x, source) in row.iter_mut().enumerate() {
                let pixel = y * width + x;
                *source = landings.source(pixel).map_or(NOTHING, |i| {
                    let flag = if is_at_centre(old, i, view, x, y) { 0 } else { MOVED };
                    i as u32 | flag
                });
                if matches!(
                    marks.get(pixel),
                    Some(PixelClass::Bad | PixelClass::Moved | PixelClass::Entering)
                ) {
                    *source |= SUSPECT;
                }
            }
        });
    }

    /// The old pixel whose sample landed here.
    pub fn of(&self, pixel: usize) -> Option<usize> {
        let source = self.0[pixel] & NOTHING;
        (source != NOTHING).then_some(source as usize)
    }

    /// True if a sample landed on the pixel's very centre.
    pub fn is_centred(&self, pixel: usize) -> bool {
        self.of(pixel).is_some() && self.0[pixel] & MOVED == 0
    }

    /// True if something unknown may stand in front here.
    pub fn is_suspect(&self, pixel: usize) -> bool {
        self.0[pixel] & SUSPECT != 0
    }
}

/// The samples that landed around a pixel and on it, in rows from the top.
pub(super) struct Around<'a> {
    old: &'a BuzzBuffer,
    view: &'a Projector,
    known: [u32; 25],
    count: usize,
    /// Pixels looked at: those outside the image are not.
    size: usize,
    suspect: bool,
    moved: bool,
}

impl<'a> Around<'a> {
    /// Looks `reach` pixels far in each direction, at most 2.
    pub fn new(
        old: &'a BuzzBuffer,
        view: &'a Projector,
        sources: &Sources,
        (x, y): (usize, usize),
        reach: usize,
    ) -> Self {
        let (width, height) = (old.width(), old.height());
        let (first, last) = (x.saturating_sub(reach), (x + reach).min(width - 1));
        let mut this = Self { old, view, known: [0; 25], count: 0, size: 0, suspect: false, moved: false };
        for y in y.saturating_sub(reach)..=(y + reach).min(height - 1) {
            for &source in &sources.0[y * width + first..=y * width + last] {
                this.size += 1;
                this.suspect |= source & SUSPECT != 0;
                this.moved |= source & MOVED != 0;
                if source & NOTHING != NOTHING {
                    this.known[this.count] = source & NOTHING;
                    this.count += 1;
                }
            }
        }
        this
    }

    /// Old pixels whose samples are known here.
    pub fn known(&self) -> impl Iterator<Item = usize> + Clone {
        self.known[..self.count].iter().map(|&i| i as usize)
    }

    /// True where a sample landed on every pixel.
    pub fn is_complete(&self) -> bool {
        self.count == self.size
    }

    /// True where a sample landed on the centre of every pixel: nothing has moved here.
    pub fn stands_still(&self) -> bool {
        !self.moved && !self.suspect && self.is_complete()
    }

    /// True where nothing unknown may stand in front, and all samples around lie on the surface of old sample `i`.
    pub fn shows_one_surface(&self, i: usize) -> bool {
        let sample = self.old.sample(i);
        !self.suspect
            && self.known().all(|k| {
                is_same_primitive(self.old, i, k) || is_one_surface(&sample, &self.old.sample(k), self.view)
            })
    }

    /// The samples that name the triangles of this neighbourhood, that of old sample `i` first.
    pub fn candidates(&self, i: usize) -> impl Iterator<Item = SurfaceSample> {
        let others = self.known().filter(move |&k| !is_same_primitive(self.old, i, k));
        std::iter::once(i).chain(others).map(|k| self.old.sample(k))
    }

    /// Sets in `ask` the bits of the lights about which the samples around disagree, and clears all others.
    pub fn disagreement(&self, rays: &impl CastCentres, trust: Trust, ask: &mut [u32]) {
        if trust == Trust::Proof && !self.is_complete() {
            ask.fill(u32::MAX);
        } else {
            differing(rays, self.old, self.known(), ask);
        }
    }

    /// Takes over into `lit` the bits on which enough samples around that lie on the surface of `sample` agree. Sets in
    /// `ask` those of all other lights.
    pub fn lend(
        &self,
        sample: &SurfaceSample,
        rays: &impl CastCentres,
        trust: Trust,
        lit: &mut [u32],
        ask: &mut [u32],
    ) {
        let normal = sample.normal.get();
        let lenders = self.known().filter(|&k| {
            let lender = self.old.sample(k);
            normal.dot(lender.normal.get()) > SAME_FACING && is_one_surface(sample, &lender, self.view)
        });
        let enough = if trust == Trust::Proof { self.size } else { ENOUGH_TO_LEND };
        match lenders.clone().next() {
            Some(first) if lenders.clone().count() >= enough => {
                differing(rays, self.old, lenders, ask);
                lit.copy_from_slice(self.old.lit(first));
            }
            _ => ask.fill(u32::MAX),
        }
    }
}

/// Sets the bits of lights on which `samples` do not all agree with the first, and clears all others.
fn differing(
    rays: &impl CastCentres,
    old: &BuzzBuffer,
    mut samples: impl Iterator<Item = usize>,
    differ: &mut [u32],
) {
    differ.fill(0);
    let Some(first) = samples.next() else { return };
    for sample in samples {
        rays.differ(old.lit(first), old.lit(sample), differ);
    }
}

fn is_at_centre(old: &BuzzBuffer, i: usize, view: &Projector, x: usize, y: usize) -> bool {
    let at = view.project(old.position[i], old.normal[i].get(), old.surface[i].is_background());
    at.is_some_and(|p| (p.x - x as f32 - 0.5).abs() < AT_CENTRE && (p.y - y as f32 - 0.5).abs() < AT_CENTRE)
}

fn is_same_primitive(old: &BuzzBuffer, a: usize, b: usize) -> bool {
    let (a, b) = (&old.surface[a], &old.surface[b]);
    (a.instance, a.primitive) == (b.instance, b.primitive)
}

/// True where two samples lie on one surface, with no step between them.
pub fn is_one_surface(a: &SurfaceSample, b: &SurfaceSample, view: &Projector) -> bool {
    if a.object != b.object {
        return false;
    }
    if a.surface.is_background() {
        return true;
    }
    let between = b.position - a.position;
    let step = STEP * view.pixel_width(a.position).max(view.pixel_width(b.position));
    between.dot(a.normal.get()).abs() <= step || between.dot(b.normal.get()).abs() <= step
}
