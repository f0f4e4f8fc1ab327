//! What comes into view is followed from where it is met.

use crate::stage::{CARD, SIDE, Stage, WALL, infer_change};
use buzz::frame::PixelClass;

/// All lit; the card ends between the columns 4 and 5.
const WITH_CARD: Stage = Stage { card_ends: 0.0, light_ends: f64::INFINITY, strip: f64::NAN };

/// Proofs that are made whatever is known: at one pixel in four of the sides, and perhaps one inside.
const LOOKOUTS: u64 = SIDE as u64 + 1;

#[test]
fn what_comes_in_at_a_side_is_followed_to_its_end() {
    // Only the wall was seen. It moves by 0.03 pixels, so that no pixel is missed; but the first column was outside.
    let empty = Stage { card_ends: f64::NEG_INFINITY, light_ends: f64::INFINITY, strip: f64::NAN };
    let (new, _, counts) = infer_change(&empty, &WITH_CARD, -0.3);
    for y in 0..SIDE as usize {
        let pixel = |x: usize| y * SIDE as usize + x;
        let objects: Vec<_> = (0..SIDE as usize).map(|x| new.object[pixel(x)]).collect();
        assert_eq!(objects[..5], [CARD.0; 5], "row {y}");
        assert_eq!(objects[5..], [WALL.0; 5], "row {y}");
        assert_eq!(new.class[pixel(0)], PixelClass::Entering);
        assert!((1..5).all(|x| new.class[pixel(x)] == PixelClass::Bad), "row {y}");
        assert!((5..9).all(|x| new.class[pixel(x)].is_reused()), "row {y}");
    }
    // Each pixel of the card that was not at the side, and the column after it, is proven once.
    assert!((50..=50 + LOOKOUTS).contains(&counts.visibility), "{counts:?}");
}

#[test]
fn what_is_known_is_not_followed() {
    for x in [-0.8, -0.3, 0.3, 0.8] {
        let (_, _, counts) = infer_change(&WITH_CARD, &WITH_CARD, x);
        assert!(counts.visibility <= LOOKOUTS, "from {x}: {counts:?}");
    }
}
