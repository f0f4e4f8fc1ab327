//! Moving objects and lights (the paper's "Moving Objects" and "Moving and Variable Lights").
//!
//! A sample rides on its surface: before anything is projected, samples of what has moved are put where their points are
//! now. What moved in front of other samples is found by voxels: those that a moved surface is in now are *entered*, those
//! that it was in before are *left*. A line from a sample to the eye through an entered voxel clears the pixel; voxels that
//! the body which carries the sample has entered count once the line has come out of them. A line from a sample to a light
//! lets that light's ray be cast anew if it passes through an entered voxel where the light had arrived, or through one
//! that was left where it had not.
//!
//! Departure: the paper stores t for each light, up to which its shadow ray is known to be free, to walk no further. We
//! store a bit; so a shadow that something else casts too is asked for more often than need be.

use super::Marks;
use super::buzz_buffer::{BuzzBuffer, Row, UNKNOWN};
use super::project::Landings;
use super::projector::Projector;
use super::voxels::{Voxels, clip};
use crate::frame::{LightWay, PixelClass, RayCounts, SurfaceSample, Way};
use glam::Vec3;
use rayon::prelude::*;

/// Something that moved: surfaces that move with one another.
#[derive(Debug, Clone, Default)]
pub struct Body {
    /// Where it is in the frame that is inferred; empty if it has vanished.
    pub entered: Voxels,
    /// Where it was in the frame that is inferred from; empty if it was not seen there.
    pub left: Voxels,
}

/// What differs between two frames beside the camera, and what inference asks about it.
pub trait Motion: Sync {
    /// All that moved.
    fn bodies(&self) -> &[Body];

    /// The number of the body that carries a sample; none if its surface stands still.
    fn body_of(&self, sample: &SurfaceSample) -> Option<usize>;

    /// A sample of a body in the frame that is inferred; none if it has vanished.
    fn follow(&self, sample: &SurfaceSample) -> Option<SurfaceSample>;

    /// Visits the ways on which light comes to a sample. May leave out what cannot matter: light from behind the surface.
    fn light_ways(&self, sample: &SurfaceSample, visit: &mut dyn FnMut(LightWay));

    /// See [`super::CastCentres::recast`].
    fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts);
}

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
    let bodies = motion.bodies();
    let Some(around) = bounds(bodies.iter().map(|b| &b.entered)) else { return };
    let width = now.width();
    (0..now.height()).into_par_iter().with_min_len(8).for_each(|y| {
        for pixel in y * width..(y + 1) * width {
            let Some(i) = landings.source(pixel) else { continue };
            let sample = now.sample(i);
            let (from, direction, until) = view.line_to(&sample);
            if clip(around, from, direction, until).is_none() {
                continue;
            }
            let own = motion.body_of(&sample);
            let stands_before = |(number, body): (usize, &Body)| match own {
                Some(own) if own == number => body.entered.are_crossed_again(from, direction, until),
                _ => body.entered.are_crossed(from, direction, until),
            };
            if bodies.iter().enumerate().any(stands_before) {
                marks.set(pixel, PixelClass::Moved);
            }
        }
    });
}

/// The lights that have to be asked about a sample because of what has moved.
pub(super) struct Askers<'a> {
    motion: &'a dyn Motion,
    entered: Option<(Vec3, Vec3)>,
    left: Option<(Vec3, Vec3)>,
}

impl<'a> Askers<'a> {
    pub fn new(motion: &'a dyn Motion) -> Self {
        let all = |of: fn(&Body) -> &Voxels| bounds(motion.bodies().iter().map(of));
        Self { motion, entered: all(|b| &b.entered), left: all(|b| &b.left) }
    }

