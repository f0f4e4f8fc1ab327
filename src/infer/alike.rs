//! Where all that landed around a pixel says the same: one triangle, lit alike. There is no more to find out.
//!
//! Samples have the same words where every bit that one of them has, all have. Which bits these are is found out for many
//! pixels at once: down their columns, and then along the row. What nothing landed on says nothing.

use super::around::{ENOUGH_TO_FILL, Trust};
use super::basis::Basis;
use super::rays::CastCentres;
use super::sources::{MOVED, NAMES, NOTHING, SUSPECT};
use crate::frame::{FourPoints, SurfaceSample};
use std::ops::Range;

/// Pixels of a row that are looked at together.
const STRETCH: usize = 64;

/// The farthest pixels that are looked at, in each direction: where something is missing around, a shadow's edge may be
/// hidden.
const REACH: usize = 2;

/// The columns of a stretch, and those beside it.
const COLUMNS: usize = STRETCH + 2 * REACH;

/// Pixels that are centred together.
const FOUR: usize = 4;

/// A pixel around which all is alike.
#[derive(Debug, Clone, Copy)]
pub(super) struct Alike {
    /// The old pixel of the sample that landed here; else of the first around.
    pub source: usize,
    /// The sample at the centre; none if that is beside the triangle.
    pub centre: Option<SurfaceSample>,
    /// True if all have the same shadow bits, or none has moved; else they have shares that differ by their noise.
    pub same: bool,
}

/// Finds the pixels of a row of which all that landed on them and around is one triangle, lit alike everywhere, and before
/// which nothing unknown may stand.
pub(super) struct AlikeRow<'a, R> {
    basis: Basis<'a, R>,
    y: usize,
    /// Of the stretch and the four that the last pixel is of.
    stretch: [Option<Found>; STRETCH],
    four: Option<FourPoints>,
}

/// Such a pixel before it is centred.
#[derive(Debug, Clone, Copy)]
struct Found {
    source: u32,
    /// True if any landed away from its pixel's centre, or none.
    moved: bool,
    same: bool,
}

impl<'a, R: CastCentres> AlikeRow<'a, R> {
    /// Row `y` of the image that a step makes.
    pub fn new(basis: Basis<'a, R>, y: usize) -> Self {
        Self { basis, y, stretch: [None; STRETCH], four: None }
    }

    /// Column `x`. They are asked for in order.
    // What is copied through memory in parts waits for itself.
    #[inline(always)]
    pub fn at(&mut self, x: usize, memory: &mut R::Memory) -> Option<Alike> {
        let at = x % STRETCH;
        if at == 0 {
            self.look_at(x);
        }
        if at.is_multiple_of(FOUR) {
            self.four = self.four(x, memory);
        }
        let Found { source, moved, same } = self.stretch[at]?;
        let source = source as usize;
        let sample = self.basis.old.sample(source);
        let centre = match &self.four {
            Some(four) => four.of(at % FOUR, &sample),
            None if moved => self.basis.rays.nearest_of(x, self.y, std::iter::once(sample), memory),
            None => Some(sample),
        };
        Some(Alike { source, centre, same: same || !moved })
    }

    /// The centres of the four pixels from column `x` on, if all are alike and on one triangle.
    fn four(&self, x: usize, memory: &mut R::Memory) -> Option<FourPoints> {
        let at = x % STRETCH;
        let [Some(a), Some(b), Some(c), Some(d)] = self.stretch[at..at + FOUR] else { return None };
        let first = a.source as usize;
        let is_one =
            |other: Found| other.moved && self.basis.old.is_same_primitive(first, other.source as usize);
        let is_one = a.moved && is_one(b) && is_one(c) && is_one(d);
        is_one.then(|| self.basis.rays.four_on((x, self.y), self.basis.old.surface[first], memory))?
    }

    /// Looks at the stretch from column `first` on.
    #[inline(never)]
    fn look_at(&mut self, first: usize) {
        let said = Stretch::new(self, first);
        for at in 0..STRETCH {
            self.stretch[at] = self.found(&said, first, at);
        }
    }

    fn found(&self, said: &Stretch, first: usize, at: usize) -> Option<Found> {
        let x = first + at;
        if x >= self.basis.old.width() || said.names[at] != 0 || said.flags[at] & SUSPECT != 0 {
            return None;
        }
        let own = self.basis.sources.of(self.y * self.basis.old.width() + x).map(|i| i as u32);
        let same = said.lit[at] == 0;
        if said.missing[at] == 0 {
            let moved = said.flags[at] & MOVED != 0;
            return own.filter(|_| same || self.agree((x, self.y))).map(|source| Found {
                source,
                moved,
                same,
            });
        }
        // Shares are interpolated where anything is missing.
        let may_fill = self.basis.trust == Trust::Neighbours && !self.basis.rays.has_shares();
        if !may_fill || said.wide_lit[at] != 0 {
            return None;
        }
        own.or_else(|| self.first_around(x, self.y)).map(|source| Found { source, moved: true, same: true })
    }

    /// The first sample around a pixel on which none landed, if there are enough of them.
    fn first_around(&self, x: usize, y: usize) -> Option<u32> {
        let (width, height) = (self.basis.old.width(), self.basis.old.height());
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let landed = rows.flat_map(|y| self.basis.sources.row(width, y, columns.clone()));
        let known = || landed.clone().map(|source| source & NOTHING).filter(|&i| i != NOTHING);
        known().next().filter(|_| known().count() >= ENOUGH_TO_FILL)
    }

