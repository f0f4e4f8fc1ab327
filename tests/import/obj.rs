//! Turntables and OBJ files. Each feature, and each way to be broken.

use crate::gltf_file::{Gltf, png};
use crate::read::{Read, features, read_bytes, refusal};
use buzz::import::{ImportOptions, import};
use buzz::scene::{AlphaMode, Scene};
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
    let read = ["a.mtl", "a.obj", "cam.gltf", "wood.png"].map(|name| at(name).canonicalize().unwrap());
    assert_eq!(scene.files, read.into());
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

/// The scene of an OBJ file by itself.
fn read_obj(obj: impl AsRef<[u8]>) -> Scene {
    let options = ImportOptions { turntable: Some(2), ..ImportOptions::default() };
    read_bytes("a.obj", obj.as_ref(), &options).unwrap_or_else(|e| panic!("{e}"))
}

const CORNERS: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n";

#[test]
fn a_byte_order_mark_hides_nothing() {
    let scene = read_obj(format!("\u{feff}{CORNERS}f -4 -3 -2\nf 1 2 3\n"));
    assert_eq!(scene.triangle_count(), 2);
    assert_eq!(scene.meshes[0].positions[0], Vec3::new(-1.0, -1.0, 0.0));
}

#[test]
fn concave_polygons_stay_hollow() {
    let u = [(-1., -1.), (1., -1.), (1., 1.), (0.3, 1.), (0.3, 0.), (-0.3, 0.), (-0.3, 1.), (-1., 1.)];
    let corners: String = u.iter().map(|(x, y)| format!("v {x} {y} 0\n")).collect();
    for first in 0..8 {
        let face: String = (0..8).map(|i| format!(" {}", (i + first) % 8 + 1)).collect();
        // The triangle beside it: faces of both kinds are told apart.
        let scene = read_obj(format!("{corners}f{face}\nf 1 2 3\n"));
        let mesh = &scene.meshes[0];
        let area: f32 = mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                let area = (b - a).cross(c - a).z / 2.0;
                assert!(area > 0.0, "{first}");
                area
            })
            .sum();
        assert!((area - 3.4 - 2.0).abs() < 1e-5, "{first}: {area}");
    }
}

#[test]
fn text_of_other_times_is_read() {
    // Latin-1 in a comment and in a name, a continued line, a tab, a polyline that is no face.
    let latin =
        b"# caf\xe9\no caf\xe9\nv -1 -1 0\nv 1 -1 \\\n0\nv\t1 1 0\nv 0 0 1\nf 1 2 \\\r\n 3\nl 1 2 3 4\n";
    let scene = read_obj(latin);
    assert_eq!((scene.triangle_count(), scene.meshes[0].name.as_str()), (1, "café"));
    assert_eq!(features(&scene), ["lines (l)"]);
}

#[test]
fn what_is_broken_in_an_obj_is_named_by_line() {
    for (obj, line, what) in [
        ("v -1,5 0 0\nv 1 -1 0\nv 1 1 0\nf 1 2 3\n", "line 1:", "`v -1,5 0 0`"),
        ("v 0 0 0\n# c\nv 1 \\\n0\nf 1 1 1\n", "line 3:", "`v 1  0`"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0\nf 1 2 3\n", "line 4:", "`vt 0`"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 2 9\n", "line 5:", "`9`"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 2 -4\n", "line 5:", "`-4`"),
    ] {
        let message = refusal(read_bytes("a.obj", obj.as_bytes(), &ImportOptions::default()));
        assert!(message.contains(line) && message.contains(what), "{message}");
    }
}

#[test]
fn what_is_not_read_of_an_obj_is_listed_with_its_line() {
    let scene =
        read_obj(format!("{CORNERS}s 1\nf 1 2 3\nusemtl red\nf 1 3 4\np 1\ncurv 0 1 1 2\nsurf 0 1 0 1 1\n"));
    let places: Vec<&str> = scene.ignored.iter().map(|i| i.place.as_str()).collect();
    assert_eq!(
        features(&scene),
        ["smoothing groups (s)", "points (p)", "curves (curv)", "free-form surfaces (surf)", "material red"]
    );
    assert_eq!(places, ["a.obj line 6", "a.obj line 9", "a.obj line 10", "a.obj line 11", "a.obj line 7"]);
    // With normals, or switched off, nothing is lost.
    let scene = read_obj(format!("{CORNERS}vn 0 0 1\ns 1\nf 1//1 2//1 3//1\ns off\nf 1 3 4\n"));
    assert_eq!(features(&scene), ["normals (vn)"]);
}

#[test]
fn colours_of_some_vertices_only_are_left_out() {
    let scene = read_obj("v 0 0 0 1 0 0\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n");
    assert_eq!((scene.triangle_count(), scene.meshes[0].colors.len()), (2, 0));
    assert_eq!(features(&scene), ["vertex colours"]);
}
