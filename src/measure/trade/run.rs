//! Renders the sampled segments by every quality in turn, twice, and keeps what each frame took and how wrong it is.

use super::{Candidate, ChainStep, Measured, MeasuredFrame, Summary, Trade, WorstPlace, distance, total};
use crate::accel::Accel;
use crate::frame::{Frame, FrameId, FrameKind, FrameStats, PixelClass, StageSeconds};
use crate::measure::{ENHANCED, Exposure, ImageError, Percentile, compare_pictures, picture, worst_place};
use crate::output::NullSink;
use crate::plan::Segment;
use crate::scene::Scene;
use crate::sequence::{FrameSink, Observer, Quality, Settings, render_sequence};
use crate::{Error, Result};
use half::f16;
use image::imageops::crop_imm;
use std::collections::{BTreeMap, BTreeSet};

/// Times that every frame is rendered: first the qualities in their order, then in the opposite one, so that a machine
/// that grows slower or faster favours none. The faster round counts: noise only ever adds.
pub const ROUNDS: usize = 2;

/// Worst places that are kept of each quality.
const WORST_PLACES: usize = 3;

/// Told what is done, and asked whether to go on.
pub trait Watch: Sync {
    /// Another segment has been rendered by a quality; `done` of `total`.
    fn rendered(&mut self, quality: Quality, done: usize, total: usize);

    /// The signal by which the user asked to stop, if so.
    fn stop_requested(&self) -> Option<i32>;
}

/// Measures `candidates` on the frames of `spans`, against the first of them.
///
/// Pictures are compared at half precision, as files hold them, so that the errors are those of [`super::super::compare()`] on
/// the files of separate runs. All sampled frames of the truth are kept in memory, [`TRUTH_BYTES_PER_PIXEL`].
///
/// # Errors
/// [`Error::Usage`] without frames or candidates; [`Error::Interrupted`] if `watch` asks to stop.
pub fn trade(
    input: &str,
    scene: &Scene,
    accel: &mut Accel,
    candidates: &[Candidate],
    spans: &[Segment],
    watch: &mut dyn Watch,
) -> Result<Trade> {
    let Some(first) = candidates.first().filter(|_| !spans.is_empty()) else {
        return Err(Error::Usage("there are no frames to measure".into()));
    };
    let mut runs: Vec<Run> = candidates.iter().map(|candidate| Run::new(candidate, spans)).collect();
    let mut truth = Truth::default();
    let turns = turns(runs.len(), spans.len());
    for (done, &Turn { round, span, quality }) in turns.iter().enumerate() {
        let run = &mut runs[quality];
        match (round, quality) {
            (0, 0) => {
                let mut sink = KeepTruth { truth: &mut truth, free: None };
                run.render(scene, accel, span, &mut sink, &*watch)?;
            }
            (0, _) | (_, 0) => run.render(scene, accel, span, &mut NullSink::default(), &*watch)?,
            // The whole truth is known since the first round, and with it the exposure.
            _ => run.check(scene, accel, span, &truth, &*watch)?,
        }
        watch.rendered(run.candidate.settings.quality, done + 1, turns.len());
    }
    let settings = &first.settings;
    Ok(Trade {
        schema: Trade::SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        input: input.into(),
        width: settings.width,
        height: settings.height,
        threads: rayon::current_num_threads(),
        rounds: ROUNDS,
        exposure: truth.exposure().scale,
        spans: spans.iter().map(|s| [s.first, s.last]).collect(),
        qualities: runs.into_iter().map(|run| run.measured(&truth)).collect(),
    })
}

/// A span to be rendered by a quality.
struct Turn {
    round: usize,
    span: usize,
    quality: usize,
}

/// Of so many qualities and spans each with each: every span by all qualities before the next one, in every other round by the last
/// quality first.
fn turns(qualities: usize, spans: usize) -> Vec<Turn> {
    let mut turns = Vec::new();
    for (round, span) in (0..ROUNDS).flat_map(|round| (0..spans).map(move |span| (round, span))) {
        let turn = |quality: usize| Turn { round, span, quality };
        match round % 2 {
            0 => turns.extend((0..qualities).map(turn)),
            _ => turns.extend((0..qualities).rev().map(turn)),
        }
    }
    turns
}

