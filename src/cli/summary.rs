//! What a run ends with: its report, and three lines that sum it up.

use super::job::Job;
use super::progress::Tally;
use buzz::frame::FrameKind;
use buzz::infer::BuzzBuffer;
use buzz::output::{self, FrameRecord, Report, ReportInput, Run, SceneSummary, SegmentRange, SettingsHash};
use buzz::plan::Plan;
use buzz::scene::Requirements;
use buzz::trace::lit_words;
use std::path::Path;

/// The report of a run on `frames`, and of the earlier `runs` that it found frames of.
pub fn report(
    input: &Path,
    settings_hash: SettingsHash,
    job: &Job,
    plan: &Plan,
    frames: Vec<FrameRecord>,
    (runs, warnings): (Vec<Run>, Vec<String>),
) -> Report {
    let scene = &job.scene;
    Report::new(ReportInput {
        input: input.display().to_string(),
        settings_hash,
        settings: output::Settings {
            quality: job.settings.quality.name().into(),
            width: job.settings.width,
            height: job.settings.height,
            fps: output::Settings::fps(scene.timing.fps),
            threads: job.threads,
            aa: job.settings.aa,
        },
        scene: SceneSummary {
            triangles: scene.triangle_count(),
            shapes: scene.shape_count(),
            instances: scene.instances.len(),
            lights: scene.lights.len(),
            requires: Requirements::of(scene).names().iter().map(|&n| n.into()).collect(),
            ignored: scene.ignored.iter().map(Into::into).collect(),
            bytes_per_pixel: BuzzBuffer::bytes_per_pixel(lit_words(scene, job.settings.trace_options())),
        },
        plan: plan.into(),
        frames,
        predicted: plan.frames.iter().map(|f| (f.frame, f.predicted_traced)).collect(),
        runs,
        warnings,
    })
}

/// Four lines: frames, rays saved, where the time went, and where the report's `page` is. So many frames were made on the way.
pub fn summary(report: &Report, made_on_the_way: usize, page: &Path) -> String {
    let totals = &report.totals;
    let frames = match (totals.frames, report.frames.iter().any(|f| f.eye.is_some())) {
        (1, false) => "frame",
        (_, false) => "frames",
        (_, true) => "pictures of two eyes",
    };
    let mut tally = Tally::default();
    for frame in &report.frames {
        tally.add(frame.from.map_or(FrameKind::Traced, |from| FrameKind::Inferred { from }), frame.rays);
    }
    let saved = tally.saved().map(|s| format!("{:.1} % of camera and shadow rays saved", 100.0 * s));
    let hidden = totals.hidden.map(|h| format!("; {h} reused samples hidden")).unwrap_or_default();
    let s = &totals.seconds;
    let wall = report.runs.last().map_or(s.wall, |run| run.seconds.wall);
    let runs = match report.runs.len() {
        0 | 1 => String::new(),
        n => format!(" ({:.1} s in all {n} runs)", s.wall),
    };
    let on_the_way = match s.on_the_way {
        0.0 => String::new(),
        seconds => format!(" {seconds:.1} frames on the way,"),
    };
    format!(
        "{} {frames}: {} traced, {} inferred, in {:.1} s{runs}\n{}{hidden}\n\
         seconds: {:.1} reading, {:.1} trees, {:.1} plan,{on_the_way} {:.1} infer, {:.1} trace, {:.1} enhance, \
         {:.1} write (beside)\nreport: {}\n",
        totals.frames,
        totals.traced_frames,
        totals.inferred_frames,
        wall,
        saved.unwrap_or_else(|| not_known(report, made_on_the_way)),
        s.import,
        s.accel,
        s.plan,
        s.infer,
        s.trace,
        s.enhance,
        s.write,
        page.display()
    )
}

/// Why nobody can tell what part of the rays was saved.
fn not_known(report: &Report, made_on_the_way: usize) -> String {
    if report.totals.traced_frames > 0 {
        return "rays saved: not known, as these frames take more rays than their key frames do".into();
    }
    let holds = |s: &&SegmentRange| report.frames.iter().any(|f| (s.first..=s.last).contains(&f.frame));
    let keys: Vec<String> = report.plan.segments.iter().filter(holds).map(|s| s.key.to_string()).collect();
    let which = match keys.as_slice() {
        [key] => format!("their key frame ({key}) is"),
        keys => format!("their key frames ({}) are", keys.join(", ")),
    };
    let on_the_way = match made_on_the_way {
        0 => String::new(),
        1 => "; 1 frame was made on the way".into(),
        made => format!("; {made} frames were made on the way"),
    };
    format!("rays saved: not known, as {which} not among these frames{on_the_way}")
}
