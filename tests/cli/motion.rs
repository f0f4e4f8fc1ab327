//! Cameras that stand still, and scenes that do not.

use crate::rig::{buzz, channels, frames_in, fresh, json, run};
use crate::stage::{CAMERA, CARD, LAMP, Stage};
use std::path::Path;

#[test]
fn a_camera_that_stands_still_gives_the_key_frames_values() {
    let (folder, out) = fresh();
    let mut stage = Stage::new();
    stage.translate(CAMERA, &[[0.3, 1.1, 6.0]; 6]);
    let scene = stage.write(&folder.path().join("s.gltf"));
    run(&scene, &out, "-r 64x36 --aov all").ok();
    let report = json(&out.join("report.json"));
    assert_eq!(report["totals"]["traced_frames"], 1);
    assert_eq!(frames_in(&out).len(), 6);
    let key = report["plan"]["keyframes"][0]["frame"].as_i64().unwrap();
    let traced = channels(&out.join(format!("s.{key:04}.exr")));
    for name in frames_in(&out) {
        for (channel, values) in channels(&out.join(&name)) {
            assert!(channel == "pixelClass.id" || values == traced[&channel], "{channel} of {name}");
        }
    }
}

/// Renders `stage` at both qualities; frames of which `changes` says that something but the camera moved since the
/// frame before must begin a segment.
fn assert_changes_are_traced(stage: &Stage, changes: &[i64]) {
    let (folder, out) = fresh();
    let scene = stage.write(&folder.path().join("s.gltf"));
    let full = folder.path().join("full");
    run(&scene, &out, "-r 64x36 --aov all").ok();
    run(&scene, &full, "-r 64x36 --aov all -q full").ok();
    let report = json(&out.join("report.json"));
    let segments = report["plan"]["segments"].as_array().unwrap();
    for &change in changes {
        let segment = segments.iter().position(|s| s["first"] == change);
        let segment = segment.unwrap_or_else(|| panic!("no segment begins at {change}: {segments:?}"));
        assert_eq!(report["plan"]["keyframes"][segment]["reason"], "cost");
        // Where the next frame has changed again, there is nobody to infer this one from.
        if changes.contains(&(change + 1)) {
            assert_eq!(report["frames"][change as usize]["kind"], "traced");
        }
    }
    let keys: Vec<i64> = segments.iter().map(|s| s["key"].as_i64().unwrap()).collect();
    for key in &keys {
        let name = format!("s.{key:04}.exr");
        assert!(channels(&out.join(&name)) == channels(&full.join(&name)), "frame {key}");
    }
    assert!(keys.len() < report["frames"].as_array().unwrap().len(), "nothing was inferred");
    assert_close(&out, &full);
}

fn assert_close(folder: &Path, reference: &Path) {
    let arguments = ["compare", folder.to_str().unwrap(), reference.to_str().unwrap(), "--fail-below", "25"];
    buzz(arguments).ok();
}

#[test]
fn frames_in_which_an_object_moves_are_traced() {
    let mut stage = Stage::drifting(12);
    let place = |i: i32| [0.2 * (i.clamp(4, 8) - 4) as f32, 0.0, 0.0];
    stage.translate(CARD, &(0..12).map(place).collect::<Vec<_>>());
    assert_changes_are_traced(&stage, &[5, 6, 7, 8]);
}

#[test]
fn frames_in_which_a_light_moves_are_traced() {
    let mut stage = Stage::drifting(12);
    let place = |i: i32| [2.0 - 0.5 * (i.clamp(4, 7) - 4) as f32, 4.0, 3.0];
    stage.translate(LAMP, &(0..12).map(place).collect::<Vec<_>>());
    assert_changes_are_traced(&stage, &[5, 6, 7]);
}
