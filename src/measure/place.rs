//! Where in a picture the difference is worst.

use serde::{Deserialize, Serialize};

/// A square of a picture, and how visible the difference is in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Left column; of another renderer's picture it may lie left of the image.
    pub x: i32,
    /// Top row.
    pub y: i32,
    /// Columns and rows.
    pub side: u32,
    /// Mean of the FLIP map in it.
    pub flip: f64,
}

impl Place {
    /// The place of a picture that begins at `origin`, in the whole image.
    #[must_use]
    pub fn in_image(self, origin: (i32, i32)) -> Self {
        Self { x: self.x.saturating_add(origin.0), y: self.y.saturating_add(origin.1), ..self }
    }
}

/// Side of the squares that are looked at: some two degrees of the view that [`super::PIXELS_PER_DEGREE`] stands for, what an
/// eye takes in at once.
const SIDE: usize = 128;

/// The square of a FLIP map of `width` columns with the largest mean; `None` if the map is empty or 0 throughout.
pub fn worst_place(map: &[f32], width: usize) -> Option<Place> {
    let height = map.len().checked_div(width)?;
    let side = SIDE.min(width).min(height);
    // Squares overlap by half, so that none of what is together is cut in two everywhere.
    let starts = |size: usize| (0..size - side).step_by((side / 2).max(1)).chain([size - side]);
    let mut worst: Option<Place> = None;
    for y in starts(height) {
        for x in starts(width) {
            let rows = (y..y + side).flat_map(|row| &map[row * width + x..][..side]);
            let flip = rows.map(|&v| f64::from(v)).sum::<f64>() / (side * side) as f64;
            if flip > worst.map_or(0.0, |w| w.flip) {
                worst = Some(Place { x: x as i32, y: y as i32, side: side as u32, flip });
            }
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_square_holds_what_is_worst() {
        let (width, height) = (400, 300);
        let mut map = vec![0.0; width * height];
        map[7 * width + 390] = 0.3;
        map[250 * width + 200] = 0.5;
        let worst = worst_place(&map, width).unwrap();
        let inside =
            |x: i32, y: i32| (worst.x..worst.x + 128).contains(&x) && (worst.y..worst.y + 128).contains(&y);
        assert!(inside(200, 250) && !inside(390, 7), "{worst:?}");
        assert!((worst.flip - 0.5 / (128.0 * 128.0)).abs() < 1e-9);
        map[250 * width + 200] = 0.0;
        let worst = worst_place(&map, width).unwrap();
        assert_eq!((worst.x, worst.y), (272, 0), "the corner belongs to a square too");
        let moved = worst.in_image((-300, 40));
        assert_eq!((moved.x, moved.y, moved.side), (-28, 40, 128));
    }

    #[test]
    fn small_and_empty_pictures() {
        assert_eq!(worst_place(&[0.2; 6], 3).unwrap().side, 2);
        assert_eq!(worst_place(&[0.0; 6], 3), None);
        assert_eq!(worst_place(&[], 0), None);
        assert_eq!(worst_place(&[], 5), None);
    }
}
