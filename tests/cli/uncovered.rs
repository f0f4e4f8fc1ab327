//! What comes out of nothing: a one-sided sheet whose plane the eye crosses, what the near and far planes no longer cut off, what was
//! too small to be sampled, and what comes in at the sides before what is far behind it.

use crate::rig::{buzz, channels, frames_in, fresh, run};
use crate::stage::{CAMERA, CARD, LAMP, Stage};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

#[test]
fn a_sheet_seen_through_its_back_appears_when_the_eye_has_passed_it() {
    let (folder, out) = fresh();
    let full = folder.path().join("full");
    let mut stage = Stage::new();
    stage.json["materials"][1]["doubleSided"] = json!(false);
    // The card faces right, and the eye passes from its left to its right.
    stage.json["nodes"][CARD]["rotation"] = json!([0.0, 0.5f64.sqrt(), 0.0, 0.5f64.sqrt()]);
    stage.json["nodes"][CARD]["translation"] = json!([0.0, 0.0, 3.0]);
    let path: Vec<[f32; 3]> = (0..12).map(|i| [0.2 * (i as f32 - 3.5), 1.0, 6.0]).collect();
    stage.translate(CAMERA, &path);
    let scene = stage.write(&folder.path().join("s.gltf"));
    for quality in ["centred", "half-pixel"] {
        run(&scene, &out, &format!("-r 128x72 --aov object --overwrite -q {quality}")).ok();
        run(&scene, &full, "-r 128x72 --aov object --overwrite -q full").ok();
        let mut seen = 0;
        for name in frames_in(&out) {
            let objects = |folder: &Path| channels(&folder.join(&name))["objectId.id"].clone();
            let (shown, truth) = (objects(&out), objects(&full));
            let card = truth.iter().copied().fold(0.0, f32::max);
            seen = seen.max(truth.iter().filter(|&&o| o == card).count());
            let wrong = shown.iter().zip(&truth).filter(|(a, b)| a != b).count();
            // At half a pixel's guarantee, all rims may be off by a pixel.
            let rim = if quality == "centred" { 8 } else { 200 };
            assert!(wrong <= rim, "{quality} {name}: {wrong} of {seen}");
        }
        assert!(seen > 100, "the card covers {seen} pixels in the end");
    }
}

/// A stage with more cards on its floor, one behind the other.
fn with_cards(count: usize) -> Stage {
    let mut stage = Stage::new();
    for i in 0..count {
        let (across, along) = ((i % 5) as f64 - 2.0, i as f64 / count as f64);
        let node = stage.json["nodes"].as_array().unwrap().len();
        let place = json!([0.8 * across, 0.0, 4.0 - 8.0 * along]);
        let card = json!({"mesh": 1, "scale": [0.5, 0.5, 0.5], "translation": place});
        stage.json["nodes"].as_array_mut().unwrap().push(card);
        stage.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }
    stage
}

/// A plan by which all `frames` are inferred from the first one.
fn all_from_the_first(scene: &Path, frames: usize) -> PathBuf {
    let plan = buzz(["plan".as_ref(), scene.as_os_str(), "--format".as_ref(), "json".as_ref()]).ok();
    let mut plan: Value = serde_json::from_str(&plan.out).unwrap();
    plan["keyframes"] = json!([{"frame": 0, "reason": "first"}]);
    plan["segments"] = json!([{"key": 0, "first": 0, "last": frames - 1}]);
    let path = scene.with_extension("plan.json");
    fs::write(&path, plan.to_string()).unwrap();
    path
}

#[test]
fn what_the_near_and_far_planes_no_longer_cut_off_is_seen() {
    // Forward things come in by the far plane, backward by the near one.
    for (name, step) in [("forward", -0.15), ("backward", 0.15)] {
        let (folder, out) = fresh();
        let full = folder.path().join("full");
        let mut stage = with_cards(15);
        let lens = &mut stage.json["cameras"][0]["perspective"];
        (lens["znear"], lens["zfar"]) = (json!(3.0), json!(6.0));
        let path: Vec<[f32; 3]> = (0..16).map(|i| [0.0, 0.8, 5.0 + step * (i - 8) as f32]).collect();
        stage.translate(CAMERA, &path);
        let scene = stage.write(&folder.path().join("s.gltf"));
        let plan = all_from_the_first(&scene, path.len());
        run(&scene, &full, "-r 192x108 --aov object -q full").ok();
        for quality in ["centred", "verified", "half-pixel"] {
            let options =
                format!("-r 192x108 --aov object --overwrite -q {quality} --plan {}", plan.display());
            run(&scene, &out, &options).ok();
            for frame in frames_in(&out) {
                let objects = |folder: &Path| channels(&folder.join(&frame))["objectId.id"].clone();
                let wrong = objects(&out).iter().zip(&objects(&full)).filter(|(a, b)| a != b).count();
                // At half a pixel's guarantee, all rims may be off by a pixel.
                let rim = if quality == "half-pixel" { 400 } else { 30 };
                assert!(wrong <= rim, "{name}, {quality}, {frame}: {wrong}");
            }
        }
    }
}

