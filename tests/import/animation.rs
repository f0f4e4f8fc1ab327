//! Animation. Each feature, and each way to be broken.

use crate::gltf_file::Gltf;
use crate::read::{Read, features};
use buzz::import::ImportOptions;
use buzz::scene::{Interpolation, LightKind, LocalTransform, Outline, Projection, Rational, Target};
use glam::{DVec3, Vec2};
use serde_json::json;

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
fn a_step_cut_arrives_on_its_frame_however_late_it_is() {
    // From 2048 s on, two times of single precision are farther apart than a hundredth of a frame.
    for start in [49_152_i32, 480_000, 2_400_000] {
        let fps = Rational { numerator: 24000, denominator: 1001 };
        let frames = start..start + 100;
        let times: Vec<f32> = frames.clone().map(|f| (f64::from(f) / fps.value()) as f32).collect();
        let values: Vec<f32> = frames.clone().flat_map(|f| [f as f32, 0.0, 0.0]).collect();
        let mut gltf = Gltf::new();
        gltf.animate(json!({"node": 0, "path": "translation"}), &times, "VEC3", &values, "STEP");
        let scene = gltf.read_with(&ImportOptions { fps: Some(fps), ..ImportOptions::default() }).unwrap();
        for frame in frames {
            let eye = scene.view(&scene.pose(scene.timing.time_of(i64::from(frame))), 0, 4, 4).eye;
            assert_eq!(eye.x, f64::from(frame));
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
    let mut gltf = Gltf::new();
    gltf.animate(json!({"node": 0, "path": "translation"}), &[0.0, 1.0], "VEC3", &[0.0; 9], "LINEAR");
    assert!(gltf.refused().contains("9 values for 2 keys"));
    // Three weights a key, where the mesh has two.
    let mut gltf = Gltf::with_triangle();
    let target = gltf.floats("VEC3", &[0.0; 9]);
    gltf.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": target}, {"POSITION": target}]);
    gltf.animate(json!({"node": 1, "path": "weights"}), &[0.0, 1.0], "SCALAR", &[0.0; 6], "LINEAR");
    assert!(gltf.refused().contains("6 values for 2 keys of 2 each"));
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
