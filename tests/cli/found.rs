//! What a run finds where it is to write: damaged frames, other files, other scenes' reports, pipes. Nobody's file is lost, and the folder
//! comes to the bytes of an undisturbed run.

use crate::rig::{Outcome, assert_same_bytes, frames_in, fresh, json, leftovers, run};
use crate::stage::{CARD, Stage};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Four frames of a stage, and the same four elsewhere.
fn rendered() -> (TempDir, PathBuf, PathBuf, PathBuf) {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let whole = folder.path().join("whole");
    for place in [&out, &whole] {
        again(&scene, place, "").ok();
    }
    (folder, scene, out, whole)
}

fn again(scene: &Path, out: &Path, options: &str) -> Outcome {
    run(scene, out, &format!("-r 32x18 --progress none {options}"))
}

#[test]
fn truncated_and_foreign_files_are_not_taken_for_frames() {
    let (_folder, scene, out, whole) = rendered();
    let bytes = fs::read(out.join("s.0000.exr")).unwrap();
    fs::write(out.join("s.0000.exr"), &bytes[..bytes.len() / 2]).unwrap();
    fs::write(out.join("s.0001.exr"), "a foreign file").unwrap();
    let mut flipped = bytes;
    let last = flipped.len() - 20;
    flipped[last] ^= 4;
    fs::write(out.join("s.0002.exr"), flipped).unwrap();
    let kept = fs::metadata(out.join("s.0003.exr")).unwrap().modified().unwrap();

    // Without a word, what stands there is somebody's: it stays.
    again(&scene, &out, "-f 1").refused(4, &["s.0001.exr", "--overwrite", "--skip-existing"]);
    assert_eq!(fs::read(out.join("s.0001.exr")).unwrap(), b"a foreign file");

    again(&scene, &out, "--skip-existing").ok();
    assert_eq!(assert_same_bytes(&out, &whole), 4);
    assert_eq!(fs::metadata(out.join("s.0003.exr")).unwrap().modified().unwrap(), kept);
    let report = json(&out.join("report.json"));
    let skipped = report["frames"].as_array().unwrap().iter().map(|f| f["skipped"].as_bool().unwrap());
    assert_eq!(skipped.collect::<Vec<_>>(), [false, false, false, true]);
}

#[test]
fn foreign_reports_and_temporary_files_are_left_alone_or_replaced() {
    let (_folder, scene, out, whole) = rendered();
    fs::write(out.join("report.json"), "").unwrap();
    fs::write(out.join("report.old.json"), "[1, 2]").unwrap();
    fs::write(out.join(".s.0001.exr.4711.tmp"), "half a frame of a run that was killed").unwrap();
    fs::write(out.join(".somebody.else.tmp"), "not ours").unwrap();
    again(&scene, &out, "--skip-existing").ok();
    assert_eq!(assert_same_bytes(&out, &whole), 4);
    assert_eq!(json(&out.join("report.json"))["totals"]["frames"], 4);
    assert_eq!(fs::read(out.join("report.old.json")).unwrap(), b"[1, 2]");
    assert_eq!(leftovers(&out), [".somebody.else.tmp"]);
}

#[test]
fn a_changed_input_makes_all_frames_anew() {
    for change in 0..3 {
        let (folder, scene, out, before) = rendered();
        let mut changed = Stage::drifting(4);
        match change {
            0 => changed.json["nodes"][CARD]["translation"] = serde_json::json!([0.1, 0, 0]),
            1 => changed.json["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = 0.61.into(),
            _ => changed.json["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = 60001.into(),
        }
        changed.write(&scene);
        again(&scene, &out, "--skip-existing").ok();
        let after = folder.path().join("after");
        again(&scene, &after, "").ok();
        assert_eq!(assert_same_bytes(&out, &after), 4, "change {change}");
        for name in frames_in(&out) {
            assert!(fs::read(out.join(&name)).unwrap() != fs::read(before.join(&name)).unwrap());
        }
        let report = json(&out.join("report.json"));
        assert!(report["frames"].as_array().unwrap().iter().all(|f| f["skipped"] == false));
        assert_eq!(report["runs"].as_array().unwrap().len(), 1, "the run before has no part in it");
    }
}

#[test]
fn frames_under_others_names_are_made_anew() {
    let (_folder, scene, out, whole) = rendered();
    fs::rename(out.join("s.0001.exr"), out.join("x")).unwrap();
    fs::rename(out.join("s.0003.exr"), out.join("s.0001.exr")).unwrap();
    fs::rename(out.join("x"), out.join("s.0003.exr")).unwrap();
    let said = again(&scene, &out, "--skip-existing").ok().err;
    assert!(
        said.contains("another frame") && said.contains("1 more") && said.contains("2 of 4 frames"),
        "{said}"
    );
    assert_eq!(assert_same_bytes(&out, &whole), 4);
}

#[test]
fn another_scenes_report_is_not_lost() {
    let (folder, _scene, out, _whole) = rendered();
    let other = Stage::drifting(4).write(&folder.path().join("other.gltf"));
    let before = fs::read(out.join("report.json")).unwrap();
    again(&other, &out, "").refused(4, &["report.json", "s.gltf", "--report"]);
    again(&other, &out, &format!("--report {}", folder.path().join("own/r.json").display())).ok();
    assert!(folder.path().join("own/r.html").exists());
    assert_eq!(fs::read(out.join("report.json")).unwrap(), before);
    again(&other, &out, "--overwrite").ok();
    assert!(json(&out.join("report.json"))["input"].as_str().unwrap().ends_with("other.gltf"));
}

#[test]
fn what_a_run_reads_is_not_what_it_replaces() {
    let (folder, scene, out, _whole) = rendered();
    let renamed = folder.path().join("scene.json");
    fs::copy(&scene, &renamed).unwrap();
    let before = fs::read(&renamed).unwrap();
    let report = format!("--overwrite --report {}", renamed.display());
    again(&renamed, &out, &report).refused(2, &["--report", "scene.json"]);
    again(&scene, &out, &format!("--skip-existing --report {}", renamed.display()))
        .refused(4, &["scene.json", "--report"]);
    assert_eq!(fs::read(&renamed).unwrap(), before);
}

#[test]
fn pipes_in_place_of_files_are_not_waited_for() {
    let (folder, scene, out, whole) = rendered();
    let pipe = |path: &Path| assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    fs::remove_file(out.join("s.0001.exr")).unwrap();
    for name in ["s.0001.exr", "report.9.json", ".buzz-1-0.lock"] {
        pipe(&out.join(name));
    }
    let said = again(&scene, &out, "--skip-existing").ok().err;
    assert!(said.contains("s.0001.exr: it is not a file"), "{said}");
    assert_eq!(assert_same_bytes(&out, &whole), 4);
    let compared = folder.path().join("compared");
    fs::create_dir(&compared).unwrap();
    fs::copy(out.join("s.0000.exr"), compared.join("s.0000.exr")).unwrap();
    pipe(&compared.join("s.0001.exr"));
    crate::rig::buzz([Path::new("compare"), &compared, &whole]).ok();
    again(&scene, &out, "--overwrite --plan /dev/zero").refused(3, &["/dev/zero"]);
}
