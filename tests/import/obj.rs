//! Turntables and OBJ files. Each feature, and each way to be broken.

use crate::gltf_file::{Gltf, png};
use crate::read::{Read, features, refusal};
use buzz::import::{ImportOptions, import};
use buzz::scene::AlphaMode;
use glam::{DVec3, Vec2, Vec3};
use serde_json::json;
use std::fs;
use tempfile::TempDir;

#[test]
fn a_scene_without_a_camera_asks_for_a_turntable_and_gets_one() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["nodes"][0] = json!({});
    let message = gltf.refused();
    assert!(message.contains("--turntable"), "{message}");
    let scene = gltf.read_with(&ImportOptions { turntable: Some(8), ..ImportOptions::default() }).unwrap();
    assert_eq!((scene.cameras.len(), scene.timing.first, scene.timing.last), (1, 0, 7));
    let centre = DVec3::new(0.5, 0.5, 0.0);
    let mut eyes = Vec::new();
    for frame in 0..8 {
        let view = scene.view(&scene.pose(scene.timing.time_of(frame)), 0, 16, 9);
        let towards = (centre - view.eye).normalize();
        assert!((towards - view.forward).length() < 1e-5, "{frame}");
        assert!(view.up.y > 0.5);
        eyes.push(view.eye);
    }
    let distance = (eyes[0] - centre).length();
    assert!(eyes.iter().all(|e| ((*e - centre).length() - distance).abs() < 1e-4));
    assert!(((eyes[0] + eyes[4]) * 0.5 - centre).truncate().x.abs() < 1e-4);
    for frames in [0, u32::MAX] {
        let options = ImportOptions { turntable: Some(frames), ..ImportOptions::default() };
        assert_eq!(gltf.read_with(&options).unwrap_err().exit_code(), 2);
    }
}

#[test]
fn a_turntable_takes_the_place_of_the_files_own_cameras() {
    let mut gltf = Gltf::with_triangle();
    gltf.pointer("/cameras/0/perspective/yfov", &[0.0, 1.0], "SCALAR", &[0.5, 1.0]);
    let scene = gltf.read_with(&ImportOptions { turntable: Some(4), ..ImportOptions::default() }).unwrap();
    assert_eq!(scene.cameras.len(), 1);
    assert_eq!(scene.cameras[0].name, "turntable");
    scene.pose(0.0);
}

const OBJ: &str = "mtllib a.mtl\no Quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                   usemtl red\nf 1/1 2/2 3/3 4/4\n";

#[test]
fn an_obj_is_rendered_through_another_files_camera() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.obj"), OBJ).unwrap();
    fs::write(at("wood.png"), png(2, 2)).unwrap();
    let mtl = "newmtl red\nKd 1 0 0\nKs 0.5\nKe 0 2 0\nNs 98\nd 0.5\nmap_Kd -s 1 1 1 wood.png\n";
    fs::write(at("a.mtl"), mtl).unwrap();
    let mut gltf = Gltf::with_triangle();
    gltf.json["scenes"][0]["extras"] = json!({"buzz": {"fps": [25, 1]}});
    fs::write(at("cam.gltf"), gltf.text()).unwrap();
    let options = ImportOptions { camera_from: Some(at("cam.gltf")), ..ImportOptions::default() };
    let scene = import(&at("a.obj"), &options).unwrap();
    assert_eq!((scene.triangle_count(), scene.cameras.len(), scene.timing.fps.numerator), (2, 1, 25));
    let material = &scene.materials[scene.meshes[0].material];
    assert_eq!(material.base_color.to_array(), [1.0, 0.0, 0.0, 0.5]);
    assert_eq!((material.emissive, material.alpha_mode), (Vec3::new(0.0, 2.0, 0.0), AlphaMode::Blend));
    assert!((material.roughness - 0.376_06).abs() < 1e-4);
    assert!(material.base_color_texture.is_some());
    assert_eq!(scene.meshes[0].uvs[0][0], Vec2::new(0.0, 1.0));
    assert!(scene.ignored.is_empty(), "{:?}", scene.ignored);
    // As additional geometry of the glTF file, its own triangle stays.
    let options = ImportOptions { geometry: vec![at("a.obj"), at("a.obj")], ..ImportOptions::default() };
    let scene = import(&at("cam.gltf"), &options).unwrap();
    assert_eq!(scene.triangle_count(), 5);
    let objects: Vec<u32> = scene.instances.iter().map(|i| i.object).collect();
    assert_eq!(objects, [1, 2, 3]);
    // Neither camera: both ways out are named. A camera for a glTF file is a contradiction.
    let message = refusal(import(&at("a.obj"), &ImportOptions::default()));
    assert!(message.contains("--camera-from") && message.contains("--turntable"));
    let options = ImportOptions { camera_from: Some(at("cam.gltf")), ..ImportOptions::default() };
    assert_eq!(import(&at("cam.gltf"), &options).unwrap_err().exit_code(), 2);
}

#[test]
fn what_is_no_number_in_an_obj_is_listed() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("a.obj");
    fs::write(&file, OBJ.replace("v 0 1 0", "v nan 1 0").replace("vt 0 1", "vt 0 inf")).unwrap();
    let scene = import(&file, &ImportOptions { turntable: Some(2), ..ImportOptions::default() }).unwrap();
    assert_eq!(scene.triangle_count(), 1);
    let listed = features(&scene);
    for kind in ["non-finite positions", "non-finite texture coordinates"] {
        assert!(listed.contains(&kind), "{listed:?}");
    }
}

#[test]
fn an_obj_reads_nothing_outside_its_folder_and_survives_what_is_missing() {
    let outer = TempDir::new().unwrap();
    let folder = outer.path().join("x");
    fs::create_dir(&folder).unwrap();
    fs::write(outer.path().join("a.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
    let file = folder.join("a.obj");
    let options = ImportOptions { turntable: Some(2), ..ImportOptions::default() };
    for library in ["../a.mtl", "gone.mtl", "/etc/hostname"] {
        fs::write(&file, OBJ.replace("a.mtl", library)).unwrap();
        let scene = import(&file, &options).unwrap();
        assert_eq!(scene.triangle_count(), 2);
        assert!(features(&scene)[0].contains("missing"), "{:?}", scene.ignored);
    }
    for broken in
        ["f 1 2 3\n", "v 1 2\n", "v a b c\n", "v 0 0 0\nf 1 2 9\n", "v 0 0 0\nf -5 1 1\n", "f 0 0 0\n"]
    {
        fs::write(&file, broken).unwrap();
        refusal(import(&file, &options));
    }
}
