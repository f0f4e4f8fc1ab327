//! `report.json`: what was asked, what was planned, what was done and what it cost.

mod frames;
mod run;

pub use frames::{FrameReport, TotalSeconds, Totals};
pub use run::{Run, RunSeconds};

use super::SettingsHash;
use super::write::write_alone;
use crate::frame::{FrameId, FrameKind, FrameStats};
use crate::plan;
use crate::scene::{Ignored, Rational};
use crate::{Error, Result};
use frames::millionths;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Everything that a report is made from.
#[derive(Debug, Clone, Default)]
pub struct ReportInput {
    /// The input as the user named it.
    pub input: String,
    /// Identifies everything that decides the pixels.
    pub settings_hash: SettingsHash,
    /// What was asked for.
    pub settings: Settings,
    /// What the scene holds.
    pub scene: SceneSummary,
    /// The plan.
    pub plan: Plan,
    /// All frames of the run, in order.
    pub frames: Vec<FrameRecord>,
    /// For each frame of the plan: the share of its pixels that was predicted to be traced.
    pub predicted: BTreeMap<i64, f64>,
    /// The runs that made them, the one that reports last.
    pub runs: Vec<Run>,
    /// What the user was warned of.
    pub warnings: Vec<String>,
}

/// A frame of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameRecord {
    /// Which frame.
    pub id: FrameId,
    /// How it was made.
    pub kind: FrameKind,
    /// Its counts and times.
    pub stats: FrameStats,
    /// True if it was there already, and its counts come from its file.
    pub skipped: bool,
}

/// The report, as it is written: `buzz-report/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`Report::SCHEMA`].
    pub schema: String,
    /// The input as the user named it.
    pub input: String,
    /// Identifies everything that decides the pixels: frames and reports of one hash belong together.
    pub settings_hash: SettingsHash,
    /// What was asked for.
    pub settings: Settings,
    /// What the scene holds.
    pub scene: SceneSummary,
    /// The plan.
    pub plan: Plan,
    /// Sums over all frames.
    pub totals: Totals,
    /// All frames, in order.
    pub frames: Vec<FrameReport>,
    /// The runs that made them, the one that reports last.
    pub runs: Vec<Run>,
    /// What the user was warned of.
    pub warnings: Vec<String>,
}

/// What was asked for.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Settings {
    /// The quality's name.
    pub quality: String,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Numerator and denominator of the frame rate.
    pub fps: [u32; 2],
    /// Threads for everything.
    pub threads: usize,
    /// Levels of super-sampling.
    pub aa: u32,
}

impl Settings {
    /// The frame rate as the report has it.
    pub fn fps(rate: Rational) -> [u32; 2] {
        [rate.numerator, rate.denominator]
    }
}

/// What the scene holds.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SceneSummary {
    /// Triangles drawn, each instance counted.
    pub triangles: usize,
    /// Analytic shapes.
    pub shapes: usize,
    /// Meshes placed in the world.
    pub instances: usize,
    /// Lights.
    pub lights: usize,
    /// [`crate::scene::Requirements::names`].
    pub requires: Vec<String>,
    /// What is left out.
    pub ignored: Vec<IgnoredFeature>,
    /// Bytes that a Buzzbuffer keeps for each pixel.
    pub bytes_per_pixel: usize,
}

/// A feature of the input that was not rendered.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct IgnoredFeature {
    /// Its name in the format.
    pub feature: String,
    /// JSON pointer or line.
    #[serde(rename = "where")]
    pub place: String,
    /// What the user sees instead.
    pub effect: String,
}

impl From<&Ignored> for IgnoredFeature {
    fn from(ignored: &Ignored) -> Self {
        let Ignored { feature, place, effect } = ignored.clone();
        Self { feature, place, effect }
    }
}

/// The plan.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Plan {
    /// Frames traced in full.
    pub keyframes: Vec<KeyFrame>,
    /// Runs of frames that stem from one key frame.
    pub segments: Vec<SegmentRange>,
    /// First frames after a cut.
    pub cuts: Vec<i64>,
}

