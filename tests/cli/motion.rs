//! Cameras that stand still, and scenes that do not.

use crate::rig::{buzz, channels, frames_in, fresh, json, run};
use crate::stage::{CAMERA, CARD, FLOOR, LAMP, Stage};
use serde_json::Value;
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

/// Renders `stage`, whose camera stands still, inferred and in full, and holds every inferred value to the full one.
/// Returns the reports.
#[track_caller]
fn assert_inferred_as_traced(stage: &Stage) -> (Value, Value) {
    let (folder, out) = fresh();
    let scene = stage.write(&folder.path().join("s.gltf"));
    let full = folder.path().join("full");
    run(&scene, &out, "-r 64x36 --aov all --segment 99").ok();
    run(&scene, &full, "-r 64x36 --aov all -q full").ok();
    for name in frames_in(&out) {
        let (inferred, traced) = (channels(&out.join(&name)), channels(&full.join(&name)));
        for (channel, values) in inferred.into_iter().filter(|(channel, _)| channel != "pixelClass.id") {
            let pairs = values.iter().zip(&traced[&channel]);
            let furthest = pairs.map(|(a, b)| (a - b).abs() / (1.0 + b.abs())).fold(0.0, f32::max);
            assert!(furthest < 2e-3, "{channel} of {name}: {furthest}");
        }
    }
    let reports = (json(&out.join("report.json")), json(&full.join("report.json")));
    assert_eq!(reports.0["totals"]["traced_frames"], 1);
    reports
}

/// A ray count of all inferred frames.
fn inferred_rays(report: &Value, kind: &str) -> u64 {
    let frames = report["frames"].as_array().unwrap().iter();
    frames.filter(|f| f["kind"] != "traced").map(|f| f["rays"][kind].as_u64().unwrap()).sum()
}

#[test]
fn an_object_that_slides_is_where_a_full_trace_has_it_and_so_is_its_shadow() {
    let mut stage = Stage::new();
    let place = |i: i32| [0.04 * (i.clamp(3, 9) - 3) as f32, 0.0, 0.0];
    stage.translate(CARD, &(0..12).map(place).collect::<Vec<_>>());
    let (inferred, full) = assert_inferred_as_traced(&stage);
    let saved = |kind| 1.0 - inferred_rays(&inferred, kind) as f64 / inferred_rays_of_full(&full, kind);
    assert!(saved("primary") > 0.6, "{}", saved("primary"));
    assert!(saved("shadow") > 0.6, "{}", saved("shadow"));
    let moved = inferred["frames"].as_array().unwrap().iter().map(|f| f["pixels"]["moved"].as_u64().unwrap());
    assert!(moved.sum::<u64>() > 0, "nothing came in front of the floor");
}

/// A ray count of the frames that the test infers: all but one of twelve.
fn inferred_rays_of_full(full: &Value, kind: &str) -> f64 {
    let frames = full["frames"].as_array().unwrap().iter();
    frames.map(|f| f["rays"][kind].as_u64().unwrap()).sum::<u64>() as f64 * 11.0 / 12.0
}

#[test]
fn an_object_that_is_switched_on_and_off_leaves_nothing_behind() {
    let mut stage = Stage::new();
    stage.show(CARD, &[true, true, false, false, true, true]);
    assert_inferred_as_traced(&stage);
}

#[test]
fn what_sinks_into_a_surface_does_not_show_through_it() {
    // Whichever of them moves, and whichever frame is the key: one way the floor rises about the ball, the other it comes out.
    for (node, step) in [(FLOOR, 0.1), (FLOOR, -0.1), (CARD, 0.13), (CARD, -0.13)] {
        let (folder, out) = fresh();
        let mut stage = Stage::ball_in_the_floor();
        stage.translate(node, &(0..8).map(|i| [0.0, step * i as f32, 0.0]).collect::<Vec<_>>());
        let scene = stage.write(&folder.path().join("s.gltf"));
        run(&scene, &out, "-r 128x72 --segment 99 --audit").ok();
        let totals = &json(&out.join("report.json"))["totals"];
        assert_eq!((&totals["traced_frames"], &totals["hidden"]), (&1.into(), &0.into()), "{node} {step}");
    }
}

#[test]
fn a_light_that_moves_takes_shadow_rays_only() {
    let mut stage = Stage::new();
    let place = |i: i32| [2.0 - 0.1 * (i.clamp(4, 7) - 4) as f32, 4.0, 3.0];
    stage.translate(LAMP, &(0..12).map(place).collect::<Vec<_>>());
    let (inferred, full) = assert_inferred_as_traced(&stage);
    assert_eq!(inferred_rays(&inferred, "primary"), 0);
    // It is asked in the three frames in which it has moved.
    let each = full["frames"][5]["rays"]["shadow"].as_u64().unwrap();
    assert!(inferred_rays(&inferred, "shadow") <= each * 3 + each / 10);
}

