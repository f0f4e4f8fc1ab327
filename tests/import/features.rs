//! The importer on small files made by hand: each feature, and each way to be broken.

use buzz::{
    Error,
    import::{ImportOptions, import},
    scene::{
        AlphaMode, Interpolation, LightKind, LocalTransform, Outline, Projection, Rational, Scene, Target,
        Wrap,
    },
};
use glam::{DVec3, Vec2, Vec3};
use serde_json::json;
use std::{fs, path::Path};
use tempfile::TempDir;

use crate::gltf_file::{Gltf, base64, png};

trait Read {
    fn read(&self) -> Result<Scene, Error>;
    fn read_with(&self, options: &ImportOptions) -> Result<Scene, Error>;
    fn scene(&self) -> Scene;
    fn refused(&self) -> String;
}

impl Read for Gltf {
    fn read(&self) -> Result<Scene, Error> {
        self.read_with(&ImportOptions::default())
    }

    fn read_with(&self, options: &ImportOptions) -> Result<Scene, Error> {
        read_bytes("scene.gltf", self.text().as_bytes(), options)
    }

    fn scene(&self) -> Scene {
        self.read().unwrap_or_else(|e| panic!("{e}"))
    }

    /// The message of the error that reading gives.
    fn refused(&self) -> String {
        refusal(self.read())
    }
}

fn refusal(result: Result<Scene, Error>) -> String {
    match result {
        Ok(_) => panic!("was read"),
        Err(error) => {
            assert_eq!(error.exit_code(), 3, "{error}");
            let message = error.to_string();
            assert!(!message.contains('\n'), "{message}");
            message
        }
    }
}

fn read_bytes(name: &str, bytes: &[u8], options: &ImportOptions) -> Result<Scene, Error> {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join(name);
    fs::write(&file, bytes).unwrap();
    import(&file, options)
}

/// A triangle whose base colour is the image at `uri`.
fn textured(uri: &str) -> Gltf {
    let mut gltf = Gltf::with_triangle();
    let uv = gltf.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    gltf.push("images", json!({"uri": uri}));
    gltf.push("textures", json!({"source": 0}));
    gltf.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    gltf
}

fn features(scene: &Scene) -> Vec<&str> {
    scene.ignored.iter().map(|i| i.feature.as_str()).collect()
}

// ---- containers and files --------------------------------------------------------------------------------------

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
        import(&file, &ImportOptions::default()).unwrap_or_else(|e| panic!("{uri}: {e}"));
    }
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

#[cfg(unix)]
#[test]
fn a_folder_or_device_is_not_a_scene() {
    assert!(
        refusal(import(Path::new("/dev/zero"), &ImportOptions::default())).contains("not a regular file")
    );
    let folder = TempDir::new().unwrap();
    assert!(refusal(import(folder.path(), &ImportOptions::default())).contains("not a regular file"));
    assert!(
        refusal(import(&folder.path().join("x.glb"), &ImportOptions::default())).contains("cannot be read")
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

// ---- nodes -----------------------------------------------------------------------------------------------------

#[test]
fn parents_come_before_children_whatever_the_files_order() {
    let mut gltf = Gltf::new();
    gltf.json["nodes"] = json!([
        {"name": "leaf", "camera": 0, "translation": [1, 0, 0]},
        {"name": "root", "children": [2], "translation": [0, 0, 3]},
        {"name": "middle", "children": [0], "scale": [2, 2, 2]},
    ]);
    gltf.json["scenes"] = json!([{"nodes": [1]}]);
    let scene = gltf.scene();
    let names: Vec<&str> = scene.nodes.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(names, ["root", "middle", "leaf"]);
    let eye = scene.view(&scene.pose(0.0), 0, 4, 4).eye;
    assert_eq!(eye, DVec3::new(2.0, 0.0, 3.0));
}

#[test]
fn a_chain_of_a_hundred_thousand_nodes_does_not_overflow_the_stack() {
    let mut gltf = Gltf::new();
    let count = 100_000;
    gltf.json["nodes"] = (0..count).map(|i| json!({"children": [i + 1], "translation": [1, 0, 0]})).collect();
    gltf.json["nodes"].as_array_mut().unwrap().push(json!({"camera": 0}));
    let scene = gltf.scene();
    assert_eq!(scene.view(&scene.pose(0.0), 0, 4, 4).eye.x, f64::from(count));
}

#[test]
fn cycles_and_second_parents_are_refused() {
    let mut gltf = Gltf::new();
    gltf.json["nodes"] = json!([{"camera": 0}, {"children": [2]}, {"children": [1]}]);
    assert!(gltf.refused().contains("its own ancestor"));
    gltf.json["nodes"] = json!([{"children": [0]}]);
    assert!(gltf.refused().contains("its own ancestor"));
    gltf.json["nodes"] = json!([{"camera": 0}, {"children": [0]}, {"children": [0]}]);
    assert!(gltf.refused().contains("/nodes/2/children/0"));
    gltf.json["nodes"] = json!([{"children": [7]}]);
    assert!(gltf.refused().contains("there is no node 7"));
}

#[test]
fn cameras_of_other_scenes_count_and_their_meshes_do_not() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["scenes"] = json!([{"nodes": [1]}, {"nodes": [0, 2]}]);
    gltf.push("nodes", json!({"mesh": 0}));
    let scene = gltf.scene();
    assert_eq!((scene.cameras.len(), scene.instances.len()), (1, 1));
    gltf.json["scene"] = json!(1);
    assert_eq!(gltf.scene().instances[0].node, 2);
    // Without scenes, all is drawn.
    let root = gltf.json.as_object_mut().unwrap();
    root.remove("scene");
    root.remove("scenes");
    assert_eq!(gltf.scene().instances.len(), 2);
}

#[test]
fn hidden_nodes_hide_what_is_below_them() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["nodes"][1]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    let scene = gltf.scene();
    assert!(!scene.pose(0.0).visible[scene.instances[0].node]);
}

// ---- geometry --------------------------------------------------------------------------------------------------

#[test]
fn vertices_that_no_triangle_uses_are_dropped() {
    let mut gltf = Gltf::with_triangle();
    let many: Vec<f32> = (0..300).map(|i| i as f32).collect();
    let position = gltf.floats("VEC3", &many);
    let indices = gltf.accessor("SCALAR", 5121, 3, &[90, 10, 50]);
    gltf.json["meshes"][0]["primitives"] =
        json!([{"attributes": {"POSITION": position}, "indices": indices}]);
    let mesh = &gltf.scene().meshes[0];
    assert_eq!(mesh.positions.len(), 3);
    assert_eq!(mesh.triangles, [[2, 0, 1]]);
    assert_eq!(mesh.positions[2].x, 270.0);
}

