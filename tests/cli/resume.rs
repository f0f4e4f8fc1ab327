//! Frames that are there already. (Damaged and foreign ones: `faults.rs`.)

use crate::rig::{Outcome, frames_in, fresh, json, run};
use crate::stage::Stage;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use tempfile::TempDir;

/// Four frames of a stage, rendered a day ago.
fn rendered() -> (TempDir, PathBuf, PathBuf) {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    again(&scene, &out, "").ok();
    for name in frames_in(&out) {
        File::options().write(true).open(out.join(name)).unwrap().set_modified(yesterday()).unwrap();
    }
    (folder, scene, out)
}

fn yesterday() -> SystemTime {
    SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000)
}

fn again(scene: &Path, out: &Path, options: &str) -> Outcome {
    run(scene, out, &format!("-r 32x18 --progress none {options}"))
}

/// Frames that have not been written since yesterday.
fn kept(out: &Path) -> usize {
    let is_old = |n: &String| fs::metadata(out.join(n)).unwrap().modified().unwrap() == yesterday();
    frames_in(out).iter().filter(|n| is_old(n)).count()
}

#[test]
fn without_a_word_frames_are_neither_kept_nor_replaced() {
    let (_folder, scene, out) = rendered();
    again(&scene, &out, "").refused(4, &["s.0000.exr", "--skip-existing", "--overwrite"]);
    again(&scene, &out, "-f 2-9").refused(4, &["s.0002.exr"]);
    assert_eq!((frames_in(&out).len(), kept(&out)), (4, 4));
    again(&scene, &out, "-f 10").ok();
    assert_eq!((frames_in(&out).len(), kept(&out)), (5, 4));
}

#[test]
fn overwriting_replaces_them() {
    let (_folder, scene, out) = rendered();
    let before = fs::read(out.join("s.0001.exr")).unwrap();
    again(&scene, &out, "--overwrite").ok();
    assert_eq!(kept(&out), 0);
    assert_eq!(fs::read(out.join("s.0001.exr")).unwrap(), before);
    again(&scene, &out, "--overwrite --skip-existing").refused(2, &["--overwrite", "--skip-existing"]);
}

#[test]
fn what_decides_no_pixel_keeps_them() {
    let (_folder, scene, out) = rendered();
    for same in ["", "-j 1", "--progress plain", "-f 1-2"] {
        run(&scene, &out, &format!("-r 32x18 --skip-existing {same}")).ok();
        assert_eq!(kept(&out), 4, "{same}");
    }
    let report = json(&out.join("report.json"));
    assert_eq!(report["totals"]["frames"], 4);
    assert!(report["frames"].as_array().unwrap().iter().all(|f| f["skipped"] == true));
}

#[test]
fn frames_that_were_not_audited_are_made_anew_to_be_audited() {
    let (_folder, scene, out) = rendered();
    let said = again(&scene, &out, "--skip-existing --audit").ok().err;
    assert!(said.contains("not audited") && said.contains("3 more"), "{said}");
    assert_eq!(kept(&out), 0);
    let said = again(&scene, &out, "--skip-existing --audit").ok().err;
    assert!(said.contains("4 of 4 frames are there already"), "{said}");
    assert!(json(&out.join("report.json"))["totals"]["hidden"].is_u64());
}

#[test]
fn what_decides_pixels_makes_them_anew() {
    for other in [
        "-r 30x18",
        "--exposure 1",
        "-q full",
        "--aov depth",
        "--compression none",
        "--crop 0,0,8,8",
        "--transparent",
        "--bounces 0",
        "--fps 24000/1001",
        "--segment 2",
    ] {
        let (_folder, scene, out) = rendered();
        let size = if other.starts_with("-r") { "" } else { "-r 32x18" };
        run(&scene, &out, &format!("{size} --skip-existing {other}")).ok();
        assert_eq!(kept(&out), 0, "{other}");
    }
}
