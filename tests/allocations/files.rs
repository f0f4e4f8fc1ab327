//! Memory that reading a file takes.

use buzz::import::{ImportOptions, import};
use buzz::scene::Scene;
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
