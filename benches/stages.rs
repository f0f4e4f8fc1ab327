//! What each stage of an inferred frame takes, on `scenes/courtyard` at 1280x720: project, obscured, clean-up, and
//! beside them tracing and shading a whole frame, and encoding it.
//!
//! `cargo bench` prints milliseconds a frame; `docs/performance.md` says what they mean.

#![allow(clippy::expect_used)] // A bench that cannot run has nothing better to do.

use buzz::accel::Accel;
use buzz::frame::{Aov, AovSet, Frame, PixelClass, RayCounts, SurfaceSample};
use buzz::import::{ImportOptions, import};
use buzz::infer::{
    Along, BuzzBuffer, CastRays, Inference, Landings, Marks, Move, Projector, creeping, gather, obscured,
    project,
};
use buzz::output::exr::encode;
use buzz::output::{Compression, FileOptions, MemorySink, SettingsHasher};
use buzz::plan::{Plan, PlannedFrame, Segment};
use buzz::scene::{Scene, View};
use buzz::sequence::{FrameSink, Settings, Unwatched, render_sequence};
use buzz::trace::{Eye, TraceOptions, Tracer};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use std::path::Path;

const WIDTH: u32 = 1280;
const HEIGHT: u32 = 720;
/// A frame in the middle of the walk, and the step that is inferred.
const FRAME: i64 = 20;

struct Caster<'a>(&'a Tracer<'a>, Eye);

impl CastRays for Caster<'_> {
    fn cast(&self, x: usize, y: usize, lit: &mut [u32], counts: &mut RayCounts) -> SurfaceSample {
        self.0.cast(&self.1, x as f64 + 0.5, y as f64 + 0.5, lit, counts)
    }
}

fn view(scene: &Scene, frame: i64) -> View {
    let pose = scene.pose(scene.timing.time_of(frame));
    scene.view(&pose, scene.camera_at(frame, None), WIDTH, HEIGHT)
}

fn stages(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/courtyard/courtyard.gltf");
    let scene = import(&path, &ImportOptions::default()).expect("the scene is in the repository");
    let pose = scene.pose(scene.timing.time_of(FRAME));
    let (from, to) = (view(&scene, FRAME), view(&scene, FRAME + 1));
    let origin: DVec3 = from.eye;
    let mut accel = Accel::new(&scene);
    accel.place(&scene, &pose, origin);
    let tracer = Tracer::new(&scene, &accel, &pose, TraceOptions::default());
    let (old_view, new_view) = (Projector::new(&from, origin), Projector::new(&to, origin));
    let fresh = || BuzzBuffer::new(WIDTH as usize, HEIGHT as usize, tracer.lit_words());
    let (mut old, mut new) = (fresh(), fresh());
    old.cast_unknown(&old_view, &Caster(&tracer, tracer.eye(&from)));
    let pixels = old.object.len();

    let mut group = c.benchmark_group("stages");
    group.sample_size(20);
    group.bench_function("trace", |b| {
        let mut buffer = fresh();
        b.iter(|| {
            buffer.forget(PixelClass::Traced);
            buffer.cast_unknown(&old_view, &Caster(&tracer, tracer.eye(&from)))
        });
    });
    let (mut landings, mut marks) = (Landings::default(), Marks::default());
    group.bench_function("project", |b| {
        b.iter(|| {
            landings.clear(pixels);
            marks.clear(pixels);
            project(&old, &new_view, &landings, &marks)
        });
    });
    group.bench_function("obscured", |b| b.iter(|| obscured(&old, &old_view, &new_view, &landings, &marks)));
    group.bench_function("gather", |b| b.iter(|| gather(&old, &landings, &marks, &mut new)));
    new.cast_unknown(&new_view, &Caster(&tracer, tracer.eye(&to)));
    group.bench_function("clean-up", |b| {
        b.iter(|| {
            creeping(&new, &landings, Along::Columns, &marks);
            creeping(&new, &landings, Along::Rows, &marks);
        });
    });
    group.bench_function("infer", |b| {
        let mut inference = Inference::default();
        b.iter(|| {
            inference.infer(
                Move::Camera,
                (&old, &from),
                (&mut new, &to),
                origin,
                &Caster(&tracer, tracer.eye(&to)),
            )
        });
    });
    let mut sink = MemorySink::default();
    let frame = rendered(&scene, &mut sink);
    group.bench_function("write", |b| {
        let options = FileOptions {
            compression: Compression::Zip,
            fps: scene.timing.fps,
            quality: "half-pixel".into(),
            settings_hash: SettingsHasher::new().finish(),
        };
        b.iter(|| encode(&frame, &options));
    });
    group.finish();
}

fn rendered(scene: &Scene, sink: &mut MemorySink) -> Frame {
    let mut settings = Settings::new(WIDTH, HEIGHT);
    settings.aovs = AovSet::from_iter([Aov::Depth, Aov::Class]);
    let segment = Segment { key: FRAME, first: FRAME, last: FRAME };
    let planned = PlannedFrame { frame: FRAME, kind: segment.kind(FRAME), predicted_traced: 1.0 };
    let plan = Plan { frames: vec![planned], segments: vec![segment], ..Plan::default() };
    let mut accel = Accel::new(scene);
    let frames = [FRAME].into();
    render_sequence(scene, &mut accel, &settings, &plan, &frames, sink, &mut Unwatched)
        .expect("nothing can be written wrongly");
    sink.finish().expect("memory");
    sink.frames.pop().expect("one frame was asked for")
}

criterion_group!(benches, stages);
criterion_main!(benches);
