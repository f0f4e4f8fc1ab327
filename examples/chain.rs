//! Infers a scene as one segment, however long, and shows frames of it as the paper's figures do.
//!
//! ```text
//! chain SCENE.gltf OUT.png WIDTH QUALITY KEY FRAME...     a row a frame: inferred from KEY step by step, traced, difference
//! ```
//!
//! `buzz-convert` ends segments long before, where a new key frame costs less than what samples lose on the way. The
//! paper has one key frame for its whole test, and shows the frame inferred through 598 others: this does the same.
//! Differences are those of the shown colours times 2.55, as the paper draws 0 to 100 of 255 as 0 to 255.
#![allow(clippy::print_stdout)] // A program may print; the library may not.

use buzz::accel::Accel;
use buzz::frame::{Aov, PixelClass};
use buzz::import::{ImportOptions, import};
use buzz::measure::picture::{beauty, contact_sheet, difference, write_png};
use buzz::measure::{Exposure, psnr};
use buzz::output::MemorySink;
use buzz::plan::{Plan, Segment};
use buzz::scene::Scene;
use buzz::sequence::{Quality, Settings, Unwatched, render_sequence};
use std::collections::BTreeSet;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [input, out, width, quality, key, numbers @ ..] = args.as_slice() else {
        return Err("usage: chain SCENE.gltf OUT.png WIDTH half-pixel|centred|verified KEY FRAME...".into());
    };
    let frames = numbers.iter().map(|n| n.parse()).collect::<Result<BTreeSet<i64>, _>>()?;
    let key: i64 = key.parse()?;
    let inferring = [Quality::HalfPixel, Quality::Centred, Quality::Verified];
    let quality = inferring
        .into_iter()
        .find(|q| q.name() == quality)
        .ok_or("QUALITY is half-pixel, centred or verified")?;
    let scene = import(Path::new(input), &ImportOptions::default())?;
    let last = frames.last().copied().unwrap_or(key).max(key);
    let first = frames.first().copied().unwrap_or(key).min(key);

    let inferred = render(&scene, quality, vec![Segment { key, first, last }], &frames)?;
    let each = frames.iter().map(|&f| Segment { key: f, first: f, last: f }).collect();
    let traced = render(&scene, Quality::Full, each, &frames)?;
    let exposure = Exposure::of(traced.frames.iter().map(|f| f.color.as_slice()));

    let mut pictures = Vec::new();
    for reference in &traced.frames {
        let Some(frame) = inferred.frames.iter().find(|f| f.number == reference.number) else { continue };
        let (a, b, columns) = (&frame.color, &reference.color, frame.view.width);
        pictures.extend(
            [
                beauty(a, columns, exposure),
                beauty(b, columns, exposure),
                difference(a, b, columns, exposure, 2.55),
            ]
            .into_iter()
            .flatten(),
        );
        let reused =
            frame.class.iter().filter(|&&c| PixelClass::ALL[usize::from(c)].is_reused()).count() as f64;
        println!(
            "frame {}: {} inferences from frame {key}, {:.1} % of pixels traced, PSNR {:.1} dB",
            frame.number,
            (frame.number - key).abs(),
            100.0 - 100.0 * reused / frame.class.len() as f64,
            psnr(a, b, exposure).unwrap_or(f64::INFINITY),
        );
    }
    Ok(write_png(&contact_sheet(&pictures, 3, width.parse()?), Path::new(out))?)
}

/// Renders `frames` by these segments.
fn render(
    scene: &Scene,
    quality: Quality,
    segments: Vec<Segment>,
    frames: &BTreeSet<i64>,
) -> buzz::Result<MemorySink> {
    let (width, height) = scene.timing.resolution.unwrap_or((1280, 720));
    let mut settings = Settings { quality, ..Settings::new(width, height) };
    settings.aovs = [Aov::Class].into_iter().collect();
    let plan = Plan { segments, ..Plan::default() };
    let mut sink = MemorySink::default();
    render_sequence(scene, &mut Accel::new(scene), &settings, &plan, frames, &mut sink, &mut Unwatched)?;
    Ok(sink)
}
