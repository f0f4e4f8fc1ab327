//! What pixels show on which nothing landed, and how that is lit, from pixels of their row that were cast before them.
//!
//! Where much comes into view at once, as in a whip pan, no old sample says anything, and all of it would be cast and ask every
//! light. But most of it is surfaces that reach over many pixels and are lit alike. So one pixel in [`STEP`] of a row is cast and
//! asks, then the one in the middle between two of these, then those between: they are cast only where these two do not show one
//! surface, and ask only about what they do not agree on.
//!
//! At an outline what comes into view is a pixel or two wide, and beside it in its row is something else. So rows come in pairs:
//! in the second, a pixel that is cast takes the light of the one above it, if that was cast and shows the same surface.
//!
//! A pixel is filled so only if nothing landed around it either: elsewhere an outline is near. What is too narrow for one row is
//! met in another, whose steps begin elsewhere, and from there [followed](super::outlines).
//!
//! Light that has changed on what is reused is shared in the same steps ([`Changed`]): on what moves, where a light has moved, and
//! where something moved before one.

use super::around::Tangent;
use super::buzz_buffer::{Row, UNKNOWN};
use super::projector::Projector;
use super::rays::CastCentres;
use crate::frame::SurfaceSample;

/// One pixel of a row in so many is cast and asks for itself.
const STEP: usize = 8;

/// What a pixel's own share weighs against that of one beside it which has asked anew, and what those that landed above and below it do.
/// What they know is the mean of many frames, so that it has less noise, and does not draw that of a row out along it; but where it
/// has changed it has to follow in a few frames.
const OLD_WEIGHT: f32 = 1.0 / 3.0;

/// The columns of a step, counted back from its end: the one in the middle, those in the middle of its halves, and the rest.
const BACK: [usize; STEP] = [0, 4, 6, 2, 7, 5, 3, 1];

/// The steps in which the pixels of a row come.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps {
    /// Columns before the first one that belong to its step.
    phase: usize,
}

impl Steps {
    /// Those of row `y`, which begin as if by chance.
    pub fn of(y: usize) -> Self {
        let mixed = (y as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Self { phase: (mixed >> 40) as usize % STEP }
    }

    /// Visits the columns of a row so wide, each after those between which it lies.
    pub fn columns(self, width: usize, mut visit: impl FnMut(usize)) {
        for end in (0..width + self.phase + STEP).step_by(STEP) {
            for back in BACK {
                // Columns before the first one wrap around and are beyond the last.
                let x = end.wrapping_sub(back + self.phase);
                if x < width {
                    visit(x);
                }
            }
        }
    }

    /// How far to the left and to the right of column `x` the pixels are between which it lies; none for one that is cast and
    /// asks for itself.
    fn reach(self, x: usize) -> Option<usize> {
        let reach = 1 << (x + self.phase).trailing_zeros().min(STEP.trailing_zeros());
        (reach < STEP).then_some(reach)
    }
}

/// What the ray through pixel (x, y) meets, if the two of its `row` between which it lies show one surface of one instance; no
/// ray is cast for it.
pub(super) fn fill<R: CastCentres>(
    row: &Row<'_>,
    (x, y): (usize, usize),
    steps: Steps,
    view: &Projector,
    rays: &R,
    memory: &mut R::Memory,
) -> Option<SurfaceSample> {
    let reach = steps.reach(x)?;
    let is_known = |x: &usize| *x < row.object.len() && row.object[*x] != UNKNOWN;
    let known = |x: Option<usize>| x.filter(is_known).map(|x| row.sample(x));
    let (left, right) = (known(x.checked_sub(reach))?, known(Some(x + reach))?);
    let is_one = Tangent::new(left, view).is_one_thing_with(&right);
    is_one.then(|| rays.nearest_of(x, y, [left, right].into_iter(), memory))?
}

/// Takes over into column `x` of `row`, where a ray has met `sample`, what is known of light in the pixel `above` it, if that was
/// cast and lies on its surface; else what the pixels between which it lies know, if both lie on its surface; for shares one will
/// do. In `ask` only the bits of lights on which they disagree are left, and of shares to be confirmed.
pub(super) fn lend(
    (row, above): (&mut Row<'_>, Option<&Row<'_>>),
    x: usize,
    steps: Steps,
    view: &Projector,
    sample: &SurfaceSample,
    rays: &impl CastCentres,
    ask: &mut [u32],
) {
    let tangent = Tangent::new(*sample, view);
    if let Some(above) = above
        && !above.class[x].is_reused()
        && tangent.may_lend(&above.sample(x))
    {
        row.put_lit(x, above.lit(x));
        ask.fill(0);
        if rays.has_shares() {
            rays.confirm(ask);
        }
        return;
    }
    let Some((reach, known)) = beside(row, x, steps, &tangent) else { return };
    let (left, own, right) = bits_beside(row, x, reach);
    let (first, second) = match known {
        (true, true) => (left, right),
        // A share on one side of it may change from there; a few rays will tell.
        (true, false) if rays.has_shares() => (left, left),
        (false, true) if rays.has_shares() => (right, right),
        _ => return,
    };
    ask.fill(0);
    rays.differ(first, second, ask);
    own.copy_from_slice(first);
    rays.blend([(first, 1.0), (second, 1.0)].into_iter(), own);
    // Between two pixels that asked there may be what neither of them sees.
    if rays.has_shares() && (reach > 1 || known != (true, true)) {
        rays.confirm(ask);
    }
}

/// How far it is to the pixels between which column `x` lies, and which of the two lie on the surface of that tangent plane.
fn beside(row: &Row<'_>, x: usize, steps: Steps, tangent: &Tangent<'_>) -> Option<(usize, (bool, bool))> {
    let reach = steps.reach(x)?;
    let lends = |other: usize| other < row.object.len() && tangent.may_lend(&row.sample(other));
    Some((reach, (x.checked_sub(reach).is_some_and(lends), lends(x + reach))))
}

/// The shadow bits so far to the left of column `x`, its own, and those as far to the right; none beyond the image.
fn bits_beside<'r>(row: &'r mut Row<'_>, x: usize, reach: usize) -> (&'r [u32], &'r mut [u32], &'r [u32]) {
    let words = row.lit_words;
    let (before, rest) = row.lit.split_at_mut(x * words);
    let (own, after) = rest.split_at_mut(words);
    let left = x.checked_sub(reach).map_or(&[][..], |left| &before[left * words..][..words]);
    let right = after.get((reach - 1) * words..reach * words).unwrap_or_default();
    (left, own, right)
}