impl From<&plan::Plan> for Plan {
    fn from(plan: &plan::Plan) -> Self {
        let keyframes = plan.keyframes.iter();
        Self {
            keyframes: keyframes
                .map(|k| KeyFrame { frame: k.frame, reason: k.reason.name().into() })
                .collect(),
            segments: plan
                .segments
                .iter()
                .map(|&plan::Segment { key, first, last }| SegmentRange { key, first, last })
                .collect(),
            cuts: plan.cuts.clone(),
        }
    }
}

/// A frame traced in full, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyFrame {
    /// Frame number.
    pub frame: i64,
    /// `first`, `cut`, `cost`, `length` or `only`.
    pub reason: String,
}

/// A run of frames that stem from one key frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmentRange {
    /// The key frame.
    pub key: i64,
    /// First frame.
    pub first: i64,
    /// Last frame, included.
    pub last: i64,
}

impl Report {
    /// Name and version of the format.
    pub const SCHEMA: &str = "buzz-report/1";

    /// Sums up a run.
    pub fn new(input: ReportInput) -> Self {
        let totals = Totals::of(&input);
        Self {
            schema: Self::SCHEMA.into(),
            input: input.input,
            settings_hash: input.settings_hash,
            settings: input.settings,
            scene: input.scene,
            plan: input.plan,
            totals,
            frames: input.frames.iter().map(|record| FrameReport::new(record, &input.predicted)).collect(),
            runs: input.runs.into_iter().map(Run::rounded).collect(),
            warnings: input.warnings,
        }
    }

    /// The report that a file holds, if it does.
    pub fn read(path: &Path) -> Option<Self> {
        // To open a pipe would wait for whoever writes to it.
        std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
        let report: Self = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
        Some(report).filter(|r| r.schema == Self::SCHEMA)
    }

    /// Writes `report.json`, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write_json(&self, path: &Path) -> Result<()> {
        let mut json = serde_json::to_string_pretty(self).map_err(|e| Error::output(path, e.to_string()))?;
        json.push('\n');
        write_alone(path, json.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{PixelClass, RayCounts, StageSeconds, SubPixelCounts};
    use serde_json::Value;

    fn stats(class: PixelClass, hidden: Option<u64>) -> FrameStats {
        let mut pixels = [0; PixelClass::COUNT];
        pixels[class as usize] = 100;
        let rays = RayCounts { primary: 7, shadow: 5, ..RayCounts::default() };
        let seconds = StageSeconds { infer: 0.123_456_789, ..StageSeconds::default() };
        let subpixels = SubPixelCounts { sampled: 9, reused: 6, wasted: 2 };
        FrameStats { pixels, subpixels, rays, seconds, hidden }
    }

    fn record(number: i64, kind: FrameKind, stats: FrameStats) -> FrameRecord {
        FrameRecord { id: number.into(), kind, stats, skipped: false }
    }

    fn report() -> Report {
        Report::new(ReportInput {
            input: "anim.gltf".into(),
            settings: Settings { quality: "half-pixel".into(), fps: [24_000, 1001], ..Settings::default() },
            frames: vec![
                record(-1, FrameKind::Traced, stats(PixelClass::Traced, None)),
                record(0, FrameKind::Inferred { from: -1 }, stats(PixelClass::Good, Some(3))),
            ],
            predicted: [(-1, 1.0)].into(),
            runs: vec![Run {
                seconds: RunSeconds { wall: f64::NAN, ..RunSeconds::default() },
                ..Run::default()
            }],
            ..ReportInput::default()
        })
    }

    /// The keys of the contract, as paths.
    fn keys(value: &Value, path: &str, all: &mut Vec<String>) {
        match value {
            Value::Object(map) => {
                for (key, value) in map {
                    all.push(format!("{path}.{key}"));
                    keys(value, &format!("{path}.{key}"), all);
                }
            }
            Value::Array(values) => values.iter().take(1).for_each(|v| keys(v, &format!("{path}[]"), all)),
            _ => {}
        }
    }

    #[test]
    fn every_key_of_the_contract_is_there_in_its_order() {
        let contract: Value = serde_json::from_str(
            r#"{ "schema":"buzz-report/1", "input":"", "settings":{"quality":"","width":0,"height":0,"fps":[24,1],"threads":2,"aa":1},
            "scene":{"triangles":0,"shapes":0,"instances":0,"lights":0,"requires":[],"ignored":[],"bytes_per_pixel":0},
            "plan":{"keyframes":[],"segments":[],"cuts":[]},
            "totals":{"frames":0,"traced_frames":0,"inferred_frames":0,"pixels":{"good":0,"overlapped":0,"missed":0,"bad":0,"creeping":0,"entering":0,"edge":0,"moved":0,"filled":0,"traced":0},
            "rays":{"primary":0,"shadow":0,"ambient":0,"reflection":0,"refraction":0,"visibility":0},
            "seconds":{"import":0,"accel":0,"plan":0,"infer":0,"trace":0,"enhance":0,"write":0,"wall":0},"hidden":null,"peak_bytes":0},
            "frames":[{"frame":2,"kind":"","from":1,"pixels":{"good":0,"overlapped":0,"missed":0,"bad":0,"creeping":0,"entering":0,"edge":0,"moved":0,"filled":0,"traced":0},
            "rays":{"primary":0,"shadow":0,"ambient":0,"reflection":0,"refraction":0,"visibility":0},"seconds":{"infer":0,"trace":0,"enhance":0,"write":0}}] }"#,
        )
        .unwrap();
        let (mut want, mut have) = (Vec::new(), Vec::new());
        keys(&contract, "", &mut want);
        keys(&serde_json::to_value(report()).unwrap(), "", &mut have);
        have.retain(|key| want.contains(key));
        assert_eq!(have, want);
    }

