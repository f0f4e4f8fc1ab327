//! Sub-pixels from what landed on them and around them: super-sampling's [`Source`] in inferred frames.

use super::around::{ENOUGH_TO_FILL, Trust, is_facing_alike, is_one_surface};
use super::buzz_buffer::BuzzBuffer;
use super::lattice::{Lattice, Position};
use super::marks::Marks;
use super::moved::is_passed;
use super::project::{AT_CENTRE, Landings};
use super::projector::Projector;
use super::rays::CastCentres;
use super::samples::Samples;
use super::slot::{Slot, Source};
use crate::frame::{PixelClass, SurfaceSample};

/// So many samples on its surface must agree before a sub-pixel that was cast borrows shadow bits from the 5x5 around it: more than
/// for a pixel, as from sub-pixels no shadow's edge is followed.
const ENOUGH_FOR_A_SUBPIXEL: usize = 6;

/// The samples of the frame that is inferred from.
pub(super) struct Carried<'a, R> {
    pub old: Samples<'a>,
    pub landings: &'a Landings,
    pub marks: &'a Marks,
    pub view: &'a Projector,
    pub trust: Option<Trust>,
    pub rays: &'a R,
}

impl<R: CastCentres> Source for Carried<'_, R> {
    fn is_landed(&self, at: Position) -> bool {
        self.landed(at).is_some_and(|number| number >= self.old.pixels.object.len())
    }

    fn settle(&self, slot: &mut Slot<'_>, pixels: &BuzzBuffer) -> bool {
        let mark = self.marks.get(self.old.lattice.pixel_around(slot.at));
        if mark.is_some_and(|class| class != PixelClass::Overlapped) {
            return false;
        }
        let own = self.landed(slot.at);
        if let Some(own) = own.filter(|_| self.trust.is_none() || self.stands_still(slot.at)) {
            let (sample, lit) = self.old.get(own);
            if self.is_passed(&sample) {
                return false;
            }
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
        if self.may_be_hidden(&sample, &around, slot.at, pixels) || self.is_passed(&sample) {
            return false;
        }
        *slot.sample = sample;
        // Some lights may not be asked: nothing is to stay of what was here before.
        slot.lit.fill(0);
        let enough = if self.trust == Some(Trust::Proof) { around.size } else { 1 };
        self.lend_from(&around, slot, enough);
        true
    }

    fn lend(&self, slot: &mut Slot<'_>) {
        match self.trust {
            None => slot.ask.fill(u32::MAX),
            Some(trust) => {
                let around = Near::new(self, slot.at, 2);
                let enough = if trust == Trust::Proof { around.size } else { ENOUGH_FOR_A_SUBPIXEL };
                self.lend_from(&around, slot, enough);
            }
        }
    }
}

impl<R: CastCentres> Carried<'_, R> {
    /// True if a body may stand before a sample now. The pixel's mark does not say: what landed on its centre may be nearer.
    fn is_passed(&self, sample: &SurfaceSample) -> bool {
        self.rays.motion().is_some_and(|motion| is_passed(sample, self.view, motion))
    }

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

    /// True if one of the four pixels between which a position lies shows something that stands before the sample and of which nothing
    /// landed around it: it has come into view since.
    fn may_be_hidden(
        &self,
        sample: &SurfaceSample,
        around: &Near<'_, R>,
        at: Position,
        pixels: &BuzzBuffer,
    ) -> bool {
        let is_unknown =
            |met: &SurfaceSample| !around.samples().any(|known| is_one_surface(&known, met, self.view));
        pixels_between(self.old.lattice, at)
            .any(|pixel| pixels.z[pixel] < self.view.depth(sample) && is_unknown(&pixels.sample(pixel)))
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

/// The pixels between whose centres a position lies.
fn pixels_between(lattice: Lattice, [x, y]: Position) -> impl Iterator<Item = usize> {
    let steps = lattice.steps() as u32;
    let of = move |at: u32| [at - at % steps, at.next_multiple_of(steps)];
    let corners = of(y).into_iter().flat_map(move |y| of(x).map(|x| [x, y]));
    corners.filter_map(move |corner| lattice.pixel_at(corner))
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
