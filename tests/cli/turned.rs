//! What comes out of nothing: a one-sided sheet whose plane the eye crosses.

use crate::rig::{channels, frames_in, fresh, run};
use crate::stage::{CAMERA, CARD, Stage};
use serde_json::json;

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
            let objects = |folder: &std::path::Path| channels(&folder.join(&name))["objectId.id"].clone();
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