#[test]
fn quantised_attributes_are_decoded() {
    let mut gltf = Gltf::new();
    let position: Vec<u8> =
        [0_i16, 0, 0, 0, 100, 0, 0, 0, 0, -50, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let view = gltf.view(&position);
    gltf.json["bufferViews"][view]["byteStride"] = json!(8);
    let position = gltf
        .push("accessors", json!({"bufferView": view, "type": "VEC3", "componentType": 5122, "count": 3}));
    let normal = gltf.accessor("VEC3", 5120, 3, &[0, 0, 127, 0, 0, 127, 0, 0, 127, 0, 0, 0]);
    gltf.json["accessors"][normal]["normalized"] = json!(true);
    let uv = gltf.accessor("VEC2", 5123, 3, &[0, 0, 255, 255, 255, 255, 0, 0, 0, 0, 0, 0]);
    gltf.json["accessors"][uv]["normalized"] = json!(true);
    let color = gltf.accessor("VEC4", 5121, 3, &[255, 0, 51, 255, 0, 0, 0, 0, 255, 255, 255, 255]);
    gltf.push(
        "meshes",
        json!({"primitives": [{"material": 0, "attributes": {
            "POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv, "COLOR_0": color}}]}),
    );
    gltf.push("images", json!({"uri": format!("data:image/png;base64,{}", base64(&png(2, 2)))}));
    gltf.push("textures", json!({"source": 0}));
    gltf.push("materials", json!({"normalTexture": {"index": 0, "scale": 0.5}}));
    gltf.node(json!({"mesh": 0}));
    let scene = gltf.scene();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions[2], Vec3::new(0.0, -50.0, 0.0));
    assert_eq!(mesh.normals[0], Vec3::Z);
    assert_eq!(mesh.uvs[0][0], Vec2::new(0.0, 1.0));
    assert!((mesh.colors[0].z - 0.2).abs() < 1e-6);
    assert_eq!(scene.materials[0].normal_texture.as_ref().unwrap().scale, 0.5);
}

#[test]
fn sparse_values_replace_and_zeros_fill() {
    let mut gltf = Gltf::with_triangle();
    let indices = gltf.view(&[1, 0]);
    let values = gltf.view(&[2.0_f32, 3.0, 4.0].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    let sparse = json!({"count": 1, "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": values}});
    let target =
        gltf.push("accessors", json!({"type": "VEC3", "componentType": 5126, "count": 3, "sparse": sparse}));
    gltf.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": target}]);
    gltf.json["meshes"][0]["weights"] = json!([0.25]);
    let scene = gltf.scene();
    let moved = &scene.meshes[0].morph_targets[0].positions;
    assert_eq!(moved, &[Vec3::ZERO, Vec3::new(2.0, 3.0, 4.0), Vec3::ZERO]);
    assert_eq!(scene.nodes[scene.instances[0].node].weights, [0.25]);
    gltf.json["accessors"][target]["count"] = json!(1);
    assert!(gltf.refused().contains("index 1 is outside"));
}

#[test]
fn counts_that_the_files_size_does_not_justify_are_refused() {
    for count in [4_000_000_000_u64, u64::from(u32::MAX), 9_000_000_000_000_000] {
        let mut gltf = Gltf::with_triangle();
        let position = gltf.push("accessors", json!({"type": "VEC3", "componentType": 5126, "count": count}));
        gltf.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(position);
        assert!(gltf.refused().contains("size can justify"));
        gltf.json["accessors"][position]["bufferView"] = json!(0);
        assert!(gltf.refused().contains("do not fit its view"));
        gltf.json["nodes"][1]["extensions"] =
            json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": position}}});
        gltf.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(0);
        gltf.json["accessors"][position].as_object_mut().unwrap().remove("bufferView");
        assert!(gltf.refused().contains("size can justify"));
    }
}

#[test]
fn one_array_used_ten_thousand_times_is_refused_before_memory_runs_out() {
    let mut gltf = Gltf::with_triangle();
    let position = gltf.floats("VEC3", &vec![0.5; 90_000]);
    let primitive = json!({"attributes": {"POSITION": position}});
    gltf.json["meshes"][0]["primitives"] = vec![primitive; 10_000].into();
    assert!(gltf.refused().contains("size can justify"));
}

#[test]
fn many_primitives_of_one_array_share_it_and_carry_their_own_vertices_only() {
    let mut gltf = Gltf::with_triangle();
    let values: Vec<f32> = (0..90_000).map(|i| i as f32).collect();
    let position = gltf.floats("VEC3", &values);
    let indices = gltf.accessor("SCALAR", 5125, 3, &[0, 0, 0, 0, 1, 0, 0, 0, 0x20, 0x4e, 0, 0]);
    let primitive = json!({"attributes": {"POSITION": position}, "indices": indices});
    gltf.json["meshes"][0]["primitives"] = vec![primitive; 10_000].into();
    let scene = gltf.scene();
    assert_eq!((scene.meshes.len(), scene.meshes[9].positions.len()), (10_000, 3));
}

#[test]
fn broken_accessors_are_refused_by_their_pointer() {
    for (key, value, wanted) in [
        ("type", json!("VEC2"), "/accessors/0: has type `VEC2`"),
        ("componentType", json!(5124), "unknown componentType"),
        ("count", json!(4), "/accessors/0: 4 elements"),
        ("count", json!(-1), "/accessors/0/count"),
        ("count", json!("3"), "/accessors/0/count"),
        ("bufferView", json!(9), "/bufferViews/9"),
        ("byteOffset", json!(4), "do not fit"),
        ("byteOffset", json!(u64::MAX), "/accessors/0"),
    ] {
        let mut gltf = Gltf::with_triangle();
        gltf.json["accessors"][0][key] = value;
        let message = gltf.refused();
        assert!(message.contains(wanted), "{key}: {message}");
    }
    for (key, value) in
        [("byteLength", json!(37)), ("byteOffset", json!(1)), ("buffer", json!(1)), ("byteStride", json!(0))]
    {
        let mut gltf = Gltf::with_triangle();
        gltf.json["bufferViews"][0][key] = value;
        assert!(gltf.refused().contains("/bufferViews/0"), "{key}");
    }
}

#[test]
fn indices_must_be_unsigned_and_in_range() {
    let mut gltf = Gltf::with_triangle();
    let indices = gltf.accessor("SCALAR", 5121, 3, &[0, 1, 3]);
    gltf.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    assert!(gltf.refused().contains("vertex index 3, but there are 3 vertices"));
    let floats = gltf.floats("SCALAR", &[0.0, 1.0, 2.0]);
    gltf.json["meshes"][0]["primitives"][0]["indices"] = json!(floats);
    assert!(gltf.refused().contains("unsigned integers"));
}

#[test]
fn triangles_with_non_finite_corners_are_left_out_and_listed() {
    let mut gltf = Gltf::with_triangle();
    let nan = f32::NAN;
    let position = gltf.floats(
        "VEC3",
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, nan, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, f32::INFINITY],
    );
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(position);
    let scene = gltf.scene();
    assert_eq!(scene.triangle_count(), 1);
    assert_eq!(scene.meshes[0].positions.len(), 3);
    assert_eq!(features(&scene), ["non-finite positions"]);
}

#[test]
fn what_is_no_number_is_listed() {
    let nan = f32::NAN;
    let mut gltf = Gltf::with_triangle();
    let uvs = gltf.floats("VEC2", &[0.0, 0.0, nan, 0.0, 0.0, 1.0]);
    let colors = gltf.floats("VEC3", &[1.0, 1.0, 1.0, 1.0, f32::INFINITY, 1.0, 0.0, 0.0, 0.0]);
    let moved = gltf.floats("VEC3", &[0.0, 0.0, 0.0, nan, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let primitive = &mut gltf.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = json!(uvs);
    primitive["attributes"]["COLOR_0"] = json!(colors);
    primitive["targets"] = json!([{"POSITION": moved}]);
    let scene = gltf.scene();
    let mut listed = features(&scene);
    listed.sort_unstable();
    let kinds = ["non-finite morph targets", "non-finite texture coordinates", "non-finite vertex colours"];
    assert_eq!(listed, kinds);
    assert_eq!(scene.meshes[0].colors[1].y, 0.0);
    assert_eq!(scene.meshes[0].morph_targets[0].positions[1], Vec3::ZERO);
}

#[test]
fn an_empty_primitive_draws_nothing() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["accessors"][0]["count"] = json!(0);
    assert_eq!(gltf.scene().triangle_count(), 0);
    gltf.json["meshes"][0]["primitives"][0]["attributes"] = json!({});
    assert_eq!(features(&gltf.scene()), ["primitive without POSITION"]);
}

#[test]
fn broken_normals_become_those_of_the_triangles() {
    let mut gltf = Gltf::with_triangle();
    let normal = gltf.floats("VEC3", &[0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0, 0.0, 2.0, 0.0]);
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normal);
    assert_eq!(gltf.scene().meshes[0].normals, [Vec3::Z, Vec3::Z, Vec3::Y]);
}

#[test]
fn gpu_instances_are_separate_objects_of_one_mesh() {
    let mut gltf = Gltf::with_triangle();
    let translation = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let rotation = gltf.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, half, 0.0, half]);
    gltf.json["nodes"][1]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation, "ROTATION": rotation}}});
    let scene = gltf.scene();
    assert_eq!(scene.meshes.len(), 1);
    let objects: Vec<u32> = scene.instances.iter().map(|i| i.object).collect();
    assert_eq!(objects, [1, 2]);
    let placed = scene.instances[1].node_from_object.transform_point3(DVec3::X);
    assert!((placed - DVec3::new(5.0, 0.0, -1.0)).length() < 1e-6, "{placed}");
}

