//! `--stereo`: two files a frame, the right eye from the left.

use crate::rig::{SMALL, assert_same_bytes, channels, courtyard, frames_in, fresh, json, run};
use crate::stage::Stage;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const PAIR: &str = "--stereo 0.1 --convergence 6 -f 1-6";

fn stereo(options: &str) -> (TempDir, PathBuf) {
    let (folder, out) = fresh();
    run(&courtyard(), &out, &format!("{PAIR} {options}")).ok();
    (folder, out)
}

/// The eye and kind of every frame of a report, and its camera and shadow rays.
fn frames(report: &Value) -> Vec<(String, String, u64)> {
    let rays = |f: &Value| f["rays"]["primary"].as_u64().unwrap() + f["rays"]["shadow"].as_u64().unwrap();
    let text = |v: &Value| v.as_str().unwrap().to_owned();
    report["frames"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| (text(&f["eye"]), text(&f["kind"]), rays(f)))
        .collect()
}

#[test]
fn each_eye_has_its_files_and_the_right_one_costs_little() {
    // Large enough for edges not to be most of it.
    let (_folder, out) = stereo("-r 240x135");
    let (_full_folder, full) = stereo("-r 240x135 -q full");
    let names = frames_in(&out);
    assert_eq!(names.len(), 12);
    assert!(
        names.contains(&"courtyard.left.0001.exr".into())
            && names.contains(&"courtyard.right.0006.exr".into())
    );
    let (report, traced) = (json(&out.join("report.1-6.json")), json(&full.join("report.1-6.json")));
    let (inferred, traced) = (frames(&report), frames(&traced));
    assert_eq!(inferred.len(), 12);
    let sum = |frames: &[(String, String, u64)], eye: &str| -> u64 {
        frames.iter().filter(|f| f.0 == eye).map(|f| f.2).sum()
    };
    assert!(inferred.iter().filter(|f| f.0 == "right").all(|f| f.1 == "inferred"));
    assert!(traced.iter().all(|f| f.1 == "traced"));
    assert!(2 * sum(&inferred, "right") < sum(&traced, "right"), "{inferred:?}");
    // Eyes see different things, and each what its own full trace sees, but for edges.
    let red = |folder: &Path, name: &str| channels(&folder.join(name))["R"].clone();
    let differs = |a: &[f32], b: &[f32]| {
        a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 0.05 * b.abs().max(0.1)).count() as f64
            / a.len() as f64
    };
    for name in &names {
        let (shown, truth) = (red(&out, name), red(&full, name));
        assert!(differs(&shown, &truth) < 0.02, "{name}: {}", differs(&shown, &truth));
    }
    let (left, right) = (red(&out, "courtyard.left.0003.exr"), red(&out, "courtyard.right.0003.exr"));
    assert!(differs(&left, &right) > 0.05);
}

#[test]
fn a_right_eyes_header_says_what_it_was_made_from() {
    let (_folder, out) = stereo("-r 16x9");
    let says = |name: &str, text: &str| {
        fs::read(out.join(name)).unwrap().windows(text.len()).any(|part| part == text.as_bytes())
    };
    assert!(says("courtyard.right.0003.exr", "inferred from the left eye"));
    assert!(says("courtyard.left.0003.exr", "inferred from frame "));
}

#[test]
fn what_stands_at_the_convergence_is_at_one_place() {
    let (folder, out) = fresh();
    // The card is six metres away.
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    run(&scene, &out, "-r 96x54 -q full --stereo 0.3 --convergence 6 -f 0 --aov object").ok();
    let edge = |eye: &str| {
        let objects = channels(&out.join(format!("s.{eye}.0000.exr")))["objectId.id"].clone();
        let card = objects[30 * 96..31 * 96].iter().position(|&o| o == objects[30 * 96 + 48]);
        card.unwrap()
    };
    assert_eq!(edge("left"), edge("right"));
}

#[test]
fn chunks_and_resumed_runs_give_the_same_bytes() {
    let (_folder, out) = stereo(SMALL);
    let (_other, parts) = fresh();
    for chunk in ["1-2", "3-6"] {
        run(&courtyard(), &parts, &format!("{SMALL} --stereo 0.1 --convergence 6 -f {chunk}")).ok();
    }
    fs::remove_file(parts.join("courtyard.right.0002.exr")).unwrap();
    fs::write(parts.join("courtyard.left.0005.exr"), "cut off").unwrap();
    let resumed = run(&courtyard(), &parts, &format!("{SMALL} {PAIR} --skip-existing")).ok();
    assert!(resumed.out.starts_with("12 pictures of two eyes"), "{}", resumed.out);
    assert_eq!(assert_same_bytes(&parts, &out), 12);
    let report = json(&parts.join("report.1-6.json"));
    let again: Vec<_> =
        report["frames"].as_array().unwrap().iter().filter(|f| f["skipped"] == false).collect();
    let numbers: Vec<_> =
        again.iter().map(|f| (f["frame"].as_i64().unwrap(), f["eye"].as_str().unwrap())).collect();
    assert_eq!(numbers, [(2, "left"), (2, "right"), (5, "left"), (5, "right")]);
}

#[test]
fn what_has_no_parallax_is_refused() {
    let (folder, out) = fresh();
    let mut stage = Stage::drifting(2);
    stage.json["cameras"] = json!([{"name": "Plan", "type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 10}}]);
    let flat = stage.write(&folder.path().join("flat.gltf"));
    run(&flat, &out, "-r 8x8 --stereo 0.1").refused(2, &["--stereo", "orthographic", "--camera"]);
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    for options in ["--stereo 0", "--stereo -1", "--stereo inf", "--stereo 0.1 --convergence 0"] {
        run(&scene, &out, &format!("-r 8x8 {options}")).refused(2, &["metres"]);
    }
    assert!(!out.exists());
}

#[test]
fn eyes_that_are_metres_apart_are_warned_of_once() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    let said = |eyes: &str| {
        run(&scene, &out, &format!("-r 16x9 --overwrite --progress none --stereo {eyes}")).ok().err
    };
    assert_eq!(said("0.065"), "");
    let far = said("65");
    assert!(far.lines().count() == 1 && far.contains("--stereo 65: 65 m between the eyes"), "{far}");
}
