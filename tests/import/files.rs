//! Containers, and the files that a scene names. Each feature, and each way to be broken.

use crate::gltf_file::{Gltf, base64};
use crate::read::{Read, features, read_bytes, refusal, textured};
use buzz::import::{ImportOptions, import};
use glam::Vec3;
use serde_json::json;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

#[test]
fn gltf_text_and_glb_give_the_same_scene() {
    let gltf = Gltf::with_triangle();
    let glb = read_bytes("scene.glb", &gltf.glb(), &ImportOptions::default()).unwrap();
    for scene in [gltf.scene(), glb] {
        assert_eq!(scene.name, "scene");
        assert_eq!(scene.triangle_count(), 1);
        assert_eq!(scene.meshes[0].positions[1], Vec3::X);
        assert!(scene.meshes[0].normals.is_empty());
        assert_eq!(scene.cameras[0].name, "Cam");
        assert_eq!(scene.instances[0].object, 1);
        assert!(scene.ignored.is_empty());
    }
}

#[test]
fn a_byte_order_mark_does_no_harm() {
    let text = format!("\u{feff}{}", Gltf::with_triangle().text());
    assert!(read_bytes("scene.gltf", text.as_bytes(), &ImportOptions::default()).is_ok());
}

#[test]
fn base64_may_lack_its_padding() {
    let mut gltf = Gltf::with_triangle();
    gltf.bytes.push(7);
    let data = base64(&gltf.bytes);
    let uri = format!("data:;base64,{}", data.trim_end_matches('='));
    gltf.json["buffers"] = json!([{"byteLength": gltf.bytes.len(), "uri": uri}]);
    gltf.scene();
    gltf.json["buffers"][0]["uri"] = json!("data:;base64,****");
    assert!(gltf.refused().contains("/buffers/0: invalid base64"));
    gltf.json["buffers"][0]["uri"] = json!("data:;base64");
    assert!(gltf.refused().contains("comma"));
}

#[test]
fn files_beside_the_scene_are_found_by_their_percent_encoded_names() {
    let folder = TempDir::new().unwrap();
    let mut gltf = Gltf::with_triangle();
    fs::create_dir(folder.path().join("a b")).unwrap();
    fs::write(folder.path().join("a b/mäsh.bin"), &gltf.bytes).unwrap();
    let file = folder.path().join("scene.gltf");
    for uri in ["a%20b/m%C3%A4sh.bin", "./a b/../a%20b/mäsh.bin", "a b\\mäsh.bin"] {
        gltf.json["buffers"] = json!([{"byteLength": gltf.bytes.len(), "uri": uri}]);
        fs::write(&file, gltf.text()).unwrap();
        let scene = import(&file, &ImportOptions::default()).unwrap_or_else(|e| panic!("{uri}: {e}"));
        let read =
            ["a b/mäsh.bin", "scene.gltf"].map(|name| folder.path().join(name).canonicalize().unwrap());
        assert_eq!(scene.files, read.into());
    }
}

#[cfg(unix)]
#[test]
fn a_colon_that_is_encoded_is_part_of_the_name() {
    let folder = TempDir::new().unwrap();
    let mut gltf = Gltf::with_triangle();
    fs::write(folder.path().join("take:2.bin"), &gltf.bytes).unwrap();
    gltf.json["buffers"] = json!([{"byteLength": gltf.bytes.len(), "uri": "take%3A2.bin"}]);
    let file = folder.path().join("scene.gltf");
    fs::write(&file, gltf.text()).unwrap();
    assert_eq!(import(&file, &ImportOptions::default()).unwrap().triangle_count(), 1);
}

#[test]
fn nothing_outside_the_scenes_folder_is_read() {
    let outer = TempDir::new().unwrap();
    let folder = outer.path().join("scene");
    fs::create_dir(&folder).unwrap();
    let mut gltf = Gltf::with_triangle();
    fs::write(outer.path().join("secret.bin"), &gltf.bytes).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(outer.path().join("secret.bin"), folder.join("link.bin")).unwrap();
    let absolute = outer.path().join("secret.bin").display().to_string();
    let file_url = format!("file://{absolute}");
    for (uri, why) in [
        ("../secret.bin", "leaves the folder"),
        ("x/../../secret.bin", "leaves the folder"),
        ("%2e%2e/secret.bin", "leaves the folder"),
        ("..%5csecret.bin", "leaves the folder"),
        (absolute.as_str(), "is absolute"),
        (file_url.as_str(), "has a scheme"),
        ("http://localhost/secret.bin", "has a scheme"),
        ("C:\\secret.bin", "has a scheme"),
        ("https%3A//../../secret.bin", "leaves the folder"),
        #[cfg(unix)]
        ("link.bin", "is a link that leaves the folder"),
    ] {
        gltf.json["buffers"] = json!([{"byteLength": gltf.bytes.len(), "uri": uri}]);
        fs::write(folder.join("scene.gltf"), gltf.text()).unwrap();
        let message = refusal(import(&folder.join("scene.gltf"), &ImportOptions::default()));
        assert!(message.contains(why), "{uri}: {message}");
    }
}