#[test]
fn a_pool_of_light_that_was_too_small_to_be_sampled_is_found_as_it_grows() {
    let (folder, out) = fresh();
    let full = folder.path().join("full");
    let mut stage = Stage::new();
    stage.json["extensions"]["KHR_lights_punctual"]["lights"][0] = json!({
        "type": "spot", "intensity": 60000, "spot": {"innerConeAngle": 0.035, "outerConeAngle": 0.04},
    });
    // The lamp and the camera look straight down.
    let down = json!([-(0.5f64.sqrt()), 0.0, 0.0, 0.5f64.sqrt()]);
    stage.json["nodes"][LAMP]["rotation"] = down.clone();
    stage.json["nodes"][LAMP]["translation"] = json!([1.0, 8.0, 0.3]);
    stage.json["nodes"][CARD]["translation"] = json!([-3.0, 0.0, 0.0]);
    stage.json["nodes"][CAMERA]["rotation"] = down;
    stage.json["nodes"][1]["scale"] = json!([100.0, 1.0, 100.0]);
    let path: Vec<[f32; 3]> = (0..36).map(|i| [0.0, 300.0 * 0.88f32.powi(i), 0.0]).collect();
    stage.translate(CAMERA, &path);
    let scene = stage.write(&folder.path().join("s.gltf"));
    let plan = all_from_the_first(&scene, path.len());
    run(&scene, &out, &format!("-r 128x72 --plan {}", plan.display())).ok();
    run(&scene, &full, "-r 128x72 -q full").ok();
    for frame in frames_in(&out) {
        let lit = |folder: &Path| {
            channels(&folder.join(&frame))["R"].iter().filter(|&&red| red > 0.05).count() as f64
        };
        let (shown, truth) = (lit(&out), lit(&full));
        // As large as the places at which light is looked for are far apart it may be missed.
        assert!(truth < 100.0 || shown > 0.9 * truth, "{frame}: {shown} of {truth} pixels are lit");
    }
}

/// Renders a stage in which the camera takes `path`, by full and inferred from its first frame; calls `check` with the layers of each
/// frame of both.
fn compare(
    mut stage: Stage,
    path: &[[f32; 3]],
    options: &str,
    check: impl Fn(&str, [BTreeMap<String, Vec<f32>>; 2]),
) {
    let (folder, out) = fresh();
    let full = folder.path().join("full");
    stage.translate(CAMERA, path);
    let scene = stage.write(&folder.path().join("s.gltf"));
    let plan = all_from_the_first(&scene, path.len());
    run(&scene, &full, &format!("{options} -q full")).ok();
    run(&scene, &out, &format!("{options} --plan {}", plan.display())).ok();
    for frame in frames_in(&out) {
        check(&frame, [&out, &full].map(|folder| channels(&folder.join(&frame))));
    }
}

#[test]
fn what_is_near_is_seen_when_it_comes_in_though_it_is_small() {
    let mut stage = Stage::new();
    // They move by ten pixels a frame, all that is behind them by two, and five pixels wide they pass the outermost ones between
    // two frames.
    for i in 0..8 {
        let node = stage.json["nodes"].as_array().unwrap().len();
        let place = json!([0.82 + 0.1 * f64::from(i), 0.75 + 0.07 * f64::from(i * 3 % 8), 4.8]);
        let card = json!({"mesh": 1, "scale": [0.03, 0.03, 0.03], "translation": place});
        stage.json["nodes"].as_array_mut().unwrap().push(card);
        stage.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }
    let path: Vec<[f32; 3]> = (0..12).map(|i| [0.08 * i as f32, 1.0, 6.0]).collect();
    compare(stage, &path, "-r 192x108 --aov object", |frame, [shown, truth]| {
        let objects = shown["objectId.id"].iter().zip(&truth["objectId.id"]);
        // Each covers thirty.
        let wrong = objects.filter(|(a, b)| a != b).count();
        assert!(wrong <= 5, "{frame}: {wrong}");
    });
}

#[test]
fn the_parts_of_one_object_have_outlines() {
    let mut stage = Stage::new();
    stage.bars_before_a_pane(8);
    let path: Vec<[f32; 3]> = (0..12).map(|i| [0.03 * i as f32, 1.0, 6.0]).collect();
    compare(stage, &path, "-r 192x108", |frame, [shown, truth]| {
        let differs = |i: &usize| ["R", "B"].iter().any(|c| (shown[*c][*i] - truth[*c][*i]).abs() > 0.3);
        let wrong = (0..truth["R"].len()).filter(differs).count();
        // When the parts of an object were taken for one surface, up to 67 were.
        assert!(wrong <= 4, "{frame}: {wrong}");
    });
}
