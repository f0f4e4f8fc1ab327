//! What frames cost in counted rays and pixels, and what share of an inferred frame is traced.
//!
//! Most numbers are what `cargo bench --bench planner` fits or measures, rounded; those that are not say so. `docs/planning.md` says
//! how well they predict.

use super::Change;
use crate::frame::{FrameKind, Quality, RayCounts};

/// What a ray to a light or to the world costs, in camera rays.
pub const SHADOW_RAY: f64 = 0.8;

/// How a quality's inferred frames are predicted.
///
/// Of a frame `new = outside * o + hidden + contested * c + stretched * s + edges * e + moved * m` is traced whatever came before.
/// Samples that are pushed on from frame to frame lose their order: a step takes them so far towards a random pattern,
/// in which a share of the pixels is missed. What is traced is in order again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Share of [`Change::outside`] that is traced.
    pub outside: f64,
    /// Share of [`Change::contested`] that is traced.
    pub contested: f64,
    /// Share of [`Change::stretched`] that is traced.
    pub stretched: f64,
    /// Pixels traced at edges for each of [`Change::edges`].
    pub edges: f64,
    /// Share of [`Change::moved`] that is traced: around outlines, and what comes out from behind them. An estimate: how much that is
    /// hangs on how finely the thing is divided.
    pub moved: f64,
    /// Share of pixels missed once samples lie at random.
    pub missed: f64,
    /// Share of the way to a random pattern that a step goes at most.
    pub scatter: f64,
    /// Motion in pixels by which a step has gone most of that.
    pub scatter_pixels: f64,
    /// What the work in place of tracing costs a pixel, in camera rays.
    pub inference: f64,
    /// Shadow rays that a traced pixel of an inferred frame takes, of those that one of a key frame takes.
    pub shadows: f64,
    /// Rays that prove a reused sample visible. Not fitted: it follows from which samples are asked.
    pub proof: f64,
}

impl Weights {
    /// Of [`Quality::HalfPixel`]: nothing is cast at edges, but samples scatter.
    pub const HALF_PIXEL: Self = Self {
        outside: 1.0,
        contested: 1.0,
        stretched: 1.0,
        edges: 0.0,
        moved: 0.5,
        missed: 0.45,
        scatter: 0.144,
        scatter_pixels: 2.8,
        inference: 0.4,
        shadows: 0.96,
        proof: 0.0,
    };

    /// Of [`Quality::Centred`]: edges are cast in every frame that moves, holes within surfaces are filled, and so is most of what
    /// comes into the image; no area is contested.
    pub const CENTRED: Self = Self {
        outside: 0.45,
        contested: 0.0,
        stretched: 0.0,
        edges: 0.78,
        moved: 0.5,
        missed: 0.0,
        scatter: 0.0,
        scatter_pixels: 1.0,
        inference: 0.7,
        shadows: 0.78,
        // One in 1024, or in 256 where what is seen grows.
        proof: 1.0 / 256.0,
    };

    /// The weights of a quality.
    pub fn of(quality: Quality) -> Self {
        match quality {
            Quality::Full | Quality::HalfPixel => Self::HALF_PIXEL,
            Quality::Centred => Self::CENTRED,
            // What is not proven is not filled in. Four samples in five are proven in tiles, at next to no cost.
            Quality::Verified => Self { outside: 1.0, proof: 0.2, ..Self::CENTRED },
        }
    }

    /// Shares of the pixels that are traced in frames inferred one from another, the first from a key frame.
    pub fn traced(self, changes: impl IntoIterator<Item = Change>) -> impl Iterator<Item = f64> {
        let mut disorder = 0.0;
        changes.into_iter().map(move |c| {
            let new = self.outside * c.outside
                + c.hidden
                + self.contested * c.contested
                + self.stretched * c.stretched
                + self.edges * c.edges
                + self.moved * c.moved;
            disorder += (1.0 - disorder) * self.scatter * (1.0 - (-c.pixels / self.scatter_pixels).exp());
            let traced = (new + self.missed * disorder * (1.0 - new)).min(1.0);
            disorder *= 1.0 - traced;
            traced
        })
    }

    /// What a pixel of a frame traced in full costs, in camera rays, if it takes so many shadow rays.
    pub fn traced_cost(shadow_rays: f64) -> f64 {
        1.0 + SHADOW_RAY * shadow_rays
    }

    /// What a pixel of an inferred frame is predicted to cost, in camera rays, if so much of the frame is traced and
    /// a traced pixel of a key frame takes so many shadow rays.
    pub fn predicted_cost(&self, traced: f64, shadow_rays: f64) -> f64 {
        let proof = self.proof * (1.0 - traced);
        self.inference + proof + traced * Self::traced_cost(self.shadows * shadow_rays)
    }

    /// What a frame of `pixels` pixels did cost, in camera rays: what [`Weights::predicted_cost`] predicts, counted.
    /// What every frame costs alike is left out: shading, reflection and refraction.
    pub fn cost(&self, kind: FrameKind, pixels: u64, rays: &RayCounts) -> f64 {
        let inference = if kind == FrameKind::Traced { 0.0 } else { self.inference * pixels as f64 };
        let camera = (rays.primary + rays.visibility) as f64;
        inference + camera + SHADOW_RAY * (rays.shadow + rays.ambient) as f64
    }
}
