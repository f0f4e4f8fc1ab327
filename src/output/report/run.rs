//! A run, as reports have it.

use super::millionths;
use serde::{Deserialize, Serialize};

/// A run that made frames of a report, or found them made.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Run {
    /// Name of the report that it wrote.
    pub report: String,
    /// When it began, in milliseconds since 1970.
    pub started: u64,
    /// Threads for everything.
    pub threads: usize,
    /// Its wall seconds that belong to no frame.
    pub seconds: RunSeconds,
    /// Most memory held, bytes: see [`peak_bytes`](crate::output::peak_bytes).
    pub peak_bytes: u64,
}

/// Wall seconds of a run that belong to no frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct RunSeconds {
    /// Reading the scene.
    pub import: f64,
    /// Building what rays are traced through.
    pub accel: f64,
    /// Choosing key frames.
    pub plan: f64,
    /// Frames that were not asked for, but from which others are inferred.
    #[serde(default)]
    pub on_the_way: f64,
    /// From start to end.
    pub wall: f64,
}

impl Run {
    /// As reports have it.
    pub(super) fn rounded(mut self) -> Self {
        let RunSeconds { import, accel, plan, on_the_way, wall } = &mut self.seconds;
        for seconds in [import, accel, plan, on_the_way, wall] {
            *seconds = millionths(*seconds);
        }
        self
    }
}