/// A quality on its way.
struct Run<'a> {
    candidate: &'a Candidate,
    /// Its frames for each span.
    frames: Vec<BTreeSet<i64>>,
    takes: BTreeMap<i64, Take>,
    check: Check,
}

impl<'a> Run<'a> {
    /// For each span all of the quality's own segments that reach into it, so that its chains are whole and its key frames
    /// are counted; no frame twice.
    fn new(candidate: &'a Candidate, spans: &[Segment]) -> Self {
        let mut taken = BTreeSet::new();
        let frames = spans.iter().map(|span| {
            let segments = candidate.plan.segments.iter();
            let touching = segments.filter(|s| s.first <= span.last && s.last >= span.first);
            touching.flat_map(|s| s.first..=s.last).filter(|&frame| taken.insert(frame)).collect()
        });
        Self { candidate, frames: frames.collect(), takes: BTreeMap::new(), check: Check::default() }
    }

    fn render(
        &mut self,
        scene: &Scene,
        accel: &mut Accel,
        span: usize,
        sink: &mut dyn FrameSink,
        watch: &dyn Watch,
    ) -> Result<()> {
        let Candidate { settings, plan } = self.candidate;
        let mut recorder = Recorder { takes: &mut self.takes, watch };
        render_sequence(scene, accel, settings, plan, &self.frames[span], sink, &mut recorder)
    }

    /// Renders, audits and compares. Neither the audit nor the comparison is timed.
    fn check(
        &mut self,
        scene: &Scene,
        accel: &mut Accel,
        span: usize,
        truth: &Truth,
        watch: &dyn Watch,
    ) -> Result<()> {
        let Candidate { settings, plan } = self.candidate;
        let settings = Settings { audit: true, ..settings.clone() };
        let (width, exposure) = (settings.window.width, truth.exposure());
        let mut sink = CheckSink { exposure, width, check: &mut self.check, truth, free: None };
        let mut recorder = Recorder { takes: &mut self.takes, watch };
        render_sequence(scene, accel, &settings, plan, &self.frames[span], &mut sink, &mut recorder)
    }

    fn measured(self, truth: &Truth) -> Measured {
        let Self { candidate: Candidate { settings, plan }, takes, check, .. } = self;
        let is_truth = check.errors.is_empty();
        let error = |frame: i64| {
            let same = || (is_truth && truth.frames.contains_key(&frame)).then(ImageError::default);
            check.errors.get(&frame).copied().or_else(same)
        };
        let frames: Vec<_> = takes
            .into_iter()
            .map(|(frame, take)| take.measured(frame, distance(plan, frame), error(frame)))
            .collect();
        Measured {
            quality: settings.quality.name(),
            summary: Summary::of(&frames, settings.window.pixels()),
            chain: ChainStep::all(&frames),
            worst: check.worst,
            frames,
        }
    }
}

/// What one frame took, round by round.
#[derive(Debug, Clone)]
struct Take {
    kind: FrameKind,
    /// Of the last round.
    stats: FrameStats,
    seconds: Vec<StageSeconds>,
}

impl Take {
    fn measured(self, frame: i64, distance: u64, error: Option<ImageError>) -> MeasuredFrame {
        let faster = self.seconds.iter().copied().min_by(|a, b| total(a).total_cmp(&total(b)));
        let from = match self.kind {
            FrameKind::Traced => None,
            FrameKind::Inferred { from } => Some(from),
        };
        let reused =
            PixelClass::ALL.iter().filter(|c| c.is_reused()).map(|&c| self.stats.pixels[c as usize]).sum();
        MeasuredFrame {
            frame,
            from,
            distance,
            seconds: faster.unwrap_or_default(),
            rounds: self.seconds.iter().map(total).collect(),
            rays: self.stats.rays,
            reused,
            hidden: self.stats.hidden,
            error,
        }
    }
}

/// Keeps each frame's counts and times.
struct Recorder<'a> {
    takes: &'a mut BTreeMap<i64, Take>,
    watch: &'a dyn Watch,
}

