//! The tracer as inference wants it.

use super::Observer;
use super::motion::SceneMotion;
use crate::accel::KnownTriangles;
use crate::frame::{FourPoints, RayCounts, SurfaceRef, SurfaceSample};
use crate::infer::{CastCentres, CastRays, Lattice, Motion};
use crate::scene::View;
use crate::trace::{Eye, Tracer};
use glam::Vec3;
use std::ops::Range;

/// Casts the rays of one frame.
#[derive(Clone, Copy)]
pub(super) struct Caster<'a> {
    pub tracer: &'a Tracer<'a>,
    pub view: &'a View,
    /// Of that view.
    pub eye: Eye,
    pub observer: &'a dyn Observer,
    /// See [`super::Settings::jitter`]; differs from frame to frame.
    pub jitter: Option<u64>,
    /// What differs from the frame that is inferred from, if anything but the camera.
    pub motion: Option<&'a SceneMotion<'a>>,
    /// Distance between the places that rays are asked for by number, in pixels.
    pub spacing: f64,
    /// Raster coordinate of the first.
    pub first: f64,
}

impl Caster<'_> {
    /// The same for positions of a lattice instead of pixels.
    pub fn on(self, lattice: Lattice) -> Self {
        Self { spacing: 1.0 / lattice.steps() as f64, first: -0.5, jitter: None, ..self }
    }

    /// Raster coordinates.
    fn place(&self, x: usize, y: usize) -> (f64, f64) {
        (x as f64 * self.spacing + self.first, y as f64 * self.spacing + self.first)
    }
}

impl CastRays for Caster<'_> {
    fn turned(&self, old: &View, visit: &(dyn Fn([Vec3; 3]) + Sync)) {
        self.tracer.turned(old, self.view, visit);
    }

    fn uncut(&self, old: &View, visit: &(dyn Fn(&[Vec3]) + Sync)) {
        self.tracer.uncut(old, self.view, visit);
    }

    fn is_cancelled(&self) -> bool {
        self.observer.stop_requested().is_some()
    }

    fn cast(&self, x: usize, y: usize, lit: &mut [u32], counts: &mut RayCounts) -> SurfaceSample {
        let place = self.jitter.map_or(self.place(x, y), |seed| {
            let bits = mix(seed ^ ((y as u64) << 32 | x as u64));
            let [dx, dy] =
                [bits as u32, (bits >> 32) as u32].map(|b| f64::from(b) / (f64::from(u32::MAX) + 1.0));
            (x as f64 + dx, y as f64 + dy)
        });
        self.tracer.cast(&self.eye, place.0, place.1, lit, counts)
    }

    fn motion(&self) -> Option<&dyn Motion> {
        self.motion.map(|motion| motion as &dyn Motion)
    }
}

impl CastCentres for Caster<'_> {
    type Memory = KnownTriangles;

    fn hit(&self, x: usize, y: usize, counts: &mut RayCounts) -> SurfaceSample {
        let (x, y) = self.place(x, y);
        self.tracer.hit(&self.eye, x, y, counts)
    }

    fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts) {
        self.tracer.recast(sample, ask, lit, counts);
    }

    fn differ(&self, a: &[u32], b: &[u32], differ: &mut [u32]) {
        self.tracer.differ(a, b, differ);
    }

    fn agree(&self, a: &[u32], b: &[u32]) -> bool {
        self.tracer.agree(a, b)
    }

    fn has_edge(&self, a: &[u32], b: &[u32]) -> bool {
        self.tracer.has_edge(a, b)
    }

    fn has_shares(&self) -> bool {
        self.tracer.has_shares()
    }

    fn confirm(&self, ask: &mut [u32]) {
        self.tracer.confirm(ask);
    }

    fn soften(&self, ask: &mut [u32]) {
        self.tracer.soften(ask);
    }

    fn keep_edges(&self, ask: &mut [u32]) {
        self.tracer.keep_edges(ask);
    }

    fn settle(&self, ask: &mut [u32]) {
        self.tracer.settle(ask);
    }

    fn blend<'a>(&self, known: impl Iterator<Item = (&'a [u32], f32)> + Clone, lit: &mut [u32]) {
        self.tracer.blend(known, lit);
    }

    fn nearest_of(
        &self,
        x: usize,
        y: usize,
        candidates: impl Iterator<Item = SurfaceSample>,
        known: &mut KnownTriangles,
    ) -> Option<SurfaceSample> {
        let (x, y) = self.place(x, y);
        self.tracer.nearest_of(&self.eye, x, y, candidates, known)
    }

    fn four_on(
        &self,
        (x, y): (usize, usize),
        surface: SurfaceRef,
        known: &mut KnownTriangles,
    ) -> Option<FourPoints> {
        let columns = [x, x + 1, x + 2, x + 3].map(|x| self.place(x, y).0);
        self.tracer.four_on(&self.eye, (columns, self.place(x, y).1), surface, known)
    }

    fn is_hidden(&self, sample: &SurfaceSample, counts: &mut RayCounts) -> bool {
        counts.visibility += 1;
        self.tracer.may_be_hidden(&self.eye, sample)
    }

    fn sees_all(
        &self,
        pixels: (Range<usize>, Range<usize>),
        at: impl Fn(usize, usize) -> SurfaceSample,
    ) -> bool {
        self.tracer.sees_all(&self.eye, pixels, at)
    }
}

/// Scatters the bits of a number (SplitMix64's finaliser).
pub(super) fn mix(n: u64) -> u64 {
    let n = n.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let n = (n ^ n >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let n = (n ^ n >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    n ^ n >> 31
}
