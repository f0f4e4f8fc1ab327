//! Soft light from the outside: what options do, and that nothing depends on how the work is cut up.

use crate::rig::{assert_same_bytes, buzz, channels, frames_in, fresh, json, run};
use crate::stage::{CAMERA, CARD, Stage};
use serde_json::{Value, json};
use std::path::PathBuf;

/// The stage under a large lamp and a sky.
fn softly_lit(mut stage: Stage) -> Stage {
    stage.json["extensions"]["KHR_lights_punctual"]["lights"][0]["extras"] = json!({"radius": 0.5});
    stage.json["scenes"][0]["extras"] = json!({"buzz": {"world": {"color": [0.5, 0.6, 0.7]}}});
    stage
}

const SOFT: &str = "-r 64x36 --aov all --light-samples 8 --ambient-samples 4";

#[test]
fn a_still_camera_gives_the_same_values_in_soft_light() {
    for quality in ["half-pixel", "centred", "verified", "full"] {
        let (folder, out) = fresh();
        let mut stage = softly_lit(Stage::new());
        stage.translate(CAMERA, &[[0.3, 1.1, 6.0]; 4]);
        let scene = stage.write(&folder.path().join("s.gltf"));
        run(&scene, &out, &format!("{SOFT} -q {quality}")).ok();
        let names = frames_in(&out);
        assert_eq!(names.len(), 4);
        let first = channels(&out.join(&names[0]));
        for name in &names[1..] {
            for (channel, values) in channels(&out.join(name)) {
                assert!(channel == "pixelClass.id" || values == first[&channel], "{channel} of {name}");
            }
        }
    }
}

#[test]
fn soft_light_depends_on_neither_threads_nor_chunks() {
    let (folder, out) = fresh();
    let scene = softly_lit(Stage::drifting(8)).write(&folder.path().join("s.gltf"));
    run(&scene, &out, &format!("{SOFT} -j 2")).ok();
    let parts = folder.path().join("parts");
    for range in ["0-2", "3-3", "4-7"] {
        run(&scene, &parts, &format!("{SOFT} -j 1 -f {range}")).ok();
    }
    assert_eq!(assert_same_bytes(&parts, &out), 8);
}

#[test]
fn rays_to_lights_and_sky_are_counted_and_saved() {
    let (folder, out) = fresh();
    let scene = softly_lit(Stage::drifting(8)).write(&folder.path().join("s.gltf"));
    // Rays to the lamp and to the sky.
    let rays = |options: &str| -> [u64; 2] {
        run(&scene, &out, &format!("-r 64x36 --overwrite {options}")).ok();
        let rays = &json(&out.join("report.json"))["totals"]["rays"];
        ["shadow", "ambient"].map(|kind| rays[kind].as_u64().unwrap())
    };
    let many = "--light-samples 8 --ambient-samples 4";
    let (one, full, inferred) = (rays("-q full"), rays(&format!("-q full {many}")), rays(many));
    // All that is seen faces all of the lamp, or nearly.
    assert_eq!(one[1], 0);
    assert!(full[0] > 7 * one[0] && full[0] <= 8 * one[0], "{full:?} {one:?}");
    assert!(full[1] >= 4 * one[0]);
    assert!(2 * inferred[0] < full[0] && 2 * inferred[1] < full[1], "{full:?} {inferred:?}");
}

/// The camera sways over 90 frames, so that most of what it sees stays in view: a chain as long as they get.
fn swaying() -> Stage {
    let mut stage = Stage::new();
    let path: Vec<[f32; 3]> = (0..90).map(|i| [0.4 * (i as f32 / 7.0).sin(), 1.0, 6.0]).collect();
    stage.translate(CAMERA, &path);
    softly_lit(stage)
}

const SIXTEEN: &str = "-r 160x90 --light-samples 16 --ambient-samples 16";

#[test]
fn soft_light_saves_nine_rays_in_ten() {
    let (folder, out) = fresh();
    let scene = swaying().write(&folder.path().join("s.gltf"));
    run(&scene, &out, SIXTEEN).ok();
    let report = json(&out.join("report.json"));
    let rays = |of: &Value| of["rays"]["shadow"].as_f64().unwrap() + of["rays"]["ambient"].as_f64().unwrap();
    let frames = report["frames"].as_array().unwrap();
    let key = frames.iter().find(|frame| frame["traced"] == 1.0).unwrap();
    let (full, inferred) = (rays(key) * frames.len() as f64, rays(&report["totals"]));
    assert!(inferred < 0.1 * full, "{:.3} of {full} rays", inferred / full);
}