    #[test]
    fn sums_and_rounding() {
        let report = report();
        assert_eq!(
            (report.totals.frames, report.totals.traced_frames, report.totals.inferred_frames),
            (2, 1, 1)
        );
        assert_eq!(report.totals.pixels["traced"], 100);
        assert_eq!(report.totals.pixels["good"], 100);
        let shares: Vec<_> = report.frames.iter().map(|f| (f.predicted_traced, f.traced)).collect();
        assert_eq!(shares, [(Some(1.0), 1.0), (None, 0.0)]);
        assert_eq!(report.totals.rays.primary, 14);
        assert_eq!(report.totals.subpixels, SubPixelCounts { sampled: 18, reused: 12, wasted: 4 });
        assert_eq!(report.totals.hidden, Some(3));
        assert_eq!(report.frames[1].seconds.infer, 0.123_457);
        assert_eq!(report.totals.seconds.wall, 0.0);
        assert_eq!((report.frames[0].from, report.frames[1].from), (None, Some(-1)));
    }

    #[test]
    fn hidden_samples_are_summed_if_all_were_looked_for() {
        let total = |hidden: [Option<u64>; 2]| {
            let inferred = |i: usize| {
                let stats = stats(PixelClass::Good, hidden[i]);
                record(i as i64 + 1, FrameKind::Inferred { from: i as i64 }, stats)
            };
            let key = record(0, FrameKind::Traced, stats(PixelClass::Traced, None));
            let frames = vec![key, inferred(0), inferred(1)];
            Report::new(ReportInput { frames, ..ReportInput::default() }).totals.hidden
        };
        assert_eq!(total([Some(3), Some(4)]), Some(7));
        assert_eq!(total([Some(3), None]), None);
        assert_eq!(total([None, None]), None);
    }

    #[test]
    fn what_is_written_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/report.json");
        report().write_json(&path).unwrap();
        let read: Report = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        assert_eq!(read, report());
    }
}
