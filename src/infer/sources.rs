//! Where the samples of a new image come from, and where all that landed around a pixel says the same.

use super::Marks;
use super::buzz_buffer::BuzzBuffer;
use super::centre::CastCentres;
use super::project::Landings;
use crate::frame::PixelClass;
use rayon::prelude::*;

/// Nothing landed on the pixel. The numbers of old pixels are below: an image has fewer than 2^30 pixels.
pub(super) const NOTHING: u32 = (1 << 30) - 1;

/// Set where something unknown may stand before what landed on the pixel, if anything did.
pub(super) const SUSPECT: u32 = 1 << 31;

/// Set where what landed on the pixel is away from its centre.
pub(super) const MOVED: u32 = 1 << 30;

/// For each pixel: the old pixel whose sample landed on it, and whether that is to be believed.
#[derive(Debug, Default)]
pub(super) struct Sources(Vec<u32>);

impl Sources {
    /// Settles it for all pixels, once all lines have been walked.
    pub fn settle(&mut self, landings: &Landings, marks: &Marks) {
        self.0.resize(landings.len(), NOTHING);
        self.0.par_iter_mut().with_min_len(1 << 14).enumerate().for_each(|(pixel, source)| {
            *source = landings.landed(pixel).map_or(NOTHING, |(i, away)| {
                let flag = if away { MOVED } else { 0 };
                i as u32 | flag
            });
            if let Some(PixelClass::Bad | PixelClass::Moved | PixelClass::Entering) = marks.get(pixel) {
                *source |= SUSPECT;
            }
        });
    }

    /// Those of the columns `columns` of row `y` of an image so wide: numbers of old pixels or [`NOTHING`], and flags.
    pub fn row(&self, width: usize, y: usize, columns: std::ops::RangeInclusive<usize>) -> &[u32] {
        &self.0[y * width..][columns]
    }

    /// The old pixel whose sample landed here.
    pub fn of(&self, pixel: usize) -> Option<usize> {
        let source = self.0[pixel] & NOTHING;
        (source != NOTHING).then_some(source as usize)
    }

    /// True if a sample landed on the pixel's very centre.
    pub fn is_centred(&self, pixel: usize) -> bool {
        self.of(pixel).is_some() && self.0[pixel] & MOVED == 0
    }

    /// The 3x3 around each pixel of row `y`, one after the other.
    pub fn alike<'a>(
        &'a self,
        old: &'a BuzzBuffer,
        y: usize,
        rays: &'a impl CastCentres,
    ) -> impl Iterator<Item = Option<Alike>> + 'a {
        let (mut left, mut middle) = (None, self.column(old, (0, y), rays));
        (0..old.width()).map(move |x| {
            let right = self.column(old, (x + 1, y), rays);
            let alike = Alike::across(old, [left, middle, right], rays);
            (left, middle) = (middle, right);
            alike
        })
    }

    /// The pixel (x, y) and those above and below it, if they are alike.
    fn column(&self, old: &BuzzBuffer, (x, y): (usize, usize), rays: &impl CastCentres) -> Option<Alike> {
        if x >= old.width() || y == 0 || y + 1 >= old.height() {
            return None;
        }
        let middle = y * old.width() + x;
        let at = |pixel: usize| Alike::of(self.0[pixel]);
        Alike::across(old, [at(middle - old.width()), at(middle), at(middle + old.width())], rays)
    }

    /// True if something unknown may stand in front here.
    pub fn is_suspect(&self, pixel: usize) -> bool {
        self.0[pixel] & SUSPECT != 0
    }
}

/// What landed on pixels beside one another if that is one triangle, lit alike on all, and nothing unknown may stand in
/// front.
#[derive(Debug, Clone, Copy)]
pub(super) struct Alike {
    /// The old pixel of the middle one.
    pub source: usize,
    /// True if any landed away from its pixel's centre.
    pub moved: bool,
    /// True if all have the same shadow bits; else they have shares that differ by their noise.
    pub same: bool,
}

impl Alike {
    fn of(source: u32) -> Option<Self> {
        let known = source & SUSPECT == 0 && source != NOTHING;
        known.then_some(Self { source: (source & NOTHING) as usize, moved: source & MOVED != 0, same: true })
    }

    /// The middle of three for all of them.
    fn across(old: &BuzzBuffer, three: [Option<Self>; 3], rays: &impl CastCentres) -> Option<Self> {
        let [Some(a), Some(b), Some(c)] = three else { return None };
        let is_same = |other| old.is_lit_alike(b.source, other);
        let same = is_same(a.source) && is_same(c.source);
        let agrees = |other| rays.agree(old.lit(b.source), old.lit(other));
        let is_one = |other| old.is_same_primitive(b.source, other);
        let alike = is_one(a.source) && is_one(c.source) && (same || agrees(a.source) && agrees(c.source));
        alike.then_some(Self {
            source: b.source,
            moved: a.moved || b.moved || c.moved,
            same: same && a.same && b.same && c.same,
        })
    }
}
