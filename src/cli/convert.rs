//! `buzz-convert INPUT OUT_DIR`: the main job.

use super::args::{CompressionArg, ConvertArgs, OutputArgs};
use super::existing::{
    existing, place_of, prepare_report, refuse_inputs, refuse_report_of_another, remove_stale_reports,
    report_files,
};
use super::interrupt::Interrupt;
use super::job::{Job, refuse_reversed, stem, warn_of_ignored};
use super::plan_file::PlanFile;
use super::progress::{Progress, Work};
use super::say;
use super::summary::{report, summary};
use super::warnings::Warnings;
use super::{memory, parse};
use anyhow::{Context, Result};
use buzz::error::Error;
use buzz::frame::{Aov, FrameId, FrameKind, FrameStats, StereoEye};
use buzz::output::{
    Compression, ExrSink, FileOptions, FrameRecord, NamePattern, OutputFolder, Report, Review, Run,
    RunSeconds, SettingsHash, SettingsHasher, Thumbnails, WithThumbnails, earlier_runs, peak_bytes,
};
use buzz::plan::{Plan, Segment};
use buzz::scene::{Projection, Scene, Timing};
use buzz::sequence::{FrameSink, Observer, Settings, render_sequence};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// What to do after an interruption.
pub const ADVICE: &str = "; finished frames are whole: run again with --skip-existing to go on";

pub fn run(args: ConvertArgs) -> Result<ExitCode> {
    let (started, start) = (SystemTime::now(), Instant::now());
    let (input, out_dir) = places(&args)?;
    let interrupt = Interrupt::watch(ADVICE).context("signals cannot be watched")?;
    let names =
        NamePattern::parse(args.output.name.as_deref().unwrap_or(NamePattern::DEFAULT), &stem(input))?;
    let asked = args.output.frames.as_deref().map(parse::frames).transpose()?;
    if asked.as_ref().is_some_and(BTreeSet::is_empty) {
        say::line("no frame is asked for: nothing to do");
        return Ok(ExitCode::SUCCESS);
    }
    let replayed = args.output.plan.as_deref().map(PlanFile::read).transpose()?;
    let memory_limit = args.output.memory.as_deref().map(parse::memory).transpose()?;
    let mut job = Job::new(input, &args.scene, &args.image.render, args.image.quality, memory_limit)?;
    warn_of_ignored(&job.scene);
    choose_image(&mut job.settings, &job.scene, &args.output)?;

    let request = Request::new(&args, input, out_dir, asked, &job.scene.timing);
    interrupt.writing();
    let folder = claim_folder(&request, names, &job)?;
    let mut warnings = Warnings::default();
    warnings.of_no_locks(&folder);
    warnings.of_eyes_far_apart(job.settings.stereo);

    memory::refuse_planning_over(memory_limit, &job)?;
    let planning = Instant::now();
    let plan = match &replayed {
        Some(file) => job.replay(file, &*interrupt)?,
        None => job.plan(1, &*interrupt)?,
    };
    let plan_seconds = planning.elapsed().as_secs_f64();

    let hash = settings_hash(&job, &plan, &args);
    let kept = existing(&folder, &request.frames, &hash, &job.settings, &args, &interrupt)?;
    warnings.of_frames_beyond(&request.frames, &job.scene.timing);
    let kept_numbers: BTreeSet<i64> = kept.iter().map(|record| record.id.number).collect();
    let to_render = &request.frames - &kept_numbers;
    if !to_render.is_empty() {
        memory::refuse_over(memory_limit, &job, 0)?;
        let is_there = |&&f: &&i64| job.settings.pictures_of(f).any(|id| folder.file_of(id).exists());
        let replaced = to_render.iter().filter(is_there).copied().collect();
        let whole = out_dir.join(WHOLE_REPORT);
        remove_stale_reports(&request.report, &whole, input, &hash, &replaced, &args)?;
    }
    let mut thumbnails = Thumbnails::of(&request.frames, job.scene.timing.pixel_aspect);
    let shown = kept.iter().map(|record| record.id).filter(|id| id.eye != Some(StereoEye::Right));
    let files: Vec<_> = shown.map(|id| (id.number, folder.file_of(id))).collect();
    thumbnails.read(&files, || interrupt.stop_requested())?;

    let options = FileOptions {
        compression: compression(args.output.compression),
        fps: job.scene.timing.fps,
        quality: job.settings.quality.name().into(),
        settings_hash: hash.clone(),
    };
    let mut sink = ExrSink::new(folder, options)?;
    let frames = to_render.iter().flat_map(|&f| job.settings.pictures_of(f)).count();
    let on_the_way = plan.on_the_way(&to_render);
    let work = Work { frames, on_the_way };
    // Its clock tells how long frames take: it begins with them.
    let progress = Progress::new(args.output.progress, work, interrupt);
    let mut recorder = Recorder { progress, records: kept, on_the_way: 0.0 };
    render(&mut job, &plan, &to_render, &mut sink, &mut thumbnails, &mut recorder)?;
    let mut records = recorder.records;
    warnings.of_repaired(&sink.repaired());

    let (report_folder, report_name) = place_of(&request.report);
    let (mut runs, said) = earlier_runs(&mut records, report_folder, &report_name, &hash);
    said.into_iter().for_each(|warning| warnings.add_unless_given(warning));
    runs.push(Run {
        report: report_name,
        started: started.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64),
        threads: job.threads,
        seconds: RunSeconds {
            import: job.import_seconds,
            accel: job.accel_seconds,
            plan: plan_seconds,
            on_the_way: recorder.on_the_way,
            wall: start.elapsed().as_secs_f64(),
        },
        peak_bytes: peak_bytes(),
    });
    let report = report(input, hash, &job, &plan, records, (runs, warnings.given));
    write_report(&report, &request, &job, sink.folder().names(), &thumbnails)?;
    say::result(&summary(&report, on_the_way, &request.report.with_extension("html")))?;
    Ok(ExitCode::SUCCESS)
}

