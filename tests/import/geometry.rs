//! Geometry. Each feature, and each way to be broken.

use crate::gltf_file::{Gltf, base64, png};
use crate::read::{Read, features};
use glam::{DVec3, Vec2, Vec3};
use serde_json::json;

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

#[test]
fn draco_without_the_mesh_beside_it_is_refused() {
    let mut gltf = Gltf::with_triangle();
    let indices = gltf.accessor("SCALAR", 5121, 3, &[0, 1, 2]);
    let primitive = &mut gltf.json["meshes"][0]["primitives"][0];
    primitive["indices"] = json!(indices);
    primitive["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}});
    gltf.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    let scene = gltf.scene();
    assert_eq!((scene.triangle_count(), features(&scene)), (1, vec!["KHR_draco_mesh_compression"]));
    for accessor in [0, indices] {
        let mut alone = Gltf { json: gltf.json.clone(), bytes: gltf.bytes.clone() };
        alone.json["accessors"][accessor].as_object_mut().unwrap().remove("bufferView");
        let message = alone.refused();
        assert!(message.contains("/meshes/0/primitives/0: KHR_draco_mesh_compression"), "{message}");
    }
}
