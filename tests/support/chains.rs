//! Counts what frames cost that are inferred outward from one key frame.

use buzz::accel::Accel;
use buzz::frame::{FrameId, FrameKind, FrameStats};
use buzz::output::MemorySink;
use buzz::plan::{Plan, Segment};
use buzz::scene::Scene;
use buzz::sequence::{Observer, Settings, render_sequence};

/// Frame numbers with what they took, in the order of rendering: the key frame, those before it, those after it.
#[derive(Default)]
struct Counter(Vec<(i64, FrameStats)>);

impl Observer for Counter {
    fn frame_done(&mut self, frame: FrameId, _: FrameKind, stats: &FrameStats, _: bool) {
        self.0.push((frame.number, *stats));
    }
}

/// Renders `segment` and counts each frame. Only its ends are shaded: camera and shadow rays are cast for all.
pub fn count(
    scene: &Scene,
    accel: &mut Accel,
    settings: &Settings,
    segment: Segment,
) -> buzz::Result<Vec<(i64, FrameStats)>> {
    let mut counter = Counter::default();
    let plan = Plan { segments: vec![segment], ..Plan::default() };
    let frames = [segment.first, segment.last].into();
    render_sequence(scene, accel, settings, &plan, &frames, &mut MemorySink::default(), &mut counter)?;
    Ok(counter.0)
}
