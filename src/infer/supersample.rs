//! Adaptive super-sampling (the paper's "Anti-Aliasing"): more samples where one a pixel does not say enough.
//!
//! Level by level, a cell whose corners differ is divided: where they do not lie on one surface, look different ways, or
//! are reached by different lights. So what is stored depends on the samples alone, not on how they are shaded; shading
//! divides further where colours differ, for which no ray is needed.
//!
//! All samples of the old frame land on the new frame's lattice of sub-pixels before it is known which are wanted, and some
//! do for nothing. As the paper says, no sub-pixel is traced before it is: then
//!
//! - by the paper's guarantee, a sample that landed on it serves as it is (half a sub-pixel);
//! - centred, it gets the sample of the ray through its place. If what landed around it lies on one surface, or the ray
//!   meets the nearest surface of those that did, no ray is cast into the scene; behind a silhouette one is, because the
//!   triangle at an outline may be in nobody's sample.
//!
//! What inference has found out about the pixel goes for its sub-pixels: where something unknown may stand before it, or a
//! gap opened in an object, they are traced. So only positions on which something landed are cleaned up.

use super::around::{Trust, is_facing_alike, is_one_surface};
use super::buzz_buffer::{BuzzBuffer, UNKNOWN};
use super::carried::Carried;
use super::lattice::Lattice;
use super::moved::Askers;
use super::project::Landings;
use super::projector::Projector;
use super::rays::CastCentres;
use super::samples::Samples;
use super::shafts::Shafts;
use super::slot::{Nothing, Slot, Source};
use super::subpixel::{Level, SubPixels};
use super::{Cost, Inference, rides};
use crate::frame::{RayCounts, SubPixelCounts, SurfaceSample};
use crate::scene::View;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::AtomicU64;

/// What super-sampling holds between frames, so that nothing is allocated for each.
#[derive(Debug, Default)]
pub struct Supersampling {
    landings: Landings,
    /// For each sub-pixel of a level: bits of the lights that have to be asked.
    ask: Vec<u32>,
}

impl Supersampling {
    /// The most that it holds for each pixel.
    pub fn bytes_per_pixel(levels: u32, words: usize) -> usize {
        if levels < 2 {
            return 0;
        }
        let ask = SubPixels::most_per_pixel(levels) * words * size_of::<u32>();
        (size_of::<AtomicU64>() << (2 * (levels - 1))) + ask
    }
}

impl Inference {
    /// Casts rays through the sub-pixels of `buffer`, whose pixels are there, where samples differ. `rays` casts them by
    /// positions of the lattice instead of pixels.
    pub fn trace_subpixels(
        &mut self,
        buffer: &mut BuzzBuffer,
        view: &View,
        origin: DVec3,
        rays: &impl CastCentres,
    ) -> (Cost, SubPixelCounts) {
        let view = Projector::new(view, origin);
        let room = (&mut self.supersampling.ask, &mut self.shafts);
        fill(room, buffer, &view, &Nothing, false, rays)
    }

    /// Finds samples for the sub-pixels of `new`, whose pixels have just been inferred from `old` by this. `rays` casts them
    /// by positions of the lattice instead of pixels. Without `trust`, what landed on a sub-pixel serves where it is.
    pub fn infer_subpixels(
        &mut self,
        old: &BuzzBuffer,
        new: &mut BuzzBuffer,
        view: &View,
        origin: DVec3,
        trust: Option<Trust>,
        rays: &impl CastCentres,
    ) -> (Cost, SubPixelCounts) {
        let view = Projector::new(view, origin);
        let old = Samples::of(if rides(rays.motion()) { &self.now } else { old });
        let Supersampling { landings, ask } = &mut self.supersampling;
        let landed = land(old, &view, landings);
        let carried = Carried { old, landings, marks: &self.marks, view: &view, trust, rays };
        let room = (ask, &mut self.shafts);
        let (cost, mut counts) = fill(room, new, &view, &carried, trust == Some(Trust::Proof), rays);
        counts.wasted = landed - counts.wasted;
        (cost, counts)
    }
}

/// Lands every old sample that the new view shows on the lattice, and counts those of sub-pixels.
fn land(old: Samples<'_>, view: &Projector, landings: &mut Landings) -> u64 {
    let (lattice, pixels) = (old.lattice, old.pixels.object.len());
    let (columns, rows) = lattice.size();
    landings.clear(columns * rows);
    let land_one = |number: usize| {
        let (sample, _) = old.get(number);
        if sample.object == UNKNOWN {
            return 0;
        }
        let place = view.project(sample.position, sample.normal.direction(), sample.surface.is_background());
        let Some(p) = place.filter(|p| view.pixel(p.x, p.y).is_some()) else { return 0 };
        let [x, y] = [p.x, p.y].map(|raster| (lattice.from_raster(raster) + 0.5) as usize);
        landings.land_at(y * columns + x, p.z, number, false);
        u64::from(number >= pixels)
    };
    (0..old.count()).into_par_iter().with_min_len(1 << 12).map(land_one).sum()
}

