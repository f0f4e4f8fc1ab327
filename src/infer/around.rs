//! What the samples that landed around a pixel say about it: whether they lie on one surface, and which lights reach it.

use super::buzz_buffer::BuzzBuffer;
use super::cell::Cell;
use super::projector::Projector;
use super::rays::CastCentres;
use super::sources::{MOVED, NOTHING, SUSPECT, Sources};
use crate::frame::SurfaceSample;
use glam::Vec3;

/// Two samples lie on one surface if either is within this many pixel widths of the other's tangent plane.
const STEP: f32 = 1.0;

/// Least cosine between normals of samples that may lend each other shadow bits.
const SAME_FACING: f32 = 0.9;

/// So many samples on its surface, its own among them, must agree before a pixel that was cast borrows shadow bits from the 5x5
/// around it. What they are wrong about [is followed](super::shadow_edges) from where it is asked.
const ENOUGH_TO_LEND: usize = 3;

/// So many samples must be known in the 3x3 around a pixel before it is filled from them.
pub(super) const ENOUGH_TO_FILL: usize = 3;

/// How much is believed without a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trust {
    /// Shadow bits on which all that is known around agrees; reused samples beside which no ray met anything unknown, but for
    /// a few that a ray proves visible, so that nothing new stays unseen for long.
    Neighbours,
    /// Shadow bits on which the whole neighbourhood is known to agree; reused samples that have been proven visible, by a ray
    /// or with all of a tile.
    Proof,
}

/// Whose shadow bits a pixel that was cast has borrowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lent {
    /// None lies on its surface.
    Nothing,
    /// Of samples that lie around it.
    Around,
    /// Of a whole cell on its surface, which knows better than what only lies around.
    Cell,
}

/// Old pixels whose samples landed near one another, in rows from the top.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearby {
    pixels: [u32; Self::MOST + 1],
    count: usize,
}

impl Nearby {
    const MOST: usize = 25;
    const NONE: Self = Self { pixels: [0; Self::MOST + 1], count: 0 };

    fn push(&mut self, i: usize) {
        self.push_if(true, i as u32);
    }

    /// Without a branch: there is room for one more than may be known.
    fn push_if(&mut self, known: bool, i: u32) {
        self.pixels[self.count] = i;
        self.count += usize::from(known);
    }

    pub fn iter(&self) -> impl Iterator<Item = usize> + Clone {
        self.pixels[..self.count].iter().map(|&i| i as usize)
    }
}

