//! Frames that are there already. (Damaged and foreign ones: `found.rs`.)

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

#[test]
fn what_a_run_warned_of_is_in_the_report_of_the_one_that_goes_on() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let bright = |options: &str| {
        let said = again(&scene, &out, &format!("--exposure 40 {options}")).ok().err;
        said.matches("were not finite or too large").count()
    };
    // Once a run, however many frames there are.
    assert_eq!(bright("-f 0-2"), 1);
    assert_eq!(bright("--skip-existing"), 2);
    let report = json(&out.join("report.json"));
    let warnings = report["warnings"].as_array().unwrap();
    assert!(warnings[0].as_str().unwrap().starts_with("frame 3: "), "{warnings:?}");
    assert!(warnings[1].as_str().unwrap().starts_with("frame 0 and 2 more: "), "{warnings:?}");
}

#[test]
fn a_report_goes_with_the_frames_that_it_is_of() {
    let (_folder, scene, out) = rendered();
    assert!(out.join("report.html").exists());
    // Killed before its end, whenever that is, it leaves no report of other frames.
    let run = crate::rig::Running::start(&scene, &out, "-r 1280x720 -q full --overwrite --progress none");
    crate::rig::wait_for("the old report to go", || !out.join("report.json").exists());
    run.signal("-TERM");
    run.end();
    assert!(!out.join("report.html").exists() || json(&out.join("report.json"))["settings"]["width"] == 1280);
}

#[test]
fn a_report_goes_when_a_part_of_its_frames_is_replaced() {
    let (_folder, scene, out) = rendered();
    let is_there = || [out.join("report.json").exists(), out.join("report.html").exists()];
    // The same pixels, no pixels of its own, and other files leave it as true as it was.
    for options in ["-f 1 --overwrite", "-f 9 --bounces 0", "-f 1 --name o.#.exr --bounces 0"] {
        again(&scene, &out, options).ok();
        assert_eq!(is_there(), [true; 2], "{options}");
    }
    for options in ["--skip-existing", "--overwrite"] {
        again(&scene, &out, &format!("-f 1 --bounces 0 {options}")).ok();
        assert_eq!(is_there(), [false; 2], "{options}");
        again(&scene, &out, "--skip-existing").ok();
        assert_eq!(is_there(), [true; 2]);
    }
    // A resumed run of other settings that is ended leaves none of before.
    let run = crate::rig::Running::start(&scene, &out, "-r 1280x720 -q full --skip-existing --progress none");
    crate::rig::wait_for("the old report to go", || !out.join("report.json").exists());
    run.signal("-TERM");
    run.end();
    assert!(!out.join("report.html").exists() || json(&out.join("report.json"))["settings"]["width"] == 1280);
}

#[cfg(target_os = "linux")]
#[test]
fn a_name_that_is_no_text_is_known_again() {
    use std::os::unix::ffi::OsStrExt;
    let (folder, out) = fresh();
    let name = std::ffi::OsStr::from_bytes(b"s\xff.gltf");
    let scene = Stage::drifting(2).write(&folder.path().join(name));
    again(&scene, &out, "").ok();
    again(&scene, &out, "--skip-existing").ok();
}

#[test]
fn a_page_of_somebody_elses_stays() {
    let (_folder, scene, out) = rendered();
    let report = format!("--skip-existing --report {}", out.join("index.json").display());
    let files: [(&str, &[u8]); 4] = [
        ("index.html", b"<h1>Shot 12</h1>"),
        ("index.html", b"<h1>Caf\xe9</h1>"),
        ("index.json", b"{\"look\": 2} // of the grade"),
        ("index.json", b"\xef\xbb\xbf{\"look\": 2}"),
    ];
    for (name, text) in files {
        fs::write(out.join(name), text).unwrap();
        again(&scene, &out, &report).refused(4, &[name, "--report"]);
        assert_eq!(fs::read(out.join(name)).unwrap(), text);
        fs::remove_file(out.join(name)).unwrap();
    }
    fs::write(out.join("index.json"), "").unwrap();
    again(&scene, &out, &report).ok();
    again(&scene, &out, &report).ok();
}
