//! The Buzzbuffer: a window-sized store of samples, the paper's data structure and its namesake.

use super::projector::Projector;
use super::rays::CastRays;
use super::subpixel::SubPixels;
use crate::frame::{PackedNormal, PixelClass, RayCounts, SurfaceRef, SurfaceSample};
use glam::Vec3;
use rayon::prelude::*;

/// The object tag of a pixel about which nothing is known yet (the paper's id_tag -2).
pub const UNKNOWN: u32 = u32::MAX;

/// One sample a pixel, as structure of arrays, rows from the top.
///
/// State: 41 bytes a pixel, and 4 more for each word of shadow bits; sub-pixels come on top.
#[derive(Debug, Clone, Default)]
pub struct BuzzBuffer {
    width: usize,
    height: usize,
    lit_words: usize,
    /// [`Projector::side`] of the view that the buffer was made for; 0 before it was made for any.
    pub(super) side: f32,
    /// Planar depth in that view, metres; infinite for the background.
    pub z: Vec<f32>,
    /// See [`SurfaceSample::position`].
    pub position: Vec<Vec3>,
    /// See [`SurfaceSample::object`]; [`UNKNOWN`] where a ray is wanted.
    pub object: Vec<u32>,
    /// See [`SurfaceSample::surface`].
    pub surface: Vec<SurfaceRef>,
    /// See [`SurfaceSample::normal`].
    pub normal: Vec<PackedNormal>,
    /// Shadow bits, `lit_words` for each pixel: what of each light reaches the point.
    pub lit: Vec<u32>,
    /// How each pixel was obtained.
    pub class: Vec<PixelClass>,
    /// The samples between the centres of pixels, with more than one level of super-sampling.
    pub finer: SubPixels,
}

impl BuzzBuffer {
    /// A buffer in which nothing is known.
    pub fn new(width: usize, height: usize, lit_words: usize) -> Self {
        let n = width * height;
        Self {
            width,
            height,
            lit_words,
            side: 0.0,
            z: vec![f32::INFINITY; n],
            position: vec![Vec3::ZERO; n],
            object: vec![UNKNOWN; n],
            surface: vec![SurfaceRef::BACKGROUND; n],
            normal: vec![PackedNormal::default(); n],
            lit: vec![0; n * lit_words],
            class: vec![PixelClass::Traced; n],
            finer: SubPixels::default(),
        }
    }

    /// The same with so many levels of super-sampling.
    #[must_use]
    pub fn with_levels(mut self, levels: u32) -> Self {
        self.finer = SubPixels::new(self.width, self.height, levels, self.lit_words);
        self
    }

    /// Bytes that a pixel of a buffer with so many words of shadow bits takes.
    pub fn bytes_per_pixel(lit_words: usize) -> usize {
        size_of::<f32>()
            + size_of::<Vec3>()
            + size_of::<u32>()
            + size_of::<SurfaceRef>()
            + size_of::<PackedNormal>()
            + lit_words * size_of::<u32>()
            + size_of::<PixelClass>()
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Words of shadow bits a pixel has.
    pub fn lit_words(&self) -> usize {
        self.lit_words
    }

    /// The sample of pixel number `i`.
    #[inline]
    pub fn sample(&self, i: usize) -> SurfaceSample {
        SurfaceSample {
            position: self.position[i],
            surface: self.surface[i],
            object: self.object[i],
            normal: self.normal[i],
        }
    }

    /// The shadow bits of pixel number `i`.
    #[inline]
    pub fn lit(&self, i: usize) -> &[u32] {
        &self.lit[i * self.lit_words..][..self.lit_words]
    }

    /// True if two pixels show one triangle, or one face of a shape.
    pub(super) fn is_same_primitive(&self, a: usize, b: usize) -> bool {
        let (a, b) = (&self.surface[a], &self.surface[b]);
        (a.instance, a.primitive) == (b.instance, b.primitive)
    }

    /// True if two pixels have the same shadow bits: mostly a word, which is compared without a call.
    pub(super) fn is_lit_alike(&self, a: usize, b: usize) -> bool {
        self.lit(a).iter().eq(self.lit(b))
    }

    /// Becomes the same as `other`, in the memory that it has.
    pub(super) fn copy_from(&mut self, other: &Self) {
        (self.width, self.height, self.lit_words) = (other.width, other.height, other.lit_words);
        self.side = other.side;
        self.z.clone_from(&other.z);
        self.position.clone_from(&other.position);
        self.object.clone_from(&other.object);
        self.surface.clone_from(&other.surface);
        self.normal.clone_from(&other.normal);
        self.lit.clone_from(&other.lit);
        self.class.clone_from(&other.class);
        self.finer.clone_from(&other.finer);
    }

    /// Forgets everything: every pixel is wanted, as `class`.
    pub fn forget(&mut self, class: PixelClass) {
        self.object.fill(UNKNOWN);
        self.class.fill(class);
    }

    /// Pixels of each class.
    pub fn count_classes(&self) -> [u64; PixelClass::COUNT] {
        let mut counts = [0; PixelClass::COUNT];
        for &class in &self.class {
            counts[class as usize] += 1;
        }
        counts
    }

    /// Casts a ray through the centre of every pixel that is unknown; if the caster is cancelled, some stay so.
    pub fn cast_unknown(&mut self, projector: &Projector, rays: &impl CastRays) -> RayCounts {
        self.side = projector.side();
        let cast_row = |y: usize, mut row: Row<'_>| {
            let mut counts = RayCounts::default();
            if rays.is_cancelled() {
                return counts;
            }
            for x in 0..row.object.len() {
                if row.object[x] != UNKNOWN {
                    continue;
                }
                let sample = rays.cast(x, y, row.lit_mut(x), &mut counts);
                row.put(x, projector, &sample);
            }
            counts
        };
        self.rows_mut().enumerate().map(|(y, row)| cast_row(y, row)).sum()
    }

