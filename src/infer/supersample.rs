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

use super::around::{SAME_FACING, Trust, is_one_surface};
use super::buzz_buffer::{BuzzBuffer, Projector, UNKNOWN};
use super::centre::{CastCentres, ENOUGH_TO_FILL};
use super::lattice::Position;
use super::moved::Askers;
use super::project::{AT_CENTRE, Landings};
use super::subpixel::{Level, Samples, SubPixels};
use super::{Cost, Inference, Marks, rides};
use crate::frame::{PixelClass, RayCounts, SubPixelCounts, SurfaceSample};
use crate::scene::View;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::AtomicU64;

/// So many samples on its surface must agree before a sub-pixel borrows shadow bits from the 5x5 around it.
const ENOUGH_TO_LEND: usize = 6;

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
        fill(&mut self.supersampling.ask, buffer, &view, &Nothing, false, rays)
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
        let (cost, mut counts) = fill(ask, new, &view, &carried, trust == Some(Trust::Proof), rays);
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
        landings.land_beside(y * columns + x, p.z, number, false);
        u64::from(number >= pixels)
    };
    (0..old.count()).into_par_iter().with_min_len(1 << 12).map(land_one).sum()
}

/// A sub-pixel that is being made.
struct Slot<'a> {
    at: Position,
    sample: &'a mut SurfaceSample,
    lit: &'a mut [u32],
    /// Bits of the lights that have to be asked.
    ask: &'a mut [u32],
}

/// Where samples may come from instead of from rays.
trait Source: Sync {
    /// True if a sample of a sub-pixel landed there.
    fn is_landed(&self, at: Position) -> bool;

    /// Finds the sample without a ray, if it can, and which lights must be asked.
    fn settle(&self, slot: &mut Slot<'_>) -> bool;

    /// Lends the sample, which was cast, shadow bits; what it cannot lend must be asked.
    fn lend(&self, slot: &mut Slot<'_>);
}

/// A key frame has no other to take samples from.
struct Nothing;

impl Source for Nothing {
    fn is_landed(&self, _: Position) -> bool {
        false
    }

    fn settle(&self, _: &mut Slot<'_>) -> bool {
        false
    }

    fn lend(&self, slot: &mut Slot<'_>) {
        slot.ask.fill(u32::MAX);
    }
}

/// Chooses the sub-pixels of `new`, finds their samples in `source`, and casts the others; with `proves`, those that were
/// found have to be proven visible by a ray. `wasted` counts what is not: those on which something landed.
fn fill<R: CastCentres>(
    ask: &mut Vec<u32>,
    new: &mut BuzzBuffer,
    view: &Projector,
    source: &impl Source,
    proves: bool,
    rays: &R,
) -> (Cost, SubPixelCounts) {
    let (mut cost, mut counts) = (Cost::default(), SubPixelCounts::default());
    let mut finer = std::mem::take(&mut new.finer);
    let lattice = finer.lattice();
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
                *reused = source.settle(&mut slot);
                u64::from(source.is_landed(slot.at))
            })
            .sum::<u64>();
        cost.add(|| slots(level, ask).map(|slot| cast(slot, source, proves, rays)).sum());
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
    rays: &impl CastCentres,
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
    if let Some(motion) = rays.motion() {
        Askers::new(motion).ask(slot.sample, slot.lit, slot.ask);
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

fn is_facing_alike(a: &SurfaceSample, b: &SurfaceSample) -> bool {
    a.surface.is_background() || a.normal.get().dot(b.normal.get()) > SAME_FACING
}

/// The samples of the frame that is inferred from.
struct Carried<'a, R> {
    old: Samples<'a>,
    landings: &'a Landings,
    marks: &'a Marks,
    view: &'a Projector,
    trust: Option<Trust>,
    rays: &'a R,
}

impl<R: CastCentres> Source for Carried<'_, R> {
    fn is_landed(&self, at: Position) -> bool {
        self.landed(at).is_some_and(|number| number >= self.old.pixels.object.len())
    }

    fn settle(&self, slot: &mut Slot<'_>) -> bool {
        let mark = self.marks.get(self.old.lattice.pixel_around(slot.at));
        if mark.is_some_and(|class| class != PixelClass::Overlapped) {
            return false;
        }
        let own = self.landed(slot.at);
        if let Some(own) = own.filter(|_| self.trust.is_none() || self.stands_still(slot.at)) {
            let (sample, lit) = self.old.get(own);
            *slot.sample = sample;
            slot.lit.copy_from_slice(lit);
            return true;
        }
        if self.trust.is_none() {
            return false;
        }
        let mut around = Near::new(self, slot.at, 1);
        if around.known().len() < ENOUGH_TO_FILL {
            around = Near::new(self, slot.at, 2);
        }
        if around.known().len() < ENOUGH_TO_FILL {
            return false;
        }
        let Some(sample) = self.nearest(&around, slot.at) else { return false };
        *slot.sample = sample;
        let enough = if self.trust == Some(Trust::Proof) { around.size } else { 1 };
        self.lend_from(&around, slot, enough);
        true
    }

