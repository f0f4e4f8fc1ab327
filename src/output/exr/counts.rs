//! A frame's counts as text: kept in its file, so that a resumed run can report frames that it did not render.

use crate::frame::{FrameStats, PixelClass, RayCounts, SubPixelCounts};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Counts {
    pixels: [u64; PixelClass::COUNT],
    /// Left out where there are none.
    #[serde(default, skip_serializing_if = "SubPixelCounts::is_empty")]
    subpixels: SubPixelCounts,
    rays: RayCounts,
    hidden: Option<u64>,
}

/// JSON of what was counted; the times are left out, or files would differ from run to run.
pub(super) fn to_text(stats: &FrameStats) -> String {
    let &FrameStats { pixels, subpixels, rays, hidden, .. } = stats;
    let counts = Counts { pixels, subpixels, rays, hidden };
    // Serialising plain numbers cannot fail.
    serde_json::to_string(&counts).unwrap_or_default()
}

/// What [`to_text`] wrote.
pub(crate) fn from_text(text: &str) -> Option<FrameStats> {
    let Counts { pixels, subpixels, rays, hidden } = serde_json::from_str(text).ok()?;
    Some(FrameStats { pixels, subpixels, rays, hidden, ..FrameStats::default() })
}
