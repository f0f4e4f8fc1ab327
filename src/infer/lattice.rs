//! Where the sub-pixels lie, and which of them are wanted (the paper's figure 13).
//!
//! With L levels of super-sampling a pixel is a structure of 2^(L-1) + 1 positions a side, of which it shares the outermost
//! with its neighbours. These are the numbers of the levels with three of them:
//!
//! ```text
//! 2 3 2 3 2
//! 3 3 3 3 3
//! 2 3 1 3 2
//! 3 3 3 3 3
//! 2 3 2 3 2
//! ```
//!
//! Departure: the paper's first level is the pixel's corners. Here it is the centre, so that the first level is the image that
//! one ray a pixel gives. Nothing else changes: a *cell* of level 2 is the square between the centres of four pixels, as the
//! paper's is that between the four corners of one. Where its corners differ it is divided into four cells of level 3 by five
//! new positions: the middles of its sides, which it shares, and its own.

use rayon::prelude::*;

/// All positions that sub-pixels of an image may have. They are counted from a pixel outside its corner, so that no number
/// is negative: the centre of pixel (x, y) is at `steps` times (x + 1, y + 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lattice {
    width: usize,
    height: usize,
    steps: usize,
}

/// Column and row on a [`Lattice`].
pub type Position = [u32; 2];

impl Lattice {
    /// The positions in an image of so many pixels, with so many levels of super-sampling (1: the pixels' centres).
    pub fn new(width: usize, height: usize, levels: u32) -> Self {
        Self { width, height, steps: 1 << (levels.max(1) - 1) }
    }

    /// Positions along the side of a pixel.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Columns and rows, those outside the image included.
    pub fn size(&self) -> (usize, usize) {
        (self.steps * (self.width + 1), self.steps * (self.height + 1))
    }

    /// True for positions in the image, its border included.
    pub fn contains(&self, [x, y]: Position) -> bool {
        // Half a pixel from a centre, which with one level is between two positions.
        let (first, half) = (self.steps.div_ceil(2), self.steps / 2);
        let inside = |at: u32, pixels: usize| (first..=pixels * self.steps + half).contains(&(at as usize));
        inside(x, self.width) && inside(y, self.height)
    }

    /// The centre of a pixel.
    pub fn centre(&self, x: usize, y: usize) -> Position {
        [x, y].map(|at| (self.steps * (at + 1)) as u32)
    }

    /// The number of the pixel whose centre is at a position, if it is one's.
    pub fn pixel_at(&self, at: Position) -> Option<usize> {
        let [x, y] = at.map(|c| c as usize);
        let is_centre = x.is_multiple_of(self.steps) && y.is_multiple_of(self.steps) && self.contains(at);
        is_centre.then(|| (y / self.steps - 1) * self.width + x / self.steps - 1)
    }

    /// The number of the pixel that a position in the image lies in; on the side of two, of the one right of it or below.
    pub fn pixel_around(&self, at: Position) -> usize {
        let along = |at: u32, pixels: usize| {
            let from_corner = (at as usize).saturating_sub(self.steps / 2);
            (from_corner / self.steps).min(pixels - 1)
        };
        along(at[1], self.height) * self.width + along(at[0], self.width)
    }

    /// Position to raster coordinate.
    pub fn to_raster(&self, at: u32) -> f64 {
        f64::from(at) / self.steps as f64 - 0.5
    }

    /// Raster coordinate to position, with its fraction.
    pub fn from_raster(&self, raster: f32) -> f32 {
        (raster + 0.5) * self.steps as f32
    }
}

/// The cells of one level and the positions in the middles of those that are divided.
#[derive(Debug, Clone, Default)]
pub struct Cells {
    lattice: Lattice,
    /// Side of a cell in positions.
    side: usize,
    columns: usize,
    /// For each cell: whether it is divided.
    divided: Vec<bool>,
    /// For each cell: the number of its first position. It has those on its upper and left side, if it or the cell beyond is
    /// divided, and its middle.
    first: Vec<u32>,
    positions: Vec<Position>,
}

impl Cells {
    /// The cells of level 2 (`depth` 0) or of one after it, none divided.
    pub fn new(lattice: Lattice, depth: u32) -> Self {
        let side = lattice.steps >> depth;
        let (columns, rows) = (lattice.size().0 / side, lattice.size().1 / side);
        Self {
            lattice,
            side,
            columns,
            divided: vec![false; columns * rows],
            first: vec![0; columns * rows],
            positions: Vec::new(),
        }
    }

    /// The most bytes that the cells of a pixel take on level 2 (`depth` 0) or one after it, beside what a position takes.
    pub fn bytes_per_pixel(depth: u32) -> usize {
        (size_of::<bool>() + size_of::<u32>()) << (2 * depth)
    }

