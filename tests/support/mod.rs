//! Frames made by hand, and the Python that reads them.

#![allow(dead_code)] // Not every test uses everything.

use buzz::frame::{
    Cover, Frame, FrameKind, FrameStats, Matte, PixelClass, RayCounts, StageSeconds, SubPixelCounts, Window,
};
use buzz::output::exr::encode;
use buzz::output::{Compression, FileOptions, SettingsHash, SettingsHasher};
use buzz::scene::{Lens, Projection, Rational, View};
use glam::{DVec2, DVec3};

/// The image's size and the part of it that is there.
pub struct Shape {
    pub image: (u32, u32),
    pub window: Window,
}

impl Shape {
    pub fn whole(width: u32, height: u32) -> Self {
        Self { image: (width, height), window: Window { x: 0, y: 0, width, height } }
    }
}

/// A camera at (1,2,3) that looks along -Z, slightly turned.
pub fn view(width: u32, height: u32) -> View {
    let forward = DVec3::new(0.2, -0.1, -1.0).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    View {
        eye: DVec3::new(1.0, 2.0, 3.0),
        right,
        up: right.cross(forward),
        forward,
        lens: Lens {
            projection: Projection::Perspective { yfov: 0.8 },
            shift: DVec2::new(0.1, -0.2),
            near: 0.1,
            far: f64::INFINITY,
            sensor_height: None,
        },
        width,
        height,
        pixel_aspect: 1.0,
    }
}

/// A frame with every layer, each pixel and channel with its own smooth and partly noisy value.
pub fn frame(number: i64, kind: FrameKind, shape: &Shape) -> Frame {
    let (width, height) = shape.image;
    let window = shape.window;
    let n = window.pixels();
    let at = |i: usize, c: usize| {
        let (x, y) = ((i % window.width as usize) as f32, (i / window.width as usize) as f32);
        let noise = ((i * 2_654_435_761 + c * 97) % 251) as f32 / 2510.0;
        (x * 0.01 + c as f32).sin() * 0.4 + 0.5 + (y * 0.013).cos() * 0.1 + noise
    };
    let three = |c: usize| (0..n).map(|i| [at(i, c), at(i, c + 1), at(i, c + 2)]).collect::<Vec<_>>();
    let two = |c: usize| (0..n).map(|i| [at(i, c) * 8.0 - 4.0, at(i, c + 1) - 0.5]).collect::<Vec<_>>();
    let cover = |name: usize, k: usize| Cover {
        name: name as u32,
        share: if name == 0 { 0.0 } else { 0.5 / k as f32 },
    };
    let class: Vec<u8> = (0..n).map(|i| (i % PixelClass::COUNT) as u8).collect();
    let mut pixels = [0; PixelClass::COUNT];
    class.iter().for_each(|&c| pixels[c as usize] += 1);
    Frame {
        number,
        eye: None,
        kind,
        view: view(width, height),
        camera: "Caméra 1".into(),
        window,
        color: (0..n).map(|i| [at(i, 0), at(i, 1), at(i, 2), (i % 3) as f32 * 0.5]).collect(),
        depth: (0..n).map(|i| if i % 7 == 0 { Frame::FAR_DEPTH } else { at(i, 3) * 10.0 }).collect(),
        class,
        normal: three(4),
        position: three(7),
        forward: two(10),
        backward: two(12),
        object: (0..n).map(|i| (i % 5 * 4_000_000) as u32).collect(),
        diffuse: three(14),
        specular: three(17),
        emission: three(20),
        lights: vec![("Key light".into(), three(23)), ("Key.light".into(), three(26))],
        mattes: [("CryptoObject", 3, 1), ("CryptoMaterial", 2, 3)]
            .map(|(layer, count, ranks)| Matte {
                layer,
                names: (0..count).map(|i| format!("{layer} {i}")).collect(),
                ranks,
                covers: (0..n * ranks).map(|i| cover(i % (count + 1), i % ranks + 1)).collect(),
            })
            .to_vec(),
        stats: FrameStats {
            pixels,
            subpixels: SubPixelCounts { sampled: 7, reused: 6, wasted: 5 },
            rays: RayCounts {
                primary: n as u64,
                shadow: 12,
                ambient: 3,
                reflection: 4,
                refraction: 5,
                visibility: 6,
            },
            seconds: StageSeconds::default(),
            hidden: None,
        },
    }
}

/// The layers of a run without `--aov`.
pub fn default_layers(mut frame: Frame) -> Frame {
    frame.normal.clear();
    frame.position.clear();
    frame.forward.clear();
    frame.backward.clear();
    frame.object.clear();
    frame.diffuse.clear();
    frame.specular.clear();
    frame.emission.clear();
    frame.lights.clear();
    frame.mattes.clear();
    frame
}

pub fn hash() -> SettingsHash {
    SettingsHasher::new().feed("test", "1").finish()
}

pub fn options(compression: Compression) -> FileOptions {
    FileOptions {
        compression,
        fps: Rational { numerator: 24_000, denominator: 1001 },
        quality: "half-pixel".into(),
        settings_hash: hash(),
    }
}

/// A frame's file.
pub fn bytes_of(frame: &Frame, compression: Compression) -> Vec<u8> {
    encode(frame, &options(compression)).unwrap().parts.concat()
}
