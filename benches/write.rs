//! Encoding and writing of frames: `cargo bench --bench write`.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

#[path = "../tests/support/mod.rs"]
mod support;

use buzz::frame::{Frame, FrameKind};
use buzz::output::exr::encode;
use buzz::output::{Compression, FrameFile};
use criterion::{Criterion, criterion_group, criterion_main};
use support::{Shape, default_layers, frame, hash, options};

/// The frame with what a renderer makes of a tiled floor under a wall: grain in the textures, not everywhere, and long
/// runs of one class. Files are about as large as those of rendered frames.
fn pictured(mut frame: Frame) -> Frame {
    let width = frame.window.width as usize;
    for i in 0..frame.window.pixels() {
        let (x, y) = (i % width, i / width);
        let floor = y > 500;
        let depth = if floor { 900.0 / (y as f32 - 400.0) } else { 9.0 + x as f32 * 0.001 };
        let tile = (x / 37 + y / 23) % 2 == 0;
        let grain = if tile && floor { (i * 2_654_435_761 % 61) as f32 / 610.0 } else { 0.0 };
        let light = 0.3 + 0.4 * (x as f32 * 0.002).sin().abs() + grain;
        frame.color[i] = [light, light * 0.8, light * 0.6 + if tile { 0.1 } else { 0.0 }, 1.0];
        frame.depth[i] = depth;
        frame.class[i] = if x % 97 == 0 { 3 } else { 1 };
        frame.normal[i] = if floor { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
        frame.position[i] =
            [(x as f32 - 960.0) * depth / 1500.0, if floor { 0.0 } else { y as f32 * -0.01 }, -depth];
        frame.forward[i] = [10.0 / depth, 1.0 / depth];
        frame.backward[i] = [-10.0 / depth, -1.0 / depth];
        frame.object[i] = u32::from(floor) + 1;
        frame.diffuse[i] = [light * 0.9, light * 0.7, light * 0.5];
        frame.specular[i] = [grain; 3];
        frame.emission[i] = [0.0; 3];
        for (_, values) in &mut frame.lights {
            values[i] = frame.diffuse[i].map(|v| v * 0.5);
        }
    }
    frame
}

fn write(c: &mut Criterion) {
    let all = pictured(frame(1, FrameKind::Traced, &Shape::whole(1920, 1080)));
    let default = default_layers(all.clone());
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut group = c.benchmark_group("write 1920x1080");
    group.sample_size(10);
    for (name, compression) in Compression::ALL {
        group.bench_function(format!("default layers, {name}"), |b| {
            b.iter(|| encode(&default, &options(compression)).unwrap());
        });
    }
    group.bench_function("default layers, zip, one thread", |b| {
        b.iter(|| one_thread.install(|| encode(&default, &options(Compression::Zip)).unwrap()));
    });
    group.bench_function("all layers, zip", |b| b.iter(|| encode(&all, &options(Compression::Zip)).unwrap()));

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.exr");
    let bytes = |frame: &Frame, c| encode(frame, &options(c)).unwrap().parts.concat().len();
    let sizes = Compression::ALL.map(|(name, c)| format!("{name} {}", bytes(&default, c)));
    println!(
        "bytes of the default layers: {}; of all, zip: {}",
        sizes.join(", "),
        bytes(&all, Compression::Zip)
    );
    std::fs::write(&path, encode(&default, &options(Compression::Zip)).unwrap().parts.concat()).unwrap();
    group.bench_function("check a file", |b| {
        b.iter(|| assert!(matches!(FrameFile::check(&path, 1.into(), &hash()), FrameFile::Complete(..))));
    });
}

criterion_group!(benches, write);
criterion_main!(benches);
