//! Past the paper: samples at the centres of their pixels.
//!
//! The half-pixel guarantee lets a reused sample lie anywhere inside its pixel. Passed on from frame to frame such
//! samples drift into a random pattern: pixels are missed that nothing new has come into, and edges turn rough. Here
//! every pixel gets the sample that the ray through its centre would return:
//!
//! - Where every sample of the neighbourhood landed on its centre nothing moves, and the sample is kept as it is.
//! - Within a surface, where the whole neighbourhood shows it without a step, the centre ray is intersected with the
//!   triangles that the neighbourhood names, and with nothing else: no ray is cast into the scene. A pixel on which
//!   nothing landed is filled in the same way.
//! - So it is inside the outline of what is nearest around, where the four old pixels between which the centre's point was
//!   ([`Cell`](super::cell::Cell)) all show that; and behind it, where the cells that came with what is nearer do not.
//! - Everywhere else a ray is cast, so that an edge moves even if it moves by less than half a pixel a frame. What rays meet
//!   that nothing around knew of is [followed](super::outlines).
//!
//! Shadow bits are settled light by light. The points around on the same surface say whether a light reaches it here: where
//! they agree they are believed; where they do not, the shadow's edge is near and a ray is cast to that light alone, but for
//! every other pixel whose cell agrees. The bits around a wrong bit disagree with it, so an error does not live on while anything moves. Shares
//! of lights that have a size are carried along with the surface ([`carry`]); where they change fast from point to point,
//! a few rays renew them.

use super::alike::{Alike, AlikeRow};
use super::around::{Around, ENOUGH_TO_FILL, Trust, believes_cells};
use super::basis::Basis;
use super::buzz_buffer::{BuzzBuffer, Row, UNKNOWN};
use super::cast::Pass;
use super::entering::KnownArea;
use super::frontier::Frontier;
use super::marks::Marks;
use super::moved::Askers;
use super::outlines::Outlines;
use super::project::Landings;
use super::projector::Projector;
use super::questions::{LightQuestions, Questions};
use super::rays::CastCentres;
use super::shadow_edges::ShadowEdges;
use super::shafts::Shafts;
use super::shares::{carry, spare};
use super::sources::Sources;
use super::tiles::Tiles;
use crate::frame::{PixelClass, RayCounts, SurfaceSample};
use rayon::prelude::*;

/// What re-centring holds between frames, so that nothing is allocated for each.
#[derive(Debug, Default)]
pub struct Centring {
    sources: Sources,
    questions: LightQuestions,
    tiles: Tiles,
    frontier: Frontier,
    outlines: Outlines,
    shadow_edges: ShadowEdges,
}

impl Centring {
    /// The most that it holds for each pixel with so many words of shadow bits: its source, the lights to ask and
    /// those in doubt, which tiles are proven, and what following outlines and shadows' edges takes.
    pub fn bytes_per_pixel(words: usize) -> usize {
        Sources::bytes_per_pixel(words)
            + LightQuestions::bytes_per_pixel(words)
            + Tiles::BYTES_PER_PIXEL
            + Frontier::BYTES_PER_PIXEL
            + Outlines::BYTES_PER_PIXEL
            + ShadowEdges::bytes_per_pixel(words)
    }

    /// Centres what can be centred without a ray. All other pixels are left unknown; their class says why.
    pub fn recentre<R: CastCentres>(
        &mut self,
        old: &BuzzBuffer,
        (landings, marks): (&Landings, &Marks),
        view: &Projector,
        rays: &R,
        trust: Trust,
        new: &mut BuzzBuffer,
    ) {
        self.sources.settle(old, landings, marks);
        new.side = view.side();
        self.questions.fit(old);
        let basis = Basis { old, sources: &self.sources, view, rays, trust };
        let rows = new.rows_mut().zip(self.questions.bands_mut(1));
        rows.enumerate().for_each(|(y, (mut row, mut questions))| {
            questions.ask.fill(0);
            questions.doubt.fill(if rays.has_shares() { u32::MAX } else { 0 });
            let mut memory = R::Memory::default();
            let mut alike = AlikeRow::new(basis, y);
            for x in 0..row.object.len() {
                let pixel = y * row.object.len() + x;
                let questions = questions.at(x);
                let own = basis.sources.of(pixel);
                row.object[x] = UNKNOWN;
                row.class[x] = match (own, marks.get(pixel)) {
                    (None, Some(PixelClass::Entering)) => PixelClass::Entering,
                    (None, _) => PixelClass::Missed,
                    (_, mark) => mark.unwrap_or(PixelClass::Good),
                };
                // Within a triangle that is lit alike all around there is no more to find out.
                let centred = if let Some(alike) = alike.at(x, &mut memory)
                    && (own.is_some() || !basis.is_gap((x, y), alike.source))
                {
                    basis.take((x, y), alike, &mut row, questions.ask)
                } else if basis.sources.is_suspect(pixel) {
                    continue;
                } else {
                    basis.centre((x, y), &mut row, questions, &mut memory)
                };
                row.class[x] = match (own, centred) {
                    (None, Some(())) => PixelClass::Filled,
                    (Some(_), None) => PixelClass::Edge,
                    _ => row.class[x],
                };
            }
        });
    }