/// Noise is shared, errors do not grow: against a truth of 256 samples, frames at the end of a chain are as good as traced
/// ones, and as those near its beginning.
#[test]
fn soft_light_stays_true_to_the_end_of_a_chain() {
    let (folder, _) = fresh();
    let scene = swaying().write(&folder.path().join("s.gltf"));
    let render = |name: &str, options: &str| {
        run(&scene, &folder.path().join(name), &format!("{options} --segment 129 -f 10,50,89")).ok();
        folder.path().join(name)
    };
    let truth = render("truth", "-r 160x90 --light-samples 256 --ambient-samples 256 -q full");
    let psnr = |of: PathBuf| -> Vec<f64> {
        let arguments = ["compare", of.to_str().unwrap(), truth.to_str().unwrap(), "--format", "json"];
        let found: Value = serde_json::from_str(&buzz(arguments).ok().out).unwrap();
        found["frames"].as_array().unwrap().iter().map(|f| f["psnr_db"].as_f64().unwrap()).collect()
    };
    let full = psnr(render("full", &format!("{SIXTEEN} -q full")));
    let inferred = psnr(render("inferred", SIXTEEN));
    for (full, inferred) in full.iter().zip(&inferred) {
        assert!(*inferred > full - 0.5, "{inferred} {full}");
    }
    assert!(inferred[2] > inferred[0] - 1.0, "{inferred:?}");
}

/// Light that something has passed settles where it rests: what its neighbours have asked anew weighs more than what was carried.
#[test]
fn soft_light_follows_what_moves_until_it_rests() {
    let (folder, _) = fresh();
    let mut stage = softly_lit(Stage::new());
    let place = |i: i32| [0.3 * (i.min(6) - 6) as f32, 0.0, 0.0];
    stage.translate(CARD, &(0..10).map(place).collect::<Vec<_>>());
    let scene = stage.write(&folder.path().join("s.gltf"));
    let render = |name: &str, options: &str| {
        run(&scene, &folder.path().join(name), &format!("-r 160x90 --segment 129 {options}")).ok();
        let red = |frame| channels(&folder.path().join(name).join(format!("s.{frame:04}.exr")))["R"].clone();
        [0, 9].map(red)
    };
    let sixteen = "--light-samples 16 --ambient-samples 16";
    let truth = render("truth", "-q full --light-samples 256 --ambient-samples 256 -f 0,9");
    let full = render("full", &format!("-q full {sixteen} -f 0,9"));
    let inferred = render("inferred", sixteen);
    // Means of 8x8 pixels have little noise.
    let error = |of: &[f32], truth: &[f32]| {
        let blocks = (0..11).flat_map(|y| (0..20).map(move |x| (8 * x, 8 * y)));
        let squares = blocks.map(|(x, y): (usize, usize)| {
            let pixels = (0..64).map(|i| (y + i / 8) * 160 + x + i % 8);
            (pixels.map(|i| of[i] - truth[i]).sum::<f32>() / 64.0).powi(2)
        });
        (squares.sum::<f32>() / 220.0).sqrt()
    };
    for ((inferred, full), truth) in inferred.iter().zip(&full).zip(&truth) {
        let (inferred, full) = (error(inferred, truth), error(full, truth));
        assert!(inferred < 4.0 * full, "{inferred} {full}");
    }
}

#[test]
fn samples_are_settings_like_others() {
    let (folder, out) = fresh();
    let scene = softly_lit(Stage::drifting(2)).write(&folder.path().join("s.gltf"));
    let skipped = |options: &str| {
        run(&scene, &out, &format!("-r 16x9 --skip-existing {options}")).ok();
        json(&out.join("report.json"))["frames"][0]["skipped"] == true
    };
    assert!(!skipped("--light-samples 4"));
    assert!(skipped("--light-samples 4"));
    assert!(!skipped("--light-samples 5"));
    assert!(!skipped("--light-samples 5 --ambient-samples 1"));
    for bad in ["--light-samples 0", "--light-samples -1", "--light-samples 5000", "--ambient-samples -1"] {
        run(&scene, &out, bad).refused(2, &["samples"]);
    }
}

#[test]
fn an_inspection_names_sizes_of_lights() {
    let (folder, _) = fresh();
    let mut stage = softly_lit(Stage::new());
    stage.json["extensions"]["KHR_lights_punctual"]["lights"][0]["type"] = json!("spot");
    stage.json["extensions"]["KHR_lights_punctual"]["lights"][0]["extras"] =
        json!({"area": {"shape": "ellipse", "size": [2, 1]}});
    let path = stage.write(&folder.path().join("s.gltf"));
    let text = buzz(["inspect", path.to_str().unwrap()]).ok().out;
    assert!(text.contains("light: Lamp (ellipse 2 x 1)"), "{text}");
    assert!(text.contains("requires: lights, soft-lights, ambient-light"), "{text}");
    let text = buzz(["inspect", path.to_str().unwrap(), "--format", "json"]).ok().out;
    let scene: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(scene["lights"], json!([{"name": "Lamp", "type": "ellipse", "size": [2.0, 1.0]}]));
    assert_eq!(scene["ignored"], json!([]));
}