impl Observer for Recorder<'_> {
    fn frame_done(&mut self, frame: FrameId, kind: FrameKind, stats: &FrameStats, wanted: bool) {
        if wanted {
            let take =
                self.takes.entry(frame.number).or_insert(Take { kind, stats: *stats, seconds: Vec::new() });
            take.stats = *stats;
            take.seconds.push(stats.seconds);
        }
    }

    fn stop_requested(&self) -> Option<i32> {
        self.watch.stop_requested()
    }
}

/// The frames that all others are measured against, as files would hold them.
#[derive(Default)]
struct Truth {
    frames: BTreeMap<i64, Vec<[f16; 4]>>,
    percentile: Percentile,
}

/// What is kept of each pixel of the truth's sampled frames.
pub const TRUTH_BYTES_PER_PIXEL: u64 = size_of::<[f16; 4]>() as u64;

impl Truth {
    fn exposure(&self) -> Exposure {
        Exposure::from_p99(self.percentile.get(0.99))
    }
}

/// Colours as a file holds them.
fn halves(color: &[[f32; 4]]) -> impl Iterator<Item = [f16; 4]> {
    color.iter().map(|pixel| pixel.map(f16::from_f32))
}

fn floats(color: impl Iterator<Item = [f16; 4]>) -> Vec<[f32; 4]> {
    color.map(|pixel| pixel.map(f16::to_f32)).collect()
}

struct KeepTruth<'a> {
    truth: &'a mut Truth,
    free: Option<Frame>,
}

impl FrameSink for KeepTruth<'_> {
    fn blank(&mut self) -> Option<Frame> {
        self.free.take()
    }

    fn put(&mut self, frame: Frame) -> Result<()> {
        self.truth.percentile.add(&frame.color);
        self.truth.frames.insert(frame.number, halves(&frame.color).collect());
        self.free = Some(frame);
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<(FrameId, StageSeconds)>> {
        Ok(Vec::new())
    }
}

/// How wrong the frames of a quality are.
#[derive(Default)]
struct Check {
    errors: BTreeMap<i64, ImageError>,
    worst: Vec<WorstPlace>,
}

struct CheckSink<'a> {
    exposure: Exposure,
    width: u32,
    check: &'a mut Check,
    truth: &'a Truth,
    free: Option<Frame>,
}

impl CheckSink<'_> {
    fn compare(&mut self, number: i64, color: &[[f32; 4]], truth: &[[f32; 4]]) {
        let (error, map) = compare_pictures(color, truth, self.width as usize, self.exposure);
        self.check.errors.insert(number, error);
        let Some(place) = worst_place(&map, self.width as usize) else { return };
        let worst = &mut self.check.worst;
        if worst.len() == WORST_PLACES && worst.last().is_some_and(|w| w.place.flip >= place.flip) {
            return;
        }
        let pictures = [
            picture::beauty(truth, self.width, self.exposure),
            picture::beauty(color, self.width, self.exposure),
            picture::difference(color, truth, self.width, self.exposure, ENHANCED),
        ];
        let (x, y) = (place.x as u32, place.y as u32);
        let crops = pictures
            .map(|whole| whole.map(|whole| crop_imm(&whole, x, y, place.side, place.side).to_image()));
        if let [Some(truth), Some(shown), Some(difference)] = crops {
            worst.push(WorstPlace { frame: number, place, truth, shown, difference });
            worst.sort_by(|a, b| b.place.flip.total_cmp(&a.place.flip));
            worst.truncate(WORST_PLACES);
        }
    }
}

impl FrameSink for CheckSink<'_> {
    fn blank(&mut self) -> Option<Frame> {
        self.free.take()
    }

    fn put(&mut self, frame: Frame) -> Result<()> {
        if let Some(truth) = self.truth.frames.get(&frame.number) {
            let truth = floats(truth.iter().copied());
            self.compare(frame.number, &floats(halves(&frame.color)), &truth);
        }
        self.free = Some(frame);
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<(FrameId, StageSeconds)>> {
        Ok(Vec::new())
    }
}
