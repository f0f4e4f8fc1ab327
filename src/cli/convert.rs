//! `buzz-convert INPUT OUT_DIR`: the main job.

use super::args::{CompressionArg, ConvertArgs, OutputArgs};
use super::existing::{
    existing, place_of, prepare_report, refuse_inputs, refuse_report_of_another, remove_stale_reports,
    report_files,
};
use super::interrupt::Interrupt;
use super::job::{Job, stem, warn_of_ignored};
use super::plan_file::PlanFile;
use super::progress::{Progress, Work};
use super::say;
use super::summary::{report, summary};
use super::{memory, parse};
use anyhow::{Context, Result};
use buzz::error::Error;
use buzz::frame::{Aov, FrameId, FrameKind, FrameStats, StereoEye};
use buzz::output::{
    Compression, ExrSink, FileOptions, FrameRecord, NamePattern, OutputFolder, Review, Run, RunSeconds,
    SettingsHash, SettingsHasher, Thumbnails, WithThumbnails, earlier_runs, peak_bytes,
};
use buzz::plan::{Plan, Segment};
use buzz::scene::{Projection, Scene};
use buzz::sequence::{FrameSink, Observer, Settings, render_sequence};
use std::collections::BTreeSet;
use std::process::ExitCode;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// What to do after an interruption.
pub const ADVICE: &str = "; finished frames are whole: run again with --skip-existing to go on";

pub fn run(args: ConvertArgs) -> Result<ExitCode> {
    let (started, start) = (SystemTime::now(), Instant::now());
    let (Some(input), Some(out_dir)) = (&args.input, &args.out_dir) else {
        return Err(Error::Usage("INPUT and OUT_DIR are missing".into()).into());
    };
    if input.extension().is_none() && !input.exists() {
        let message =
            "there is no such file, nor such a command; commands are plan, inspect, compare and trade";
        return Err(Error::input(input, "file", message).into());
    }
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
    let timing = job.scene.timing;
    let frames = asked.unwrap_or_else(|| (timing.first..=timing.last).collect());

    let whole = frames == (timing.first..=timing.last).collect();
    let report_path = args.output.report.clone().unwrap_or_else(|| out_dir.join(report_name(&frames, whole)));

    let mut warnings = Warnings::default();

    interrupt.writing();
    let is_elsewhere = args.output.report.is_some();
    if is_elsewhere {
        prepare_report(&report_path)?;
    }
    let pictures = frames.iter().flat_map(|&f| pictures_of(f, &job.settings));
    let folder = OutputFolder::open(out_dir, names, pictures)?;
    if !folder.is_locked() {
        let path = folder.path().display();
        warnings.add(format!("{path}: the file system has no locks: do not run twice on the same frames"));
    }
    // In the output folder: which had to be made first.
    if !is_elsewhere {
        prepare_report(&report_path)?;
    }
    let mut inputs = job.scene.files.clone();
    inputs.extend(args.output.plan.as_ref().and_then(|plan| plan.canonicalize().ok()));
    let pictures = frames.iter().flat_map(|&f| pictures_of(f, &job.settings)).map(|id| folder.file_of(id));
    refuse_inputs(pictures.chain(report_files(&report_path)), &inputs)?;
    if !args.output.overwrite {
        refuse_report_of_another(&report_path, input)?;
    }
    memory::refuse_planning_over(memory_limit, &job)?;
    let planning = Instant::now();
    let plan = match &replayed {
        Some(file) => job.replay(file, &*interrupt)?,
        None => job.plan(1, &*interrupt)?,
    };
    let plan_seconds = planning.elapsed().as_secs_f64();
    let hash = settings_hash(&job, &plan, &args);
    let skipped = existing(&folder, &frames, &hash, &job.settings, &args, &interrupt)?;
    let beyond = frames.iter().filter(|&&f| !(timing.first..=timing.last).contains(&f)).count();
    if beyond > 0 {
        warnings.add(format!(
            "--frames: {beyond} of them are not in the scene's range, {}-{}; curves stand still there",
            timing.first, timing.last
        ));
    }
    let to_render: BTreeSet<i64> =
        frames.difference(&skipped.iter().map(|r| r.id.number).collect()).copied().collect();
    if !to_render.is_empty() {
        memory::refuse_over(memory_limit, &job, 0)?;
    }

    let options = FileOptions {
        compression: compression(args.output.compression),
        fps: timing.fps,
        quality: job.settings.quality.name().into(),
        settings_hash: hash.clone(),
    };
    let is_there = |&&frame: &&i64| pictures_of(frame, &job.settings).any(|id| folder.file_of(id).exists());
    let replaced: BTreeSet<i64> = to_render.iter().filter(is_there).copied().collect();
    let mut sink = ExrSink::new(folder, options)?;
    if !to_render.is_empty() {
        let whole = out_dir.join("report.json");
        remove_stale_reports(&report_path, &whole, input, &hash, &replaced, &args)?;
    }
    let count = to_render.iter().flat_map(|&f| pictures_of(f, &job.settings)).count();
    let work = Work { frames: count, on_the_way: plan.on_the_way(&to_render) };
    let mut thumbnails = Thumbnails::of(&frames, timing.pixel_aspect);
    let pictured = skipped.iter().filter(|r| r.id.eye != Some(StereoEye::Right));
    let files: Vec<_> = pictured.map(|r| (r.id.number, sink.folder().file_of(r.id))).collect();
    thumbnails.read(&files, || interrupt.stop_requested())?;
    // Its clock tells how long frames take: it begins with them.
    let progress = Progress::new(args.output.progress, work, interrupt);
    let mut recorder = Recorder { progress, records: skipped, on_the_way: 0.0 };
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
    let repaired = sink.repaired();
    if let [(first, _), rest @ ..] = repaired.as_slice() {
        let frames = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
        let values: u64 = repaired.iter().map(|(_, values)| values).sum();
        warnings.add(format!(
            "frame {first}{frames}: {values} values were not finite or too large for their channel and were replaced"
        ));
    }

    let (report_folder, report_name) = place_of(&report_path);
    let (mut runs, said) = earlier_runs(&mut records, report_folder, &report_name, &hash);
    said.into_iter().for_each(|warning| warnings.add_unless_given(warning));
    let seconds = RunSeconds {
        import: job.import_seconds,
        accel: job.accel_seconds,
        plan: plan_seconds,
        on_the_way: recorder.on_the_way,
        wall: start.elapsed().as_secs_f64(),
    };
    runs.push(Run {
        report: report_name,
        started: started.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64),
        threads: job.threads,
        seconds,
        peak_bytes: peak_bytes(),
    });
    let report = report(input, hash, &job, &plan, records, (runs, warnings.given));
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
        pixel_aspect: timing.pixel_aspect,
        window: job.settings.window,
        has_class: job.settings.aovs.contains(Aov::Class),
    };
    review.write(&report_path, &thumbnails)?;
    say::result(&summary(&report))?;
    Ok(ExitCode::SUCCESS)
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

/// What was warned of, for the report.
#[derive(Default)]
struct Warnings {
    given: Vec<String>,
}

impl Warnings {
    fn add(&mut self, warning: String) {
        say::complain(format_args!("warning: {warning}"));
        self.given.push(warning);
    }

    fn add_unless_given(&mut self, warning: String) {
        if !self.given.contains(&warning) {
            self.add(warning);
        }
    }
}

/// Each frame's pictures: one, or the eyes'.
pub(super) fn pictures_of(frame: i64, settings: &Settings) -> impl Iterator<Item = FrameId> {
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
