//! Moving objects and lights (the paper's "Moving Objects" and "Moving and Variable Lights").
//!
//! A sample rides on its surface: before anything is projected, samples of what has moved are put where their points are
//! now. What moved in front of other samples is found by voxels: those that a moved surface is in now are *entered*, those
//! that it was in before are *left*. A line from a sample to the eye through an entered voxel clears the pixel; voxels that
//! the body which carries the sample has entered count once the line has come out of them. A line from a sample to a light
//! lets that light's ray be cast anew if it passes through an entered voxel where the light had arrived, or through one
//! that was left where it had not.
//!
//! Few lines have anything that moved near them: [`Bodies`](super::bodies::Bodies) and [`Shafts`] tell which. And where neighbours agree on a light
//! that may have changed it need not be asked at all: see [`Changed`](super::between::Changed).
//!
//! Departure: the paper stores t for each light, up to which its shadow ray is known to be free, to walk no further. We
//! store a bit; so a shadow that something else casts too is asked for more often than need be.

use super::bodies::Shaft;
use super::buzz_buffer::{BuzzBuffer, Row, UNKNOWN};
use super::marks::Marks;
use super::project::Landings;
use super::projector::Projector;
use super::rays::Motion;
use super::shafts::{Shafts, Span, TILE, pixels};
use super::voxels::Line;
use crate::frame::{LightChange, LightWay, PixelClass, RayCounts, SurfaceSample, Way};
use rayon::prelude::*;

/// Makes `now` of `old`, with samples of bodies where they are now.
pub(super) fn ride(old: &BuzzBuffer, motion: &dyn Motion, now: &mut BuzzBuffer) {
    now.copy_from(old);
    let follow_row = |row: Row<'_>| {
        for x in 0..row.object.len() {
            let sample = row.sample(x);
            if motion.body_of(&sample).is_none() {
                continue;
            }
            match motion.follow(&sample) {
                Some(sample) => (row.position[x], row.normal[x]) = (sample.position, sample.normal),
                None => row.object[x] = UNKNOWN,
            }
        }
    };
    now.rows_mut().for_each(follow_row);
    for level in &mut now.finer.levels {
        level.samples.par_iter_mut().with_min_len(1 << 10).for_each(|sample| {
            if motion.body_of(sample).is_some() {
                match motion.follow(sample) {
                    Some(now) => *sample = now,
                    None => sample.object = UNKNOWN,
                }
            }
        });
    }
}

/// Marks the pixels on which a sample landed before which a body may stand.
pub(super) fn moved(
    now: &BuzzBuffer,
    view: &Projector,
    motion: &dyn Motion,
    landings: &Landings,
    marks: &Marks,
) {
    let entered = &motion.bodies().entered;
    let (width, height) = (now.width(), now.height());
    let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
    (0..across * down).into_par_iter().with_min_len(64).for_each(|tile| {
        let landed = pixels(width, height, (tile % across, tile / across))
            .filter_map(|pixel| Some((pixel, landings.source(pixel)?)));
        let (mut span, mut sees_background) = (Span::default(), false);
        for (_, i) in landed.clone() {
            span.include(now.position[i]);
            sees_background |= now.surface[i].is_background();
        }
        let Some((middle, half)) = span.middle_and_half() else { return };
        if !sees_background && !entered.may_meet(&Shaft::new(view.way_to_eye(), middle), half) {
            return;
        }
        for (pixel, i) in landed {
            if is_passed(&now.sample(i), view, motion) {
                marks.set(pixel, PixelClass::Moved);
            }
        }
    });
}

/// True if a body may stand before a sample now.
pub(super) fn is_passed(sample: &SurfaceSample, view: &Projector, motion: &dyn Motion) -> bool {
    let (from, direction, until) = view.line_to(sample);
    let line = Shaft::Line(Line::new(from, direction, until));
    motion.bodies().entered.meet(&line, motion.body_of(sample))
}

