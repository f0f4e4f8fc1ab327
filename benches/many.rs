//! What must not grow with the square of a scene: reading a file with many shapes or extensions, trees of many
//! instances, and what an inferred frame asks of each.

#![allow(clippy::expect_used)] // A bench that cannot run has nothing better to do.

use buzz::accel::Accel;
use buzz::import::{ImportOptions, import};
use buzz::scene::{Material, Mesh, Scene, View};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DAffine3, DVec3};
use serde_json::{Value, json};
use std::fs;

/// Elements of each array.
const MANY: usize = 16_000;
/// Instances in a row: so many rows.
const ROWS: usize = 100;

fn read(c: &mut Criterion) {
    let numbers = 0..MANY;
    let node = |shape: usize| json!({"extensions": {"BUZZ_analytic_shape": {"shape": shape}}});
    let shape = json!({"type": "sphere"});
    let shapes = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": numbers.clone().collect::<Vec<_>>()}],
        "nodes": numbers.clone().map(node).collect::<Vec<_>>(),
        "extensions": {"KHR_implicit_shapes": {"shapes": vec![shape; MANY]}},
    });
    let names: Vec<String> = numbers.map(|number| format!("VENDOR_{number}")).collect();
    let used: serde_json::Map<String, Value> = names.iter().rev().map(|n| (n.clone(), json!({}))).collect();
    let extensions = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"extensions": used}],
        "extensionsUsed": names,
    });
    let mut group = c.benchmark_group("read");
    group.sample_size(10);
    let folder = tempfile::tempdir().expect("a folder");
    let options = ImportOptions { turntable: Some(2), ..ImportOptions::default() };
    for (name, gltf) in [("shapes", shapes), ("extensions", extensions)] {
        let file = folder.path().join(format!("{name}.gltf"));
        fs::write(&file, gltf.to_string()).expect("a file");
        group.bench_function(name, |b| b.iter(|| import(&file, &options).expect("a scene")));
    }
    group.finish();
}

fn instances(c: &mut Criterion) {
    let mut scene = Scene::default();
    scene.add_material(Material::default());
    let ball = scene.add_mesh(Mesh::uv_sphere(0.5, 100, 0));
    for i in 0..ROWS * ROWS {
        let (x, z) = ((i % ROWS) as f64 - 0.5 * ROWS as f64, -((i / ROWS) as f64));
        scene.add_instance(ball, DAffine3::from_translation(DVec3::new(1.3 * x, 0.0, 1.3 * z)));
    }
    scene.add_camera(DVec3::new(0.0, 2.0, 5.0), DVec3::new(0.0, 2.0, 0.0), 0.7);
    let pose = scene.pose(0.0);
    let old = scene.view(&pose, 0, 320, 180);
    let new = View { eye: old.eye + DVec3::new(0.02, 0.0, 0.0), ..old };
    let mut group = c.benchmark_group("instances");
    group.sample_size(10);
    group.bench_function("trees", |b| b.iter(|| Accel::new(&scene)));
    let mut accel = Accel::new(&scene);
    accel.place(&scene, &pose, old.eye);
    group.bench_function("turned", |b| b.iter(|| accel.turned(&scene, (&old, &new), &|_| {})));
    group.finish();
}

criterion_group!(benches, read, instances);
criterion_main!(benches);
