//! A frame's counts as text: kept in its file, so that a resumed run can report frames that it did not render.

use crate::frame::{FrameStats, PixelClass, RayCounts};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Counts {
    pixels: [u64; PixelClass::COUNT],
    rays: RayCounts,
    hidden: Option<u64>,
}

/// JSON of what was counted; the times are left out, or files would differ from run to run.
pub(super) fn to_text(stats: &FrameStats) -> String {
    let counts = Counts { pixels: stats.pixels, rays: stats.rays, hidden: stats.hidden };
    // Serialising plain numbers cannot fail.
    serde_json::to_string(&counts).unwrap_or_default()
}

/// What [`to_text`] wrote.
pub(crate) fn from_text(text: &str) -> Option<FrameStats> {
    let Counts { pixels, rays, hidden } = serde_json::from_str(text).ok()?;
    Some(FrameStats { pixels, rays, hidden, ..FrameStats::default() })
}