#[test]
fn skins_bind_their_joints_and_weights_sum_to_one() {
    let mut gltf = Gltf::with_triangle();
    let joints = gltf.accessor("VEC4", 5121, 3, &[0, 9, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]);
    let weights = gltf.floats("VEC4", &[2.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let attributes = &mut gltf.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    gltf.push("skins", json!({"joints": [0, 1]}));
    gltf.json["nodes"][1]["skin"] = json!(0);
    let scene = gltf.scene();
    assert_eq!(scene.instances[0].skin, Some(0));
    assert_eq!(scene.meshes[0].joints[0], [[0; 4], [1, 0, 0, 0], [0; 4]]);
    assert!(scene.meshes[0].joint_weights[0].iter().all(|w| w.iter().sum::<f32>() == 1.0));
    gltf.json["skins"][0]["joints"] = json!([0]);
    assert!(gltf.refused().contains("uses 2 joints, its skin has 1"));
    gltf.json["skins"][0]["joints"] = json!([0, 77]);
    assert!(gltf.refused().contains("/skins/0/joints/1"));
}

#[test]
fn meshopt_views_are_decompressed_and_lies_about_their_size_refused() {
    let stream = [0xd1, 0x00, 0x04, 0xcd, 0x01, 0x04, 0x07, 0x98, 0x1f, 0x00, 0x00, 0x00, 0x00];
    let mut gltf = Gltf::with_triangle();
    let position = gltf.floats("VEC3", &vec![0.25; 3 * 1001]);
    let view = gltf.view(&stream);
    let compressed = gltf.json["bufferViews"][view].clone();
    gltf.push("bufferViews", json!({"buffer": 1, "byteLength": 24}));
    let mut extension = compressed;
    for (key, value) in [("count", json!(6)), ("byteStride", json!(4)), ("mode", json!("INDICES"))] {
        extension[key] = value;
    }
    let view = view + 1;
    gltf.json["bufferViews"][view]["extensions"] = json!({"EXT_meshopt_compression": extension});
    let data = base64(&gltf.bytes);
    gltf.json["buffers"] = json!([
        {"byteLength": gltf.bytes.len(), "uri": format!("data:;base64,{data}")},
        {"byteLength": 24, "extensions": {"EXT_meshopt_compression": {"fallback": true}}},
    ]);
    let indices = gltf
        .push("accessors", json!({"bufferView": view, "type": "SCALAR", "componentType": 5125, "count": 6}));
    gltf.json["meshes"][0]["primitives"][0] =
        json!({"attributes": {"POSITION": position}, "indices": indices});
    assert_eq!(gltf.scene().triangle_count(), 2);
    let extension = format!("/bufferViews/{view}/extensions/EXT_meshopt_compression");
    for (key, value) in [
        ("count", json!(1_u64 << 40)),
        ("count", json!(5)),
        ("count", json!(7)),
        ("byteStride", json!(3)),
        ("mode", json!("TRIANGLES")),
        ("mode", json!("X")),
        ("filter", json!("X")),
    ] {
        let mut broken = Gltf { json: gltf.json.clone(), bytes: Vec::new() };
        broken.json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"][key] = value;
        assert!(broken.refused().contains(&extension), "{key}");
    }
}

// ---- materials and images --------------------------------------------------------------------------------------

#[test]
fn materials_keep_their_factors_and_extensions() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    gltf.push(
        "materials",
        json!({
            "name": "Glass", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
            "emissiveFactor": [1, 0.5, 0],
            "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0, "roughnessFactor": 0.5},
            "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 4},
                "KHR_materials_ior": {"ior": 1.33},
                "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0, 2]},
                "KHR_materials_transmission": {"transmissionFactor": 0.9},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]},
            },
        }),
    );
    let scene = gltf.scene();
    let material = &scene.materials[0];
    assert_eq!((material.name.as_str(), material.double_sided), ("Glass", true));
    assert_eq!(material.alpha_mode, AlphaMode::Mask(0.25));
    assert_eq!(material.base_color.to_array(), [0.1, 0.2, 0.3, 0.4]);
    assert_eq!(material.emissive, Vec3::new(4.0, 2.0, 0.0));
    assert_eq!((material.ior, material.specular, material.transmission), (1.33, 0.5, 0.9));
    assert_eq!(material.volume.unwrap().attenuation_distance, 2.0);
    gltf.json["materials"][0]["extensions"]["KHR_materials_volume"]["thicknessFactor"] = json!(0);
    assert!(gltf.scene().materials[0].volume.is_none());
    gltf.json["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = json!("much");
    assert!(gltf.refused().contains("/materials/0/pbrMetallicRoughness/metallicFactor"));
}