/// The lights that have to be asked about a sample because of what has moved.
pub(super) struct Askers<'a> {
    motion: &'a dyn Motion,
    shafts: &'a Shafts,
}

impl<'a> Askers<'a> {
    /// For the pixels of `new`: their samples may change since, but most will be what they are.
    pub fn new(motion: &'a dyn Motion, new: &BuzzBuffer, shafts: &'a mut Shafts) -> Self {
        shafts.look(new, motion.bodies(), motion.ways());
        Self { motion, shafts }
    }

    /// True if a sample lies on something that has moved.
    pub fn is_on_body(&self, sample: &SurfaceSample) -> bool {
        self.motion.body_of(sample).is_some()
    }

    /// True if nothing about the lights at a sample in pixel number `pixel` can have changed.
    pub fn are_quiet(&self, pixel: usize, sample: &SurfaceSample) -> bool {
        sample.surface.is_background() || !self.is_on_body(sample) && self.shafts.are_all_clear(pixel, sample)
    }

    /// Sets in `ask` the bits of the lights of which `lit` may not hold any more, at a sample in pixel number `pixel`; of those on
    /// which its neighbours have `agreed`, perhaps more, as that is not looked into.
    pub fn ask(
        &self,
        pixel: usize,
        sample: &SurfaceSample,
        (lit, agreed): (&[u32], &[u32]),
        ask: &mut [u32],
    ) {
        // On a body everything else has moved.
        if self.is_on_body(sample) {
            return ask.fill(u32::MAX);
        }
        let motion = self.motion;
        let bodies = motion.bodies();
        for (number, light) in motion.ways().iter().enumerate() {
            let &LightWay { way, word, mask, change } = light;
            if ask[word] & mask == mask {
                continue;
            }
            let stale = match change {
                LightChange::None => false,
                LightChange::Reach => motion.arrives_anew(number, sample),
                LightChange::Place => true,
            };
            let bits = lit[word] & mask;
            let changes = || {
                if self.shafts.are_clear(pixel, sample, light) || comes_from_behind(way, sample) {
                    return false;
                }
                if agreed.get(word).is_some_and(|agreed| agreed & mask == mask) {
                    return true;
                }
                let shaft = Shaft::new(way, sample.position);
                let hidden = bits != 0 && bodies.entered.meet(&shaft, None);
                hidden || bits != mask && bodies.left.meet(&shaft, None)
            };
            if stale || changes() {
                ask[word] |= mask;
            }
        }
    }
}

/// True if light that comes this way meets the back of a sample's surface, where it does not matter what hides it.
fn comes_from_behind(way: Way, sample: &SurfaceSample) -> bool {
    let normal = sample.normal.get();
    match way {
        Way::From(position, 0.0) => normal.dot(position - sample.position) <= 0.0,
        Way::Along(direction, 0.0) => normal.dot(direction) <= 0.0,
        _ => false,
    }
}

/// Asks anew about the lights of reused samples of `new` that something moved before.
pub(super) fn relight(new: &mut BuzzBuffer, motion: &dyn Motion, shafts: &mut Shafts) -> RayCounts {
    let askers = Askers::new(motion, new, shafts);
    let (width, words) = (new.width(), new.lit_words());
    let ask_row = |(y, mut row): (usize, Row<'_>)| {
        let (mut counts, mut ask) = (RayCounts::default(), vec![0; words]);
        for x in 0..row.object.len() {
            let (pixel, sample) = (y * width + x, row.sample(x));
            if row.class[x].is_reused() && row.object[x] != UNKNOWN && !askers.are_quiet(pixel, &sample) {
                ask.fill(0);
                askers.ask(pixel, &sample, (row.lit(x), &[]), &mut ask);
                motion.recast(&sample, &ask, row.lit_mut(x), &mut counts);
            }
        }
        counts
    };
    new.rows_mut().enumerate().map(ask_row).sum()
}
