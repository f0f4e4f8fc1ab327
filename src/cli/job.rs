//! Arguments as meant: the scene read, the camera chosen, sizes and ranges resolved.

use super::args::{QualityArg, RenderArgs, SceneArgs};
use super::plan_file::PlanFile;
use super::{parse, say};
use anyhow::{Context, Result};
use buzz::accel::Accel;
use buzz::error::Error;
use buzz::import::{ImportOptions, import};
use buzz::output::most_bytes;
use buzz::plan::{PathFrame, Plan, PlanOptions, plan, replay};
use buzz::scene::{Ignored, Scene};
use buzz::sequence::{Observer, Quality, Settings, camera_path};
use std::path::Path;
use std::time::Instant;

/// A scene that is ready to be planned or rendered.
pub struct Job {
    pub scene: Scene,
    pub accel: Accel,
    pub longest_segment: u32,
    pub settings: Settings,
    pub threads: usize,
    /// Seconds that reading the scene took.
    pub import_seconds: f64,
    /// Seconds that building its trees took.
    pub accel_seconds: f64,
}

impl Job {
    /// Reads the scene and resolves the options. Refuses pictures that take more than so many bytes of memory, or than the machine has.
    pub fn new(
        input: &Path,
        scene_args: &SceneArgs,
        render: &RenderArgs,
        quality: QualityArg,
        memory: Option<u64>,
    ) -> Result<Self> {
        let threads = use_threads(render.threads)?;
        let longest_segment = parse::segment(&render.segment)?;
        let start = Instant::now();
        let (scene, camera) = read(input, scene_args, memory)?;
        let import_seconds = start.elapsed().as_secs_f64();
        require_camera(&scene, input)?;
        refuse_endless(&scene, input)?;
        let own = scene.timing.resolution.unwrap_or((1280, 720));
        let (width, height) =
            render.resolution.as_deref().map_or(Ok(own), |text| parse::resolution(text, own))?;
        let mut settings = Settings::new(width, height);
        settings.camera = camera;
        settings.light_samples = render.light_samples;
        settings.ambient_samples = render.ambient_samples;
        let start = Instant::now();
        let accel = Accel::new(&scene);
        let accel_seconds = start.elapsed().as_secs_f64();
        let mut job =
            Self { scene, accel, longest_segment, settings, threads, import_seconds, accel_seconds };
        job.choose_quality(quality);
        Ok(job)
    }

    /// Renders with `quality` from now on.
    pub fn choose_quality(&mut self, quality: QualityArg) {
        self.settings.quality = match quality {
            QualityArg::Full => Quality::Full,
            QualityArg::HalfPixel => Quality::HalfPixel,
            QualityArg::Centred => Quality::Centred,
            QualityArg::Verified => Quality::Verified,
        };
    }

    /// Plans the scene's own range for so many machines.
    pub fn plan(&mut self, workers: usize, observer: &dyn Observer) -> Result<Plan> {
        let path = self.path(observer)?;
        let quality = self.settings.quality;
        let options = PlanOptions { quality, longest_segment: self.longest_segment, workers };
        Ok(plan(&path, &self.cuts(), options))
    }

    /// Replays the plan of a file.
    pub fn replay(&mut self, file: &PlanFile, observer: &dyn Observer) -> Result<Plan> {
        let quality = self.settings.quality;
        if quality == Quality::Full && file.infers() {
            let message = "--plan: its frames are inferred from others, but --quality full traces every frame; leave one of them out";
            return Err(Error::Usage(message.into()).into());
        }
        let (segments, cuts) = (file.segments(self.scene.timing.fps)?, file.cuts()?);
        let path = self.path(observer)?;
        let unfit = |what| file.unfit("/segments", format!("{what}; make a new plan of this scene"));
        Ok(replay(&path, &self.cuts(), quality, &segments, cuts).map_err(unfit)?)
    }

    fn path(&mut self, observer: &dyn Observer) -> Result<Vec<PathFrame>> {
        Ok(camera_path(&self.scene, &mut self.accel, &self.settings, observer)?)
    }

    /// The cuts that the scene names; none where one camera is chosen instead.
    fn cuts(&self) -> Vec<i64> {
        match self.settings.camera {
            Some(_) => Vec::new(),
            None => self.scene.cuts.iter().map(|c| c.frame).collect(),
        }
    }
}

