//! The rays that are left once samples are re-centred: to see what pixels show, to prove some of what is reused, and to the
//! lights that may have changed.

use super::around::{Around, Lent, Tangent, Trust, is_one_surface};
use super::basis::Basis;
use super::between::{self, Changed, Steps};
use super::buzz_buffer::{BuzzBuffer, Row, UNKNOWN, pixels_around};
use super::cell::growth;
use super::entering::KnownArea;
use super::moved::Askers;
use super::projector::Projector;
use super::questions::{LightQuestions, Questions};
use super::rays::CastCentres;
use super::shares::{carry, spare};
use super::tiles::Tiles;
use crate::frame::{PixelClass, RayCounts, SurfaceSample};
use rayon::prelude::*;
use std::ops::Range;

/// One pixel in so many, on either axis, is proven visible whatever is known about it, and asks all lights.
///
/// What was too small to be sampled when it was far away would never be met, however large it grows: nothing lands on it,
/// and all around it agree that it is not there. Here it is met sooner or later, and [followed](super::outlines) to its
/// outline.
const LOOKOUT: usize = 32;

/// The same where what is seen has grown so much that such things do, or does not say: where nothing landed, and in the
/// background.
const NEAR_LOOKOUT: usize = 16;

/// One pixel in so many at the sides of the image. What comes in there before what hardly moves, or goes out, as the sky does and
/// what a camera turns around, lands nowhere and leaves no pixel empty.
const SIDE_LOOKOUT: usize = 4;

/// The same on what has moved. Where it turns or folds, what comes before its own surface lies within the voxels that
/// the line to the eye begins in, and they say nothing.
const BODY_LOOKOUT: usize = 4;

/// The same of what has been filled in between pixels that were cast in the frame before, and of the contested area at the image's sides,
/// where what is nearer than what is behind it comes in farther than to the outermost pixels.
const NEW_LOOKOUT: usize = 8;

/// The growth in a frame, by coming nearer or by zooming, from which what is seen grows fast.
const FAST: f32 = 1.03;

/// One pixel in so many, on either axis, has its shares confirmed.
const RENEWED: usize = 16;

/// Pixels on a grid that stands elsewhere in each view, so that nothing stays between its points.
#[derive(Clone, Copy)]
struct Grid {
    first: (usize, usize),
}

impl Grid {
    fn of(view: &Projector) -> Self {
        let scattered = view.scatter() as usize;
        Self { first: (scattered % LOOKOUT, scattered / LOOKOUT % LOOKOUT) }
    }

    /// True at one pixel in `step` on either axis; a grid of half the step has all pixels of the whole one.
    fn has(self, (x, y): (usize, usize), step: usize) -> bool {
        x % step == self.first.0 % step && y % step == self.first.1 % step
    }

    /// True at one pixel in [`NEW_LOOKOUT`], so that three by three hold one.
    fn has_new(self, (x, y): (usize, usize)) -> bool {
        (x + 3 * y) % NEW_LOOKOUT == (self.first.0 + self.first.1) % NEW_LOOKOUT
    }

    /// True at one pixel in [`SIDE_LOOKOUT`] of each row and each column.
    fn has_side(self, (x, y): (usize, usize)) -> bool {
        (x + y) % SIDE_LOOKOUT == (self.first.0 + self.first.1) % SIDE_LOOKOUT
    }
}

/// What casting the rays of a frame goes by.
pub(super) struct Pass<'a, R> {
    pub basis: Basis<'a, R>,
    proven: &'a Tiles,
    /// Whether the camera moves.
    moves: bool,
    /// Where nothing can have come in before what has stayed; none where that is everywhere.
    known: Option<KnownArea<'a>>,
    grid: Grid,
    askers: Option<Askers<'a>>,
}