/// Chooses the sub-pixels of `new`, finds their samples in `source`, and casts the others; with `proves`, those that were
/// found have to be proven visible by a ray. `wasted` counts what is not: those on which something landed.
fn fill<R: CastCentres>(
    (ask, shafts): (&mut Vec<u32>, &mut Shafts),
    new: &mut BuzzBuffer,
    view: &Projector,
    source: &impl Source,
    proves: bool,
    rays: &R,
) -> (Cost, SubPixelCounts) {
    let (mut cost, mut counts) = (Cost::default(), SubPixelCounts::default());
    let mut finer = std::mem::take(&mut new.finer);
    let lattice = finer.lattice();
    let askers = rays.motion().map(|motion| Askers::new(motion, new, shafts));
    for depth in 0..finer.levels.len() {
        let (coarser, level) = finer.levels.split_at_mut(depth);
        let Some(level) = level.first_mut() else { break };
        let samples = Samples { pixels: new, lattice, levels: coarser };
        level.cells.divide(|[x, y], corners| {
            coarser.last().is_none_or(|above| above.cells.is_divided([x / 2, y / 2]))
                && differ(corners.filter_map(|at| samples.at(at)), view, rays)
        });
        level.fit();
        ask.resize(level.samples.len() * level.stride(), 0);
        let landed = slots(level, ask)
            .map(|(mut slot, reused)| {
                slot.ask.fill(0);
                *reused = source.settle(&mut slot, new);
                u64::from(source.is_landed(slot.at))
            })
            .sum::<u64>();
        cost.add(|| slots(level, ask).map(|slot| cast(slot, source, proves, (rays, &askers), lattice)).sum());
        counts.sampled += level.samples.len() as u64;
        counts.reused += level.reused.iter().filter(|&&reused| reused).count() as u64;
        counts.wasted += landed;
    }
    new.finer = finer;
    (cost, counts)
}

/// The sub-pixels of a level and whether they are reused, for writing in parallel.
fn slots<'a>(
    level: &'a mut Level,
    ask: &'a mut [u32],
) -> impl IndexedParallelIterator<Item = (Slot<'a>, &'a mut bool)> {
    let (stride, words) = (level.stride(), level.words());
    let Level { cells, samples, lit, reused, .. } = level;
    let bits = lit.par_chunks_mut(stride).zip(ask.par_chunks_mut(stride));
    let slots = cells.positions().par_iter().zip(samples).zip(bits).zip(reused).with_min_len(64);
    slots.map(move |(((&at, sample), (lit, ask)), reused)| {
        (Slot { at, sample, lit: &mut lit[..words], ask: &mut ask[..words] }, reused)
    })
}

/// Casts what rays a sub-pixel still wants.
fn cast(
    (mut slot, reused): (Slot<'_>, &mut bool),
    source: &impl Source,
    proves: bool,
    (rays, askers): (&impl CastCentres, &Option<Askers<'_>>),
    lattice: Lattice,
) -> RayCounts {
    let mut counts = RayCounts::default();
    if rays.is_cancelled() {
        return counts;
    }
    if *reused && proves && rays.is_hidden(slot.sample, &mut counts) {
        *reused = false;
    }
    if !*reused {
        *slot.sample = rays.hit(slot.at[0] as usize, slot.at[1] as usize, &mut counts);
        slot.lit.fill(0);
        source.lend(&mut slot);
    }
    let pixel = lattice.pixel_around(slot.at);
    if let Some(askers) = askers.as_ref().filter(|askers| !askers.are_quiet(pixel, slot.sample)) {
        askers.ask(pixel, slot.sample, (slot.lit, &[]), slot.ask);
    }
    if slot.ask.iter().any(|&bits| bits != 0) {
        rays.recast(slot.sample, slot.ask, slot.lit, &mut counts);
    }
    counts
}

/// True where samples do not all lie on one surface, look different ways, or are reached by different lights.
fn differ<'a>(
    mut samples: impl Iterator<Item = (SurfaceSample, &'a [u32])>,
    view: &Projector,
    rays: &impl CastCentres,
) -> bool {
    let Some((first, first_lit)) = samples.next() else { return false };
    samples.any(|(sample, lit)| {
        !is_one_surface(&first, &sample, view)
            || !is_facing_alike(&first, &sample)
            || !rays.agree(first_lit, lit)
    })
}
