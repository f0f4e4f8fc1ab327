//! What an artist sees while it runs, and what stops it.

use super::args::ProgressArg;
use super::interrupt::Interrupt;
use super::say;
use buzz::frame::{FrameId, FrameKind, FrameStats, RayCounts, StereoEye};
use buzz::sequence::Observer;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Counts frames and rays, prints them, and passes on a request to stop.
pub struct Progress {
    style: Style,
    work: Work,
    done: usize,
    /// Frames made that were not asked for.
    passed: usize,
    tally: Tally,
    start: Instant,
    interrupt: Arc<Interrupt>,
}

/// What there is to do.
#[derive(Debug, Clone, Copy)]
pub struct Work {
    /// Pictures that are asked for.
    pub frames: usize,
    /// Frames that have to be made before.
    pub on_the_way: usize,
}

enum Style {
    Bar(ProgressBar),
    Plain,
    Openjd,
    None,
}

/// Rays of a run, and what tracing every frame would have taken.
#[derive(Debug, Default, Clone, Copy)]
pub struct Tally {
    frames: u64,
    key_frames: u64,
    key_rays: u64,
    rays: RayCounts,
}

impl Tally {
    /// Counts a frame.
    pub fn add(&mut self, kind: FrameKind, rays: RayCounts) {
        self.frames += 1;
        self.rays += rays;
        if kind == FrameKind::Traced {
            self.key_frames += 1;
            self.key_rays += rays.primary_and_shadow();
        }
    }

    /// Share of camera and shadow rays saved, if the other frames need as many as the key frames do. Unknown where they plainly need
    /// more, as where a light is out in the key frames.
    pub fn saved(&self) -> Option<f64> {
        let full = self.key_rays as f64 / self.key_frames as f64 * self.frames as f64;
        let cast = self.rays.primary_and_shadow() as f64;
        (full > 0.0 && cast <= full).then(|| 1.0 - cast / full)
    }
}

impl Progress {
    /// Progress of `work`; `interrupt` knows whether to stop.
    pub fn new(style: ProgressArg, work: Work, interrupt: Arc<Interrupt>) -> Self {
        let total = work.frames + work.on_the_way;
        let style = match style {
            ProgressArg::Auto if std::io::stderr().is_terminal() => Style::Bar(bar(total)),
            ProgressArg::Bar => Style::Bar(bar(total)),
            ProgressArg::Auto | ProgressArg::Plain => Style::Plain,
            ProgressArg::Openjd => Style::Openjd,
            ProgressArg::None => Style::None,
        };
        let (tally, start) = (Tally::default(), Instant::now());
        Self { style, work, done: 0, passed: 0, tally, start, interrupt }
    }

    /// Leaves the terminal as it was.
    pub fn finish(&self) {
        if let Style::Bar(bar) = &self.style {
            bar.finish_and_clear();
        }
    }

    fn left(&self) -> Duration {
        let (made, all) = (self.done + self.passed, self.work.frames + self.work.on_the_way);
        let each = self.start.elapsed().as_secs_f64() / made.max(1) as f64;
        Duration::from_secs_f64(each * all.saturating_sub(made) as f64)
    }

    /// Says that a frame was made which was not asked for.
    fn pass(&self, frame: FrameId) {
        let what = format!("on the way, {} of {}", self.passed, self.work.on_the_way);
        match &self.style {
            Style::Bar(bar) => {
                bar.set_style(style(RUNNING));
                bar.set_message(format!("frame {frame} {what}"));
                bar.inc(1);
            }
            Style::Plain => {
                say::line(format_args!("frame {frame}: {what}, {} left", HumanDuration(self.left())))
            }
            Style::Openjd => {
                // A reader that cannot be reached is no error of the frame's.
                let left = HumanDuration(self.left());
                let _ = say::result(&format!("openjd_status: {what}: frame {frame}, {left} left\n"));
            }
            Style::None => {}
        }
    }

    fn say(&self, frame: FrameId, kind: FrameKind, stats: &FrameStats) {
        let saved =
            self.tally.saved().map(|s| format!(", {:.1} % of rays saved", s * 100.0)).unwrap_or_default();
        let how = match kind {
            FrameKind::Traced => "traced".to_owned(),
            FrameKind::Inferred { .. } if frame.eye == Some(StereoEye::Right) => "inferred from left".into(),
            FrameKind::Inferred { from } => format!("inferred from {from}"),
        };
        let share = 100.0 * stats.traced_share();
        match &self.style {
            Style::Bar(bar) => {
                bar.set_style(style(RUNNING));
                bar.set_message(format!("frame {frame} {how}{saved}"));
                bar.inc(1);
            }
            Style::Plain => say::line(format_args!(
                "frame {frame}: {how}, {share:.1} % of pixels traced; {}/{}{saved}, {} left",
                self.done,
                self.work.frames,
                HumanDuration(self.left())
            )),
            Style::Openjd => {
                let percent = 100.0 * self.done as f64 / self.work.frames.max(1) as f64;
                let left = HumanDuration(self.left());
                let lines = format!(
                    "openjd_progress: {percent:.1}\nopenjd_status: frame {frame} {how}{saved}, {left} left\n"
                );
                // A reader that cannot be reached is no error of the frame's.
                let _ = say::result(&lines);
            }
            Style::None => {}
        }
    }
}

/// Once a frame is there.
const RUNNING: &str = "{bar:30} {pos}/{len}  {msg}  {eta} left";

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

fn bar(total: usize) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::stderr());
    // Nobody knows how long it will take before the first frame.
    bar.set_style(style("{bar:30} {pos}/{len}  {msg}"));
    bar.set_message("first frame");
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

impl Observer for Progress {
    fn frame_done(&mut self, frame: FrameId, kind: FrameKind, stats: &FrameStats, wanted: bool) {
        if !wanted {
            self.passed += 1;
            return self.pass(frame);
        }
        self.done += 1;
        self.tally.add(kind, stats.rays);
        self.say(frame, kind, stats);
    }

    fn stop_requested(&self) -> Option<i32> {
        self.interrupt.stop_requested()
    }
}