#[test]
fn specular_glossiness_becomes_a_dielectric_of_the_same_reflectance() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let extension =
        json!({"diffuseFactor": [0.5, 0, 0, 1], "specularFactor": [0.04, 0.02, 1], "glossinessFactor": 0.75});
    gltf.push("materials", json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": extension}}));
    let scene = gltf.scene();
    let material = &scene.materials[0];
    assert_eq!((material.metallic, material.roughness, material.base_color.x), (0.0, 0.25, 0.5));
    assert!((material.specular_color - Vec3::new(1.0, 0.5, 25.0)).length() < 1e-5);
}

#[test]
fn a_buffer_file_named_many_times_is_read_once() {
    let folder = TempDir::new().unwrap();
    let mut gltf = Gltf::with_triangle();
    gltf.bytes.resize(1 << 20, 0);
    fs::write(folder.path().join("a.bin"), &gltf.bytes).unwrap();
    gltf.json["buffers"] = vec![json!({"byteLength": 36, "uri": "a.bin"}); 20_000].into();
    let file = folder.path().join("scene.gltf");
    fs::write(&file, gltf.text()).unwrap();
    assert_eq!(import(&file, &ImportOptions::default()).unwrap().triangle_count(), 1);
}

#[test]
fn texture_transforms_and_samplers_are_read() {
    let uri = format!("data:image/png;base64,{}", base64(&png(2, 2)));
    let mut gltf = textured(&uri);
    gltf.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}));
    gltf.json["textures"][0]["sampler"] = json!(0);
    let transform = json!({"offset": [0.5, 0.25], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 1], "texCoord": 1});
    gltf.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
        json!({"KHR_texture_transform": transform});
    let scene = gltf.scene();
    let texture = scene.materials[0].base_color_texture.unwrap();
    assert_eq!((texture.wrap_u, texture.wrap_v, texture.nearest), (Wrap::Clamp, Wrap::Mirror, true));
    assert_eq!(texture.uv_set, 1);
    // Scaled to (2, 0), turned counter-clockwise with v down to (0, -2), moved.
    let at = texture.transform.transform_point2(Vec2::X);
    assert!((at - Vec2::new(0.5, -1.75)).length() < 1e-6, "{at}");
    // The set that is missing is filled, and said to be.
    assert_eq!(scene.meshes[0].uvs.len(), 2);
    assert_eq!(scene.meshes[0].uvs[1].len(), 3);
    assert_eq!(features(&scene), ["texture without texture coordinates"]);
}

#[test]
fn an_image_used_as_colour_and_as_data_is_two_images() {
    let uri = format!("data:image/png;base64,{}", base64(&png(4, 4)));
    let mut gltf = textured(&uri);
    gltf.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    assert_eq!(gltf.scene().images.len(), 1);
    gltf.json["materials"][0]["occlusionTexture"] = json!({"index": 0, "strength": 0.5});
    let scene = gltf.scene();
    assert_eq!(scene.images.len(), 2);
    let material = &scene.materials[0];
    let color = material.base_color_texture.unwrap().image;
    assert_eq!(material.emissive_texture.unwrap().image, color);
    assert_ne!(material.occlusion_texture.unwrap().0.image, color);
}

#[test]
fn one_file_behind_many_images_is_decoded_once() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("wood.png"), png(8, 8)).unwrap();
    let mut gltf = textured("wood.png");
    gltf.push("images", json!({"uri": "./wood.png"}));
    gltf.push("textures", json!({"source": 1}));
    gltf.json["materials"][0]["emissiveTexture"] = json!({"index": 1});
    let file = folder.path().join("scene.gltf");
    fs::write(&file, gltf.text()).unwrap();
    let scene = import(&file, &ImportOptions::default()).unwrap();
    assert_eq!(scene.images.len(), 1);
    assert_eq!(scene.materials[0].emissive_texture.unwrap().image, 0);
}

