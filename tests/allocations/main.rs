//! Memory that frames take: all of it is asked for until the first inferred frames are done, and used again by the others. What reading
//! a file takes.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod files;

use buzz::accel::Accel;
use buzz::frame::{FrameId, FrameKind, FrameStats};
use buzz::import::{ImportOptions, import};
use buzz::output::NullSink;
use buzz::plan::{Plan, PlannedFrame, Segment};
use buzz::scene::Scene;
use buzz::sequence::{Observer, Quality, Settings, render_sequence};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

#[global_allocator]
static ALLOCATOR: dhat::Alloc = dhat::Alloc;

/// Held by a test that counts: the allocator counts for all threads together.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Blocks that had been allocated in all when each frame was done.
struct Counter(Vec<u64>);

impl Observer for Counter {
    fn frame_done(&mut self, _: FrameId, _: FrameKind, _: &FrameStats, _: bool) {
        self.0.push(dhat::HeapStats::get().total_blocks);
    }
}

/// Frames of one chain.
const FRAMES: std::ops::RangeInclusive<i64> = 20..=36;

/// Allocations of each frame of a chain.
fn allocations(scene: &Scene, settings: &Settings) -> Vec<u64> {
    let segment = Segment { key: *FRAMES.start(), first: *FRAMES.start(), last: *FRAMES.end() };
    let planned = |frame| PlannedFrame { frame, kind: segment.kind(frame), predicted_traced: 1.0 };
    let plan = Plan { frames: FRAMES.map(planned).collect(), segments: vec![segment], ..Plan::default() };
    let frames: BTreeSet<i64> = FRAMES.collect();
    let mut accel = Accel::new(scene);
    let mut counter = Counter(Vec::with_capacity(frames.len()));
    // Within the pool, as work that is handed to it from outside is queued on the heap.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    pool.install(|| {
        let mut sink = NullSink::default();
        render_sequence(scene, &mut accel, settings, &plan, &frames, &mut sink, &mut counter).unwrap();
    });
    counter.0.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

#[test]
fn a_frame_like_the_one_before_allocates_nothing() {
    let _alone = alone();
    let courtyard = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/courtyard/courtyard.gltf");
    let scene = import(&courtyard, &ImportOptions::default()).unwrap();
    let profiler = dhat::Profiler::builder().testing().build();
    for quality in [Quality::HalfPixel, Quality::Centred, Quality::Verified] {
        let settings = Settings { quality, ..Settings::new(160, 90) };
        let counts = allocations(&scene, &settings);
        // The first inferred frame makes the buffers, the first ones at all the threads' own.
        assert!(counts[0] > 0, "nothing was counted");
        assert!(counts[2..].iter().all(|&count| count == 0), "{quality:?}: {counts:?}");
    }
    drop(profiler);
}
