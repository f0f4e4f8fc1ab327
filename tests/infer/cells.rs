//! What the four old pixels around a point say: the inside of an outline, and the side of a shadow's edge.

use crate::stage::{CARD, SIDE, Stage, WALL, infer};
use buzz::frame::{PixelClass, RayCounts};
use buzz::infer::CastCentres;

#[test]
fn the_inside_of_an_outline_is_not_cast_and_what_it_may_have_come_over_is() {
    // The last column of the card is the fifth, number 4. From the left the card moves right, over the wall; from
    // the right it goes away, and what would have come with it was wall.
    let stage = Stage { card_ends: 0.0, light_ends: f64::INFINITY, strip: f64::NAN };
    for (x, card, wall) in
        [(-0.3, PixelClass::Good, PixelClass::Edge), (0.3, PixelClass::Edge, PixelClass::Good)]
    {
        let (new, _) = infer(&stage, x);
        for y in 2..8 {
            let class = |x: usize| new.class[y * SIDE as usize + x];
            assert_eq!([class(3), class(4), class(5)], [PixelClass::Good, card, wall], "from {x}, row {y}");
            assert_eq!(new.object[y * SIDE as usize + 4], CARD.0);
        }
    }
}

#[test]
fn an_outline_that_passes_a_centre_is_met() {
    // The card has gone from the fifth column, and has come to the sixth.
    for (x, seen) in [(0.8, [CARD.0, WALL.0, WALL.0]), (-0.8, [CARD.0, CARD.0, CARD.0])] {
        let (new, eye) = infer(&Stage { card_ends: 0.0, light_ends: f64::INFINITY, strip: f64::NAN }, x);
        for y in 2..8 {
            let object = |x: usize| new.object[y * SIDE as usize + x];
            assert_eq!([object(3), object(4), object(5)], seen, "from {x}, row {y}");
            let truth = |x: usize| eye.hit(x, y, &mut RayCounts::default()).object;
            assert_eq!([truth(3), truth(4), truth(5)], seen);
        }
    }
}

#[test]
fn the_light_is_asked_for_only_beside_a_shadows_edge() {
    // All is card; the light ends in the middle of it, and the card moves by 0.3 pixels.
    let stage = Stage { card_ends: f64::INFINITY, light_ends: 0.0, strip: f64::NAN };
    // The edge was between the old columns 4 and 5; whose centre is between them now asks, whichever side it carries.
    for (x, straddles) in [(-0.3, 5), (0.3, 4)] {
        let (new, eye) = infer(&stage, x);
        let asked = eye.asked.lock().unwrap();
        for y in 2..8usize {
            for x in 2..8usize {
                let i = y * SIDE as usize + x;
                assert_eq!(new.class[i], PixelClass::Good);
                assert_eq!(new.lit(i)[0] == 1, eye.is_lit(&new.sample(i)), "({x}, {y})");
                let asks = asked.contains(&(x, y));
                assert!(asks || x != straddles, "({x}, {y})");
                assert!(!asks || x == 4 || x == 5, "({x}, {y})");
            }
        }
    }
}

#[test]
fn a_pixel_that_is_cast_takes_the_light_of_the_cell_that_it_was_in() {
    let stage = Stage { card_ends: 0.0, light_ends: f64::INFINITY, strip: f64::NAN };
    let (new, eye) = infer(&stage, -0.3);
    let asked = eye.asked.lock().unwrap();
    for y in 2..8usize {
        // Beyond the outline, where the card might have come to: but what is seen is the wall, as in all of its cell.
        let i = y * SIDE as usize + 5;
        assert_eq!((new.class[i], new.object[i], new.lit(i)[0]), (PixelClass::Edge, WALL.0, 1));
        assert!(!asked.contains(&(5, y)));
    }
}

#[test]
fn light_on_what_is_before_or_behind_it_makes_no_pixel_ask() {
    // The card is lit and the wall is not, each as far as it is seen: where the light ends is hidden.
    let stage = Stage { card_ends: 0.0, light_ends: 0.0, strip: f64::NAN };
    for (x, beside) in [(-0.3, 4), (0.3, 5)] {
        let (new, eye) = infer(&stage, x);
        let asked = eye.asked.lock().unwrap();
        for y in 2..8usize {
            assert_eq!(new.class[y * SIDE as usize + beside], PixelClass::Good);
            assert!(!asked.contains(&(beside, y)), "from {x}, row {y}");
            let lit = |x: usize| new.lit(y * SIDE as usize + x)[0];
            assert_eq!([lit(3), lit(6)], [1, 0]);
        }
    }
}