/// The input and the output folder.
fn places(args: &ConvertArgs) -> Result<(&Path, &Path)> {
    let (Some(input), Some(out_dir)) = (&args.input, &args.out_dir) else {
        return Err(Error::Usage("INPUT and OUT_DIR are missing".into()).into());
    };
    refuse_reversed(input, out_dir)?;
    if input.extension().is_none() && !input.exists() {
        let message =
            "there is no such file, nor such a command; commands are plan, inspect, compare and trade";
        return Err(Error::input(input, "file", message).into());
    }
    Ok((input, out_dir))
}

/// What a run is asked to make, of what, and where.
struct Request<'a> {
    args: &'a ConvertArgs,
    input: &'a Path,
    out_dir: &'a Path,
    frames: BTreeSet<i64>,
    report: PathBuf,
}

/// The report of a scene's whole range.
const WHOLE_REPORT: &str = "report.json";

impl<'a> Request<'a> {
    /// Of the frames that are asked for, or the whole range.
    fn new(
        args: &'a ConvertArgs,
        input: &'a Path,
        out_dir: &'a Path,
        asked: Option<BTreeSet<i64>>,
        timing: &Timing,
    ) -> Self {
        let range: BTreeSet<i64> = (timing.first..=timing.last).collect();
        let frames = asked.unwrap_or_else(|| range.clone());
        // Part of a range has a report of its own, so that several runs may share a folder.
        let name = match (frames.first(), frames.last()) {
            (Some(first), Some(last)) if frames != range => format!("report.{first}-{last}.json"),
            _ => WHOLE_REPORT.into(),
        };
        let report = args.output.report.clone().unwrap_or_else(|| out_dir.join(name));
        Self { args, input, out_dir, frames, report }
    }
}

/// Opens the output folder for the run's frames. Finds out before the rendering that nothing which the run reads, and no other scene's report,
/// is replaced, and that its own report can be written.
fn claim_folder(request: &Request, names: NamePattern, job: &Job) -> Result<OutputFolder> {
    let Request { args, input, out_dir, frames, report } = request;
    let pictures = || frames.iter().flat_map(|&frame| job.settings.pictures_of(frame));
    let is_elsewhere = args.output.report.is_some();
    if is_elsewhere {
        prepare_report(report)?;
    }
    let folder = OutputFolder::open(out_dir, names, pictures())?;
    // In the output folder: which had to be made first.
    if !is_elsewhere {
        prepare_report(report)?;
    }
    let mut inputs = job.scene.files.clone();
    inputs.extend(args.output.plan.as_ref().and_then(|plan| plan.canonicalize().ok()));
    refuse_inputs(pictures().map(|id| folder.file_of(id)).chain(report_files(report)), &inputs)?;
    if !args.output.overwrite {
        refuse_report_of_another(report, input)?;
    }
    Ok(folder)
}

/// Renders `frames` into `sink`. Then the recorder has them beside those that it had, in order.
fn render(
    job: &mut Job,
    plan: &Plan,
    frames: &BTreeSet<i64>,
    sink: &mut ExrSink,
    thumbnails: &mut Thumbnails,
    recorder: &mut Recorder,
) -> Result<()> {
    let Job { scene, accel, settings, .. } = job;
    let mut shown = WithThumbnails { sink, thumbnails };
    let rendered = render_sequence(scene, accel, settings, plan, frames, &mut shown, recorder);
    // Frames that are under way are still written, whatever stopped the run.
    let written = sink.finish();
    recorder.progress.finish();
    rendered?;
    for (id, seconds) in written? {
        if let Some(record) = recorder.records.iter_mut().find(|record| record.id == id) {
            record.stats.seconds.write = seconds.write;
        }
    }
    recorder.records.sort_by_key(|record| record.id);
    Ok(())
}