#[test]
fn pictures_that_memory_cannot_hold_are_refused_before_they_are_decoded() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("wood.png"), png(16, 16)).unwrap();
    fs::write(at("sky.png"), png(16, 16)).unwrap();
    fs::write(at("a.gltf"), textured("wood.png").text()).unwrap();
    let mut sky = Gltf::with_triangle();
    sky.json["scenes"][0]["extras"] = json!({"buzz": {"world": {"image": "sky.png"}}});
    fs::write(at("b.gltf"), sky.text()).unwrap();
    fs::write(at("c.mtl"), "newmtl wood\nmap_Kd wood.png\n").unwrap();
    fs::write(at("c.obj"), "mtllib c.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl wood\nf 1 2 3\n").unwrap();
    for name in ["a.gltf", "b.gltf", "c.obj"] {
        let with = |picture_bytes| {
            let options = ImportOptions { picture_bytes, turntable: Some(2), ..ImportOptions::default() };
            import(&at(name), &options)
        };
        assert_eq!(with(Some(16 * 16 * 6)).unwrap().images.len(), 1, "{name}");
        let error = with(Some(16 * 16 * 5)).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{name}: {error}");
        assert!(error.to_string().contains("pictures take at least"), "{name}: {error}");
    }
}

#[test]
fn pictures_that_cannot_be_decoded_cost_their_texture_only() {
    let whole = png(16, 16);
    for data in [&whole[..20], &whole[..whole.len() / 2], b"nonsense", b""] {
        let gltf = textured(&format!("data:image/png;base64,{}", base64(data)));
        let scene = gltf.scene();
        assert!(scene.materials[0].base_color_texture.is_none());
        assert!(features(&scene)[0].starts_with("image that cannot be read"), "{:?}", scene.ignored);
    }
    // A picture whose header claims more than any file of its size holds.
    let mut bomb = whole.clone();
    bomb[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let crc = crc32(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&crc.to_be_bytes());
    let scene = textured(&format!("data:image/png;base64,{}", base64(&bomb))).scene();
    assert!(features(&scene)[0].contains("more than its size justifies"), "{:?}", scene.ignored);
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

#[test]
fn basisu_textures_without_another_image_are_listed() {
    let mut gltf = textured("x.png");
    gltf.json["extensionsUsed"] = json!(["KHR_texture_basisu"]);
    gltf.json["textures"][0] = json!({"extensions": {"KHR_texture_basisu": {"source": 0}}});
    let scene = gltf.scene();
    assert!(scene.materials[0].base_color_texture.is_none());
    assert!(features(&scene).contains(&"KHR_texture_basisu"));
}

// ---- cameras, lights, extras -----------------------------------------------------------------------------------

#[test]
fn orthographic_lenses_infinite_far_planes_and_shift_are_read() {
    let mut gltf = Gltf::new();
    assert_eq!(gltf.scene().cameras[0].lens.far, f64::INFINITY);
    gltf.json["cameras"][0] = json!({
        "type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 10},
        "extras": {"shift": [0.25, -0.5], "dof": {"fstop": 2}},
    });
    let scene = gltf.scene();
    let lens = scene.cameras[0].lens;
    assert_eq!(lens.projection, Projection::Orthographic { xmag: 3.0, ymag: 2.0 });
    assert_eq!((lens.shift.x, lens.shift.y, lens.far), (0.25, -0.5, 10.0));
    assert_eq!(features(&scene), ["depth of field"]);
    for broken in [
        json!({"type": "perspective"}),
        json!({"type": "fisheye"}),
        json!({"type": "perspective", "perspective": {"yfov": 0}}),
        json!({"type": "perspective", "perspective": {"yfov": 4}}),
        json!({"type": "perspective", "perspective": {"yfov": -0.5}}),
        json!({"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1}}),
    ] {
        gltf.json["cameras"][0] = broken;
        assert!(gltf.refused().contains("/cameras/0"));
    }
}

#[test]
fn lights_are_radiometric_whatever_their_parents_scale() {
    let mut gltf = Gltf::new();
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 1366, "color": [1, 0.5, 0], "range": 9, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4},
         "extras": {"radius": 0.1}},
        {"type": "directional"},
    ]}});
    gltf.node(json!({"scale": [3, 3, 3], "children": [2]}));
    gltf.push("nodes", json!({"name": "Spot", "extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [1, 0, 0]}));
    let scene = gltf.scene();
    let light = &scene.lights[0];
    assert_eq!((light.name.as_str(), light.intensity, light.range), ("Spot", 2.0, Some(9.0)));
    assert_eq!(light.kind, LightKind::Spot { inner_cone: 0.2, outer_cone: 0.4 });
    assert_eq!((light.size, features(&scene)), (0.1, vec![]));
    let posed = &scene.pose(0.0).lights[0];
    assert_eq!((posed.position, posed.direction), (DVec3::new(3.0, 0.0, 0.0), DVec3::NEG_Z));
    gltf.json["nodes"][2]["extensions"]["KHR_lights_punctual"]["light"] = json!(2);
    assert!(gltf.refused().contains("there is no light 2"));
}

#[test]
fn extras_give_rate_range_size_cuts_and_world() {
    let mut gltf = Gltf::new();
    gltf.node(json!({"name": "Cam.B", "camera": 0}));
    gltf.json["scenes"][0]["extras"] = json!({"buzz": {
        "version": 1, "fps": [24000, 1001], "frame_start": 101, "frame_end": 148, "resolution": [1920, 1080],
        "pixel_aspect": 2, "shutter": 0.5, "something": "else",
        "cuts": [{"frame": 101, "camera": "Cam", "node": 0}, {"frame": 120, "node": 0}, {"frame": 125, "camera": "Cam.B"}],
        "world": {"color": [1, 0.5, 0], "strength": 2, "rotation": 1.5},
        "lost": [{"object": "Smoke", "feature": "volume", "action": "render it separately"}],
    }});
    let scene = gltf.scene();
    let timing = scene.timing;
    assert_eq!(timing.fps, Rational { numerator: 24000, denominator: 1001 });
    assert_eq!((timing.frame_start, timing.first, timing.last), (101, 101, 148));
    assert_eq!((timing.resolution, timing.pixel_aspect), (Some((1920, 1080)), 2.0));
    let cuts: Vec<(i64, usize)> = scene.cuts.iter().map(|c| (c.frame, c.camera)).collect();
    assert_eq!(cuts, [(101, 0), (125, 1)]);
    assert_eq!((scene.world.color, scene.world.rotation), (Vec3::new(2.0, 1.0, 0.0), 1.5));
    assert_eq!(features(&scene), ["shutter", "volume of Smoke"]);
    // Another rate samples the same movement more finely.
    let fps = Some(Rational { numerator: 48000, denominator: 1001 });
    let scene = gltf.read_with(&ImportOptions { fps, ..ImportOptions::default() }).unwrap();
    assert_eq!((scene.timing.first, scene.timing.last, scene.cuts[1].frame), (101, 195, 149));
}

#[test]
fn extras_of_the_wrong_kind_are_named() {
    for (key, value) in [
        ("fps", json!([24, 0])),
        ("fps", json!(24)),
        ("fps", json!([24])),
        ("frame_start", json!(1.5)),
        ("frame_end", json!(1e300)),
        ("resolution", json!([0, 5])),
        ("resolution", json!([1, 2, 3])),
        ("pixel_aspect", json!(0)),
        ("shutter", json!("half")),
        ("cuts", json!([{"camera": "x"}])),
        ("cuts", json!([{"frame": 1, "node": 99}])),
        ("world", json!({"color": [1, 2]})),
        ("world", json!({"strength": -1})),
        ("world", json!({"image": "gone.hdr"})),
        ("lost", json!({})),
    ] {
        let mut gltf = Gltf::new();
        gltf.json["scenes"][0]["extras"] = json!({"buzz": {key: value}});
        let message = gltf.refused();
        assert!(message.contains(&format!("/scenes/0/extras/buzz/{key}")), "{key}: {message}");
    }
}

#[test]
fn a_worlds_picture_is_loaded_from_beside_the_file() {
    let folder = TempDir::new().unwrap();
    let picture = image::Rgb32FImage::from_pixel(4, 2, image::Rgb([2.0, 1.0, 0.5]));
    image::DynamicImage::ImageRgb32F(picture).save(folder.path().join("sky.hdr")).unwrap();
    fs::write(folder.path().join("sky.png"), png(4, 2)).unwrap();
    let mut gltf = Gltf::new();
    for name in ["sky.hdr", "sky.png"] {
        gltf.json["scenes"][0]["extras"] = json!({"buzz": {"world": {"image": name}}});
        let file = folder.path().join("scene.gltf");
        fs::write(&file, gltf.text()).unwrap();
        let scene = import(&file, &ImportOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((scene.world.image, scene.images.len()), (Some(0), 1));
        assert_eq!(scene.images[0].name, name);
    }
}

#[test]
fn pictures_that_are_not_whole_are_refused() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("scene.gltf");
    let read = |name: &str| {
        let mut gltf = Gltf::new();
        gltf.json["scenes"][0]["extras"] = json!({"buzz": {"world": {"image": name}}});
        fs::write(&file, gltf.text()).unwrap();
        import(&file, &ImportOptions::default()).map(|_| ()).map_err(|e| e.to_string())
    };
    let noise =
        image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([(x * y) as u8, (x * 7) as u8, (y * 13) as u8]));
    let whole = folder.path().join("whole.jpg");
    noise.save(&whole).unwrap();
    let bytes = fs::read(&whole).unwrap();
    fs::write(folder.path().join("cut.jpg"), &bytes[..bytes.len() / 2]).unwrap();
    assert_eq!(read("whole.jpg"), Ok(()));
    assert!(read("cut.jpg").unwrap_err().contains("cut off"));

    // What an EXR stores is its data window, which may be far larger than the picture that it shows.
    let picture = image::Rgb32FImage::from_pixel(4, 2, image::Rgb([2.0, 1.0, 0.5]));
    image::DynamicImage::ImageRgb32F(picture).save(folder.path().join("sky.exr")).unwrap();
    let mut bytes = fs::read(folder.path().join("sky.exr")).unwrap();
    assert_eq!(read("sky.exr"), Ok(()));
    let name = b"dataWindow\0box2i\0";
    let at = bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len() + 4;
    bytes[at + 8..at + 12].copy_from_slice(&160_000_000_i32.to_le_bytes());
    fs::write(folder.path().join("sky.exr"), bytes).unwrap();
    let refused = read("sky.exr").unwrap_err();
    assert!(refused.contains("world/image: the image cannot be read"), "{refused}");
}

// ---- animation -------------------------------------------------------------------------------------------------

#[test]
fn the_range_is_from_the_earliest_to_the_latest_key_of_all_animations() {
    let mut gltf = Gltf::with_triangle();
    let t = 1.0 / 24.0;
    gltf.animate(
        json!({"node": 0, "path": "translation"}),
        &[t, 2.0],
        "VEC3",
        &[0.0, 0.0, 0.0, 1.0, 2.0, 3.0],
        "LINEAR",
    );
    gltf.animate(json!({"node": 1, "path": "scale"}), &[0.5, 3.0], "VEC3", &[1.0; 6], "STEP");
    let scene = gltf.scene();
    assert_eq!((scene.timing.first, scene.timing.last), (1, 72));
    let eye = scene.view(&scene.pose(scene.timing.time_of(48)), 0, 4, 4).eye;
    assert_eq!(eye, DVec3::new(1.0, 2.0, 3.0));
    // Later than the last key, the value holds.
    assert_eq!(scene.view(&scene.pose(3.0), 0, 4, 4).eye, eye);
}

#[test]
fn a_step_cut_arrives_on_its_frame_at_every_rate() {
    for (numerator, denominator) in [(24, 1), (25, 1), (30, 1), (24000, 1001)] {
        let fps = Rational { numerator, denominator };
        let times: Vec<f32> = (0..200).map(|f| (f64::from(f) / fps.value()) as f32).collect();
        let values: Vec<f32> = (0..200).flat_map(|f| [f as f32, 0.0, 0.0]).collect();
        let mut gltf = Gltf::new();
        gltf.animate(json!({"node": 0, "path": "translation"}), &times, "VEC3", &values, "STEP");
        let scene = gltf.read_with(&ImportOptions { fps: Some(fps), ..ImportOptions::default() }).unwrap();
        assert_eq!((scene.timing.first, scene.timing.last), (0, 199));
        for frame in 0..200 {
            let eye = scene.view(&scene.pose(scene.timing.time_of(frame)), 0, 4, 4).eye;
            assert_eq!(eye.x, frame as f64, "{fps:?}");
        }
    }
}

#[test]
fn pointers_drive_lenses_lights_and_visibility() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {}}]}});
    gltf.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    let light = "/extensions/KHR_lights_punctual/lights/0";
    let times = [0.0, 1.0];
    gltf.pointer("/cameras/0/perspective/yfov", &times, "SCALAR", &[0.5, 1.0]);
    gltf.pointer("/cameras/0/perspective/znear", &times, "SCALAR", &[0.5, 1.0]);
    gltf.pointer("/cameras/0/extras/shift", &times, "VEC2", &[0.0, 0.0, 0.5, 1.0]);
    gltf.pointer(&format!("{light}/intensity"), &times, "SCALAR", &[683.0, 1366.0]);
    gltf.pointer(&format!("{light}/color"), &times, "VEC3", &[1.0, 1.0, 1.0, 0.0, 0.5, 1.0]);
    gltf.pointer(&format!("{light}/range"), &times, "SCALAR", &[1.0, 3.0]);
    gltf.pointer(&format!("{light}/spot/outerConeAngle"), &times, "SCALAR", &[0.2, 0.4]);
    gltf.pointer(&format!("{light}/spot.innerConeAngle"), &times, "SCALAR", &[0.1, 0.2]);
    gltf.pointer("/nodes/1/extensions/KHR_node_visibility/visible", &times, "SCALAR", &[1.0, 0.0]);
    gltf.pointer("/nodes/1/translation", &times, "VEC3", &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
    gltf.pointer("/materials/0/alphaCutoff", &times, "SCALAR", &[0.0, 1.0]);
    gltf.pointer("/scenes/0/extras/buzz/world/strength", &times, "SCALAR", &[0.0, 1.0]);
    let scene = gltf.scene();
    assert_eq!(scene.channels.len(), 10);
    assert_eq!(scene.ignored.len(), 2);
    let pose = scene.pose(1.0);
    let close = |a: f32, b: f32| (a - b).abs() < 1e-6;
    assert_eq!(pose.lenses[0].projection, Projection::Perspective { yfov: 1.0 });
    assert_eq!((pose.lenses[0].near, pose.lenses[0].shift.x, pose.lenses[0].shift.y), (1.0, 0.5, 1.0));
    let light = &pose.lights[0];
    assert!(close(light.intensity.y, 1.0) && close(light.intensity.z, 2.0), "{:?}", light.intensity);
    assert_eq!(light.range, Some(3.0));
    let LightKind::Spot { inner_cone, outer_cone } = light.kind else { panic!() };
    assert!(close(inner_cone, 0.2) && close(outer_cone, 0.4));
    assert!(!pose.visible[scene.instances[0].node] && scene.pose(0.99).visible[scene.instances[0].node]);
}

