//! `buzz-convert INPUT OUT_DIR`: the main job.

use super::args::{CompressionArg, ConvertArgs};
use super::interrupt::Interrupt;
use super::job::{Job, stem, warn_of_ignored};
use super::plan_file::PlanFile;
use super::progress::{Progress, Tally};
use super::say;
use super::{memory, parse};
use anyhow::{Context, Result};
use buzz::error::Error;
use buzz::frame::{Aov, FrameId, FrameKind, FrameStats, StereoEye};
use buzz::infer::BuzzBuffer;
use buzz::output::{
    self, Compression, ExrSink, FileOptions, FrameFile, FrameRecord, NamePattern, OutputFolder, Report,
    ReportInput, Review, Run, RunSeconds, SceneSummary, SettingsHash, SettingsHasher, Thumbnails,
    WithThumbnails, earlier_runs, peak_bytes,
};
use buzz::plan::{Plan, Segment};
use buzz::scene::{Projection, Requirements, Scene};
use buzz::sequence::{FrameSink, Observer, Settings, render_sequence};
use buzz::trace::lit_words;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

pub fn run(args: ConvertArgs) -> Result<ExitCode> {
    let (started, start) = (SystemTime::now(), Instant::now());
    let (Some(input), Some(out_dir)) = (&args.input, &args.out_dir) else {
        return Err(Error::Usage("INPUT and OUT_DIR are missing".into()).into());
    };
    let interrupt = Interrupt::watch().context("signals cannot be watched")?;
    let names =
        NamePattern::parse(args.output.name.as_deref().unwrap_or(NamePattern::DEFAULT), &stem(input))?;
    let asked = args.output.frames.as_deref().map(parse::frames).transpose()?;
    if asked.as_ref().is_some_and(BTreeSet::is_empty) {
        say::line("no frame is asked for: nothing to do");
        return Ok(ExitCode::SUCCESS);
    }
    let replayed = args.output.plan.as_deref().map(PlanFile::read).transpose()?;
    let mut job = Job::new(input, &args.scene, &args.image.render, args.image.quality)?;
    warn_of_ignored(&job.scene);
    choose_image(&mut job, &args)?;
    let memory_limit = args.output.memory.as_deref().map(parse::memory).transpose()?;
    let timing = job.scene.timing;
    let frames = asked.unwrap_or_else(|| (timing.first..=timing.last).collect());

    let whole = frames == (timing.first..=timing.last).collect();
    let report_path = args.output.report.clone().unwrap_or_else(|| out_dir.join(report_name(&frames, whole)));

    interrupt.writing();
    if let Some(path) = &args.output.report {
        prepare_report(path)?;
    }
    let pictures = frames.iter().flat_map(|&f| pictures_of(f, &job.settings));
    let folder = OutputFolder::open(out_dir, names, pictures)?;
    if !folder.is_locked() {
        let path = folder.path().display();
        say::complain(format_args!(
            "warning: {path}: the file system has no locks: do not run twice on the same frames"
        ));
    }
    let planning = Instant::now();
    let plan = match &replayed {
        Some(file) => job.replay(file, &*interrupt)?,
        None => job.plan(1, &*interrupt)?,
    };
    let plan_seconds = planning.elapsed().as_secs_f64();
    let hash = settings_hash(&job, &plan, &args);
    let skipped = existing(&folder, &frames, &hash, &job.settings, &args, &interrupt)?;
    let to_render: BTreeSet<i64> =
        frames.difference(&skipped.iter().map(|r| r.id.number).collect()).copied().collect();
    if let Some(limit) = memory_limit.filter(|_| !to_render.is_empty()) {
        memory::refuse_over(limit, &job)?;
    }

    let options = FileOptions {
        compression: compression(args.output.compression),
        fps: timing.fps,
        quality: job.settings.quality.name().into(),
        settings_hash: hash.clone(),
    };
    let mut sink = ExrSink::new(folder, options)?;
    let pixels = job.settings.window.pixels() as u64;
    let count = to_render.iter().flat_map(|&f| pictures_of(f, &job.settings)).count();
    let progress = Progress::new(args.output.progress, count, pixels, interrupt);
    let mut thumbnails = Thumbnails::of(&frames);
    for record in skipped.iter().filter(|r| r.id.eye != Some(StereoEye::Right)) {
        thumbnails.read(record.id.number, &sink.folder().file_of(record.id));
    }
    let mut recorder = Recorder { progress, records: skipped };
    let Job { scene, accel, settings, .. } = &mut job;
    let mut shown = WithThumbnails { sink: &mut sink, thumbnails: &mut thumbnails };
    let rendered = render_sequence(scene, accel, settings, &plan, &to_render, &mut shown, &mut recorder);
    // Frames that are under way are still written, whatever stopped the run.
    let written = sink.finish();
    recorder.progress.finish();
    rendered?;
    let mut records = recorder.records;
    for (id, seconds) in written? {
        if let Some(record) = records.iter_mut().find(|r| r.id == id) {
            record.stats.seconds.write = seconds.write;
        }
    }
    records.sort_by_key(|r| r.id);
    for (frame, values) in sink.repaired() {
        say::complain(format_args!(
            "warning: frame {frame}: {values} values were not finite or too large for their channel and were replaced"
        ));
    }

    let (report_folder, report_name) = place_of(&report_path);
    let mut runs = earlier_runs(&mut records, report_folder, &report_name, &hash);
    let seconds = RunSeconds {
        import: job.import_seconds,
        accel: job.accel_seconds,
        plan: plan_seconds,
        wall: start.elapsed().as_secs_f64(),
    };
    runs.push(Run {
        report: report_name,
        started: started.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64),
        threads: job.threads,
        seconds,
        peak_bytes: peak_bytes(),
    });
    let report = report(input, hash, &job, &plan, records, runs);
    report.write_json(&report_path)?;
    report.write_html(&report_path.with_extension("html"), &thumbnails.encoded())?;
    // Of a pair, the left eye is looked at.
    let names = sink.folder().names();
    let review_names =
        if job.settings.stereo.is_some() { names.of_eye(StereoEye::Left) } else { names.clone() };
    let review = Review {
        folder: out_dir,
        names: &review_names,
        frames: &frames,
        cuts: &plan.cuts,
        keyframes: &report.plan.keyframes,
        fps: timing.fps,
        width: job.settings.width,
        height: job.settings.height,
        has_class: job.settings.aovs.contains(Aov::Class),
    };
    review.write(&report_path, &thumbnails)?;
    say::result(&summary(&report))?;
    Ok(ExitCode::SUCCESS)
}

