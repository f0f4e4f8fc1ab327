//! The half-pixel guarantee against its own error: inferred frames may differ from full ones as much as a full trace does
//! whose rays are offset at random inside their pixels, and hardly more.
//!
//! Both errors are printed (`cargo test --release --test sequence guarantee -- --nocapture`). The scenes of this repository always run; those
//! beside it where they are there. `BUZZ_RESOLUTION=1280x720 BUZZ_FRAMES=all` measures at full size.

use buzz::accel::Accel;
use buzz::frame::{Frame, FrameKind, PixelClass};
use buzz::import::{ImportOptions, import};
use buzz::measure::{Exposure, psnr};
use buzz::output::MemorySink;
use buzz::plan::{LONGEST_SEGMENT, Plan, PlanOptions, Segment, plan};
use buzz::scene::Scene;
use buzz::sequence::{Quality, Settings, Unwatched, camera_path, render_sequence};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn resolution() -> (u32, u32) {
    let text = std::env::var("BUZZ_RESOLUTION").unwrap_or_else(|_| "320x180".into());
    let (width, height) = text.split_once('x').expect("BUZZ_RESOLUTION is like 1280x720");
    (width.parse().unwrap(), height.parse().unwrap())
}

/// Chains of twelve frames on either side of the first key frame that has others, or of the whole range if asked for.
fn some_frames(plan: &Plan) -> BTreeSet<i64> {
    let all = std::env::var("BUZZ_FRAMES").is_ok_and(|f| f == "all");
    let near = |s: &&Segment| all || s.first < s.last;
    let reach = if all { i64::from(LONGEST_SEGMENT) } else { 12 };
    let chains = plan.segments.iter().filter(near).take(if all { usize::MAX } else { 1 });
    chains.flat_map(|s| s.first.max(s.key - reach)..=s.last.min(s.key + reach)).collect()
}

fn render(scene: &Scene, plan: &Plan, frames: &BTreeSet<i64>, jitter: Option<u64>) -> Vec<Frame> {
    let (width, height) = resolution();
    let settings = Settings { jitter, quality: Quality::HalfPixel, ..Settings::new(width, height) };
    let mut sink = MemorySink::default();
    let mut accel = Accel::new(scene);
    render_sequence(scene, &mut accel, &settings, plan, frames, &mut sink, &mut Unwatched).unwrap();
    sink.frames.sort_by_key(|f| f.number);
    sink.frames
}

/// Mean PSNR of the frames that `inferred` names, against `truth`.
fn mean_psnr(frames: &[Frame], truth: &[Frame], inferred: &BTreeSet<i64>) -> f64 {
    let exposure = Exposure::of(truth.iter().map(|f| f.color.as_slice()));
    let pairs = frames.iter().zip(truth).filter(|(f, _)| inferred.contains(&f.number));
    let values: Vec<f64> = pairs.filter_map(|(a, b)| psnr(&a.color, &b.color, exposure)).collect();
    assert!(!values.is_empty(), "no inferred frame differs from its full trace: nothing is measured");
    values.iter().sum::<f64>() / values.len() as f64
}

fn check(file: &Path) {
    let scene = import(file, &ImportOptions::default()).unwrap();
    let (width, height) = resolution();
    let settings = Settings::new(width, height);
    let path = camera_path(&scene, &mut Accel::new(&scene), &settings, &Unwatched).unwrap();
    let cuts: Vec<i64> = scene.cuts.iter().map(|c| c.frame).collect();
    let make =
        |quality| plan(&path, &cuts, PlanOptions { quality, longest_segment: LONGEST_SEGMENT, workers: 1 });
    let (inferring, full) = (make(Quality::HalfPixel), make(Quality::Full));
    let frames = some_frames(&inferring);
    let truth = render(&scene, &full, &frames, None);
    let ours = render(&scene, &inferring, &frames, None);
    let offset = render(&scene, &full, &frames, Some(1));
    let inferred = ours.iter().filter(|f| f.kind != FrameKind::Traced).map(|f| f.number).collect();
    let reused = ours.iter().filter(|f| f.kind != FrameKind::Traced).map(reused_share);
    let least = reused.fold(1.0, f64::min);
    assert!(least > 0.5, "{}: in a frame only {least} of the pixels are reused", file.display());
    let (ours, offset) = (mean_psnr(&ours, &truth, &inferred), mean_psnr(&offset, &truth, &inferred));
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    println!(
        "{name}: inferred {ours:.2} dB, full with rays offset at random {offset:.2} dB, {} frames",
        inferred.len()
    );
    assert!(ours > offset - 1.0, "{name}: {ours:.2} dB is more than 1 dB under {offset:.2} dB");
}

/// Share of a frame's pixels that show old samples.
fn reused_share(frame: &Frame) -> f64 {
    let is_reused = |id: &&u8| PixelClass::ALL[usize::from(**id)].is_reused();
    frame.class.iter().filter(is_reused).count() as f64 / frame.class.len() as f64
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn courtyard_keeps_the_guarantee() {
    check(&root().join("scenes/courtyard/courtyard.gltf"));
}

#[test]
fn gallery_keeps_the_guarantee() {
    check(&root().join("scenes/gallery/gallery.gltf"));
}

#[test]
fn buzz_city_keeps_the_guarantee() {
    check(&root().join("scenes/buzz-city/buzz-city.gltf"));
}

#[test]
fn scenes_that_others_made_keep_the_guarantee() {
    let walk = root().join("../shared/scenes/walk");
    let names = [
        "breakfast_dolly/breakfast_dolly.gltf",
        "gas_station_orbit_cut_whip.glb",
        "sponza_walk_cut.glb",
        "zdm2_fastpan.glb",
    ];
    for file in names.map(|name| walk.join(name)) {
        if file.exists() {
            check(&file);
        } else {
            println!("skipped: {} is not there", file.display());
        }
    }
}