/// The samples that landed around a pixel and on it.
pub(super) struct Around<'a> {
    old: &'a BuzzBuffer,
    view: &'a Projector,
    pixel: (usize, usize),
    known: Nearby,
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
        let rows = y.saturating_sub(reach)..=(y + reach).min(height - 1);
        let size = rows.clone().count() * (last - first + 1);
        let (mut known, mut flags) = (Nearby::NONE, 0);
        for y in rows {
            for &source in sources.row(width, y, first..=last) {
                flags |= source;
                known.push_if(source & NOTHING != NOTHING, source & NOTHING);
            }
        }
        let (suspect, moved) = (flags & SUSPECT != 0, flags & MOVED != 0);
        Self { old, view, pixel: (x, y), known, size, suspect, moved }
    }

    /// Old pixels whose samples are known here.
    pub fn known(&self) -> impl Iterator<Item = usize> + Clone {
        self.known.iter()
    }

    /// True where a sample landed on every pixel.
    pub fn is_complete(&self) -> bool {
        self.known.count == self.size
    }

    /// True where a sample landed on the centre of every pixel: nothing has moved here.
    pub fn stands_still(&self) -> bool {
        !self.moved && !self.suspect && self.is_complete()
    }

    /// Samples that name the triangles of the surface of old sample `i` here, each once, that of `i` first; none unless the
    /// pixel's centre lies within that surface. Of a surface behind others that is known only if neighbours are trusted. `body_of`
    /// is the body that carries an old sample.
    pub fn surface_of(
        &self,
        i: usize,
        trust: Trust,
        body_of: impl Fn(usize) -> Option<usize>,
    ) -> Option<Nearby> {
        let (mut triangles, mut others) = (Nearby::NONE, Nearby::NONE);
        triangles.push(i);
        let tangent = Tangent::new(self.old.sample(i), self.view);
        for k in self.known().filter(|&k| !self.old.is_same_primitive(i, k)) {
            if !tangent.reaches(&self.old.sample(k)) {
                others.push(k);
            } else if !triangles.iter().any(|named| self.old.is_same_primitive(named, k)) {
                triangles.push(k);
            }
        }
        // What moves otherwise may sink into this surface, or come out of it: then an outline moves with neither.
        let keeps_off = || trust == Trust::Proof || others.iter().all(|k| body_of(k) == body_of(i));
        (others.count == 0 || keeps_off() && self.is_inside(&tangent, i, &others, trust)).then_some(triangles)
    }

    /// The cell that has come to the centre with old sample `i`, if all of it shows the surface of that sample.
    pub fn cell(&self, i: usize) -> Option<Cell> {
        self.cell_on((&Tangent::new(self.old.sample(i), self.view), i), i)
    }

    /// The cell that has come to the centre along with old sample `mover`, if all of it shows the surface of `i`.
    fn cell_on(&self, surface: (&Tangent<'_>, usize), mover: usize) -> Option<Cell> {
        let cell = Cell::of(self.old, self.view, mover, self.pixel)?;
        cell.corners.iter().all(|&k| self.is_on(surface, k)).then_some(cell)
    }

    /// True if old sample `k` shows the surface of `i`.
    fn is_on(&self, (tangent, i): (&Tangent<'_>, usize), k: usize) -> bool {
        self.old.is_same_primitive(i, k) || tangent.reaches(&self.old.sample(k))
    }

    /// True if no outline between the surface of `i` and `others` passes here. An outline moves with what is nearer. That is
    /// this surface, or, if neighbours are trusted, others: what has come here with each must be between four old pixels that
    /// all show this surface.
    fn is_inside(&self, tangent: &Tangent<'_>, i: usize, others: &Nearby, trust: Trust) -> bool {
        let depth = |k: usize| self.view.depth(&self.old.sample(k));
        let own = depth(i);
        let is_past = |k: usize| trust == Trust::Neighbours && self.cell_on((tangent, i), k).is_some();
        others.iter().all(|k| depth(k) > own || is_past(k)) && self.cell_on((tangent, i), i).is_some()
    }

    /// True if something landed on all pixels here, with the same shadow bits.
    pub fn is_lit_alike(&self) -> bool {
        let first = self.known.pixels[0] as usize;
        self.is_complete() && self.known().all(|k| self.old.is_lit_alike(first, k))
    }

    /// Sets in `ask` the bits of the lights about which the samples around disagree, and clears all others. If neighbours are
    /// trusted, only those on the surface of old sample `i` are heard: what is lit before or behind it says nothing.
    pub fn disagreement(&self, i: usize, rays: &impl CastCentres, trust: Trust, ask: &mut [u32]) {
        if trust == Trust::Proof && !self.is_complete() {
            return ask.fill(u32::MAX);
        }
        ask.fill(0);
        let mut tangent = None;
        for k in self.known().filter(|&k| !self.old.is_lit_alike(i, k)) {
            let tangent = tangent.get_or_insert_with(|| Tangent::new(self.old.sample(i), self.view));
            if trust == Trust::Proof || self.is_on((tangent, i), k) {
                rays.differ(self.old.lit(i), self.old.lit(k), ask);
            }
        }
    }

    /// Takes over into `lit` the bits on which enough samples around that lie on the surface of `sample` agree, and the mean
    /// of their shares. Sets in `ask` those of all other lights. What is not `certain` asks all, and at least to be confirmed.
    pub fn lend(
        &self,
        sample: &SurfaceSample,
        rays: &impl CastCentres,
        (trust, certain): (Trust, bool),
        lit: &mut [u32],
        ask: &mut [u32],
    ) -> Lent {
        let tangent = Tangent::new(*sample, self.view);
        let lends = |k: &usize| tangent.may_lend(&self.old.sample(*k));
        let mut known = self.known().filter(lends);
        let Some(first) = known.next() else {
            ask.fill(u32::MAX);
            return Lent::Nothing;
        };
        if believes_cells(trust, rays)
            && let Some(cell) = Cell::of(self.old, self.view, first, self.pixel)
            && cell.corners.iter().all(lends)
        {
            cell.lend(self.old, rays, lit, ask);
            return Lent::Cell;
        }
        let mut lenders = Nearby::NONE;
        std::iter::once(first).chain(known).for_each(|k| lenders.push(k));
        differing(rays, self.old, &lenders, ask);
        lit.copy_from_slice(self.old.lit(first));
        rays.blend(lenders.iter().map(|k| (self.old.lit(k), 1.0)), lit);
        let enough = if trust == Trust::Proof { self.size } else { ENOUGH_TO_LEND };
        if !certain || lenders.count < enough {
            rays.confirm(ask);
        }
        Lent::Around
    }
}

/// Whether four old pixels that agree about a light are believed. Shares are not bits, and are [carried](super::shares).
pub(super) fn believes_cells(trust: Trust, rays: &impl CastCentres) -> bool {
    trust == Trust::Neighbours && !rays.has_shares()
}

/// Sets the bits of lights on which `samples` do not all agree with the first, and clears all others.
fn differing(rays: &impl CastCentres, old: &BuzzBuffer, samples: &Nearby, differ: &mut [u32]) {
    differ.fill(0);
    let Some(first) = samples.iter().next() else { return };
    for sample in samples.iter().filter(|&sample| !old.is_lit_alike(first, sample)) {
        rays.differ(old.lit(first), old.lit(sample), differ);
    }
}

/// A sample's tangent plane, to hold many samples against it.
pub(super) struct Tangent<'a> {
    sample: SurfaceSample,
    normal: Vec3,
    /// How far off the plane the same surface may be as far as this sample's own pixel goes, metres.
    step: f32,
    view: &'a Projector,
}

