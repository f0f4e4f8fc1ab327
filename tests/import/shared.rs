//! The importer on scenes that nobody here made, where they lie beside the repository (`../shared/scenes`).

use buzz::{
    Error,
    import::{ImportOptions, import},
    scene::{Projection, Scene},
};
use glam::{DMat4, DVec3};
use serde_json::Value;
use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

/// The folder of shared scenes; none, and said so, where it is not there.
fn shared() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: {} is not there", folder.display());
    None
}

fn files_below(folder: &Path, wanted: &dyn Fn(&str) -> bool, out: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            files_below(&path, wanted, out);
        } else if wanted(&path.to_string_lossy()) {
            out.push(path);
        }
    }
}

/// Every index in range and every array as long as it says.
fn check(scene: &Scene) {
    for (i, node) in scene.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|p| p < i));
    }
    for mesh in &scene.meshes {
        let count = mesh.positions.len();
        assert!(mesh.material < scene.materials.len());
        assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < count));
        assert!(mesh.positions.iter().all(|p| p.is_finite()));
        for length in [mesh.normals.len(), mesh.tangents.len(), mesh.colors.len()] {
            assert!(length == 0 || length == count);
        }
        assert!(mesh.uvs.iter().all(|set| set.len() == count));
        assert!(mesh.joints.iter().map(Vec::len).all(|n| n == count));
        assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-3));
    }
    for instance in &scene.instances {
        assert!(
            instance.mesh < scene.meshes.len() && instance.node < scene.nodes.len() && instance.object > 0
        );
        assert!(instance.skin.is_none_or(|s| s < scene.skins.len()));
    }
    assert!(scene.cameras.iter().all(|c| c.node < scene.nodes.len()));
    assert!(scene.cuts.iter().all(|c| c.camera < scene.cameras.len()));
    for channel in &scene.channels {
        let curve = &channel.curve;
        assert!(curve.times.windows(2).all(|w| w[0] < w[1]) && !curve.times.is_empty());
        assert!(curve.values.len() >= curve.times.len() * curve.width);
    }
    scene.pose(scene.timing.time_of(scene.timing.last));
}

#[test]
fn every_shared_scene_is_read_or_refused_in_one_line() {
    let Some(shared) = shared() else { return };
    let mut files = Vec::new();
    let is_gltf = |p: &str| p.ends_with(".gltf") || p.ends_with(".glb");
    for folder in ["conf", "conf_camera", "blender_export", "walk"] {
        files_below(&shared.join(folder), &is_gltf, &mut files);
    }
    assert!(files.len() > 100, "{}", files.len());
    let (mut read, mut refused) = (0, 0);
    for file in &files {
        let name = file.strip_prefix(&shared).unwrap().display().to_string();
        let start = Instant::now();
        let mut result = import(file, &ImportOptions::default());
        if matches!(&result, Err(Error::Input { location, .. }) if location == "/cameras") {
            let options = ImportOptions { turntable: Some(4), ..ImportOptions::default() };
            result = import(file, &options);
        }
        let took = start.elapsed();
        match result {
            Ok(scene) => {
                check(&scene);
                read += 1;
                println!(
                    "{took:6.1?} {name}: {} triangles; ignored: {:?}",
                    scene.triangle_count(),
                    scene.ignored
                );
            }
            Err(error) => {
                refused += 1;
                assert_eq!(error.exit_code(), 3, "{name}: {error}");
                assert!(!error.to_string().contains('\n'), "{name}: {error}");
                println!("{took:6.1?} {error}");
            }
        }
        assert!(took.as_secs() < 10, "{name} took {took:?}");
    }
    println!("{read} read, {refused} refused");
    assert!(read > 100);
}

#[test]
fn required_extensions_that_are_not_supported_are_named() {
    let Some(shared) = shared() else { return };
    for (file, name) in [
        ("conf_camera/unknown_required_extension.gltf", "ACME_unobtainium"),
        ("walk/zdm2_fastpan_draco.glb", "KHR_draco_mesh_compression"),
    ] {
        let error = import(&shared.join(file), &ImportOptions::default()).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().contains(name), "{error}");
    }
}

