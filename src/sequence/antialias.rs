//! From sub-pixels to pixels: the shading of all that are there, more of them where colours differ, and their mean.
//!
//! A pixel is four quarters, each a quarter of a cell between its centre and three others'. Where the cell is whole, the
//! quarter has the colour of the centre. Where it is divided, the quarter is the mean of its corners, or of its own four
//! quarters', by area (T. Whitted, *An Improved Illumination Model for Shaded Display*, 1980).

use super::resolve::{Pixel, Resolver};
use crate::accel::KnownTriangles;
use crate::frame::{Frame, RayCounts, SurfaceSample};
use crate::infer::{BuzzBuffer, Level, Position, Samples, SubPixels};
use crate::trace::{SHADED_AT_ONCE, Shader};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Corners of a cell differ in colour if any channel, encoded for display, does by more than this share of its range: what
/// `compare` counts as a pixel that is off.
const CONTRAST: f32 = 0.05;

/// What the shading of sub-pixels holds between frames.
#[derive(Default)]
pub(super) struct Antialias {
    /// The sub-pixels that are shaded: those of the buffer, and more where colours differ.
    shaded: SubPixels,
    /// What the eye sees of each sample: pixels first, then level by level.
    pixels: Vec<Pixel>,
}

impl Antialias {
    /// The most that it holds for each pixel.
    pub fn bytes_per_pixel(levels: u32, words: usize) -> usize {
        if levels < 2 {
            return 0;
        }
        let samples = 1 + SubPixels::most_per_pixel(levels);
        SubPixels::bytes_per_pixel(levels, words) + samples * size_of::<Pixel>()
    }

    /// Shades the samples of `buffer`, and more where neighbours differ in colour.
    fn shade(&mut self, resolver: &Resolver<'_>, buffer: &BuzzBuffer) -> RayCounts {
        let (lattice, words) = (buffer.finer.lattice(), buffer.lit_words());
        if self.shaded.lattice() != lattice || self.shaded.levels.iter().any(|l| l.words() != words) {
            self.shaded = buffer.finer.clone();
        }
        let stored = Samples::of(buffer);
        let count = buffer.object.len();
        self.pixels.resize(count, Pixel::default());
        let shader = || resolver.shader();
        let shade_pixels = |shader: &mut Shader<'_, '_>, (k, pixels): (usize, &mut [Pixel])| {
            let mut counts = RayCounts::default();
            if resolver.observer.stop_requested().is_none() {
                resolver.shade_pixels(shader, buffer, k * SHADED_AT_ONCE, pixels, &mut counts);
            }
            counts
        };
        let pixels = self.pixels.par_chunks_mut(SHADED_AT_ONCE).enumerate().with_min_len(16);
        let mut counts: RayCounts = pixels.map_init(shader, shade_pixels).sum();
        for depth in 0..self.shaded.levels.len() {
            let (coarser, level) = self.shaded.levels.split_at_mut(depth);
            let (Some(level), Some(own)) = (level.first_mut(), buffer.finer.levels.get(depth)) else { break };
            let known = Samples { pixels: buffer, lattice, levels: coarser };
            let pixels = &self.pixels;
            level.cells.divide(|cell, corners| {
                let is_open = coarser.last().is_none_or(|c| c.cells.is_divided(cell.map(|c| c / 2)));
                let mut colours =
                    corners.filter_map(|at| known.number(at)).map(|number| pixels[number].encoded());
                is_open && (own.cells.is_divided(cell) || differ(&mut colours))
            });
            level.fit();
            let shaded = self.pixels.len();
            self.pixels.resize(shaded + level.samples.len(), Pixel::default());
            counts += shade_level(resolver, level, depth, (stored, known), &mut self.pixels[shaded..]);
        }
        counts
    }

    /// The samples that were shaded last, of `buffer` and more.
    pub fn samples<'a>(&'a self, buffer: &'a BuzzBuffer) -> Samples<'a> {
        Samples { pixels: buffer, lattice: buffer.finer.lattice(), levels: &self.shaded.levels }
    }

    /// Visits the samples that a pixel is the mean of, by number, with their weights.
    pub fn visit(&self, buffer: &BuzzBuffer, pixel: usize, mut visit: impl FnMut(usize, f32)) {
        let samples = self.samples(buffer);
        let (x, y) = (pixel % buffer.width(), pixel / buffer.width());
        let cells = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]];
        let is_divided = |&cell: &[usize; 2]| samples.levels[0].cells.is_divided(cell);
        if !cells.iter().any(is_divided) {
            return visit(pixel, 1.0);
        }
        for (i, cell) in cells.iter().enumerate() {
            if is_divided(cell) {
                // The quarter of the cell that is this pixel's.
                let quarter = [2 * cell[0] + 1 - i % 2, 2 * cell[1] + 1 - i / 2];
                visit_quarter(samples, quarter, 1, 0.25, &mut visit);
            } else {
                visit(pixel, 0.25);
            }
        }
    }
}

/// Visits the samples that a cell is the mean of; its corners are there.
fn visit_quarter(
    samples: Samples<'_>,
    [x, y]: [usize; 2],
    depth: usize,
    weight: f32,
    visit: &mut impl FnMut(usize, f32),
) {
    let quarters = [[0, 0], [1, 0], [0, 1], [1, 1]];
    if samples.levels.get(depth).is_some_and(|level| level.cells.is_divided([x, y])) {
        for [dx, dy] in quarters {
            visit_quarter(samples, [2 * x + dx, 2 * y + dy], depth + 1, weight / 4.0, visit);
        }
        return;
    }
    let side = samples.lattice.steps() >> depth;
    for [dx, dy] in quarters {
        let corner = [(x + dx) * side, (y + dy) * side].map(|c| c as u32);
        if let Some(number) = samples.number(corner) {
            visit(number, weight / 4.0);
        }
    }
}

