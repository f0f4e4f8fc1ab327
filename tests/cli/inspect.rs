//! What `inspect` says that a scene requires, and that what it does not require is neither run nor stored.

use crate::rig::{buzz, fresh};
use crate::stage::{CAMERA, CARD, LAMP, Stage};
use serde_json::Value;

fn inspect(stage: &Stage) -> Value {
    let (folder, _) = fresh();
    let path = stage.write(&folder.path().join("s.gltf"));
    serde_json::from_str(&buzz(["inspect", path.to_str().unwrap(), "--format", "json"]).ok().out).unwrap()
}

fn names(scene: &Value, key: &str) -> Vec<String> {
    scene[key].as_array().unwrap().iter().map(|name| name.as_str().unwrap().into()).collect()
}

/// What `more` has under a key that `less` has not.
fn added(more: &Value, less: &Value, key: &str) -> Vec<String> {
    let less = names(less, key);
    names(more, key).into_iter().filter(|name| !less.contains(name)).collect()
}

fn bytes(scene: &Value, key: &str) -> u64 {
    scene[key].as_u64().unwrap()
}

#[test]
fn a_light_asks_for_shadow_bits() {
    let lit = inspect(&Stage::new());
    let mut dark = Stage::new();
    dark.json.as_object_mut().unwrap().remove("extensions");
    dark.json["nodes"][LAMP].as_object_mut().unwrap().remove("extensions");
    let dark = inspect(&dark);
    assert_eq!(added(&lit, &dark, "requires"), ["lights"]);
    assert_eq!(added(&lit, &dark, "stages"), ["shadow", "shadow-edges", "diffuse", "highlights"]);
    assert_eq!(bytes(&lit, "bytes_per_pixel"), bytes(&dark, "bytes_per_pixel") + 4);
}

#[test]
fn frames_and_cameras_are_those_that_are_asked_for() {
    let (folder, _) = fresh();
    let path = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let inspect = |options: &str| {
        buzz(["inspect", path.to_str().unwrap()].into_iter().chain(options.split_whitespace()))
    };
    let said = inspect("--start-frame 1001 --camera Cam").ok().out;
    assert!(said.contains("frames 1001-1004 ") && said.contains("camera 0: Cam (chosen)\n"), "{said}");
    assert!(said.contains(", 1 light, 1 camera\n") && said.ends_with("ignored: nothing\n"), "{said}");
    let said: Value = serde_json::from_str(&inspect("--camera 0 --format json").ok().out).unwrap();
    assert_eq!((&said["frames"], &said["camera"]), (&serde_json::json!([0, 3]), &0.into()));
    inspect("--camera Nobody").refused(2, &["--camera Nobody: there is no such camera", "0 (Cam)"]);
    inspect("--start-frame 9999999999").refused(2, &["--start-frame"]);
}

#[test]
fn names_do_nothing_to_the_terminal() {
    let (folder, _) = fresh();
    let mut stage = Stage::new();
    let name = "L\u{1b}[2J\nlight: none";
    for node in [CAMERA, LAMP] {
        stage.json["nodes"][node]["name"] = name.into();
    }
    stage.json["extensions"]["KHR_lights_punctual"]["lights"][0]["name"] = name.into();
    stage.json["cameras"][0]["name"] = name.into();
    stage.json["materials"][0]["extensions"] = serde_json::json!({"X\u{1b}[31m": {}});
    let path = stage.write(&folder.path().join("s.gltf"));
    let said = buzz(["inspect", path.to_str().unwrap()]).ok().out;
    assert!(!said.chars().any(|c| c.is_control() && c != '\n'), "{said}");
    assert_eq!(said.matches("L\\u{1b}[2J\\nlight: none").count(), 2, "{said}");
}

#[test]
fn moving_objects_ask_for_a_copy_of_the_samples() {
    let still = inspect(&Stage::new());
    let mut moving = Stage::new();
    moving.translate(CARD, &[[0.0; 3], [1.0, 0.0, 0.0]]);
    let moving = inspect(&moving);
    assert_eq!(added(&moving, &still, "requires"), ["moving-objects"]);
    assert_eq!(added(&moving, &still, "stages"), ["ride", "moved", "relight"]);
    let held = |scene| bytes(scene, "held_bytes_per_pixel");
    // And part of a byte for what the samples of eight by eight pixels see past all that moved.
    assert_eq!(held(&moving), held(&still) + bytes(&moving, "bytes_per_pixel") + 1);
}

#[test]
fn lights_that_change_ask_for_no_copy() {
    let still = inspect(&Stage::new());
    let mut dimmed = Stage::new();
    dimmed.change("/extensions/KHR_lights_punctual/lights/0/intensity", &[60000.0, 100.0]);
    let dimmed = inspect(&dimmed);
    assert_eq!(added(&dimmed, &still, "requires"), ["changing-lights"]);
    assert_eq!(added(&dimmed, &still, "stages"), ["relight"]);
    assert_eq!(bytes(&dimmed, "held_bytes_per_pixel"), bytes(&still, "held_bytes_per_pixel"));
}