impl<'a> Tangent<'a> {
    pub fn new(sample: SurfaceSample, view: &'a Projector) -> Self {
        let step = STEP * view.pixel_width(sample.position);
        Self { sample, normal: sample.normal.get(), step, view }
    }

    /// True if `other` lies on the same surface and faces the same way: what light reaches one is likely to reach the other.
    pub fn may_lend(&self, other: &SurfaceSample) -> bool {
        let faces_alike = || {
            let direction = other.normal.direction();
            self.normal.dot(direction) > SAME_FACING * direction.length()
        };
        (other.normal == self.sample.normal || faces_alike()) && self.reaches(other)
    }

    /// True if `other` may lend, or lies on the same face.
    pub fn is_one_thing_with(&self, other: &SurfaceSample) -> bool {
        let face =
            |sample: &SurfaceSample| (sample.surface.instance, sample.surface.primitive, sample.normal);
        face(other) == face(&self.sample) || self.may_lend(other)
    }

    /// See [`is_one_surface`].
    fn reaches(&self, other: &SurfaceSample) -> bool {
        // The bars of a window and the panes behind them are two things, though of one object and within a pixel's width.
        if self.sample.surface.instance != other.surface.instance {
            return false;
        }
        if self.sample.surface.is_background() {
            return true;
        }
        let between = other.position - self.sample.position;
        let off = between.dot(self.normal).abs();
        // Nearly all are within the first.
        off <= self.step || {
            let step = self.step.max(STEP * self.view.pixel_width(other.position));
            off <= step || between.dot(other.normal.get()).abs() <= step
        }
    }
}

/// True where two samples lie on one surface: of one instance, with no step between them that is larger than the side of a pixel there.
pub fn is_one_surface(a: &SurfaceSample, b: &SurfaceSample, view: &Projector) -> bool {
    Tangent::new(*a, view).reaches(b)
}

/// True where two samples look nearly the same way.
pub(super) fn is_facing_alike(a: &SurfaceSample, b: &SurfaceSample) -> bool {
    a.surface.is_background() || a.normal.get().dot(b.normal.get()) > SAME_FACING
}