impl<'a, R: CastCentres> Pass<'a, R> {
    pub fn new(
        basis: Basis<'a, R>,
        proven: &'a Tiles,
        (moves, known): (bool, Option<KnownArea<'a>>),
        askers: Option<Askers<'a>>,
    ) -> Self {
        Self { basis, proven, moves, known, grid: Grid::of(basis.view), askers }
    }

    /// Casts what is wanted at all pixels.
    pub fn cast(&self, new: &mut BuzzBuffer, questions: &mut LightQuestions) -> RayCounts {
        self.by_rows(new, questions, |y, (row, above), questions, counts| {
            let (steps, mut memory) = (Steps::of(y), R::Memory::default());
            let mut changed = self.changed();
            let known = self.known.map_or(0..self.basis.old.width(), |known| known.columns(y));
            steps.columns(row.object.len(), |x| {
                if row.object[x] != UNKNOWN && self.wants_proof((x, y), row, &known) {
                    self.forget_if_hidden(x, row, counts);
                }
                if row.object[x] == UNKNOWN {
                    let found = self.fill((x, y), row, steps, &mut memory);
                    self.see((x, y), (row, above), found, questions.at(x), counts);
                } else if self.basis.trust == Trust::Neighbours && self.looks_out((x, y), row) {
                    // Light and shadows that were too small to be met grow as surfaces do.
                    self.basis.rays.confirm(questions.at(x).ask);
                }
                self.ask((x, y), row, questions.at(x), &mut changed, counts);
            });
        })
    }

    /// Proves the samples of `pixels`, which are in order, visible, and casts those that are hidden, or were only filled in between
    /// others.
    pub fn prove(&self, new: &mut BuzzBuffer, pixels: &[u32], questions: &mut LightQuestions) -> RayCounts {
        let width = self.basis.old.width();
        self.by_rows(new, questions, |y, (row, above), questions, counts| {
            let mut changed = self.changed();
            let first = pixels.partition_point(|&pixel| (pixel as usize) < y * width);
            let columns = pixels[first..].iter().map(|&pixel| pixel as usize - y * width);
            for x in columns.take_while(|&x| x < width) {
                if self.is_new(y * width + x) {
                    row.class[x] = PixelClass::Missed;
                    row.object[x] = UNKNOWN;
                } else {
                    self.forget_if_hidden(x, row, counts);
                }
                if row.object[x] == UNKNOWN {
                    self.see((x, y), (row, above), None, questions.at(x), counts);
                    self.ask((x, y), row, questions.at(x), &mut changed, counts);
                }
            }
        })
    }

    /// Calls `cast_row` for each row, two by two and in parallel; of the second of two, with what the first has become.
    fn by_rows(
        &self,
        new: &mut BuzzBuffer,
        questions: &mut LightQuestions,
        cast_row: impl Fn(usize, (&mut Row<'_>, Option<&Row<'_>>), &mut Questions<'_>, &mut RayCounts) + Sync,
    ) -> RayCounts {
        let width = self.basis.old.width();
        let pairs = new.bands_mut(2).zip(questions.bands_mut(2));
        let cast_pair = |(number, (rows, questions)): (usize, (Row<'_>, Questions<'_>))| {
            let mut counts = RayCounts::default();
            if self.basis.rays.is_cancelled() {
                return counts;
            }
            let [mut first, mut second] = rows.split_at(width);
            let [mut asked_first, mut asked_second] = questions.split_at(width);
            cast_row(2 * number, (&mut first, None), &mut asked_first, &mut counts);
            // An odd number of rows leaves one alone.
            if !second.object.is_empty() {
                let above = Some(&first);
                cast_row(2 * number + 1, (&mut second, above), &mut asked_second, &mut counts);
            }
            counts
        };
        pairs.enumerate().map(cast_pair).sum()
    }

    /// True where nothing around is believed, as something may have grown there that was too small to be met.
    fn looks_out(&self, (x, y): (usize, usize), row: &Row<'_>) -> bool {
        let has_grown = |i: usize| {
            FAST * growth(self.basis.old, self.basis.view, i, row.z[x]) < 1.0
                || self.basis.old.z[i].is_infinite()
        };
        let grows = || self.basis.sources.of(y * self.basis.old.width() + x).is_none_or(has_grown);
        let has = |step: usize| self.grid.has((x, y), step);
        self.moves && has(NEAR_LOOKOUT) && (has(LOOKOUT) || grows())
    }

    /// True where what is reused is proven visible whatever is known around it; `known` are the columns in which nothing has come in.
    fn wants_proof(&self, (x, y): (usize, usize), row: &Row<'_>, known: &Range<usize>) -> bool {
        let is_at_side =
            || x == 0 || y == 0 || x + 1 == self.basis.old.width() || y + 1 == self.basis.old.height();
        let comes_in = || self.moves && is_at_side() && self.grid.has_side((x, y));
        let is_new = || {
            self.grid.has_new((x, y)) && (!known.contains(&x) || self.was_new(y * self.basis.old.width() + x))
        };
        let is_body = || self.askers.as_ref().is_some_and(|askers| askers.is_on_body(&row.sample(x)));
        match self.basis.trust {
            Trust::Proof => !self.proven.has((x, y)),
            Trust::Neighbours => {
                self.looks_out((x, y), row)
                    || comes_in()
                    || is_new()
                    || self.grid.has((x, y), BODY_LOOKOUT) && is_body()
            }
        }
    }

    /// True if nothing landed on a pixel, nor on any around it.
    pub fn is_new(&self, pixel: usize) -> bool {
        let width = self.basis.old.width();
        self.basis.sources.is_nothing_around(width, (pixel % width, pixel / width))
    }

    /// True if what has landed on a pixel was new in the old view, and no ray was cast for it.
    fn was_new(&self, pixel: usize) -> bool {
        let (width, height, class) = (self.basis.old.width(), self.basis.old.height(), &self.basis.old.class);
        let is_new = |&i: &usize| class[i] == PixelClass::Filled || !class[i].is_reused();
        self.basis.sources.of(pixel).is_some_and(|i| {
            class[i] == PixelClass::Filled && pixels_around(width, height, i).all(|around| is_new(&around))
        })
    }

    /// What an unknown pixel shows that has come into view with all around it, where its row says so.
    fn fill(
        &self,
        (x, y): (usize, usize),
        row: &mut Row<'_>,
        steps: Steps,
        memory: &mut R::Memory,
    ) -> Option<SurfaceSample> {
        let is_new = self.basis.trust == Trust::Neighbours && self.is_new(y * row.object.len() + x);
        let found = is_new
            .then(|| between::fill(row, (x, y), steps, self.basis.view, self.basis.rays, memory))
            .flatten()?;
        row.class[x] = PixelClass::Filled;
        Some(found)
    }

    /// Makes the sample of column `x` unknown if something hides it.
    fn forget_if_hidden(&self, x: usize, row: &mut Row<'_>, counts: &mut RayCounts) {
        if self.basis.rays.is_hidden(&row.sample(x), counts) {
            row.class[x] = PixelClass::Bad;
            row.object[x] = UNKNOWN;
        }
    }

    /// Casts a pixel that is unknown, unless what it shows is `found` already, and finds out what is known around it of its lights.
    fn see(
        &self,
        (x, y): (usize, usize),
        (row, above): (&mut Row<'_>, Option<&Row<'_>>),
        found: Option<SurfaceSample>,
        Questions { ask, doubt, .. }: Questions<'_>,
        counts: &mut RayCounts,
    ) {
        let Basis { old, sources, view, rays, trust } = self.basis;
        let sample = found.unwrap_or_else(|| rays.hit(x, y, counts));
        row.put(x, view, &sample);
        row.lit_mut(x).fill(0);
        ask.fill(u32::MAX);
        let own = sources.of(y * old.width() + x);
        let certain = own.filter(|&i| is_one_surface(&sample, &old.sample(i), view));
        // What comes in here may be a shadow, and half of what is around is outside of the image.
        let enters = row.class[x] == PixelClass::Entering;
        let mut lent = Lent::Nothing;
        if found.is_none()
            && !enters
            && (certain.is_some() || rays.has_shares() || trust == Trust::Neighbours)
        {
            let around = Around::new(old, view, sources, (x, y), 2);
            lent = around.lend(&sample, rays, (trust, certain.is_some()), row.lit_mut(x), ask);
            if let Some(i) = certain
                && rays.has_shares()
            {
                carry((old, i), view, (x, y), &sample, rays, (row.lit_mut(x), ask));
            }
        }
        // What only lies around a pixel on which nothing landed is asked anew, but for shares, which a few rays confirm.
        let is_poor = if rays.has_shares() { lent == Lent::Nothing } else { lent != Lent::Cell };
        if !enters && certain.is_none() && is_poor && trust == Trust::Neighbours {
            between::lend((row, above), x, Steps::of(y), view, &sample, rays, ask);
        } else if lent != Lent::Nothing {
            spare((x, y), trust, rays, ask);
        }
        doubt.fill(if lent == Lent::Cell { 0 } else { u32::MAX });
    }

    /// The shadow bits that landed above and below a pixel, where they lie on its surface.
    fn known_above_and_below(&self, (x, y): (usize, usize), tangent: &Tangent<'_>) -> [Option<&'a [u32]>; 2] {
        let landed = |y: usize| self.basis.sources.of(y * self.basis.old.width() + x);
        let lends = |&i: &usize| tangent.may_lend(&self.basis.old.sample(i));
        [y.checked_sub(1), Some(y + 1).filter(|&y| y < self.basis.old.height())]
            .map(|y| y.and_then(landed).filter(lends).map(|i| self.basis.old.lit(i)))
    }

    /// Room for the lights that may have changed, where any may.
    fn changed(&self) -> Changed {
        if self.askers.is_some() { Changed::new(self.basis.old.lit_words()) } else { Changed::default() }
    }

    /// Asks the lights that have to be asked.
    fn ask(
        &self,
        (x, y): (usize, usize),
        row: &mut Row<'_>,
        Questions { ask, doubt, .. }: Questions<'_>,
        changed: &mut Changed,
        counts: &mut RayCounts,
    ) {
        let rays = self.basis.rays;
        if self.moves && rays.has_shares() && self.grid.has((x, y), RENEWED) {
            rays.confirm(ask);
        }
        // Its lights were asked when it was cast in an earlier frame, or since.
        let is_kept =
            row.class[x].is_reused() && self.basis.sources.is_centred(y * self.basis.old.width() + x);
        let mut settled = is_kept && ask.iter().all(|&bits| bits == 0);
        let believed = doubt.iter().all(|&bits| bits == 0);
        let pixel = y * row.object.len() + x;
        if let Some(askers) = &self.askers
            && !askers.are_quiet(pixel, &row.sample(x))
        {
            changed.bits.copy_from_slice(ask);
            if self.basis.trust == Trust::Neighbours {
                let known = |tangent: &Tangent<'_>| self.known_above_and_below((x, y), tangent);
                changed.compare(row, x, (Steps::of(y), self.basis.view), rays, known);
            }
            askers.ask(pixel, &row.sample(x), (row.lit(x), &changed.agreed), &mut changed.bits);
            changed.bits.iter_mut().zip(&*ask).for_each(|(bits, asked)| *bits &= !asked);
            settled &= !changed.settle(row.lit_mut(x), doubt);
            ask.iter_mut().zip(&changed.bits).for_each(|(ask, bits)| *ask |= bits);
        }
        if ask.iter().any(|&bits| bits != 0) {
            let (sample, lit) = (row.sample(x), row.lit_mut(x));
            // Where what is found is not what was carried, that is in doubt around here too.
            let mut note = |lit: &[u32]| doubt.iter_mut().zip(lit).for_each(|(doubt, lit)| *doubt ^= lit);
            if believed {
                note(lit);
            }
            rays.recast(&sample, ask, lit, counts);
            if believed {
                note(lit);
            }
            rays.settle(ask);
        }
        if settled {
            ask.fill(u32::MAX);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Lens, Projection, View};
    use glam::{DVec2, DVec3};
    use std::collections::HashSet;

    fn grid(eye_x: f64) -> Grid {
        let lens = Lens {
            projection: Projection::Perspective { yfov: 0.7 },
            shift: DVec2::ZERO,
            near: 0.1,
            far: f64::INFINITY,
            sensor_height: None,
        };
        let (eye, right, up, forward) = (DVec3::X * eye_x, DVec3::X, DVec3::Y, DVec3::NEG_Z);
        let view = View { eye, right, up, forward, lens, width: 64, height: 48, pixel_aspect: 1.0 };
        Grid::of(&Projector::new(&view, DVec3::ZERO))
    }

    #[test]
    fn lookouts_stand_elsewhere_in_each_view() {
        let places: HashSet<_> = (0..1600).map(|i| grid(0.001 * f64::from(i)).first).collect();
        // Of 1024 places, 1600 draws leave one in five.
        assert!(places.len() > 720, "{}", places.len());
    }

    #[test]
    fn the_denser_grid_has_the_places_of_the_other() {
        for i in 0..20 {
            let grid = grid(f64::from(i));
            let count = |step| {
                let pixels = (0..64).flat_map(|x| (0..64).map(move |y| (x, y)));
                pixels.filter(|&pixel| grid.has(pixel, step)).count()
            };
            let one_in = |step: usize| 64 * 64 / (step * step);
            assert_eq!((count(LOOKOUT), count(NEAR_LOOKOUT)), (one_in(LOOKOUT), one_in(NEAR_LOOKOUT)));
            let both = |x, y| !grid.has((x, y), LOOKOUT) || grid.has((x, y), NEAR_LOOKOUT);
            assert!((0..64).all(|x| (0..64).all(|y| both(x, y))));
        }
    }
}