/// The lights whose bits in a pixel may not hold any more, though it is reused; and room to find out.
#[derive(Default)]
pub(super) struct Changed {
    /// Their bits.
    pub bits: Vec<u32>,
    /// The bits on which the pixel and the two between which it lies agree.
    pub agreed: Vec<u32>,
    mean: Vec<u32>,
}

impl Changed {
    /// For so many words of shadow bits.
    pub fn new(words: usize) -> Self {
        let bits = || vec![0; words];
        Self { bits: bits(), agreed: bits(), mean: bits() }
    }

    /// Finds out on which lights column `x` of `row` agrees with the two pixels between which it lies, which have been asked: on
    /// none if either shows another surface. Shares are averaged with theirs, and with what was `known` above and below.
    pub fn compare<'o>(
        &mut self,
        row: &mut Row<'_>,
        x: usize,
        (steps, view): (Steps, &Projector),
        rays: &impl CastCentres,
        known: impl Fn(&Tangent<'_>) -> [Option<&'o [u32]>; 2],
    ) {
        self.agreed.fill(0);
        let tangent = Tangent::new(row.sample(x), view);
        let Some((reach, (true, true))) = beside(row, x, steps, &tangent) else { return };
        let (left, own, right) = bits_beside(row, x, reach);
        [left, right].into_iter().for_each(|other| rays.differ(own, other, &mut self.agreed));
        self.agreed.iter_mut().for_each(|bits| *bits = !*bits);
        self.mean.copy_from_slice(own);
        if rays.has_shares() {
            // Of what was known above and below nothing is taken that may have changed.
            let [above, below] =
                known(&tangent).map(|lit| lit.filter(|lit| rays.agree(own, lit)).unwrap_or(own));
            let old = [&*own, above, below].map(|lit| (lit, OLD_WEIGHT));
            let known = old.into_iter().chain([(left, 1.0), (right, 1.0)]);
            rays.blend(known, &mut self.mean);
        }
    }

    /// Settles in `lit` those of these lights on which there is agreement, so that only the others are left to be asked. They are in
    /// `doubt`: where all three are wrong, the edge of a shadow is near, and is [followed](super::shadow_edges) from where it is
    /// known. Returns whether anything is settled.
    pub fn settle(&mut self, lit: &mut [u32], doubt: &mut [u32]) -> bool {
        let known = self.mean.iter().zip(&self.agreed);
        let mut settled = 0;
        for (((lit, doubt), bits), (mean, agreed)) in lit.iter_mut().zip(doubt).zip(&mut self.bits).zip(known)
        {
            let agreed = *bits & agreed;
            *lit = *lit & !agreed | mean & agreed;
            *doubt |= agreed;
            *bits &= !agreed;
            settled |= agreed;
        }
        settled != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_column_comes_once_and_after_those_between_which_it_lies() {
        for (width, phase) in (1..40).flat_map(|width| (0..STEP).map(move |phase| (width, phase))) {
            let steps = Steps { phase };
            let mut order = Vec::new();
            steps.columns(width, |x| order.push(x));
            let place = |x: usize| order.iter().position(|&other| other == x);
            assert_eq!(order.len(), width);
            for x in 0..width {
                let own = place(x);
                assert!(own.is_some(), "{x} of {width} from {phase}");
                let beside =
                    steps.reach(x).map_or([Some(x); 2], |reach| [x.checked_sub(reach), Some(x + reach)]);
                let inside = beside.into_iter().flatten().filter(|&other| other < width);
                assert!(inside.into_iter().all(|other| place(other) <= own));
            }
        }
    }

    #[test]
    fn one_column_in_eight_lies_between_none() {
        let reaches = |phase: usize| (0..9).map(move |x| Steps { phase }.reach(x).unwrap_or(0));
        assert!(reaches(0).eq([0, 1, 2, 1, 4, 1, 2, 1, 0]));
        assert!(reaches(3).eq([1, 4, 1, 2, 1, 0, 1, 2, 1]));
    }

    #[test]
    fn rows_begin_anywhere_and_elsewhere_than_those_beside_them() {
        let phases: Vec<_> = (0..64).map(|y| Steps::of(y).phase).collect();
        for phase in 0..STEP {
            let count = phases.iter().filter(|&&other| other == phase).count();
            assert!((4..=12).contains(&count), "{count} of 64 begin {phase} columns before");
        }
        assert!(phases.windows(2).all(|two| two[0] != two[1]), "{phases:?}");
    }
}
