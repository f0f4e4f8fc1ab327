//! What inference asks of the scene: rays, what is known without one, and what has moved. The tracer answers, or a test's table.

use super::bodies::Bodies;
use crate::frame::{FourPoints, LightWay, RayCounts, SurfaceRef, SurfaceSample};
use crate::scene::View;
use glam::Vec3;
use std::ops::Range;

/// Whatever can find out what a pixel's centre sees: the tracer, or a test's table.
pub trait CastRays: Sync {
    /// The sample that the ray through the centre of pixel (x, y) finds; sets `lit`, counts what it casts.
    fn cast(&self, x: usize, y: usize, lit: &mut [u32], counts: &mut RayCounts) -> SurfaceSample;

    /// Visits, in any order, the corners (metres, relative to the segment's origin) of triangles that open to the eye between `old` and the
    /// view that rays are cast for: whose visible side the old view saw as a line, or not at all.
    fn turned(&self, old: &View, visit: &(dyn Fn([Vec3; 3]) + Sync)) {
        let _ = (old, visit);
    }

    /// Visits, in any order, outlines (corners in order around, metres, relative to the segment's origin) of what the near or far plane of
    /// `old` cut off, and the view that rays are cast for sees.
    fn uncut(&self, old: &View, visit: &(dyn Fn(&[Vec3]) + Sync)) {
        let _ = (old, visit);
    }

    /// True if the result is not wanted any more: no further row is begun. Once true, it stays true.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// What differs beside the camera from the frame that is inferred from; by default nothing.
    fn motion(&self) -> Option<&dyn Motion> {
        None
    }
}

/// What re-centring asks of the scene, beside whole rays: parts of one, and surfaces that are known already.
pub trait CastCentres: CastRays {
    /// What is worth remembering from one pixel to the next; it changes no answer.
    type Memory: Default;

    /// The sample that the ray through the centre of pixel (x, y) finds; no light is asked for.
    fn hit(&self, x: usize, y: usize, counts: &mut RayCounts) -> SurfaceSample;

    /// Finds out which of the lights named by the bits of `ask` reach the sample, and changes their bits in `lit`. Where `ask`
    /// has bits of [`CastCentres::confirm`] only, the shares in `lit` are believed unless a few rays speak against them.
    fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts);

    /// Sets in `differ` bits of the lights on which two samples disagree: all bits in which they differ, unless some of
    /// them belong to numbers that are noisy.
    fn differ(&self, a: &[u32], b: &[u32], differ: &mut [u32]) {
        for ((differ, a), b) in differ.iter_mut().zip(a).zip(b) {
            *differ |= a ^ b;
        }
    }

    /// True if two samples' shadow bits mean the same: [`CastCentres::differ`] would set none.
    fn agree(&self, a: &[u32], b: &[u32]) -> bool {
        a == b
    }

    /// True if an edge of a shadow may lie between two samples.
    fn has_edge(&self, a: &[u32], b: &[u32]) -> bool {
        a != b
    }

    /// Whether any of a sample's bits are numbers: shares of light.
    fn has_shares(&self) -> bool {
        false
    }

    /// Sets in `ask` what asks all lights for their bits, and shares only to be confirmed.
    fn confirm(&self, ask: &mut [u32]) {
        ask.fill(u32::MAX);
    }

    /// Makes of all that `ask` asks of shares to confirm them.
    fn soften(&self, ask: &mut [u32]) {
        let _ = ask;
    }

    /// Clears in `ask` what asks for shares only to be confirmed: there is no edge of a shadow.
    fn keep_edges(&self, ask: &mut [u32]) {
        let _ = ask;
    }

    /// Sets in `ask` all bits of the shares about which it asks anything: once answered, nothing is left to be asked.
    fn settle(&self, ask: &mut [u32]) {
        let _ = ask;
    }

    /// Sets the shares in `lit` to the mean of those that are `known`, each with its weight.
    fn blend<'a>(&self, known: impl Iterator<Item = (&'a [u32], f32)> + Clone, lit: &mut [u32]) {
        let _ = (known, lit);
    }

    /// What the ray through the centre of pixel (x, y) meets first of the triangles that `candidates` lie on. Where these
    /// are the background: that. Not counted, as nothing is looked for in the scene.
    fn nearest_of(
        &self,
        x: usize,
        y: usize,
        candidates: impl Iterator<Item = SurfaceSample>,
        memory: &mut Self::Memory,
    ) -> Option<SurfaceSample>;

    /// Where the rays through the centres of four pixels of a row, from (x, y) on, meet the triangle that `surface` lies on; to
    /// the last bit what [`CastCentres::nearest_of`] finds. None if they have to be looked at one by one.
    fn four_on(
        &self,
        (x, y): (usize, usize),
        surface: SurfaceRef,
        memory: &mut Self::Memory,
    ) -> Option<FourPoints> {
        let _ = (x, y, surface, memory);
        None
    }

    /// True if something hides the sample from the eye. Counted as `visibility`.
    fn is_hidden(&self, sample: &SurfaceSample, counts: &mut RayCounts) -> bool;

    /// True if it is known, without a ray for each, that none of the samples `at` the centres of a rectangle of pixels, columns
    /// and rows, is hidden from the eye.
    fn sees_all(
        &self,
        pixels: (Range<usize>, Range<usize>),
        at: impl Fn(usize, usize) -> SurfaceSample,
    ) -> bool {
        let _ = (pixels, at);
        false
    }
}

/// What differs between two frames beside the camera, and what inference asks about it.
pub trait Motion: Sync {
    /// All that moved.
    fn bodies(&self) -> &Bodies;

    /// The number of the body that carries a sample; none if its surface stands still.
    fn body_of(&self, sample: &SurfaceSample) -> Option<usize>;

    /// A sample of a body in the frame that is inferred; none if it has vanished.
    fn follow(&self, sample: &SurfaceSample) -> Option<SurfaceSample>;

    /// The ways on which light comes to samples: one for each light, and one for the world if that gives ambient light.
    fn ways(&self) -> &[LightWay];

    /// True if light number `light`, of those whose [`LightChange`](crate::frame::LightChange) is `Reach`, shines where a sample is, and did not before.
    fn arrives_anew(&self, light: usize, sample: &SurfaceSample) -> bool;

    /// See [`CastCentres::recast`].
    fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts);
}
