//! The light of pixels on which nothing landed, from pixels of their row that were cast before them.
//!
//! Where much comes into view at once, as in a whip pan, no old sample says how it is lit, and all of it would ask every light.
//! But what is cast there is of surfaces that are lit alike over many pixels. So one pixel in [`STEP`] of a row asks, then the
//! one in the middle between two of these, then those between: each only about what its two neighbours do not agree on.

use super::around::Tangent;
use super::buzz_buffer::{Projector, Row};
use super::centre::CastCentres;
use crate::frame::SurfaceSample;

/// One pixel of a row in so many asks for itself.
const STEP: usize = 4;

/// The columns of a row, each after those between which it lies.
pub(super) fn columns(width: usize) -> impl Iterator<Item = usize> {
    let stop = |stop: usize| [Some(stop), stop.checked_sub(2), stop.checked_sub(3), stop.checked_sub(1)];
    (0..width + STEP).step_by(STEP).flat_map(stop).flatten().filter(move |&x| x < width)
}

/// How far to the left and to the right of column `x` the pixels are between which it lies; none for one that asks for itself.
fn reach(x: usize) -> Option<usize> {
    let reach = 1 << x.trailing_zeros().min(STEP.trailing_zeros());
    (reach < STEP).then_some(reach)
}

/// Takes over into column `x` of `row`, where a ray has met `sample`, what the pixels between which it lies know of light, if
/// both lie on its surface; for shares one will do. In `ask` only the bits of lights on which they disagree are left, and of
/// shares to be confirmed.
pub(super) fn lend(
    row: &mut Row<'_>,
    x: usize,
    view: &Projector,
    sample: &SurfaceSample,
    rays: &impl CastCentres,
    ask: &mut [u32],
) {
    let Some(reach) = reach(x) else { return };
    let tangent = Tangent::new(*sample, view);
    let lends = |other: usize| other < row.object.len() && tangent.may_lend(&row.sample(other));
    let known = (x.checked_sub(reach).is_some_and(lends), lends(x + reach));
    let words = row.lit_words;
    let own = x * words..(x + 1) * words;
    let (before, rest) = row.lit.split_at_mut(own.start);
    let (own, after) = rest.split_at_mut(words);
    let left = || &before[(x - reach) * words..][..words];
    let right = || &after[(reach - 1) * words..][..words];
    let (first, second) = match known {
        (true, true) => (left(), right()),
        // A share on one side of it may change from there; a few rays will tell.
        (true, false) if rays.has_shares() => (left(), left()),
        (false, true) if rays.has_shares() => (right(), right()),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_column_comes_once_and_after_those_between_which_it_lies() {
        for width in 1..40 {
            let order: Vec<_> = columns(width).collect();
            let place = |x: usize| order.iter().position(|&other| other == x);
            assert_eq!(order.len(), width);
            for x in 0..width {
                let own = place(x);
                assert!(own.is_some(), "{x} of {width}");
                let beside = reach(x).map_or([x, x], |reach| [x - reach, x + reach]);
                assert!(beside.into_iter().filter(|&other| other < width).all(|other| place(other) <= own));
            }
        }
    }

    #[test]
    fn one_column_in_four_lies_between_none() {
        let reaches: Vec<_> = (0..9).map(|x| reach(x).unwrap_or(0)).collect();
        assert_eq!(reaches, [0, 1, 2, 1, 0, 1, 2, 1, 0]);
    }
}