/// Writes the report, its page, and its folder for review.
fn write_report(
    report: &Report,
    request: &Request,
    job: &Job,
    names: &NamePattern,
    thumbnails: &Thumbnails,
) -> Result<()> {
    report.write_json(&request.report)?;
    report.write_html(&request.report.with_extension("html"), &thumbnails.encoded())?;
    let (settings, timing) = (&job.settings, &job.scene.timing);
    // Of a pair, the left eye is looked at.
    let names = if settings.stereo.is_some() { names.of_eye(StereoEye::Left) } else { names.clone() };
    let review = Review {
        folder: request.out_dir,
        names: &names,
        frames: &request.frames,
        cuts: &report.plan.cuts,
        keyframes: &report.plan.keyframes,
        fps: timing.fps,
        width: settings.width,
        height: settings.height,
        pixel_aspect: timing.pixel_aspect,
        window: settings.window,
        has_class: settings.aovs.contains(Aov::Class),
    };
    Ok(review.write(&request.report, thumbnails)?)
}

/// Puts into `settings` what is asked of the image.
pub(super) fn choose_image(settings: &mut Settings, scene: &Scene, args: &OutputArgs) -> Result<()> {
    if let Some(text) = &args.crop {
        settings.window = parse::crop(text, (settings.width, settings.height))?;
    }
    if !args.exposure.is_finite() {
        let message = format!("--exposure {}: expected a number of stops", args.exposure);
        return Err(Error::Usage(message).into());
    }
    settings.stereo = args.stereo.map(|eyes| parse::stereo(eyes, args.convergence)).transpose()?;
    settings.aovs = parse::aovs(&args.aov)?;
    settings.transparent = args.transparent;
    settings.exposure = args.exposure;
    settings.bounces = args.bounces;
    settings.aa = args.aa;
    settings.audit = args.audit;
    memory::refuse_uncountable(settings)?;
    if settings.stereo.is_some() {
        refuse_parallel(scene, settings)?;
    }
    Ok(())
}

/// Parallel rays show both eyes the same.
fn refuse_parallel(scene: &Scene, settings: &Settings) -> Result<()> {
    let cameras: BTreeSet<usize> =
        (scene.timing.first..=scene.timing.last).map(|f| scene.camera_at(f, settings.camera)).collect();
    let parallel = |&&c: &&usize| matches!(scene.cameras[c].lens.projection, Projection::Orthographic { .. });
    match cameras.iter().find(parallel) {
        Some(&c) => {
            let name = &scene.cameras[c].name;
            let message = format!(
                "--stereo: camera {name} is orthographic, and has no parallax; choose another by --camera"
            );
            Err(Error::Usage(message).into())
        }
        None => Ok(()),
    }
}

/// Identifies everything that decides the pixels: the scene as read, the settings, the plan, and the program's version.
fn settings_hash(job: &Job, plan: &Plan, args: &ConvertArgs) -> SettingsHash {
    let mut hasher = SettingsHasher::new();
    let mut settings = job.settings.clone();
    settings.audit = false;
    hasher.feed("version", env!("CARGO_PKG_VERSION"));
    hasher.feed("settings", format!("{settings:?}"));
    hasher.feed("quality", job.settings.quality.name());
    for Segment { key, first, last } in &plan.segments {
        hasher.feed("segment", [key, first, last].map(|n| n.to_le_bytes()).concat());
    }
    for cut in &plan.cuts {
        hasher.feed("cut", cut.to_le_bytes());
    }
    hasher.feed("compression", format!("{:?}", args.output.compression));
    job.scene.digest(&mut |name, bytes| {
        hasher.feed(name, bytes);
    });
    hasher.finish()
}

fn compression(compression: CompressionArg) -> Compression {
    match compression {
        CompressionArg::None => Compression::None,
        CompressionArg::Rle => Compression::Rle,
        CompressionArg::Zips => Compression::Zips,
        CompressionArg::Zip => Compression::Zip,
        CompressionArg::Piz => Compression::Piz,
    }
}

/// Keeps what each frame took, and passes it on to be shown.
struct Recorder {
    progress: Progress,
    records: Vec<FrameRecord>,
    /// Seconds that frames took that are not wanted, but lie on the way to those that are.
    on_the_way: f64,
}

impl Observer for Recorder {
    fn frame_done(&mut self, id: FrameId, kind: FrameKind, stats: &FrameStats, wanted: bool) {
        if wanted {
            self.records.push(FrameRecord { id, kind, stats: *stats, skipped: false });
        } else {
            self.on_the_way += stats.seconds.infer + stats.seconds.trace;
        }
        self.progress.frame_done(id, kind, stats, wanted);
    }

    fn stop_requested(&self) -> Option<i32> {
        self.progress.stop_requested()
    }
}