/// Reads the scene, and finds the camera in it that is asked for. Refuses pictures that take more than so many bytes of memory, or
/// than the machine has.
pub fn read(input: &Path, args: &SceneArgs, memory: Option<u64>) -> Result<(Scene, Option<usize>)> {
    let options = ImportOptions {
        fps: args.fps.as_deref().map(parse::fps).transpose()?,
        geometry: args.geometry.clone(),
        camera_from: args.camera_from.clone(),
        turntable: args.turntable,
        picture_bytes: memory.or_else(most_bytes),
        strict: args.strict,
    };
    let mut scene = import(input, &options)?;
    if let Some(first) = args.start_frame {
        renumber(&mut scene, first)?;
    }
    let camera = args.camera.as_deref().map(|name| find_camera(&scene, name)).transpose()?;
    Ok((scene, camera))
}

/// Says once what of the scene is not rendered, and if nothing in it shines.
pub fn warn_of_ignored(scene: &Scene) {
    if scene.is_dark() {
        say::complain(
            "warning: nothing in the scene shines, so all is black: add a light, an emissive material, or a world in extras.buzz",
        );
    }
    for ignored in &scene.ignored {
        let Ignored { place, feature, effect } = ignored;
        say::complain(format_args!("warning: {place}: {feature}: {effect}"));
    }
}

/// An error if the scene stands where the output folder is to be named.
pub fn refuse_reversed(input: &Path, out_dir: &Path) -> Result<()> {
    let is_scene = |path: &Path| {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        path.is_file() && ["gltf", "glb", "obj"].iter().any(|scene| extension == *scene)
    };
    if !input.is_file() && is_scene(out_dir) {
        let message = format!(
            "is no file, but {} is a scene; is the order reversed? INPUT comes first, then OUT_DIR",
            out_dir.display()
        );
        return Err(Error::input(input, "file", message).into());
    }
    Ok(())
}

/// The stem of the input's name, for the frames' names.
pub fn stem(input: &Path) -> String {
    input.file_stem().map_or_else(|| "frame".to_owned(), |s| s.to_string_lossy().into_owned())
}

fn use_threads(threads: Option<usize>) -> Result<usize> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(parse::threads(threads)?);
    pool.build_global().context("the threads could not be started")?;
    Ok(rayon::current_num_threads())
}

fn require_camera(scene: &Scene, input: &Path) -> Result<()> {
    if scene.cameras.is_empty() {
        let message = "the file has no camera; export one, or give --turntable FRAMES for an orbit";
        return Err(Error::input(input, "/cameras", message).into());
    }
    Ok(())
}

fn renumber(scene: &mut Scene, first: i64) -> Result<()> {
    if !parse::is_frame_number(first) {
        return Err(Error::Usage(format!("--start-frame {first}: expected {}", parse::FRAME_NUMBERS)).into());
    }
    let shift = first - scene.timing.first;
    let timing = &mut scene.timing;
    for number in [&mut timing.frame_start, &mut timing.first, &mut timing.last] {
        *number += shift;
    }
    for cut in &mut scene.cuts {
        cut.frame += shift;
    }
    Ok(())
}

/// Longest range that is planned: more than an hour. A misplaced key must not fill the memory.
const MOST_FRAMES: i64 = 100_000;

fn refuse_endless(scene: &Scene, input: &Path) -> Result<()> {
    let frames = scene.timing.last - scene.timing.first + 1;
    if frames <= MOST_FRAMES {
        return Ok(());
    }
    let message = format!(
        "the animation has {frames} frames, more than {MOST_FRAMES}; see whether the last key is misplaced, or give a lower --fps"
    );
    Err(Error::input(input, "/animations", message).into())
}

fn find_camera(scene: &Scene, name: &str) -> Result<usize> {
    let by_name = scene.cameras.iter().position(|c| c.name == name);
    let by_index = || name.parse::<usize>().ok().filter(|&i| i < scene.cameras.len());
    by_name.or_else(by_index).ok_or_else(|| {
        let names: Vec<String> =
            scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} ({})", c.name)).collect();
        Error::Usage(format!("--camera {name}: there is no such camera; there are {}", names.join(", ")))
            .into()
    })
}
