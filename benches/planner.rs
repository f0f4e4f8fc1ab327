//! Fits the planner's weights (`src/plan/weights.rs`), and says how well they predict.
//!
//! ```text
//! cargo bench --bench planner -- [WIDTH [SCENE...]]     320 and scenes/courtyard, if not said otherwise
//! ```
//!
//! Chains of frames are inferred outward from every thirteenth frame and counted. *Shares* are fitted to the least mean
//! absolute difference of predicted and counted traced pixels, weight by weight, in steps that get smaller. *Costs* are
//! ratios of wall times, so they need an idle machine; whoever changes the constants rounds them. The planner itself
//! never sees a clock. Last, each scene is rendered by the plan that the weights in the code make of it.
#![allow(missing_docs, clippy::print_stdout)] // Not the library.

#[path = "../tests/support/chains.rs"]
mod chains;

use buzz::accel::Accel;
use buzz::frame::FrameStats;
use buzz::import::{ImportOptions, import};
use buzz::plan::{Change, LONGEST_SEGMENT, PathFrame, PlanOptions, Segment, Weights, plan, steps};
use buzz::scene::Scene;
use buzz::sequence::{Quality, Settings, Unwatched, camera_path};
use std::error::Error;
use std::path::Path;

/// Frames from one measured key frame to the next, and how many are inferred on either side of it: about as many as in a
/// planned segment.
const EVERY: usize = 13;
const REACH: i64 = 8;

/// The weights of shares.
const FITTED: [fn(&mut Weights) -> &mut f64; 7] = [
    |w| &mut w.outside,
    |w| &mut w.contested,
    |w| &mut w.stretched,
    |w| &mut w.edges,
    |w| &mut w.missed,
    |w| &mut w.scatter,
    |w| &mut w.scatter_pixels,
];

/// A chain's changes, and the shares of pixels that were traced.
type Chain = Vec<(Change, f64)>;

fn main() -> Result<(), Box<dyn Error>> {
    // Cargo says --bench to a bench.
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let width: u32 = args.first().map_or(Ok(320), |w| w.parse())?;
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/courtyard/courtyard.gltf");
    let files: Vec<&str> = args.iter().skip(1).map(String::as_str).collect();
    let files = if files.is_empty() { vec![own] } else { files };
    let scenes = files.iter().map(|f| import(Path::new(f), &ImportOptions::default()));
    let scenes = scenes.collect::<Result<Vec<_>, _>>()?;
    for quality in [Quality::HalfPixel, Quality::Centred] {
        let settings = Settings { quality, ..Settings::new(width, width * 9 / 16) };
        let mut measured = Measured::default();
        for (file, scene) in files.iter().zip(&scenes) {
            let mut accel = Accel::new(scene);
            let path = camera_path(scene, &mut accel, &settings, &Unwatched)?;
            measured.add_chains(scene, &mut accel, &settings, &path)?;
            compare(file, scene, &mut accel, &settings, &path)?;
        }
        let used = Weights::of(quality);
        let fitted = measured.fit(used);
        println!("{}, used: {:.4} {used:?}", quality.name(), measured.difference(&used));
        println!("{}, fits: {:.4} {fitted:?}", quality.name(), measured.difference(&fitted));
        measured.print_costs();
    }
    Ok(())
}

#[derive(Default)]
struct Measured {
    chains: Vec<Chain>,
    frames: Vec<FrameStats>,
    pixels: u64,
    /// Of key frames: shadow and camera rays.
    key_rays: [u64; 2],
}

impl Measured {
    fn add_chains(
        &mut self,
        scene: &Scene,
        accel: &mut Accel,
        settings: &Settings,
        path: &[PathFrame],
    ) -> buzz::Result<()> {
        let steps = steps(path);
        let pixels = u64::from(settings.width * settings.height);
        let start = scene.timing.first;
        for key in (scene.timing.first..=scene.timing.last).step_by(EVERY) {
            let (first, last) = ((key - REACH).max(start), (key + REACH).min(scene.timing.last));
            let counted = chains::count(scene, accel, settings, Segment { key, first, last })?;
            let (before, after): (Vec<_>, Vec<_>) =
                counted[1..].iter().partition(|(number, _)| *number < key);
            for (frames, is_forward) in [(before, false), (after, true)] {
                let chain = frames.iter().map(|(number, stats)| {
                    let place = (number - start) as usize;
                    let step = if is_forward { steps[place - 1] } else { steps[place] };
                    let change = if is_forward { step.forward } else { step.backward };
                    (change, stats.rays.primary as f64 / pixels as f64)
                });
                self.chains.push(chain.collect());
            }
            let key_rays = counted[0].1.rays;
            self.key_rays[0] += key_rays.shadow + key_rays.ambient;
            self.key_rays[1] += key_rays.primary;
            self.frames.extend(counted[1..].iter().map(|(_, stats)| *stats));
            self.pixels += pixels * (counted.len() as u64 - 1);
        }
        Ok(())
    }