/// Finds the samples of a level and shades them: those that are `stored`, and others from what is `known` around them.
fn shade_level(
    resolver: &Resolver<'_>,
    level: &mut Level,
    depth: usize,
    (stored, known): (Samples<'_>, Samples<'_>),
    pixels: &mut [Pixel],
) -> RayCounts {
    let eye = resolver.eye.finer(depth + 1);
    let stride = level.stride();
    let half = level.cells.side() as u32 / 2;
    let Level { cells, samples, lit, .. } = level;
    let lit = lit.par_chunks_mut(stride * SHADED_AT_ONCE);
    let places = cells.positions().par_chunks(SHADED_AT_ONCE).zip(samples.par_chunks_mut(SHADED_AT_ONCE));
    let places = places.zip(lit).zip(pixels.par_chunks_mut(SHADED_AT_ONCE));
    let shader = || resolver.shader();
    type Places<'p> = (((&'p [Position], &'p mut [SurfaceSample]), &'p mut [u32]), &'p mut [Pixel]);
    let shade = |shader: &mut Shader<'_, '_>, (((places, samples), lit), pixels): Places<'_>| {
        let mut counts = RayCounts::default();
        if resolver.observer.stop_requested().is_some() {
            return counts;
        }
        let mut words_of = [[].as_slice(); SHADED_AT_ONCE];
        for (k, (&at, lit)) in places.iter().zip(lit.chunks_mut(stride)).enumerate() {
            // Where nothing is known around, nothing is there.
            let found = stored.at(at).or_else(|| between(resolver, known, at, half));
            let nothing = || (SurfaceSample::background(Vec3::NEG_Z), Default::default());
            let (found, bits) = found.unwrap_or_else(nothing);
            samples[k] = found;
            lit[..bits.len()].copy_from_slice(bits);
            words_of[k] = bits;
        }
        resolver.shade_four(shader, &eye, samples, words_of, pixels, &mut counts);
        counts
    };
    places.with_min_len(16).map_init(shader, shade).sum()
}

/// The sample between others that lie on one surface under the same lights: no ray is needed to see it. Where the ray
/// through its place meets none of their triangles, it is one of them.
fn between<'a>(
    resolver: &Resolver<'_>,
    known: Samples<'a>,
    at: Position,
    half: u32,
) -> Option<(SurfaceSample, &'a [u32])> {
    // Beside it, above and below, or at the corners of the cell.
    let ways = |c: u32| if (c / half).is_multiple_of(2) { [0, 0] } else { [-1, 1] };
    let [columns, rows] = at.map(ways);
    let around = rows.into_iter().flat_map(|dy| columns.map(|dx| [dx, dy])).filter_map(|by| {
        let step = |i: usize| at[i].wrapping_add_signed(by[i] * half as i32);
        known.at([step(0), step(1)])
    });
    let lattice = known.lattice;
    let [x, y] = at.map(|c| lattice.to_raster(c));
    let candidates = around.clone().map(|(sample, _)| sample);
    let met = resolver.tracer.nearest_of(&resolver.eye, x, y, candidates, &mut KnownTriangles::default());
    let primitive = |s: &SurfaceSample| (s.surface.instance, s.surface.primitive);
    let of_same =
        |met: &SurfaceSample| around.clone().find(|(sample, _)| primitive(sample) == primitive(met));
    match met.and_then(|met| Some((met, of_same(&met)?.1))) {
        Some(found) => Some(found),
        None => around.clone().next(),
    }
}

/// True where any colour differs from the first in any channel.
fn differ(colours: &mut impl Iterator<Item = Vec4>) -> bool {
    let Some(first) = colours.next() else { return false };
    colours.any(|colour| (colour - first).abs().max_element() > CONTRAST)
}

impl Resolver<'_> {
    /// Fills the layers that come from shading with the means of samples.
    pub(super) fn shade_subpixels(
        &self,
        buffer: &BuzzBuffer,
        antialias: &mut Antialias,
        frame: &mut Frame,
    ) -> RayCounts {
        let counts = antialias.shade(self, buffer);
        self.fill_rows(
            frame,
            buffer.width(),
            || (),
            |(), first, means, _| {
                for (pixel, mean) in (first..).zip(means) {
                    *mean = Pixel::default();
                    antialias
                        .visit(buffer, pixel, |number, weight| mean.add(&antialias.pixels[number], weight));
                }
            },
        );
        counts
    }

    /// The mean of what a light's diffuse part is on a pixel's samples.
    pub(super) fn mean_light(
        &self,
        buffer: &BuzzBuffer,
        antialias: &Antialias,
        pixel: usize,
        light: usize,
    ) -> [f32; 3] {
        let samples = antialias.samples(buffer);
        let mut mean = glam::Vec3::ZERO;
        antialias.visit(buffer, pixel, |number, weight| {
            let (sample, lit) = samples.get(number);
            let eye = self.eye.finer(samples.place(number).0);
            mean += weight * self.tracer.light_diffuse(&eye, &sample, lit, light);
        });
        mean.to_array()
    }
}
