//! One segment's frames: traced or inferred, finished and handed over, one by one.

use super::antialias::Antialias;
use super::caster::{Caster, mix};
use super::mattes::MatteNames;
use super::motion::SceneMotion;
use super::resolve::{Neighbour, Resolver, count_hidden, empty_frame};
use super::shot::Shot;
use super::{FrameSink, Observer, Settings, go_on};
use crate::Result;
use crate::accel::Accel;
use crate::frame::{Aov, FrameId, FrameKind, FrameStats, PixelClass, Quality, StereoEye, SurfaceSample};
use crate::infer::{BuzzBuffer, Inference, Move, Projector, SeenLight, Trust};
use crate::plan::Segment;
use crate::scene::{Scene, View};
use crate::trace::Tracer;
use glam::DVec3;
use std::collections::BTreeSet;
use std::time::Instant;

/// Renders the frames of one segment: fills buffers with samples, turns these into frames and hands them over.
pub(super) struct SegmentRenderer<'a> {
    pub scene: &'a Scene,
    pub settings: &'a Settings,
    pub segment: &'a Segment,
    pub origin: DVec3,
    /// What the key frame shows, of the left or only eye, and of the right one.
    pub key_views: [View; 2],
    pub cuts: &'a [i64],
    pub wanted: &'a BTreeSet<i64>,
    pub names: Option<MatteNames>,
    pub antialias: &'a mut Antialias,
    pub sink: &'a mut dyn FrameSink,
    pub observer: &'a mut dyn Observer,
}

