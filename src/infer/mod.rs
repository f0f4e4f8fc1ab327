//! The paper: S. J. Adelson and L. F. Hodges, *Exploiting Spatio-Temporal Coherence in Ray-Traced Animation Frames*,
//! GIT-GVU-93-01, Georgia Institute of Technology, 1993.
//!
//! [`Inference::infer`] is its algorithm box; [`Inference::infer_centred`] goes past it. Nothing here knows a file format or a renderer: it is given a buffer of
//! samples, two views, and something that casts a ray when told to. `docs/algorithm.md` maps every section of the
//! paper to a function here and says where and why we depart from it.
//!
//! | paper | here |
//! |---|---|
//! | Buzzbuffer | [`BuzzBuffer`] |
//! | id_tag, -2 | [`BuzzBuffer::object`], [`UNKNOWN`] |
//! | the four by four matrix, d / (d + z_t) | [`Projector`] |
//! | good, missed, overlapped, bad pixels | [`PixelClass`](crate::frame::PixelClass) |
//! | miny, (begx, begy) | depth and pixel of a landing, in [`project()`] |
//! | L, C, C1, (endx, endy), int_z | `ImageLine` in `obscured.rs` |
//! | test_z | in [`creeping()`] |
//! | P, k | [`entering()`] |
//! | X + e z_p / (d + z_p), positive gaps | [`Parallax`], [`other_eye()`], [`in_gaps()`] |
//! | 2^(L-1) + 1, levels of sub-pixels | [`Lattice`], [`SubPixels`], [`Supersampling`] |
//! | moving objects, voxels; moving and variable lights | [`Motion`], [`Voxels`] |
//! | (not in the paper) samples at pixel centres; outlines and shadows' edges followed | [`Centring`] |
//! | (not in the paper) the light on what is mirrored | [`SeenLight`] |

mod alike;
mod around;
mod basis;
mod between;
mod bodies;
mod buzz_buffer;
mod carried;
mod cast;
mod cell;
mod centre;
mod creeping;
mod entering;
mod frontier;
mod lattice;
mod marks;
mod moved;
mod obscured;
mod outlines;
mod project;
mod projector;
mod questions;
mod rays;
mod samples;
mod seen;
mod shadow_edges;
mod shafts;
mod shares;
mod slot;
mod sources;
mod stereo;
mod subpixel;
mod supersample;
mod tiles;
mod uncovered;
mod voxels;

pub use around::{Trust, is_one_surface};
pub use bodies::{Bodies, Body};
pub use buzz_buffer::{BuzzBuffer, UNKNOWN};
pub use centre::Centring;
pub use creeping::{Along, creeping};
pub use entering::entering;
pub use lattice::{Cells, Lattice, Position};
pub use marks::Marks;
pub use obscured::obscured;
pub use project::{Landings, gather, project};
pub use projector::{Projected, Projector};
pub use rays::{CastCentres, CastRays, Motion};
pub use samples::Samples;
pub use seen::SeenLight;
pub use stereo::{Parallax, in_gaps, other_eye};
pub use subpixel::{Level, SubPixels};
pub use supersample::Supersampling;
pub use uncovered::uncovered;
pub use voxels::{Line, Voxels};

use crate::frame::RayCounts;
use crate::scene::View;
use creeping::forget_creeping;
use entering::{KnownArea, at_sides};
use glam::DVec3;
use moved::{moved, relight, ride};
use shafts::Shafts;
use std::sync::atomic::AtomicU64;
use std::time::{Duration, Instant};

/// Infers frames from their neighbours. Holds what the work needs between two frames, so that none is allocated for
/// each.
#[derive(Debug, Default)]
pub struct Inference {
    landings: Landings,
    marks: Marks,
    centring: Centring,
    supersampling: Supersampling,
    shafts: Shafts,
    /// The old samples where their surfaces are now; used only where something moves.
    now: BuzzBuffer,
}

/// Of a view that begins at the eye, nothing nearer is taken to come in, metres.
const NEAREST: f64 = 1e-6;

/// What lies between the old view and the new.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Move {
    /// Any camera move.
    Camera,
    /// From the left eye of a stereo pair to the right one.
    OtherEye,
}

/// What inferring a frame took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Cost {
    /// Rays cast for pixels that no sample explains.
    pub rays: RayCounts,
    /// Wall time spent on rays; the rest is the work that replaces tracing.
    pub tracing: Duration,
}

impl Inference {
    /// The most that it holds for each pixel, with so many levels of super-sampling, where a sample has so many words of
    /// shadow bits, and where something in the scene moves or nothing does.
    pub fn bytes_per_pixel(levels: u32, words: usize, moves: bool) -> usize {
        let buffer = BuzzBuffer::bytes_per_pixel(words) + SubPixels::bytes_per_pixel(levels, words);
        let now = if moves { buffer + Shafts::bytes_per_pixel(words) } else { 0 };
        let marks = size_of::<AtomicU64>() + Marks::BYTES_PER_PIXEL;
        marks + Centring::bytes_per_pixel(words) + Supersampling::bytes_per_pixel(levels, words) + now
    }

