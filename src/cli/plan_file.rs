//! A plan as a file: what `plan --format json` prints, and `convert --plan` replays.

use anyhow::Result;
use buzz::error::{Error, reason};
use buzz::output::{self, KeyFrame, SegmentRange};
use buzz::plan::{Plan, Reason, Segment};
use buzz::scene::Rational;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The part of a printed plan that decides the frames; the rest of it tells why, and is not read.
#[derive(Serialize, Deserialize)]
pub struct PlanFile {
    schema: String,
    fps: [u32; 2],
    keyframes: Vec<KeyFrame>,
    segments: Vec<SegmentRange>,
    cuts: Vec<i64>,
    #[serde(skip)]
    path: PathBuf,
}

impl PlanFile {
    const SCHEMA: &str = "buzz-plan/1";

    /// A plan for a sequence of `fps` frames a second.
    pub fn new(plan: &Plan, fps: Rational) -> Self {
        let output::Plan { keyframes, segments, cuts } = output::Plan::from(plan);
        let (schema, fps) = (Self::SCHEMA.into(), output::Settings::fps(fps));
        Self { schema, fps, keyframes, segments, cuts, path: PathBuf::new() }
    }

    /// Reads a plan.
    pub fn read(path: &Path) -> Result<Self> {
        let fail = |why: String| Error::input(path, "file", why);
        let unread = |e: std::io::Error| fail(reason(&e));
        // To open a pipe would wait for whoever writes to it, and a device has no end.
        if !std::fs::metadata(path).map_err(unread)?.is_file() {
            return Err(fail("is no file; give it what plan --format json prints".into()).into());
        }
        let text = std::fs::read(path).map_err(unread)?;
        let mut plan: Self = serde_json::from_slice(&text)
            .map_err(|e| Error::json(path, &e, "--plan takes what plan --format json prints"))?;
        plan.path = path.to_owned();
        if plan.schema != Self::SCHEMA {
            let message = format!("is {}, expected {}; make a new plan", plan.schema, Self::SCHEMA);
            return Err(plan.unfit("/schema", message).into());
        }
        Ok(plan)
    }

    /// True if it infers any frame.
    pub fn infers(&self) -> bool {
        self.segments.iter().any(|s| s.first != s.last)
    }

    /// First frames after a cut, in order: each is that of a segment.
    pub fn cuts(&self) -> Result<&[i64]> {
        let firsts: BTreeSet<i64> = self.segments.iter().map(|s| s.first).collect();
        for (i, &cut) in self.cuts.iter().enumerate() {
            let follows = i == 0 || self.cuts[i - 1] < cut;
            if !follows || !firsts.contains(&cut) {
                let message = format!("{cut} must be the first frame of a segment, after the cut before it");
                return Err(self.unfit(&format!("/cuts/{i}"), message).into());
            }
        }
        Ok(&self.cuts)
    }

    /// Its segments and the reasons for their key frames, if they are at `fps` frames a second.
    pub fn segments(&self, fps: Rational) -> Result<Vec<(Segment, Reason)>> {
        if self.fps != output::Settings::fps(fps) {
            let [numerator, denominator] = self.fps;
            let Rational { numerator: n, denominator: d } = fps;
            let message = format!(
                "is {numerator}/{denominator}, but the scene has {n}/{d} frames a second; make a new plan, or give --fps"
            );
            return Err(self.unfit("/fps", message).into());
        }
        if self.keyframes.len() != self.segments.len() {
            let message = format!("there are {} for {} segments", self.keyframes.len(), self.segments.len());
            return Err(self.unfit("/keyframes", message).into());
        }
        let pairs = self.segments.iter().zip(&self.keyframes).enumerate();
        let both = pairs.map(|(i, (&SegmentRange { key, first, last }, keyframe))| {
            let reason = Reason::named(&keyframe.reason).filter(|_| keyframe.frame == key);
            let message = || {
                format!("is not the key frame {key} of segment {first}-{last}, for one of the known reasons")
            };
            let reason = reason.ok_or_else(|| self.unfit(&format!("/keyframes/{i}"), message()))?;
            Ok((Segment { key, first, last }, reason))
        });
        both.collect()
    }

    /// An error at a place in the file.
    pub fn unfit(&self, place: &str, message: String) -> Error {
        Error::input(&self.path, place, message)
    }
}