impl SegmentRenderer<'_> {
    pub fn caster<'a>(
        &'a self,
        tracer: &'a Tracer<'a>,
        shot: &'a Shot,
        motion: Option<&'a SceneMotion<'a>>,
    ) -> Caster<'a> {
        let jitter = self.settings.jitter.map(|seed| mix(seed ^ shot.frame as u64));
        let (spacing, first) = (1.0, 0.5);
        Caster {
            tracer,
            view: &shot.view,
            eye: tracer.eye(&shot.view),
            observer: &*self.observer,
            jitter,
            motion,
            spacing,
            first,
        }
    }

    /// Casts a ray through every pixel, and more where these differ.
    pub fn trace(
        &self,
        tracer: &Tracer<'_>,
        shot: &Shot,
        buffer: &mut BuzzBuffer,
        inference: &mut Inference,
    ) -> FrameStats {
        let start = Instant::now();
        buffer.forget(PixelClass::Traced);
        let projector = Projector::new(&shot.view, self.origin);
        let caster = self.caster(tracer, shot, None);
        let rays = buffer.cast_unknown(&projector, &caster);
        let on_lattice = caster.on(buffer.finer.lattice());
        let (cost, subpixels) = inference.trace_subpixels(buffer, &shot.view, self.origin, &on_lattice);
        let mut stats =
            FrameStats { rays: [rays, cost.rays].into_iter().sum(), subpixels, ..FrameStats::default() };
        stats.seconds.trace = start.elapsed().as_secs_f64();
        stats
    }

    /// Infers one view from another, as exactly as the quality asks.
    pub fn infer(
        &self,
        by: Move,
        (old, from): (&BuzzBuffer, &Shot),
        (new, to): (&mut BuzzBuffer, &Shot),
        caster: &Caster<'_>,
        inference: &mut Inference,
    ) -> FrameStats {
        let start = Instant::now();
        let (source, target, origin) = ((old, &from.view), (&mut *new, &to.view), self.origin);
        let trust = match self.settings.quality {
            Quality::Full | Quality::HalfPixel => None,
            Quality::Centred => Some(Trust::Neighbours),
            Quality::Verified => Some(Trust::Proof),
        };
        let cost = match trust {
            None => inference.infer(by, source, target, origin, caster),
            Some(trust) => inference.infer_centred(by, source, target, origin, trust, caster),
        };
        let mut stats = FrameStats { rays: cost.rays, ..FrameStats::default() };
        stats.seconds.trace = cost.tracing.as_secs_f64();
        if self.settings.aa > 1 {
            let on_lattice = caster.on(new.finer.lattice());
            let (cost, subpixels) = inference.infer_subpixels(old, new, &to.view, origin, trust, &on_lattice);
            stats.rays += cost.rays;
            stats.subpixels = subpixels;
            stats.seconds.trace += cost.tracing.as_secs_f64();
        }
        stats.seconds.infer = start.elapsed().as_secs_f64() - stats.seconds.trace;
        stats
    }

    /// How a frame, or an eye of it, is made.
    fn kind(&self, shot: &Shot) -> FrameKind {
        match shot.eye {
            Some(StereoEye::Right) if self.settings.quality != Quality::Full => {
                FrameKind::Inferred { from: shot.frame }
            }
            _ => self.segment.kind(shot.frame),
        }
    }

    /// Finishes a frame, unless the user asked to stop: then its samples may be missing, and it is dropped.
    pub fn emit(
        &mut self,
        (accel, tracer): (&Accel, &Tracer<'_>),
        shot: &Shot,
        buffer: &BuzzBuffer,
        mut stats: FrameStats,
    ) -> Result<()> {
        go_on(self.observer)?;
        let (number, kind) = (shot.frame, self.kind(shot));
        if self.wanted.contains(&number) {
            let start = Instant::now();
            stats.pixels = buffer.count_classes();
            let mut frame = self.sink.blank().unwrap_or_else(|| empty_frame(shot.full_view));
            frame.number = number;
            frame.eye = shot.eye;
            frame.kind = kind;
            frame.view = shot.full_view;
            frame.camera.clone_from(&self.scene.cameras[shot.camera].name);
            let seen = SeenLight::new(buffer, &shot.view, self.origin);
            let known = |point: &SurfaceSample| seen.lit(point, |a, b| tracer.agree(a, b));
            // Key frames are traced in all respects, and as long as the camera is held there nothing changes. What is to be
            // proven is not taken from what is seen elsewhere.
            let moves = shot.full_view != self.key_views[usize::from(shot.eye == Some(StereoEye::Right))];
            let is_trusted = moves && self.settings.quality == Quality::Centred;
            let resolver = Resolver {
                scene: self.scene,
                settings: self.settings,
                gain: self.settings.exposure.exp2(),
                tracer,
                eye: tracer.eye(&shot.view),
                observer: &*self.observer,
                origin: self.origin,
                next: self.neighbour(accel, shot, number + 1, self.cuts.contains(&(number + 1))),
                previous: self.neighbour(accel, shot, number - 1, self.cuts.contains(&number)),
                known: is_trusted.then_some(&known),
                names: self.names.as_ref(),
            };
            stats.rays += resolver.resolve(buffer, self.antialias, &mut frame);
            stats.seconds.enhance = start.elapsed().as_secs_f64();
            if self.settings.audit {
                stats.hidden = Some(count_hidden(tracer, &*self.observer, &shot.view, buffer));
            }
            go_on(self.observer)?;
            frame.stats = stats;
            self.sink.put(frame)?;
        }
        let id = FrameId { number, eye: shot.eye };
        self.observer.frame_done(id, kind, &stats, self.wanted.contains(&number));
        go_on(self.observer)
    }

    /// The frame next to `shot`, for motion; none across a cut or outside the range.
    fn neighbour(&self, accel: &Accel, shot: &Shot, number: i64, is_cut: bool) -> Option<Neighbour> {
        let timing = &self.scene.timing;
        let wanted = self.settings.aovs.contains(Aov::Motion) && !is_cut;
        let inside = (timing.first..=timing.last).contains(&number);
        let other = (wanted && inside).then(|| Shot::of_eye(shot.eye, self.scene, self.settings, number));
        other.filter(|o| o.camera == shot.camera).map(|o| {
            let moved = !self.scene.surfaces_alike(&shot.pose, &o.pose);
            let raster = [&shot.view, &o.view].map(|view| view.raster_from_world(self.origin));
            Neighbour { raster, surfaces: moved.then(|| accel.displaced(self.scene, &o.pose)) }
        })
    }
}