    fn lend(&self, slot: &mut Slot<'_>) {
        match self.trust {
            None => slot.ask.fill(u32::MAX),
            Some(trust) => {
                let around = Near::new(self, slot.at, 2);
                let enough = if trust == Trust::Proof { around.size } else { ENOUGH_TO_LEND };
                self.lend_from(&around, slot, enough);
            }
        }
    }
}

impl<R: CastCentres> Carried<'_, R> {
    /// The number of the old sample that landed nearest to the eye.
    fn landed(&self, at: Position) -> Option<usize> {
        self.landings.source(at[1] as usize * self.old.lattice.size().0 + at[0] as usize)
    }

    /// True if all that landed here and around lies in its very place: nothing moves. Something landed here. What is far away
    /// stays in place though the outline before it moves, so more than one sub-pixel must be looked at.
    fn stands_still(&self, at: Position) -> bool {
        let is_still = |at| self.landed(at).is_none_or(|number| self.is_at(number, at));
        is_still(at) && around(at, 1).filter(|&at| self.old.lattice.contains(at)).all(is_still)
    }

    /// True if a sample lies at the very place.
    fn is_at(&self, number: usize, at: Position) -> bool {
        let (sample, _) = self.old.get(number);
        let place =
            self.view.project(sample.position, sample.normal.direction(), sample.surface.is_background());
        let near = AT_CENTRE * self.old.lattice.steps() as f32;
        let is_near = |raster: f32, at: u32| (self.old.lattice.from_raster(raster) - at as f32).abs() < near;
        place.is_some_and(|p| is_near(p.x, at[0]) && is_near(p.y, at[1]))
    }

    /// What the ray through a position meets of the surfaces around it, if that is certain: they are one, or it meets that
    /// which is nearest to the eye.
    fn nearest(&self, around: &Near<'_, R>, at: Position) -> Option<SurfaceSample> {
        let view = self.view;
        let front = around.front()?;
        let is_one = around.samples().all(|sample| is_one_surface(&front, &sample, view));
        let candidates = around.distinct().filter(|s| is_one || !s.surface.is_background());
        let met =
            self.rays.nearest_of(at[0] as usize, at[1] as usize, candidates, &mut R::Memory::default())?;
        (is_one || is_one_surface(&met, &front, view)).then_some(met)
    }

    /// Takes over the shadow bits on which those around agree that lie on the surface of the sample, if they are enough. The
    /// other lights must be asked.
    fn lend_from(&self, around: &Near<'_, R>, slot: &mut Slot<'_>, enough: usize) {
        let sample = *slot.sample;
        let mut lenders = around.known().iter().map(|&number| self.old.get(number)).filter(|(lender, _)| {
            is_one_surface(&sample, lender, self.view) && is_facing_alike(&sample, lender)
        });
        let Some((_, first)) = lenders.next() else { return slot.ask.fill(u32::MAX) };
        let mut count = 1;
        for (_, lit) in lenders {
            count += 1;
            self.rays.differ(first, lit, slot.ask);
        }
        if count < enough {
            return slot.ask.fill(u32::MAX);
        }
        slot.lit.copy_from_slice(first);
    }
}

/// The positions around one, in rows from the top; some may lie outside the image.
fn around([x, y]: Position, reach: i32) -> impl Iterator<Item = Position> {
    let block = (-reach..=reach).flat_map(move |dy| (-reach..=reach).map(move |dx| (dx, dy)));
    let others = block.filter(|&by| by != (0, 0));
    others.map(move |(dx, dy)| [x.wrapping_add_signed(dx), y.wrapping_add_signed(dy)])
}

/// The samples that landed on the sub-pixels around one and on it: on it first, then in rows from the top.
struct Near<'a, R> {
    carried: &'a Carried<'a, R>,
    known: [usize; 25],
    count: usize,
    /// Sub-pixels looked at: those outside the image are not.
    size: usize,
}

impl<'a, R: CastCentres> Near<'a, R> {
    /// Looks `reach` sub-pixels far in each direction, at most 2.
    fn new(carried: &'a Carried<'a, R>, at: Position, reach: i32) -> Self {
        let mut this = Self { carried, known: [0; 25], count: 0, size: 0 };
        this.look(at);
        around(at, reach).for_each(|at| this.look(at));
        this
    }

    fn look(&mut self, at: Position) {
        if self.carried.old.lattice.contains(at) {
            self.size += 1;
            if let Some(number) = self.carried.landed(at) {
                self.known[self.count] = number;
                self.count += 1;
            }
        }
    }

    fn known(&self) -> &[usize] {
        &self.known[..self.count]
    }

    fn samples(&self) -> impl Iterator<Item = SurfaceSample> {
        self.known().iter().map(|&number| self.carried.old.get(number).0)
    }

    /// The sample that is nearest to the eye; of equally near ones, the first.
    fn front(&self) -> Option<SurfaceSample> {
        let view = self.carried.view;
        self.samples().min_by(|a, b| view.depth(a).total_cmp(&view.depth(b)))
    }

    /// A sample of each triangle.
    fn distinct(&self) -> impl Iterator<Item = SurfaceSample> {
        let primitive = |s: &SurfaceSample| (s.surface.instance, s.surface.primitive);
        self.samples().enumerate().filter_map(move |(i, sample)| {
            let is_new = !self.samples().take(i).any(|s| primitive(&s) == primitive(&sample));
            is_new.then_some(sample)
        })
    }
}