#[test]
fn the_walk_scenes_hold_as_many_triangles_as_their_makers_counted() {
    let Some(shared) = shared() else { return };
    for (file, triangles, lights) in [
        ("walk/breakfast_dolly/breakfast_dolly.gltf", 270_623, 3),
        ("walk/gas_station_orbit_cut_whip.glb", 99_002, 5),
        ("walk/kaykit_dungeon_walk.glb", 88_749, 10),
        ("walk/kaykit_dungeon_walk_meshopt.glb", 88_749, 10),
        ("walk/sponza_walk_cut.glb", 262_087, 6),
        ("walk/zdm2_fastpan.glb", 58_772, 7),
    ] {
        let scene = import(&shared.join(file), &ImportOptions::default()).unwrap();
        println!("{file}: {} of {triangles}; {:?}", scene.triangle_count(), scene.timing);
        // Triangles that use a vertex twice are left out.
        assert!(scene.triangle_count() <= triangles && scene.triangle_count() * 1000 > triangles * 995);
        assert_eq!(scene.lights.len(), lights);
    }
}

/// World matrix at a row of the oracle.
fn matrix(value: &Value) -> DMat4 {
    let mut columns = [0.0; 16];
    for (r, row) in value.as_array().unwrap().iter().enumerate() {
        for (c, v) in row.as_array().unwrap().iter().enumerate() {
            columns[4 * c + r] = v.as_f64().unwrap();
        }
    }
    DMat4::from_cols_array(&columns)
}

/// Right and up made orthonormal to the view direction.
fn axes(world: DMat4) -> [DVec3; 3] {
    let forward = -world.z_axis.truncate().normalize();
    let right = world.x_axis.truncate().reject_from_normalized(forward).normalize();
    let up =
        world.y_axis.truncate().reject_from_normalized(forward).reject_from_normalized(right).normalize();
    [forward, right, up]
}

#[test]
fn cameras_stand_where_the_oracle_says_at_every_frame() {
    let Some(shared) = shared() else { return };
    let oracle = shared.join("oracle");
    let mut files = Vec::new();
    files_below(&oracle, &|p| p.ends_with(".cameras.json"), &mut files);
    assert!(files.len() > 30);
    let mut compared = 0;
    for file in &files {
        let name = file.strip_prefix(&oracle).unwrap().to_string_lossy().into_owned();
        let scene_file = shared.join(name.strip_suffix(".cameras.json").unwrap());
        if name.contains("unknown_required") || name.contains("draco") {
            continue;
        }
        let json: Value = serde_json::from_slice(&fs::read(file).unwrap()).unwrap();
        let mut scene = import(&scene_file, &ImportOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(json["fps"].as_f64(), Some(scene.timing.fps.value()), "{name}");
        // The oracle counts frames from time 0.
        scene.timing.frame_start = 0;
        let cameras = json["cameras"].as_array().unwrap();
        assert_eq!(cameras.len(), scene.cameras.len(), "{name}");
        for (index, camera) in cameras.iter().enumerate() {
            let frames = camera["frames"].as_array().unwrap();
            let at = |f: &Value| matrix(&f["world"]).w_axis.truncate();
            let first = at(&frames[0]);
            let (mut low, mut high) = (first, first);
            for frame in frames {
                (low, high) = (low.min(at(frame)), high.max(at(frame)));
            }
            let tolerance = 1e-4 * (high - low).length().max(first.length());
            for frame in frames {
                let number = frame["frame"].as_i64().unwrap();
                let place = format!("{name} camera {index} frame {number}");
                let time = scene.timing.time_of(number);
                assert!((time - frame["t"].as_f64().unwrap()).abs() < 1e-6, "{place}");
                let pose = scene.pose(time);
                let view = scene.view(&pose, index, 1280, 720);
                let world = matrix(&frame["world"]);
                let off = (view.eye - world.w_axis.truncate()).length();
                assert!(off <= tolerance, "{place}: {off} > {tolerance}");
                for (found, wanted) in [view.forward, view.right, view.up].into_iter().zip(axes(world)) {
                    assert!((found - wanted).length() < 1e-4, "{place}: {found} {wanted}");
                }
                if let Some(wanted) = frame["yfov"].as_f64() {
                    let Projection::Perspective { yfov } = view.lens.projection else { panic!("{place}") };
                    assert!((yfov - wanted).abs() < 1e-5, "{place}: {yfov} {wanted}");
                }
                compared += 1;
            }
        }
    }
    println!("{} files, {compared} camera poses compared", files.len());
    assert!(compared > 1000);
}