#[test]
fn a_missing_buffer_is_an_error_and_a_missing_picture_is_not() {
    let mut gltf = textured("gone.png");
    let scene = gltf.scene();
    assert!(scene.images.is_empty());
    assert!(scene.materials[0].base_color_texture.is_none());
    assert_eq!(features(&scene), ["image gone.png is missing"]);
    assert_eq!(scene.ignored[0].place, "/images/0");
    gltf.json["buffers"] = json!([{"byteLength": 36, "uri": "gone.bin"}]);
    assert!(gltf.refused().contains("gone.bin is missing"));
}

#[test]
fn names_that_lead_to_no_file_are_refused_by_who_has_them() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("scene.gltf");
    fs::create_dir(folder.path().join("sub")).unwrap();
    let refused = |gltf: &Gltf| {
        fs::write(&file, gltf.text()).unwrap();
        refusal(import(&file, &ImportOptions::default()))
    };
    for (uri, why) in
        [("", "the URI is empty"), ("sub", "sub is not a regular file"), (".", "is not a regular file")]
    {
        let mut gltf = Gltf::with_triangle();
        gltf.json["buffers"] = json!([{"byteLength": 36, "uri": uri}]);
        let message = refused(&gltf);
        assert!(message.contains("scene.gltf: /buffers/0: ") && message.contains(why), "{message}");
        let mut gltf = Gltf::with_triangle();
        gltf.json["scenes"][0]["extras"] = json!({"buzz": {"world": {"image": uri}}});
        let message = refused(&gltf);
        assert!(message.contains("world/image: ") && message.contains(why), "{message}");
    }
    assert_eq!(features(&textured("").scene()), ["image without uri and bufferView"]);
}

#[cfg(unix)]
#[test]
fn a_folder_or_device_is_not_a_scene() {
    assert!(
        refusal(import(Path::new("/dev/zero"), &ImportOptions::default())).contains("not a regular file")
    );
    let folder = TempDir::new().unwrap();
    assert!(refusal(import(folder.path(), &ImportOptions::default())).contains("not a regular file"));
    assert!(
        refusal(import(&folder.path().join("x.glb"), &ImportOptions::default()))
            .contains("there is no such file")
    );
}

#[test]
fn truncated_glbs_name_the_byte() {
    let glb = Gltf::with_triangle().glb();
    for end in (0..glb.len() - 3).step_by(5) {
        let message = refusal(read_bytes("scene.glb", &glb[..end], &ImportOptions::default()));
        assert!(
            message.contains("byte ") || message.contains("line ") || message.contains("/buffers/0"),
            "{message}"
        );
    }
    let mut old = glb.clone();
    old[4] = 1;
    assert!(refusal(read_bytes("scene.glb", &old, &ImportOptions::default())).contains("version 1"));
}

#[test]
fn text_that_is_no_gltf_is_refused() {
    let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    for text in
        ["", "{", "[]", "{}", "null", r#"{"asset":{"version":"1.0"}}"#, r#"{"asset":{"version":{}}}"#, &deep]
    {
        refusal(read_bytes("scene.gltf", text.as_bytes(), &ImportOptions::default()));
    }
}

#[test]
fn unknown_required_extensions_are_named_and_known_ones_are_read() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["extensionsRequired"] =
        json!(["KHR_materials_volume", "KHR_materials_specular", "KHR_mesh_quantization"]);
    gltf.scene();
    for name in ["ACME_x", "KHR_draco_mesh_compression", "KHR_texture_basisu"] {
        gltf.json["extensionsRequired"] = json!([name]);
        assert!(gltf.refused().contains(&format!("requires {name}")));
    }
}

#[test]
fn used_extensions_that_are_not_rendered_are_listed_once_and_refused_if_strict() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["extensionsUsed"] = json!(["KHR_materials_clearcoat", "KHR_materials_unlit", "ACME_x"]);
    for _ in 0..2 {
        gltf.push("materials", json!({"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}}));
    }
    let scene = gltf.scene();
    assert_eq!(features(&scene), ["KHR_materials_clearcoat", "ACME_x"]);
    assert_eq!(scene.ignored[0].place, "/materials/0");
    let strict = ImportOptions { strict: true, ..ImportOptions::default() };
    let message = refusal(gltf.read_with(&strict));
    assert!(message.contains("KHR_materials_clearcoat") && message.contains("1 more"), "{message}");
    assert!(Gltf::with_triangle().read_with(&strict).is_ok());
}

#[test]
fn extensions_that_the_file_forgets_to_declare_are_listed_after_those_that_it_declares() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["extensionsUsed"] = json!(["ACME_x"]);
    gltf.push(
        "materials",
        json!({"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}, "KHR_materials_unlit": {}}}),
    );
    gltf.json["nodes"][1]["extensions"] = json!({"ACME_y": {}});
    gltf.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_materials_variants": {"mappings": []}});
    let scene = gltf.scene();
    let listed: Vec<(&str, &str)> =
        scene.ignored.iter().map(|i| (i.feature.as_str(), i.place.as_str())).collect();
    let wanted = [
        ("ACME_x", "/extensionsUsed/0"),
        ("KHR_materials_clearcoat", "/materials/0"),
        ("ACME_y", "/nodes/1"),
        ("KHR_materials_variants", "/meshes/0/primitives/0"),
    ];
    assert_eq!(listed, wanted);
    let strict = ImportOptions { strict: true, ..ImportOptions::default() };
    assert!(refusal(gltf.read_with(&strict)).contains("ACME_x"));
}