    /// Makes `new`, the samples of `new_view`, from `old`, those of `old_view`. Positions are relative to `origin`.
    ///
    /// Every sample that is reused lies inside its pixel's square (the half-pixel guarantee), and no line L, on which an old hit
    /// may hide something, passes before it; every other pixel is traced through its centre. `origin` is in world metres.
    pub fn infer(
        &mut self,
        by: Move,
        (old, old_view): (&BuzzBuffer, &View),
        (new, new_view): (&mut BuzzBuffer, &View),
        origin: DVec3,
        rays: &impl CastRays,
    ) -> Cost {
        let to = Projector::new(new_view, origin);
        let mut cost = Cost::default();
        let k = self.reproject(by, old, old_view, new_view, origin, rays);
        let (landings, marks) = (&self.landings, &self.marks);
        // Clear what an old hit could be hiding.
        match by {
            Move::Camera => obscured(old, &Projector::new(old_view, origin), &to, landings, marks),
            Move::OtherEye => in_gaps(old, &Parallax::between(old_view, new_view, origin), landings, marks),
        }
        // Clear the contested area, where new objects may come in.
        entering(old_view, new_view, k, marks);
        let old = if rides(rays.motion()) { &self.now } else { old };
        gather(old, &self.landings, &self.marks, new);

        // Ray-cast the positions that nothing explains, then the gaps that opened inside objects.
        cost.add(|| new.cast_unknown(&to, rays));
        for along in [Along::Columns, Along::Rows] {
            creeping(new, &self.landings, along, &self.marks);
            forget_creeping(new, &self.marks);
            cost.add(|| new.cast_unknown(&to, rays));
        }
        if let Some(motion) = rays.motion() {
            cost.add(|| relight(new, motion, &mut self.shafts));
        }
        cost
    }

    /// Makes `new` as [`Inference::infer`] does, but with every sample at its pixel's centre (past the paper).
    pub fn infer_centred(
        &mut self,
        by: Move,
        (old, old_view): (&BuzzBuffer, &View),
        (new, new_view): (&mut BuzzBuffer, &View),
        origin: DVec3,
        trust: Trust,
        rays: &impl CastCentres,
    ) -> Cost {
        let to = Projector::new(new_view, origin);
        let mut cost = Cost::default();
        let k = self.reproject(by, old, old_view, new_view, origin, rays);
        let old = if rides(rays.motion()) { &self.now } else { old };
        // Clear the sides, where new objects may come in.
        at_sides(old, &to, &self.landings, &self.marks);

        // Centre what lies within surfaces. Cast rays at edges, and at what nothing explains; where they meet what was hidden or
        // has come in, for which some are cast in the contested area too, cast as far as it goes. Then along shadows' edges.
        self.centring.recentre(old, (&self.landings, &self.marks), &to, rays, trust, new);
        let (moves, known) = (old_view != new_view, KnownArea::between(old_view, new_view, k));
        cost.add(|| self.centring.cast((old, &mut self.shafts), (&to, moves, known), rays, trust, new));
        cost
    }

    /// Finds which old sample each new pixel shows, and before which something stands that moved or has opened to the eye.
    /// Where something has moved, `now` are the old samples after it. Returns k, how near new objects may come in: as near as anything
    /// that is known; where that is only sky, as near as the view begins.
    fn reproject(
        &mut self,
        by: Move,
        old: &BuzzBuffer,
        old_view: &View,
        new_view: &View,
        origin: DVec3,
        rays: &impl CastRays,
    ) -> f64 {
        let (landings, marks) = (&mut self.landings, &mut self.marks);
        let to = Projector::new(new_view, origin);

        // Initialise the Buzzbuffer.
        landings.clear(old.object.len());
        marks.clear(old.object.len());

        // Samples ride on the surfaces that moved.
        let motion = rays.motion();
        if let Some(motion) = motion.filter(|_| rides(motion)) {
            ride(old, motion, &mut self.now);
        }
        let now = if rides(motion) { &self.now } else { old };

        // Project the old pixels; the nearest hit wins.
        let nearest = match by {
            Move::Camera => project(now, &to, landings, marks),
            Move::OtherEye => other_eye(old, &Parallax::between(old_view, new_view, origin), landings, marks),
        };

        // Clear what a surface that opens to the eye stands before (not in the paper, whose objects are solid), and what the near or
        // far plane no longer cuts off (nor are its scenes cut).
        rays.turned(old_view, &|triangle| uncovered(&triangle, &to, landings, marks));
        if by == Move::Camera {
            rays.uncut(old_view, &|outline| uncovered(outline, &to, landings, marks));
        }

        // Clear what something that moved stands before.
        if let Some(motion) = motion {
            moved(now, &to, motion, landings, marks);
        }
        nearest.map_or(new_view.lens.near.max(NEAREST), f64::from)
    }
}

/// True if any sample may have moved with its surface.
fn rides(motion: Option<&dyn Motion>) -> bool {
    motion.is_some_and(|motion| !motion.bodies().is_empty())
}

impl Cost {
    /// Adds what `cast` casts, and the time that it takes.
    fn add(&mut self, cast: impl FnOnce() -> RayCounts) {
        let start = Instant::now();
        self.rays += cast();
        self.tracing += start.elapsed();
    }
}