#[test]
fn a_light_that_changes_takes_no_ray_but_where_it_had_not_shone() {
    let mut stage = Stage::new();
    stage.change("/extensions/KHR_lights_punctual/lights/0/intensity", &[6e4, 5e4, 3e4, 1e4, 2e4, 7e4]);
    let (inferred, _) = assert_inferred_as_traced(&stage);
    assert_eq!(inferred_rays(&inferred, "primary") + inferred_rays(&inferred, "shadow"), 0);

    let mut stage = Stage::new();
    stage.change("/extensions/KHR_lights_punctual/lights/0/intensity", &[0.0, 0.0, 0.0, 1e4, 2e4, 7e4]);
    let (inferred, full) = assert_inferred_as_traced(&stage);
    let each = full["frames"][5]["rays"]["shadow"].as_u64().unwrap();
    let key_is_dark = inferred["plan"]["keyframes"][0]["frame"].as_i64().unwrap() < 3;
    assert_eq!(inferred_rays(&inferred, "shadow"), if key_is_dark { each } else { 0 });
}

#[test]
fn our_stage_is_inferred_whatever_moves() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/stage/stage.gltf");
    let (folder, out) = fresh();
    let full = folder.path().join("full");
    let frames = "-r 240x135 -f 8-19 --segment 24";
    run(&scene, &out, frames).ok();
    run(&scene, &full, &format!("{frames} -q full")).ok();
    let report = json(&out.join("report.8-19.json"));
    let classes =
        report["frames"].as_array().unwrap().iter().map(|f| f["pixels"]["traced"].as_u64().unwrap());
    assert!(classes.filter(|&traced| traced > 0).count() <= 1, "one key frame at most");
    let arguments = ["compare", out.to_str().unwrap(), full.to_str().unwrap(), "--fail-below", "40"];
    buzz(arguments).ok();
}

#[test]
fn what_passes_the_eye_moves_out_of_the_image() {
    let (folder, out) = fresh();
    let mut stage = Stage::new();
    stage.translate(CAMERA, &[[0.0, 1.0, 12.0], [0.0, 1.0, 7.0], [0.0, 1.0, 2.0], [0.0, 1.0, -3.0]]);
    let scene = stage.write(&folder.path().join("s.gltf"));
    run(&scene, &out, "-r 64x36 --aov motion,position -q full").ok();
    let frame = channels(&out.join("s.0001.exr"));
    let (mut passed, width) = (0, 64.0f32);
    for (i, &z) in frame["P.Z"].iter().enumerate() {
        if z > 2.0 && z < 7.0 && frame["P.Y"][i] < 0.5 {
            let (u, v) = (frame["forward.u"][i], frame["forward.v"][i]);
            let outward = u * (i as f32 % width - width / 2.0 + 0.5);
            assert!(v < -10.0 && v.is_finite() && outward > 0.0, "{i}: {u} {v}");
            passed += 1;
        }
    }
    assert!(passed > 100, "{passed} pixels pass");
}

#[test]
fn a_camera_on_twos_is_not_cut_and_one_that_jumps_is() {
    let (folder, _) = fresh();
    let mut stage = Stage::new();
    // From above: to and fro on twos, then from far higher.
    stage.json["nodes"][CAMERA]["rotation"] = serde_json::json!([-(0.5f64.sqrt()), 0.0, 0.0, 0.5f64.sqrt()]);
    let across = |i: usize| 1.2 * [-1.0, 0.0, 1.0, 0.0][i / 2 % 4];
    let place = |i: usize| [across(i), if i < 14 { 4.0 } else { 14.0 }, 0.0];
    stage.translate(CAMERA, &(0..24).map(place).collect::<Vec<_>>());
    let scene = stage.write(&folder.path().join("s.gltf"));
    let plan = buzz(["plan".as_ref(), scene.as_os_str(), "--format".as_ref(), "json".as_ref()]).ok();
    let plan: Value = serde_json::from_str(&plan.out).unwrap();
    assert_eq!(plan["cuts"], serde_json::json!([14]));
}

#[test]
fn the_sky_moves_as_a_camera_turns_whatever_its_near_plane() {
    let (folder, out) = fresh();
    let mut stage = Stage::new();
    stage.json["cameras"][0]["perspective"]["znear"] = serde_json::json!(3.0);
    stage.turn(CAMERA, &[-0.1, 0.0, 0.1]);
    let scene = stage.write(&folder.path().join("s.gltf"));
    run(&scene, &out, "-r 64x36 --aov motion,depth -q full").ok();
    let frame = channels(&out.join("s.0001.exr"));
    let sky = |i: &usize| frame["depth.Z"][*i] >= 1e10;
    // A tenth of a radian of a view that is 0.7 high: in the middle some 5 pixels, more at the sides.
    for i in (0..64 * 36).filter(sky) {
        let u = frame["forward.u"][i];
        assert!(u > 4.0 && u < 8.0, "{i}: {u}");
    }
    assert!((0..64 * 36).filter(sky).count() > 200);
}