    /// True if the samples of each column agree with that in its middle, and the middle ones with that of the pixel: they have
    /// shares that differ by their noise. Something landed on all of them.
    fn agree(&self, (x, y): (usize, usize)) -> bool {
        let lit = |x: usize, y: usize| {
            let source = self.basis.sources.of(y * self.basis.old.width() + x);
            source.map_or(&[][..], |i| self.basis.old.lit(i))
        };
        let is_column =
            |x: usize| [y - 1, y + 1].into_iter().all(|y2| self.basis.rays.agree(lit(x, y), lit(x, y2)));
        let is_row = || [x - 1, x + 1].into_iter().all(|x2| self.basis.rays.agree(lit(x, y), lit(x2, y)));
        self.basis.rays.has_shares() && (x - 1..=x + 1).all(is_column) && is_row()
    }
}

/// What is said around each pixel of a stretch of a row. Where samples differ in a word, some of its bits are set.
struct Stretch {
    /// Flags of any of the 3x3.
    flags: [u32; STRETCH],
    /// Where nothing landed on some of the 3x3.
    missing: [u32; STRETCH],
    /// Where the 3x3 show several triangles.
    names: [u32; STRETCH],
    /// Where the shadow bits of the 3x3 differ.
    lit: [u32; STRETCH],
    /// Where those of the 5x5 do.
    wide_lit: [u32; STRETCH],
}

impl Stretch {
    fn new<R>(of: &AlikeRow<'_, R>, first: usize) -> Self {
        let (width, height, y) = (of.basis.old.width(), of.basis.old.height(), of.y);
        let columns = first.saturating_sub(REACH)..(first + STRETCH + REACH).min(width);
        // Where `columns` begin: outside the image nothing landed.
        let at = columns.start + REACH - first;
        let row = |k: usize| (y + k).checked_sub(REACH).filter(|&row| row < height);
        let landed =
            |k: usize| row(k).map_or(&[][..], |row| of.basis.sources.row(width, row, columns.clone()));
        let unknown: [_; ROWS] = std::array::from_fn(|k| {
            let mut unknown = [u32::MAX; COLUMNS];
            let is_nothing = |source: u32| if source & NOTHING == NOTHING { u32::MAX } else { 0 };
            unknown[at..].iter_mut().zip(landed(k)).for_each(|(to, &source)| *to = is_nothing(source));
            unknown
        });
        let mut this = Self {
            flags: [0; STRETCH],
            missing: [0; STRETCH],
            names: [0; STRETCH],
            lit: [0; STRETCH],
            wide_lit: [0; STRETCH],
        };
        let (mut flags, mut missing) = (Common::NONE, Common::NONE);
        for k in NEAR {
            flags.include(at, landed(k), &unknown[k]);
            missing.include(0, &unknown[k], &unknown[k]);
        }
        flags.any::<1>(&mut this.flags);
        missing.any::<1>(&mut this.missing);
        for number in 0..NAMES + of.basis.old.lit_words() {
            let mut common = Common::NONE;
            let include = |common: &mut Common, k: usize| {
                if let Some(row) = row(k) {
                    let words = of.basis.sources.words(number, width, row, columns.clone());
                    common.include(at, words, &unknown[k]);
                }
            };
            NEAR.for_each(|k| include(&mut common, k));
            if number < NAMES {
                common.differing::<1>(&mut this.names);
            } else {
                common.differing::<1>(&mut this.lit);
                FAR.into_iter().for_each(|k| include(&mut common, k));
                common.differing::<REACH>(&mut this.wide_lit);
            }
        }
        this
    }
}

/// The rows that are looked at; the three in their middle, and the others.
const ROWS: usize = 2 * REACH + 1;
const NEAR: Range<usize> = REACH - 1..REACH + 2;
const FAR: [usize; 2] = [0, ROWS - 1];

/// For each column: the bits that any of some words has, and those that all have.
struct Common {
    any: [u32; COLUMNS],
    all: [u32; COLUMNS],
}

impl Common {
    const NONE: Self = Self { any: [0; COLUMNS], all: [u32::MAX; COLUMNS] };

    /// Takes in a word for each column from `at` on, but for what is unknown.
    fn include(&mut self, at: usize, words: &[u32], unknown: &[u32; COLUMNS]) {
        let bits = self.any[at..].iter_mut().zip(&mut self.all[at..]);
        for (((any, all), word), unknown) in bits.zip(words).zip(&unknown[at..]) {
            *any |= word;
            *all &= word | unknown;
        }
    }

    /// The bits that any word has in the columns so near to each of the stretch.
    fn any<const NEAR: usize>(&self, bits: &mut [u32; STRETCH]) {
        for (x, bits) in bits.iter_mut().enumerate() {
            *bits = (x + REACH - NEAR..=x + REACH + NEAR).fold(0, |any, x| any | self.any[x]);
        }
    }

    /// Adds those in which the words there differ.
    fn differing<const NEAR: usize>(&self, bits: &mut [u32; STRETCH]) {
        for (x, bits) in bits.iter_mut().enumerate() {
            let common = |(any, all): (u32, u32), x: usize| (any | self.any[x], all & self.all[x]);
            let (any, all) = (x + REACH - NEAR..=x + REACH + NEAR).fold((0, u32::MAX), common);
            *bits |= any & !all;
        }
    }
}