    /// The rows, for writing in parallel.
    pub(super) fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = Row<'_>> {
        self.bands_mut(1)
    }

    /// So many rows at a time, one after the other, for writing in parallel; the last may have fewer.
    pub(super) fn bands_mut(&mut self, rows: usize) -> impl IndexedParallelIterator<Item = Row<'_>> {
        let (w, lit_words) = (rows * self.width, self.lit_words);
        (
            self.z.par_chunks_mut(w),
            self.position.par_chunks_mut(w),
            self.object.par_chunks_mut(w),
            self.surface.par_chunks_mut(w),
            self.normal.par_chunks_mut(w),
            words_by_rows(&mut self.lit, self.width * lit_words, self.height, rows),
            self.class.par_chunks_mut(w),
        )
            .into_par_iter()
            .map(move |columns| Row::of(columns, lit_words))
    }
}

/// Shadow bits, `per_row` words of them, of so many rows at a time. A scene without lights has none, but a chunk's length may not be
/// zero: then there is a word for each row, which nobody reads.
pub(super) fn words_by_rows(
    words: &mut Vec<u32>,
    per_row: usize,
    height: usize,
    rows: usize,
) -> impl IndexedParallelIterator<Item = &mut [u32]> {
    let per_row = per_row.max(1);
    words.resize(per_row * height, 0);
    words.par_chunks_mut(per_row * rows)
}

/// The pixels around one that are inside the image, at most eight.
pub(super) fn pixels_around(width: usize, height: usize, pixel: usize) -> impl Iterator<Item = usize> {
    const AROUND: [[isize; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];
    let (x, y) = (pixel % width, pixel / width);
    AROUND.into_iter().filter_map(move |[right, down]| {
        let (x, y) = (x.wrapping_add_signed(right), y.wrapping_add_signed(down));
        (x < width && y < height).then(|| y * width + x)
    })
}

/// One row of a [`BuzzBuffer`], or several.
pub(super) struct Row<'a> {
    pub z: &'a mut [f32],
    pub position: &'a mut [Vec3],
    pub object: &'a mut [u32],
    pub surface: &'a mut [SurfaceRef],
    pub normal: &'a mut [PackedNormal],
    pub lit: &'a mut [u32],
    pub class: &'a mut [PixelClass],
    pub lit_words: usize,
}

/// What a [`Row`] has of each column, in the order of its fields.
type Columns<'a> = (
    &'a mut [f32],
    &'a mut [Vec3],
    &'a mut [u32],
    &'a mut [SurfaceRef],
    &'a mut [PackedNormal],
    &'a mut [u32],
    &'a mut [PixelClass],
);

impl<'a> Row<'a> {
    fn of((z, position, object, surface, normal, lit, class): Columns<'a>, lit_words: usize) -> Self {
        Self { z, position, object, surface, normal, lit, class, lit_words }
    }

    /// What is before column `x`, and what is from there on.
    pub fn split_at(self, x: usize) -> [Self; 2] {
        let x = x.min(self.object.len());
        let (z, position) = (self.z.split_at_mut(x), self.position.split_at_mut(x));
        let (object, surface) = (self.object.split_at_mut(x), self.surface.split_at_mut(x));
        let (normal, class) = (self.normal.split_at_mut(x), self.class.split_at_mut(x));
        let lit = self.lit.split_at_mut(x * self.lit_words);
        let before = (z.0, position.0, object.0, surface.0, normal.0, lit.0, class.0);
        let after = (z.1, position.1, object.1, surface.1, normal.1, lit.1, class.1);
        [before, after].map(|columns| Self::of(columns, self.lit_words))
    }

    /// The sample in column `x`.
    pub fn sample(&self, x: usize) -> SurfaceSample {
        SurfaceSample {
            position: self.position[x],
            surface: self.surface[x],
            object: self.object[x],
            normal: self.normal[x],
        }
    }

    /// The shadow bits of column `x`.
    pub fn lit(&self, x: usize) -> &[u32] {
        &self.lit[x * self.lit_words..][..self.lit_words]
    }

    /// The shadow bits of column `x`, for writing.
    pub fn lit_mut(&mut self, x: usize) -> &mut [u32] {
        &mut self.lit[x * self.lit_words..][..self.lit_words]
    }

    /// Stores the shadow bits of column `x`: mostly a word, which is copied without a call.
    pub fn put_lit(&mut self, x: usize, lit: &[u32]) {
        match (self.lit_mut(x), lit) {
            ([to], &[word]) => *to = word,
            (to, lit) => to.copy_from_slice(lit),
        }
    }

    /// Stores a sample in column `x`; its shadow bits and class are set apart.
    #[inline]
    pub fn put(&mut self, x: usize, view: &Projector, sample: &SurfaceSample) {
        self.z[x] = view.depth(sample);
        self.position[x] = sample.position;
        self.object[x] = sample.object;
        self.surface[x] = sample.surface;
        self.normal[x] = sample.normal;
    }
}