    /// Casts the rays that are still wanted: to see what pixels show, and to the lights that may reach it. `moves` says
    /// whether the camera does, `known` where nothing can have come in before what has stayed.
    pub(super) fn cast(
        &mut self,
        (old, shafts): (&BuzzBuffer, &mut Shafts),
        (view, moves, known): (&Projector, bool, Option<KnownArea<'_>>),
        rays: &impl CastCentres,
        trust: Trust,
        new: &mut BuzzBuffer,
    ) -> RayCounts {
        let askers = rays.motion().map(|motion| Askers::new(motion, new, shafts));
        self.tiles.clear();
        if trust == Trust::Proof {
            let at = |x: usize, y: usize| new.sample(y * new.width() + x);
            self.tiles.look(new, |pixels| rays.sees_all(pixels, at));
        }
        let basis = Basis { old, sources: &self.sources, view, rays, trust };
        let pass = Pass::new(basis, &self.tiles, (moves, known), askers);
        let (frontier, questions) = (&mut self.frontier, &mut self.questions);
        let mut counts = pass.cast(new, questions);
        // Where everything is proven nothing new is met beside it.
        if trust == Trust::Neighbours {
            counts += self.outlines.follow(frontier, &pass, new, questions);
        }
        counts += self.shadow_edges.follow(frontier, new, view, questions, rays);
        counts
    }
}

impl<R: CastCentres> Basis<'_, R> {
    /// Stores what is at the centre of a pixel around which all is alike, if anything is.
    #[inline]
    fn take(&self, pixel: (usize, usize), alike: Alike, row: &mut Row<'_>, ask: &mut [u32]) -> Option<()> {
        let (x, sample) = (pixel.0, alike.centre?);
        self.reuse(x, alike.source, &sample, row);
        if !alike.same {
            carry((self.old, alike.source), self.view, pixel, &sample, self.rays, (row.lit_mut(x), ask));
            spare(pixel, self.trust, self.rays, ask);
        }
        Some(())
    }

    /// Finds and stores what is at the centre of a pixel among the surfaces around it, if that is certain, and sets the bits of the
    /// lights to ask there, and of those in doubt.
    fn centre(
        &self,
        (x, y): (usize, usize),
        row: &mut Row<'_>,
        questions: Questions<'_>,
        memory: &mut R::Memory,
    ) -> Option<()> {
        let pixel = y * self.old.width() + x;
        let own = self.sources.of(pixel);
        let around = Around::new(self.old, self.view, self.sources, (x, y), 1);
        if let Some(i) = own
            && around.stands_still()
        {
            self.reuse(x, i, &self.old.sample(i), row);
            return Some(());
        }
        let is_enough = |&i: &usize| around.known().count() >= ENOUGH_TO_FILL && !self.is_gap((x, y), i);
        let i = own.or_else(|| around.known().next().filter(is_enough))?;
        let candidates = around.surface_of(i, self.trust, |k| self.body_of(k))?;
        let candidates = candidates.iter().map(|k| self.old.sample(k));
        let sample = self.rays.nearest_of(x, y, candidates, memory)?;
        self.reuse(x, i, &sample, row);
        // Where it is the very sample that landed here, its lights are known.
        if !self.sources.is_centred(pixel) && !around.is_lit_alike() {
            self.light((x, y), (i, &sample), around, row, questions);
        }
        Some(())
    }

    /// The body that carries an old sample, if it has moved.
    fn body_of(&self, i: usize) -> Option<usize> {
        self.rays.motion()?.body_of(&self.old.sample(i))
    }

    /// True if a pixel on which nothing landed, and beside which old sample `i` did, is between things that have moved apart: of either
    /// more may be seen than before.
    fn is_gap(&self, pixel: (usize, usize), i: usize) -> bool {
        self.rays.motion().is_some() && {
            let body = self.body_of(i);
            let around = Around::new(self.old, self.view, self.sources, pixel, 2);
            around.known().any(|k| self.body_of(k) != body)
        }
    }

    /// Settles which lights reach `sample`, at the centre of a pixel on the surface of old sample `i`, as far as the samples around
    /// agree; sets the bits of those to ask, and of those in doubt.
    fn light(
        &self,
        (x, y): (usize, usize),
        (i, sample): (usize, &SurfaceSample),
        around: Around<'_>,
        row: &mut Row<'_>,
        Questions { ask, doubt, .. }: Questions<'_>,
    ) {
        let Self { old, sources, view, rays, trust } = *self;
        // On a chess board: what is wrong here is asked beside it.
        let is_believed = (x + y) % 2 == 0 && believes_cells(trust, rays);
        match is_believed.then(|| around.cell(i)).flatten() {
            Some(cell) => cell.lend(old, rays, row.lit_mut(x), ask),
            None => {
                doubt.fill(u32::MAX);
                // A hole may hide a shadow's edge: then look farther.
                let wide = || Around::new(old, view, sources, (x, y), 2);
                let around = if around.is_complete() { around } else { wide() };
                around.disagreement(i, rays, trust, ask);
            }
        }
        if rays.has_shares() {
            rays.soften(ask);
            carry((old, i), view, (x, y), sample, rays, (row.lit_mut(x), ask));
            spare((x, y), trust, rays, ask);
        }
    }

    /// Stores a sample with the shadow bits of old sample `i`.
    #[inline]
    fn reuse(&self, x: usize, i: usize, sample: &SurfaceSample, row: &mut Row<'_>) {
        row.put(x, self.view, sample);
        row.put_lit(x, self.old.lit(i));
    }
}
