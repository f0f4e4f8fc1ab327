//! Memory that reading a file takes.

use buzz::import::{ImportOptions, import};
use buzz::scene::Scene;
use image::{DynamicImage, Rgb, Rgb32FImage, Rgba, RgbaImage};
use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;

/// Reads `gltf` from a folder with its pictures, and counts what that takes.
fn read(gltf: &Value, folder: &TempDir) -> (Scene, dhat::HeapStats) {
    let file = folder.path().join("scene.gltf");
    fs::write(&file, gltf.to_string()).unwrap();
    let options = ImportOptions { turntable: Some(2), ..ImportOptions::default() };
    let profiler = dhat::Profiler::builder().testing().build();
    let scene = import(&file, &options).unwrap();
    let taken = dhat::HeapStats::get();
    drop(profiler);
    (scene, taken)
}

#[test]
fn a_file_of_twice_as_many_shapes_takes_twice_as_much_to_read() {
    let _alone = super::alone();
    let folder = TempDir::new().unwrap();
    let blocks = [200, 400].map(|count| {
        let shapes: Vec<Value> = (0..count).map(|_| json!({"type": "sphere"})).collect();
        let node = |shape: usize| json!({"extensions": {"BUZZ_analytic_shape": {"shape": shape}}});
        let gltf = json!({
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": (0..count).collect::<Vec<_>>()}],
            "nodes": (0..count).map(node).collect::<Vec<_>>(),
            "extensions": {"KHR_implicit_shapes": {"shapes": shapes}},
            "extensionsUsed": ["BUZZ_analytic_shape", "KHR_implicit_shapes"],
        });
        let (scene, taken) = read(&gltf, &folder);
        assert_eq!(scene.shape_count(), count);
        taken.total_blocks as f64
    });
    assert!(blocks[1] < 2.5 * blocks[0], "{blocks:?} blocks");
}

#[test]
fn a_picture_is_in_memory_once() {
    const SIDE: u32 = 512;
    let _alone = super::alone();
    let folder = TempDir::new().unwrap();
    let hdr = DynamicImage::ImageRgb32F(Rgb32FImage::from_pixel(SIDE, SIDE, Rgb([0.5; 3])));
    let png = DynamicImage::ImageRgba8(RgbaImage::from_pixel(SIDE, SIDE, Rgba([9; 4])));
    for (name, picture) in [("sky.hdr", hdr), ("sky.png", png)] {
        picture.save(folder.path().join(name)).unwrap();
        let gltf = json!({
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0], "extras": {"buzz": {"world": {"image": name}}}}],
            "nodes": [{"extensions": {"BUZZ_analytic_shape": {"shape": 0}}}],
            "extensions": {"KHR_implicit_shapes": {"shapes": [{"type": "sphere"}]}},
        });
        let (scene, taken) = read(&gltf, &folder);
        let kept = scene.images[0].memory_bytes();
        assert!((taken.max_bytes as f64) < 1.2 * kept as f64, "{name}: {} for {kept}", taken.max_bytes);
    }
}