    /// Mean absolute difference of predicted and counted shares of traced pixels.
    fn difference(&self, weights: &Weights) -> f64 {
        let of_chain = |chain: &Chain| {
            let predicted = weights.traced(chain.iter().map(|c| c.0));
            predicted.zip(chain).map(|(p, c)| (p - c.1).abs()).sum::<f64>()
        };
        let frames: usize = self.chains.iter().map(Vec::len).sum();
        self.chains.iter().map(of_chain).sum::<f64>() / frames.max(1) as f64
    }

    /// The weights of shares that predict best, from those that are used. What a quality does not do, weighs nothing.
    fn fit(&self, used: Weights) -> Weights {
        let (mut best, mut least, mut step) = (used, self.difference(&used), 0.5);
        while step > 0.01 {
            let before = least;
            for field in FITTED {
                for factor in [1.0 + step, 1.0 / (1.0 + step)] {
                    let mut tried = best;
                    *field(&mut tried) *= factor;
                    let difference = self.difference(&tried);
                    if difference < least {
                        (best, least) = (tried, difference);
                    }
                }
            }
            step *= if least < before { 1.0 } else { 0.5 };
        }
        best
    }

    /// What inference and shadow rays take, in the time of a camera ray. Seconds of rays are one sum for both kinds: it is
    /// split by least squares over frames.
    fn print_costs(&self) {
        let (mut aa, mut ab, mut bb, mut at, mut bt) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut traced, mut shadow) = (0, 0);
        for FrameStats { rays, seconds, .. } in &self.frames {
            let (a, b) = ((rays.primary + rays.visibility) as f64, (rays.shadow + rays.ambient) as f64);
            (aa, ab, bb) = (aa + a * a, ab + a * b, bb + b * b);
            (at, bt) = (at + a * seconds.trace, bt + b * seconds.trace);
            (traced, shadow) = (traced + rays.primary, shadow + rays.shadow + rays.ambient);
        }
        let determinant = aa * bb - ab * ab;
        let (camera, light) = ((at * bb - bt * ab) / determinant, (bt * aa - at * ab) / determinant);
        let infer: f64 = self.frames.iter().map(|f| f.seconds.infer).sum::<f64>() / self.pixels as f64;
        let per_key = self.key_rays[0] as f64 / self.key_rays[1] as f64;
        println!(
            "    a shadow ray: {:.2} of a camera ray; inference: {:.2} a pixel; shadow rays a traced pixel: {:.2} of a key frame's",
            light / camera,
            infer / camera,
            shadow as f64 / traced as f64 / per_key
        );
    }
}

/// Renders a scene by its plan, and compares what is traced with what is predicted.
fn compare(
    file: &str,
    scene: &Scene,
    accel: &mut Accel,
    settings: &Settings,
    path: &[PathFrame],
) -> buzz::Result<()> {
    let cuts: Vec<i64> = scene.cuts.iter().map(|c| c.frame).collect();
    let options = PlanOptions { quality: settings.quality, longest_segment: LONGEST_SEGMENT, workers: 1 };
    let plan = plan(path, &cuts, options);
    let pixels = f64::from(settings.width * settings.height);
    let (mut difference, mut traced, mut predicted) = (0.0, 0.0, 0.0);
    for &segment in &plan.segments {
        for (number, stats) in chains::count(scene, accel, settings, segment)? {
            let planned = plan.frames[(number - scene.timing.first) as usize];
            let share = stats.rays.primary as f64 / pixels;
            difference += (planned.predicted_traced - share).abs();
            (traced, predicted) = (traced + share, predicted + planned.predicted_traced);
        }
    }
    let frames = plan.frames.len() as f64;
    println!(
        "{} {} at {}x{}: {} frames, {} key frames; {:.1} % of pixels traced, {:.1} % predicted; frame by frame {:.1} points apart",
        Path::new(file).file_stem().unwrap_or_default().display(),
        settings.quality.name(),
        settings.width,
        settings.height,
        plan.frames.len(),
        plan.keyframes.len(),
        100.0 * traced / frames,
        100.0 * predicted / frames,
        100.0 * difference / frames,
    );
    Ok(())
}
