//! Nodes. Each feature, and each way to be broken.

use crate::gltf_file::Gltf;
use crate::read::Read;
use glam::DVec3;
use serde_json::json;

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
fn a_camera_of_another_scene_is_the_last_choice() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["nodes"] = json!([
        {"name": "other", "camera": 0, "translation": [0, 0, 9]},
        {"mesh": 0},
        {"name": "still", "camera": 0},
        {"name": "moved", "camera": 0},
    ]);
    gltf.json["scenes"] = json!([{"nodes": [1, 2, 3]}, {"nodes": [0]}]);
    let seen_through = |gltf: &Gltf| {
        let scene = gltf.scene();
        scene.cameras[scene.camera_at(0, None)].name.clone()
    };
    assert_eq!(seen_through(&gltf), "still");
    for (node, seen) in [(0, "still"), (3, "moved")] {
        gltf.animate(json!({"node": node, "path": "translation"}), &[0.0, 1.0], "VEC3", &[1.0; 6], "LINEAR");
        assert_eq!(seen_through(&gltf), seen);
    }
    // It is there to be asked for, and where there is no other.
    assert_eq!(gltf.scene().cameras.len(), 3);
    assert_eq!(gltf.scene().camera_at(0, Some(0)), 0);
    gltf.json["scenes"][0]["nodes"] = json!([1]);
    assert_eq!(seen_through(&gltf), "other");
}

#[test]
fn hidden_nodes_hide_what_is_below_them() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["nodes"][1]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    let scene = gltf.scene();
    assert!(!scene.pose(0.0).visible[scene.instances[0].node]);
}
