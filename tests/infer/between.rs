//! Where nothing landed, the light is asked for at some pixels, and between them only where they disagree.

use crate::stage::{SIDE, Stage, infer};

/// The columns that asked for the light, seen from 6 pixels to the right: all is card, and those from number 4 on
/// are new. But that one is beside what was known.
fn asked(light_ends: f64) -> Vec<usize> {
    let stage = Stage { card_ends: f64::INFINITY, light_ends };
    let (new, eye) = infer(&stage, 6.0);
    let asked = eye.asked.lock().unwrap();
    let columns = |y: usize| (5..SIDE as usize).filter(|&x| asked.contains(&(x, y))).collect::<Vec<_>>();
    for y in 0..SIDE as usize {
        assert_eq!(columns(y), columns(0), "row {y}");
        for i in (0..SIDE as usize).map(|x| y * SIDE as usize + x) {
            assert_eq!(new.lit(i)[0] == 1, eye.is_lit(&new.sample(i)), "pixel {i}");
        }
    }
    columns(0)
}

#[test]
fn one_pixel_in_four_asks_where_all_is_lit_alike() {
    // The last column has none to its right.
    assert_eq!(asked(f64::INFINITY), [8, 9]);
    assert_eq!(asked(f64::NEG_INFINITY), [8, 9]);
}

#[test]
fn an_edge_of_a_shadow_is_found_between_pixels_that_disagree() {
    // Column x shows the card at 1.5 + x.
    assert_eq!(asked(7.7), [6, 7, 8, 9]);
    assert_eq!(asked(6.7), [5, 6, 8, 9]);
}