/// Finds out before the rendering, not after it, that the report cannot be written.
pub(super) fn prepare_report(path: &Path) -> Result<()> {
    if path.extension().is_none_or(|e| e != "json") {
        let message =
            format!("--report {}: expected a .json file; a page is written beside it", path.display());
        return Err(Error::Usage(message).into());
    }
    if path.is_dir() {
        return Err(Error::output(path, "is a folder; name a file in it").into());
    }
    let (folder, _) = place_of(path);
    let made = std::fs::create_dir_all(folder).and_then(|()| tempfile::tempfile_in(folder));
    made.map_err(|e| Error::output(path, format!("the report cannot be written there ({e})")))?;
    Ok(())
}

/// The folder of a file, and its name in it.
fn place_of(path: &Path) -> (&Path, String) {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    (folder, path.file_name().unwrap_or_default().to_string_lossy().into_owned())
}

/// Resolves what depends on the image's size.
fn choose_image(job: &mut Job, args: &ConvertArgs) -> Result<()> {
    let settings = &mut job.settings;
    if let Some(text) = &args.output.crop {
        settings.window = parse::crop(text, (settings.width, settings.height))?;
    }
    if !args.output.exposure.is_finite() {
        return Err(
            Error::Usage(format!("--exposure {}: expected a number of stops", args.output.exposure)).into()
        );
    }
    settings.stereo =
        args.output.stereo.map(|eyes| parse::stereo(eyes, args.output.convergence)).transpose()?;
    settings.aovs = parse::aovs(&args.output.aov)?;
    settings.transparent = args.output.transparent;
    settings.exposure = args.output.exposure;
    settings.bounces = args.output.bounces;
    settings.aa = args.output.aa;
    settings.light_samples = args.output.light_samples;
    settings.ambient_samples = args.output.ambient_samples;
    settings.audit = args.output.audit;
    if settings.stereo.is_some() {
        refuse_parallel(&job.scene, settings)?;
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

/// Each frame's pictures: one, or the eyes'.
fn pictures_of(frame: i64, settings: &Settings) -> impl Iterator<Item = FrameId> {
    let eyes: &[Option<StereoEye>] = match settings.stereo {
        Some(_) => &[Some(StereoEye::Left), Some(StereoEye::Right)],
        None => &[None],
    };
    eyes.iter().map(move |&eye| FrameId { number: frame, eye })
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

/// Frames that are there already and may stay; an error if some are there and nothing says what to do with them.
fn existing(
    folder: &OutputFolder,
    frames: &BTreeSet<i64>,
    hash: &SettingsHash,
    settings: &Settings,
    args: &ConvertArgs,
    interrupt: &Interrupt,
) -> Result<Vec<FrameRecord>> {
    if args.output.overwrite {
        return Ok(Vec::new());
    }
    if !args.output.skip_existing {
        let pictures = || frames.iter().flat_map(|&number| pictures_of(number, settings));
        if let Some(path) = pictures().map(|id| folder.file_of(id)).find(|path| path.exists()) {
            let message = "is there already; give --skip-existing to keep finished frames, or --overwrite to replace them";
            return Err(Error::output(path, message).into());
        }
        return Ok(Vec::new());
    }
    // Each file is read in full: thousands of them take their time.
    let check = |id: FrameId| match folder.check(id, hash) {
        FrameFile::Complete(stats, kind) => Some(FrameRecord { id, kind, stats, skipped: true }),
        FrameFile::Missing | FrameFile::Stale(_) => None,
    };
    // A pair is there if both of it are.
    let check_all = |&number: &i64| match interrupt.stop_requested() {
        Some(signal) => Err(Error::Interrupted { signal }),
        None => Ok(pictures_of(number, settings).map(check).collect::<Option<Vec<_>>>()),
    };
    let found = frames.par_iter().map(check_all).collect::<buzz::Result<Vec<_>>>()?;
    Ok(found.into_iter().flatten().flatten().collect())
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

/// `report.json`, or one of its own for a part of the range, so that several runs may share a folder.
fn report_name(frames: &BTreeSet<i64>, whole: bool) -> String {
    match (frames.first(), frames.last()) {
        (Some(first), Some(last)) if !whole => format!("report.{first}-{last}.json"),
        _ => "report.json".into(),
    }
}

/// Keeps what each frame took, and passes it on to be shown.
struct Recorder {
    progress: Progress,
    records: Vec<FrameRecord>,
}

impl Observer for Recorder {
    fn frame_done(&mut self, id: FrameId, kind: FrameKind, stats: &FrameStats, wanted: bool) {
        if wanted {
            self.records.push(FrameRecord { id, kind, stats: *stats, skipped: false });
        }
        self.progress.frame_done(id, kind, stats, wanted);
    }

    fn stop_requested(&self) -> Option<i32> {
        self.progress.stop_requested()
    }
}

fn report(
    input: &Path,
    settings_hash: SettingsHash,
    job: &Job,
    plan: &Plan,
    frames: Vec<FrameRecord>,
    runs: Vec<Run>,
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
        warnings: Vec::new(),
    })
}

/// Three lines: frames, rays saved, where the time went.
fn summary(report: &Report) -> String {
    let totals = &report.totals;
    let frames = if totals.frames == 1 { "frame" } else { "frames" };
    let mut tally = Tally::default();
    for frame in &report.frames {
        tally.add(frame.from.map_or(FrameKind::Traced, |from| FrameKind::Inferred { from }), frame.rays);
    }
    let saved = tally.saved().map(|s| format!("{:.1} % of camera and shadow rays saved", 100.0 * s));
    let hidden = totals.hidden.map(|h| format!("; {h} reused samples hidden")).unwrap_or_default();
    let runs = match report.runs.len() {
        0 | 1 => String::new(),
        n => format!(" of {n} runs added up"),
    };
    let s = &totals.seconds;
    format!(
        "{} {frames}: {} traced, {} inferred, in {:.1} s{runs}\n{}{hidden}\n\
         seconds: {:.1} reading, {:.1} trees, {:.1} plan, {:.1} infer, {:.1} trace, {:.1} enhance, \
         {:.1} write (beside)\n",
        totals.frames,
        totals.traced_frames,
        totals.inferred_frames,
        s.wall,
        saved.unwrap_or_else(|| "no key frame among these frames to measure the saving against".into()),
        s.import,
        s.accel,
        s.plan,
        s.infer,
        s.trace,
        s.enhance,
        s.write
    )
}