    /// Divides the cells for which `is_divided` says so, given the cell and its corners in the image; others that stand out
    /// of the image by half or more are left whole.
    pub fn divide(
        &mut self,
        is_divided: impl Fn([usize; 2], &mut dyn Iterator<Item = Position>) -> bool + Sync,
    ) {
        let (lattice, side, columns) = (self.lattice, self.side, self.columns);
        let rows = self.divided.par_chunks_mut(columns).with_min_len(8).enumerate();
        rows.for_each(|(y, row)| {
            for (x, divided) in row.iter_mut().enumerate() {
                let (corner, middle) = ([x * side, y * side], [x * side + side / 2, y * side + side / 2]);
                let corners = [[0, 0], [side, 0], [0, side], [side, side]];
                let mut corners = corners
                    .into_iter()
                    .map(|[dx, dy]| [corner[0] + dx, corner[1] + dy].map(|c| c as u32))
                    .filter(|&at| lattice.contains(at));
                *divided = lattice.contains(middle.map(|c| c as u32)) && is_divided([x, y], &mut corners);
            }
        });
        self.positions.clear();
        for cell in 0..self.divided.len() {
            self.first[cell] = self.positions.len() as u32;
            let own = self.own(cell);
            self.positions.extend(own.into_iter().flatten());
        }
    }

    /// True if the cell is divided.
    pub fn is_divided(&self, [x, y]: [usize; 2]) -> bool {
        self.divided[y * self.columns + x]
    }

    /// Side of a cell in positions.
    pub fn side(&self) -> usize {
        self.side
    }

    /// The positions in the middles of divided cells and of their sides, in order.
    pub fn positions(&self) -> &[Position] {
        &self.positions
    }

    /// The number of a position among [`Cells::positions`].
    pub fn find(&self, at: Position) -> Option<usize> {
        let [x, y] = at.map(|c| c as usize / self.side);
        let cell = y * self.columns + x;
        let own = self.own(cell).into_iter().flatten().position(|own| own == at)?;
        Some(self.first[cell] as usize + own)
    }

    /// The middles of a cell's upper and left side, and its own, where they are wanted.
    fn own(&self, cell: usize) -> [Option<Position>; 3] {
        let (x, y) = (cell % self.columns, cell / self.columns);
        let here = self.divided[cell];
        let above = here || (y > 0 && self.divided[cell - self.columns]);
        let left = here || (x > 0 && self.divided[cell - 1]);
        if !above && !left {
            return [None; 3];
        }
        let (corner, half) = ([x * self.side, y * self.side], self.side / 2);
        let at = |dx: usize, dy: usize| {
            Some([corner[0] + dx, corner[1] + dy].map(|c| c as u32)).filter(|&at| self.lattice.contains(at))
        };
        [at(half, 0).filter(|_| above), at(0, half).filter(|_| left), at(half, half).filter(|_| here)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_has_two_to_the_levels_less_one_and_one_positions_a_side() {
        for (levels, side) in [(1, 1), (2, 3), (3, 5)] {
            let lattice = Lattice::new(1, 1, levels);
            let (columns, rows) = lattice.size();
            let all = (0..rows + 1).flat_map(|y| (0..columns + 1).map(move |x| [x as u32, y as u32]));
            assert_eq!(all.filter(|&at| lattice.contains(at)).count(), side * side);
        }
    }

    #[test]
    fn a_pixels_centre_is_where_its_raster_centre_is() {
        let lattice = Lattice::new(7, 5, 3);
        for (x, y) in [(0, 0), (6, 4), (3, 2)] {
            let at = lattice.centre(x, y);
            assert_eq!(at.map(|c| c as f32), [x, y].map(|c| lattice.from_raster(c as f32 + 0.5)));
            assert_eq!((lattice.pixel_at(at), lattice.pixel_around(at)), (Some(y * 7 + x), y * 7 + x));
            assert_eq!(lattice.pixel_at([at[0] + 2, at[1]]), None);
        }
        // The image's last column of positions belongs to its last pixel.
        assert_eq!(lattice.pixel_around([7 * 4 + 2, 4]), 6);
    }

    #[test]
    fn a_divided_cell_has_five_positions_of_which_it_shares_four() {
        let lattice = Lattice::new(4, 4, 2);
        let mut cells = Cells::new(lattice, 0);
        cells.divide(|cell, _| cell == [2, 2]);
        assert_eq!(cells.positions(), [[5, 4], [4, 5], [5, 5], [6, 5], [5, 6]]);
        cells.divide(|cell, _| cell == [2, 2] || cell == [3, 2]);
        assert_eq!(cells.positions().len(), 9);
        for (number, &at) in cells.positions().iter().enumerate() {
            assert_eq!(cells.find(at), Some(number));
        }
        assert_eq!(cells.find([3, 3]), None);
    }

    #[test]
    fn cells_at_the_border_have_the_positions_inside() {
        let lattice = Lattice::new(1, 1, 3);
        let mut cells = Cells::new(lattice, 0);
        // All four are divided: the eight positions of level 2 around the only pixel's centre.
        cells.divide(|_, corners| corners.count() == 1);
        assert_eq!(cells.positions().len(), 8);
        let mut finer = Cells::new(lattice, 1);
        finer.divide(|[x, y], corners| cells.is_divided([x / 2, y / 2]) && corners.count() == 4);
        assert_eq!(finer.positions().len(), 16);
    }
}