    /// Sets in `ask` the bits of the lights of which `lit` may not hold any more.
    pub fn ask(&self, sample: &SurfaceSample, lit: &[u32], ask: &mut [u32]) {
        if sample.surface.is_background() {
            return;
        }
        // On a body everything else has moved.
        if self.motion.body_of(sample).is_some() {
            return ask.fill(u32::MAX);
        }
        self.motion.light_ways(sample, &mut |light| {
            let LightWay { way, word, mask, stale } = light;
            if ask[word] & mask == mask {
                return;
            }
            let bits = lit[word] & mask;
            let hidden = || bits != 0 && self.crosses(sample.position, way, self.entered, |b| &b.entered);
            let uncovered = || bits != mask && self.crosses(sample.position, way, self.left, |b| &b.left);
            if stale || hidden() || uncovered() {
                ask[word] |= mask;
            }
        });
    }

    /// Whether light that comes to `point` this way passes through marked voxels of any body.
    fn crosses(
        &self,
        point: Vec3,
        way: Way,
        around: Option<(Vec3, Vec3)>,
        of: impl Fn(&Body) -> &Voxels,
    ) -> bool {
        let Some(around) = around else { return false };
        let mut voxels = self.motion.bodies().iter().map(of);
        match way {
            Way::From(position, 0.0) => {
                let direction = position - point;
                clip(around, point, direction, 1.0).is_some()
                    && voxels.any(|v| v.are_crossed(point, direction, 1.0))
            }
            Way::Along(direction, 0.0) => {
                clip(around, point, direction, f32::INFINITY).is_some()
                    && voxels.any(|v| v.are_crossed(point, direction, f32::INFINITY))
            }
            Way::From(position, radius) => {
                let along = position - point;
                let distance = along.length();
                // The tangent of the angle whose sine is radius / distance.
                let tangent = radius / (distance * distance - radius * radius).max(0.0).sqrt();
                let until = distance + radius;
                distance <= radius || voxels.any(|v| is_in_cone(v, point, along / distance, tangent, until))
            }
            Way::Along(direction, tangent) => {
                voxels.any(|v| is_in_cone(v, point, direction, tangent, f32::INFINITY))
            }
            Way::Around(share) => voxels.any(|v| fills(v, point, share)),
        }
    }
}

/// Asks anew about the lights of reused samples of `new` that something moved before.
pub(super) fn relight(new: &mut BuzzBuffer, motion: &dyn Motion) -> RayCounts {
    let askers = Askers::new(motion);
    let words = new.lit_words();
    let ask_row = |mut row: Row<'_>| {
        let (mut counts, mut ask) = (RayCounts::default(), vec![0; words]);
        for x in 0..row.object.len() {
            if row.class[x].is_reused() && row.object[x] != UNKNOWN {
                let sample = row.sample(x);
                ask.fill(0);
                askers.ask(&sample, row.lit_mut(x), &mut ask);
                motion.recast(&sample, &ask, row.lit_mut(x), &mut counts);
            }
        }
        counts
    };
    new.rows_mut().map(ask_row).sum()
}

/// The box around all that is marked.
fn bounds<'a>(voxels: impl Iterator<Item = &'a Voxels>) -> Option<(Vec3, Vec3)> {
    voxels.filter_map(Voxels::bounds).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// Middle and radius of the ball around the voxels.
fn ball(voxels: &Voxels) -> Option<(Vec3, f32)> {
    voxels.bounds().map(|(min, max)| ((min + max) / 2.0, (max - min).length() / 2.0))
}

/// Whether the ball around the voxels reaches into a cone from `point` around the unit `axis`, as far as `until`.
fn is_in_cone(voxels: &Voxels, point: Vec3, axis: Vec3, tangent: f32, until: f32) -> bool {
    let Some((middle, radius)) = ball(voxels) else { return false };
    let along = (middle - point).dot(axis);
    let aside = (middle - point).reject_from_normalized(axis).length();
    // Where the ball comes closest to the cone's side it is at most its radius farther along.
    let wide = (along + radius).clamp(0.0, until) * tangent;
    along >= -radius && along <= until + radius && aside <= wide + radius
}

/// Whether the ball around the voxels fills more than a share of what light comes from all around.
fn fills(voxels: &Voxels, point: Vec3, share: f32) -> bool {
    // A ball's share of a cosine-weighted hemisphere is the square of its radius over its distance at most.
    ball(voxels).is_some_and(|(middle, radius)| radius * radius > share * middle.distance_squared(point))
}
