//! Creeping pixels: what shows through a gap that opened inside an object.
//!
//! When an object grows on the image, neighbours on it may land with a gap between them. A sample that is seen through
//! the gap, behind both ends, would stay and creep into the object. The paper looks along each column, then each row,
//! for a gap between two pixels of one object and casts rays at what lies behind both.
//!
//! Departure: the paper takes any two pixels of an object for a gap, however far apart, which casts a ray at all that
//! is seen between the legs of a table. Its cause is that "consecutive edge pixels do not reproject consecutively", so
//! only ends that came from neighbouring pixels count here.

use super::buzz_buffer::{BuzzBuffer, UNKNOWN};
use super::marks::Marks;
use super::obscured::DEPTH_STEP;
use super::project::Landings;
use crate::frame::PixelClass;
use rayon::prelude::*;

/// Which way to look for gaps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    /// Down each column: first.
    Columns,
    /// Along each row: second.
    Rows,
}

/// Longest gap in pixels: neighbours that land farther apart than this show a surface sixteen times as large as it
/// was, of which nearly every pixel is missed and traced anyway.
const LONGEST_GAP: usize = 16;

/// Pixels in the old image that count as neighbours: samples lie anywhere in their pixels, and a pixel between two of
/// them may have been overlapped.
const NEIGHBOURS: usize = 2;

/// Marks pixels that lie behind both ends of a gap in one object. The buffer must be complete.
pub fn creeping(buffer: &BuzzBuffer, landings: &Landings, along: Along, marks: &Marks) {
    let (width, height) = (buffer.width(), buffer.height());
    let (lines, length) = if along == Along::Columns { (width, height) } else { (height, width) };
    (0..lines).into_par_iter().with_min_len(16).for_each(|line| {
        let pixel = |at: usize| if along == Along::Columns { at * width + line } else { line * width + at };
        for begin in 0..length.saturating_sub(2) {
            let continues = |at: usize| is_same_surface(buffer, pixel(begin), pixel(at));
            if buffer.object[pixel(begin)] == 0 || continues(begin + 1) {
                continue;
            }
            let furthest = (begin + 1 + LONGEST_GAP).min(length - 1);
            let Some(end) = (begin + 2..=furthest).find(|&at| continues(at)) else { continue };
            if !were_neighbours(landings, pixel(begin), pixel(end), width) {
                continue;
            }
            let test_z = buffer.z[pixel(begin)].max(buffer.z[pixel(end)]);
            for at in begin + 1..end {
                if buffer.z[pixel(at)] > test_z {
                    marks.set(pixel(at), PixelClass::Creeping);
                }
            }
        }
    });
}

/// Forgets the reused samples among the marked pixels; what a ray has found already is true.
pub fn forget_creeping(buffer: &mut BuzzBuffer, marks: &Marks) {
    let width = buffer.width();
    buffer.rows_mut().enumerate().for_each(|(y, row)| {
        for x in 0..width {
            if row.class[x].is_reused() && marks.get(y * width + x) == Some(PixelClass::Creeping) {
                row.class[x] = PixelClass::Creeping;
                row.object[x] = UNKNOWN;
            }
        }
    });
}

/// True where the two pixels show one object without a step in depth.
fn is_same_surface(buffer: &BuzzBuffer, a: usize, b: usize) -> bool {
    let (near, far) = (buffer.z[a].min(buffer.z[b]), buffer.z[a].max(buffer.z[b]));
    buffer.object[a] == buffer.object[b] && far <= near * DEPTH_STEP
}

/// True where what landed on both pixels came from neighbouring pixels of the old image, kept or cast since.
fn were_neighbours(landings: &Landings, a: usize, b: usize, width: usize) -> bool {
    let (Some(a), Some(b)) = (landings.source(a), landings.source(b)) else { return false };
    (a / width).abs_diff(b / width) <= NEIGHBOURS && (a % width).abs_diff(b % width) <= NEIGHBOURS
}