#[test]
fn lights_have_the_sizes_that_extras_say() {
    let mut gltf = Gltf::new();
    let area = |shape: &str| json!({"area": {"shape": shape, "size": [2, 0.5]}, "radius": 7});
    let lights = json!([
        {"type": "point", "extras": {"radius": 0.25, "angle": 1}},
        {"type": "directional", "extras": {"radius": 0.25, "angle": std::f32::consts::PI}},
        {"type": "spot", "extras": area("rectangle")},
        {"type": "spot", "extras": area("ellipse")},
        {"type": "point"},
    ]);
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    for light in 0..5 {
        gltf.node(json!({"scale": [3, 3, 3], "extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    let scene = gltf.scene();
    assert_eq!(features(&scene), [""; 0]);
    let sizes: Vec<f32> = scene.lights.iter().map(|l| l.size).collect();
    assert_eq!((sizes[0], sizes[1], sizes[4]), (0.25, std::f32::consts::PI, 0.0));
    let size = Vec2::new(2.0, 0.5);
    assert_eq!(scene.lights[2].kind, LightKind::Area { outline: Outline::Rectangle, size });
    assert_eq!(scene.lights[3].kind, LightKind::Area { outline: Outline::Ellipse, size });
    assert_eq!([0, 1, 2, 3, 4].map(|l| scene.light_has_size(l)), [true, true, true, true, false]);
    for (extras, place) in [
        (json!({"radius": -1}), "extras/radius"),
        (json!({"radius": "big"}), "extras/radius"),
        (json!({"area": {"shape": "star", "size": [1, 1]}}), "extras/area"),
        (json!({"area": {"shape": "ellipse", "size": [1, 0]}}), "extras/area/size"),
        (json!({"area": {"shape": "ellipse"}}), "extras/area/size"),
    ] {
        gltf.json["extensions"]["KHR_lights_punctual"]["lights"][2]["extras"] = extras;
        assert!(gltf.refused().contains(&format!("lights/2/{place}")), "{}", gltf.refused());
    }
    gltf.json["extensions"]["KHR_lights_punctual"]["lights"][1]["extras"] = json!({"angle": 3.15});
    assert!(gltf.refused().contains("lights/1/extras/angle"));
}

#[test]
fn sizes_of_lights_are_animated() {
    let mut gltf = Gltf::with_triangle();
    let area = json!({"shape": "rectangle", "size": [1, 1]});
    let lights =
        json!([{"type": "point"}, {"type": "directional"}, {"type": "spot", "extras": {"area": area}}]);
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    for light in 0..3 {
        gltf.node(json!({"extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    let light = "/extensions/KHR_lights_punctual/lights";
    gltf.pointer(&format!("{light}/0/extras/radius"), &[0.0, 1.0], "SCALAR", &[0.0, 2.0]);
    gltf.pointer(&format!("{light}/1/extras/angle"), &[0.0, 1.0], "SCALAR", &[-1.0, 0.5]);
    gltf.pointer(&format!("{light}/2/extras/area/size"), &[0.0, 1.0], "VEC2", &[1.0, 1.0, 3.0, 5.0]);
    let scene = gltf.scene();
    assert_eq!(features(&scene), [""; 0]);
    assert!((0..3).all(|l| scene.light_has_size(l)));
    let sizes = |time: f64| scene.pose(time).lights.iter().map(|l| l.size).collect::<Vec<_>>();
    assert_eq!((sizes(0.0), sizes(1.0)), (vec![0.0, 0.0, 0.0], vec![2.0, 0.5, 0.0]));
    let size = Vec2::new(2.0, 3.0);
    assert_eq!(scene.pose(0.5).lights[2].kind, LightKind::Area { outline: Outline::Rectangle, size });
}

#[test]
fn a_camera_on_two_nodes_zooms_on_both() {
    let mut gltf = Gltf::new();
    gltf.node(json!({"camera": 0}));
    gltf.pointer("/cameras/0/perspective/yfov", &[0.0, 1.0], "SCALAR", &[0.5, 1.0]);
    let targets: Vec<Target> = gltf.scene().channels.iter().map(|c| c.target).collect();
    assert_eq!(targets, [Target::CameraYfov(0), Target::CameraYfov(1)]);
}

#[test]
fn the_lens_that_a_camera_does_not_have_is_not_animated() {
    let mut gltf = Gltf::new();
    gltf.pointer("/cameras/0/orthographic/ymag", &[0.0, 1.0], "SCALAR", &[0.5, 1.0]);
    gltf.pointer("/cameras/0/orthographic/znear", &[0.0, 1.0], "SCALAR", &[0.5, 1.0]);
    gltf.pointer("/cameras/0/perspective/znear", &[0.0, 1.0], "SCALAR", &[0.5, 1.0]);
    let scene = gltf.scene();
    let targets: Vec<Target> = scene.channels.iter().map(|c| c.target).collect();
    assert_eq!(targets, [Target::CameraNear(0)]);
    let listed = ["animation of /cameras/*/orthographic/ymag", "animation of /cameras/*/orthographic/znear"];
    assert_eq!(features(&scene), listed);
}

#[test]
fn of_two_animations_of_one_property_the_last_wins_and_is_listed() {
    let mut gltf = Gltf::new();
    for x in [1.0, 2.0] {
        gltf.animate(json!({"node": 0, "path": "translation"}), &[0.0], "VEC3", &[x, 0.0, 0.0], "LINEAR");
    }
    let scene = gltf.scene();
    assert_eq!(scene.channels.len(), 1);
    assert_eq!(scene.view(&scene.pose(0.0), 0, 4, 4).eye.x, 2.0);
    assert_eq!(features(&scene), ["several animations of one property"]);
}

#[test]
fn keys_that_are_no_numbers_or_out_of_order_are_left_out() {
    let mut gltf = Gltf::new();
    let times = [0.0, f32::NAN, 2.0, 1.0, 3.0, 4.0];
    let mut values = vec![0.0; 18];
    values[12] = f32::INFINITY;
    values[15] = 7.0;
    gltf.animate(json!({"node": 0, "path": "translation"}), &times, "VEC3", &values, "LINEAR");
    let scene = gltf.scene();
    assert_eq!(scene.channels[0].curve.times, [0.0, 2.0, 4.0]);
    assert_eq!(features(&scene), ["animation keys that are not numbers", "animation keys out of order"]);
}

#[test]
fn two_keys_at_one_time_are_a_jump() {
    let mut gltf = Gltf::new();
    let values = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 9.0, 0.0, 0.0];
    gltf.animate(json!({"node": 0, "path": "translation"}), &[0.0, 1.0, 1.0], "VEC3", &values, "LINEAR");
    let scene = gltf.scene();
    let x = |time: f64| scene.view(&scene.pose(time), 0, 4, 4).eye.x;
    assert!((x(0.5) - 0.5).abs() < 1e-6 && x(1.0) == 9.0);
}

#[test]
fn key_times_beyond_any_film_are_refused() {
    let mut gltf = Gltf::new();
    gltf.animate(json!({"node": 0, "path": "translation"}), &[0.0, 1e30], "VEC3", &[0.0; 6], "LINEAR");
    assert!(gltf.refused().contains("frames away"));
}

#[test]
fn broken_animations_are_refused_by_their_pointer() {
    for (pointer, value) in [
        ("/animations/0/channels/0/sampler", json!(5)),
        ("/animations/0/channels/0/target/node", json!(5)),
        ("/animations/0/samplers/0/input", json!(99)),
        ("/animations/0/samplers/0/output", json!(0)),
        ("/animations/0/samplers/0/interpolation", json!("BEZIER")),
    ] {
        let mut gltf = Gltf::new();
        gltf.animate(json!({"node": 0, "path": "translation"}), &[0.0, 1.0], "VEC3", &[0.0; 6], "LINEAR");
        *gltf.json.pointer_mut(pointer).unwrap() = value;
        gltf.refused();
    }
    let mut gltf = Gltf::new();
    gltf.animate(json!({"node": 0, "path": "translation"}), &[0.0, 1.0], "VEC3", &[0.0; 6], "CUBICSPLINE");
    assert!(gltf.refused().contains("values for 2 keys"));
}

#[test]
fn cubic_splines_and_normalised_rotations_are_read() {
    let mut gltf = Gltf::new();
    let mut values = vec![0.0; 18];
    values[3] = 1.0;
    values[12] = 5.0;
    gltf.animate(json!({"node": 0, "path": "translation"}), &[0.0, 1.0], "VEC3", &values, "CUBICSPLINE");
    let input = gltf.floats("SCALAR", &[0.0]);
    let output = gltf.accessor("VEC4", 5122, 1, &[0, 0, 0xff, 0x7f, 0, 0, 0, 0]);
    gltf.json["accessors"][output]["normalized"] = json!(true);
    gltf.push(
        "animations",
        json!({"samplers": [{"input": input, "output": output}],
               "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]}),
    );
    let scene = gltf.scene();
    assert_eq!(scene.channels[0].curve.interpolation, Interpolation::CubicSpline);
    let view = scene.view(&scene.pose(0.5), 0, 4, 4);
    assert_eq!(view.eye.x, 3.0);
    // Half a turn about Y.
    assert!((view.forward - DVec3::Z).length() < 1e-6);
}

#[test]
fn a_matrix_that_is_animated_is_taken_apart() {
    let mut gltf = Gltf::new();
    gltf.json["nodes"][0] = json!({"camera": 0, "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 1, 2, 3, 1]});
    assert!(matches!(gltf.scene().nodes[0].transform, LocalTransform::Matrix(_)));
    gltf.animate(json!({"node": 0, "path": "scale"}), &[0.0], "VEC3", &[1.0; 3], "LINEAR");
    let scene = gltf.scene();
    assert_eq!(scene.pose(0.0).world_from_node[0].translation, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(scene.pose(0.0).world_from_node[0].matrix3.x_axis, DVec3::X);
}

#[test]
fn morph_weights_are_animated_by_as_many_numbers_as_there_are_targets() {
    let mut gltf = Gltf::with_triangle();
    let target = gltf.floats("VEC3", &[0.0; 9]);
    gltf.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": target}, {"POSITION": target}]);
    gltf.animate(
        json!({"node": 1, "path": "weights"}),
        &[0.0, 1.0],
        "SCALAR",
        &[0.0, 1.0, 1.0, 0.0],
        "LINEAR",
    );
    let scene = gltf.scene();
    assert_eq!(scene.pose(1.0).weights[scene.instances[0].node], [1.0, 0.0]);
}

// ---- turntable and OBJ -----------------------------------------------------------------------------------------

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
