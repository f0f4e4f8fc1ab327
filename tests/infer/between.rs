//! Where nothing landed, some pixels are cast and ask for the light, and those between only where these do not agree.

use crate::stage::{SIDE, Stage, WALL, infer, infer_light};
use buzz::frame::PixelClass;
use buzz::infer::Trust;

/// Columns of which nothing was known, nor of what is around them, seen from 6 pixels to the right.
const NEW: std::ops::Range<usize> = 5..SIDE as usize;

/// For each row, the columns among the new ones that were cast, and those that asked for the light. All show what a ray would
/// meet, under the light that reaches it.
fn cast_and_asked(stage: &Stage) -> Vec<[Vec<usize>; 2]> {
    let (new, eye) = infer(stage, 6.0);
    let side = SIDE as usize;
    for i in 0..side * side {
        let (x, y) = (i % side, i / side);
        let met = eye.meet(x, y);
        assert_eq!((new.object[i], new.position[i]), (met.object, met.position), "pixel {x}, {y}");
        assert_eq!(new.lit(i)[0] == 1, eye.is_lit(&met), "pixel {x}, {y}");
    }
    let asked = eye.asked.lock().unwrap();
    let is_cast = |x: usize, y: usize| new.class[y * side + x] != PixelClass::Filled;
    let row = |y: usize| {
        let columns = |is: &dyn Fn(usize) -> bool| NEW.filter(|&x| is(x)).collect::<Vec<_>>();
        [columns(&|x| is_cast(x, y)), columns(&|x| asked.contains(&(x, y)))]
    };
    (0..side).map(row).collect()
}

#[test]
fn a_few_pixels_are_cast_and_ask_where_all_is_one_surface_lit_alike() {
    for light_ends in [f64::INFINITY, f64::NEG_INFINITY] {
        let rows = cast_and_asked(&Stage { card_ends: f64::INFINITY, light_ends, strip: f64::NAN });
        for (y, [cast, asked]) in rows.iter().enumerate() {
            // At most the end of a step, and those that are alone because what is beside them is outside the image.
            assert!((1..=3).contains(&cast.len()), "{rows:?}");
            // The second of two rows takes what the first has asked, but for the sides of the image, where light may come in.
            let is_side = |x: usize| x == SIDE as usize - 1 || y == SIDE as usize - 1;
            let is_above = |x: &usize| y % 2 == 1 && !is_side(*x) && rows[y - 1][0].contains(x);
            let alone: Vec<_> = cast.iter().copied().filter(|x| !is_above(x)).collect();
            assert_eq!(&alone, asked, "{rows:?}");
        }
        assert!(rows.iter().any(|row| row != &rows[0]), "rows begin at different columns");
    }
}

#[test]
fn an_edge_is_found_between_pixels_that_disagree() {
    // Column x shows the card at 1.5 + x: both edges lie between columns 6 and 7.
    for (card_ends, light_ends) in [(f64::INFINITY, 8.0), (8.0, f64::INFINITY)] {
        for [cast, asked] in cast_and_asked(&Stage { card_ends, light_ends, strip: f64::NAN }) {
            let beside = if card_ends.is_finite() { &cast } else { &asked };
            assert!(beside.contains(&6) && beside.contains(&7), "{cast:?}, {asked:?}");
        }
    }
}

#[test]
fn a_column_that_opens_asks_in_every_other_row_and_the_rows_between_take_its_light() {
    for light_ends in [f64::INFINITY, f64::NEG_INFINITY] {
        // The card goes away from the fifth column, where the wall is seen now.
        let stage = Stage { card_ends: 0.0, light_ends, strip: f64::NAN };
        let (new, eye) = infer(&stage, 0.8);
        let asked = eye.asked.lock().unwrap();
        for y in 0..SIDE as usize {
            let i = y * SIDE as usize + 4;
            assert_eq!((new.object[i], new.lit(i)[0] == 1), (WALL.0, light_ends > 0.0), "row {y}");
            let is_side = y == SIDE as usize - 1;
            assert_eq!(asked.contains(&(4, y)), y % 2 == 0 || is_side, "row {y}");
        }
    }
}

#[test]
fn what_is_narrower_than_a_step_is_met_in_some_row_and_followed_through_the_others() {
    // Column x shows the card at 1.5 + x.
    let strip = 8.0;
    for [cast, _] in cast_and_asked(&Stage { card_ends: f64::INFINITY, light_ends: f64::INFINITY, strip }) {
        assert!(cast.contains(&7), "{cast:?}");
    }
}

/// How many pixels ask for a light whose shadow begins at `now` after it began at `before`. All know then whether it reaches them.
fn asked_of_moved_light(before: f64, now: f64, trust: Trust) -> usize {
    let stage = |light_ends| Stage { card_ends: f64::INFINITY, light_ends, strip: f64::NAN };
    let after = stage(now);
    let (new, eye, rays) = infer_light(&stage(before), &after, trust);
    let side = SIDE as usize;
    for i in 0..side * side {
        let (x, y) = (i % side, i / side);
        assert_eq!(new.lit(i)[0] == 1, eye.is_lit(&eye.meet(x, y)), "pixel {x}, {y}");
    }
    assert_eq!(rays.primary, 0);
    rays.shadow as usize
}

#[test]
fn a_light_that_moved_is_asked_by_some_pixels_and_along_its_shadow() {
    let all = (SIDE * SIDE) as usize;
    for (before, now) in [(f64::INFINITY, f64::INFINITY), (f64::NEG_INFINITY, f64::NEG_INFINITY)] {
        // The ends of steps and what lies beyond the last one.
        assert!((2..all / 2).contains(&asked_of_moved_light(before, now, Trust::Neighbours)));
    }
    // Column x shows the card at x - 4.5.
    for now in [-3.0, -1.0, 0.0, 2.0, 4.0] {
        for before in [now - 1.0, now, now + 1.0] {
            assert!(asked_of_moved_light(before, now, Trust::Neighbours) < all * 3 / 4, "{before} to {now}");
            assert_eq!(asked_of_moved_light(before, now, Trust::Proof), all);
        }
    }
    // Where all is changed, all is asked.
    assert_eq!(asked_of_moved_light(f64::INFINITY, f64::NEG_INFINITY, Trust::Neighbours), all);
}
