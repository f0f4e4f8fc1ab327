//! What goes wrong around a run: disks, folders, signals, other runs (other files: `found.rs`). After each fault nothing is lost, no
//! file is partial, the exit code says what happened, and the next run brings the folder to the bytes of an undisturbed one.

use crate::rig::{
    BINARY, Outcome, Running, SMALL, assert_same_bytes, courtyard, frames_in, fresh, json, leftovers,
    listing, reference, run, wait_for,
};
use crate::stage::Stage;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// The courtyard, slowly enough to be disturbed.
fn start(out: &Path) -> Running {
    Running::start(&courtyard(), out, &format!("{SMALL} -j 1 --progress none --skip-existing"))
}

/// Takes the folder up again; then every frame there must have the bytes of an undisturbed run, and nothing else is left.
#[track_caller]
fn assert_taken_up(out: &Path) {
    run(&courtyard(), out, &format!("{SMALL} -f 0-40 --skip-existing")).ok();
    assert!((41..=96).contains(&assert_same_bytes(out, reference())));
    assert_eq!(leftovers(out), [""; 0]);
}

/// One frame that takes far longer than any of these tests.
const LONG: &str = "-r 3840x2160 -f 8 -j 1 --bounces 8 --progress none";

fn is_locked(folder: &Path) -> bool {
    listing(folder).iter().any(|n| n.starts_with(".buzz-"))
}

// ---- The place that is written to.

/// Runs `script` in a name space of its own, in which it may mount, with $BUZZ, $SCENE and $OUT.
fn in_own_mounts(out: &Path, script: &str) -> Option<Outcome> {
    let may = Command::new("unshare").args(["-rm", "sh", "-c", "mount -t tmpfs tmpfs /mnt"]).output();
    if !may.is_ok_and(|o| o.status.success()) {
        println!("skipped: this system lets nobody mount (unshare -rm)");
        return None;
    }
    fs::create_dir(out).unwrap();
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", script]);
    let output = command.env("BUZZ", BINARY).env("SCENE", courtyard()).env("OUT", out).output().unwrap();
    Some(Outcome {
        code: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    })
}

#[test]
fn a_full_disk_ends_the_run_with_4_and_whole_frames() {
    let (folder, out) = fresh();
    let saved = folder.path().join("saved");
    let script = format!(
        "mount -t tmpfs -o size=400k tmpfs \"$OUT\" || exit 99
         \"$BUZZ\" \"$SCENE\" \"$OUT\" {SMALL} --progress none; code=$?
         cp -a \"$OUT\" '{}'; exit $code",
        saved.display()
    );
    let Some(outcome) = in_own_mounts(&out, &script) else { return };
    outcome.refused(4, &["No space left", "courtyard.", "--skip-existing"]);
    assert!(assert_same_bytes(&saved, reference()) > 2);
    assert_eq!(leftovers(&saved), [""; 0]);
    assert_taken_up(&saved);
}

/// Needs no rights: a write that fails half way through a file.
#[test]
fn a_limit_on_file_sizes_ends_the_run_with_4_and_no_partial_file() {
    let (_folder, out) = fresh();
    // Blocks of 512 bytes; a frame takes more.
    let script = format!("trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$1\" \"$2\" {SMALL} --progress none");
    let command =
        ["-c", &script, BINARY, courtyard().to_str().unwrap(), out.to_str().unwrap()].map(String::from);
    let output = Command::new("sh").args(command).output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(4), "{err}");
    assert!(err.contains("courtyard.") && err.contains("too large") && err.lines().count() == 1, "{err}");
    assert_eq!(listing(&out), [""; 0]);
    assert_taken_up(&out);
}

#[test]
fn a_limit_on_file_sizes_ends_the_run_with_4_and_leaves_nothing() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let script = format!(
        "ulimit -f 1; exec {BINARY} {} {} -r 320x180 --progress none",
        scene.display(),
        out.display()
    );
    let output = Command::new("sh").args(["-c", &script]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(4), "{said}");
    assert!(said.contains("raise the limit"), "{said}");
    assert_eq!(listing(&out), [""; 0]);
}

#[test]
fn a_read_only_file_system_is_refused_with_4() {
    let (_folder, out) = fresh();
    let script = format!(
        "mount -t tmpfs -o ro tmpfs \"$OUT\" || exit 99
         exec \"$BUZZ\" \"$SCENE\" \"$OUT\" {SMALL} --progress none"
    );
    let Some(outcome) = in_own_mounts(&out, &script) else { return };
    outcome.refused(4, &["Read-only", "may be written to"]);
}

#[test]
fn a_folder_without_the_right_to_write_is_refused_with_4() {
    use std::os::unix::fs::PermissionsExt;
    let (_folder, out) = fresh();
    fs::create_dir(&out).unwrap();
    fs::set_permissions(&out, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(out.join("probe"), "").is_ok() {
        println!("skipped: permissions do not bind root");
        return;
    }
    run(&courtyard(), &out, SMALL).refused(4, &["out", "may be written to"]);
}

#[test]
fn a_folder_that_vanishes_ends_the_run_with_4() {
    let (folder, out) = fresh();
    let running = start(&out);
    wait_for("frames", || frames_in(&out).len() >= 2);
    let away = folder.path().join("away");
    fs::rename(&out, &away).unwrap();
    running.end().refused(4, &["courtyard.", "folder"]);
    assert!(!out.exists());
    // Put back, it is taken up again, whatever is left of the run that lost it.
    fs::rename(&away, &out).unwrap();
    assert_taken_up(&out);
}

// ---- Signals.

#[test]
fn a_signal_ends_the_run_with_its_code_and_leaves_whole_frames() {
    for (signal, name, code) in [("-INT", "Ctrl-C", 130), ("-TERM", "SIGTERM", 143)] {
        let (_folder, out) = fresh();
        let running = start(&out);
        wait_for("frames", || frames_in(&out).len() >= 2);
        running.signal(signal);
        running.end().refused(code, &[name, "--skip-existing"]);
        assert!((2..96).contains(&assert_same_bytes(&out, reference())));
        assert_eq!(leftovers(&out), [""; 0]);
        assert!(!out.join("report.json").exists(), "a report is for a finished run");
    }
}

#[test]
fn a_long_frame_is_given_up_at_once() {
    let (_folder, out) = fresh();
    let running = Running::start(&courtyard(), &out, LONG);
    wait_for("the folder", || is_locked(&out));
    std::thread::sleep(Duration::from_millis(300));
    let start = Instant::now();
    running.signal("-TERM");
    running.end().refused(143, &["SIGTERM"]);
    // A second is what is promised; the machine that runs this test may be busy.
    assert!(start.elapsed() < Duration::from_secs(4), "{:?}", start.elapsed());
    assert_eq!(listing(&out), [""; 0]);
}

#[test]
fn a_second_signal_does_no_harm() {
    for (second, codes) in [("-INT", [130, 130]), ("-TERM", [130, 143])] {
        let (_folder, out) = fresh();
        let running = start(&out);
        wait_for("frames", || frames_in(&out).len() >= 2);
        running.signal("-INT");
        running.signal(second);
        let outcome = running.end();
        assert!(codes.contains(&outcome.code), "{outcome:?}");
        assert_same_bytes(&out, reference());
        assert_eq!(leftovers(&out), [""; 0], "no partial file remains");
        assert_taken_up(&out);
    }
}

#[test]
fn a_killed_run_is_resumed_to_the_same_bytes() {
    let (_folder, out) = fresh();
    for frames in [3, 30] {
        let mut running = start(&out);
        wait_for("frames", || frames_in(&out).len() >= frames);
        running.0.kill().unwrap();
        running.0.wait().unwrap();
        // Whatever has a frame's name is the frame.
        let done = assert_same_bytes(&out, reference());
        assert!((frames..96).contains(&done), "{done} frames when killed");
        assert!(!out.join("report.json").exists());
    }
    let kept = frames_in(&out).len();
    run(&courtyard(), &out, &format!("{SMALL} --skip-existing")).ok();
    assert_eq!(assert_same_bytes(&out, reference()), 96);
    assert_eq!(leftovers(&out), [""; 0]);

    // The report covers all frames: what was there counts as its files say.
    let (resumed, whole) = (json(&out.join("report.json")), json(&reference().join("report.json")));
    for key in ["pixels", "rays", "frames", "traced_frames", "inferred_frames"] {
        assert_eq!(resumed["totals"][key], whole["totals"][key], "{key}");
    }
    let frames = resumed["frames"].as_array().unwrap();
    assert_eq!(frames.iter().filter(|f| f["skipped"] == true).count(), kept);
    for (a, b) in frames.iter().zip(whole["frames"].as_array().unwrap()) {
        for key in ["frame", "kind", "from", "pixels", "rays"] {
            assert_eq!(a[key], b[key]);
        }
    }
}

/// `tests/endurance.py` does this for 2,000 frames.
#[test]
fn kills_at_any_moment_lose_nothing() {
    let (_folder, out) = fresh();
    let mut kills = 0;
    // Moments a few milliseconds apart: while reading, planning, rendering, encoding, writing, locking.
    for moment in (0u64..).map(|i| 40 + i * 37 % 400) {
        let mut running = start(&out);
        std::thread::sleep(Duration::from_millis(moment));
        if let Some(status) = running.0.try_wait().unwrap() {
            assert!(status.success());
            break;
        }
        running.0.kill().unwrap();
        running.0.wait().unwrap();
        assert_same_bytes(&out, reference());
        kills += 1;
        if kills == 12 {
            run(&courtyard(), &out, &format!("{SMALL} --skip-existing")).ok();
            break;
        }
    }
    assert!(kills > 0);
    assert_eq!(assert_same_bytes(&out, reference()), 96);
    assert_eq!(leftovers(&out), [""; 0]);
}

// ---- Other runs.

#[test]
fn two_runs_cannot_write_the_same_frames() {
    let (_folder, out) = fresh();
    let mut first = Running::start(&courtyard(), &out, LONG);
    wait_for("the folder", || is_locked(&out));
    for rest in ["-f 8", "-f 1-10 --skip-existing", "-f 8-9 --overwrite"] {
        let message = ["courtyard.0008.exr", "another run", "--frames"];
        run(&courtyard(), &out, &format!("{SMALL} {rest}")).refused(4, &message);
    }
    // Other frames, and other names, are no business of the first.
    run(&courtyard(), &out, &format!("{SMALL} -f 20")).ok();
    run(&courtyard(), &out, &format!("{SMALL} -f 8 --name other.####.exr")).ok();
    // A dead run claims nothing, though its lock's file is there.
    first.0.kill().unwrap();
    first.0.wait().unwrap();
    assert!(is_locked(&out));
    run(&courtyard(), &out, &format!("{SMALL} -f 8")).ok();
    assert_eq!(leftovers(&out), [""; 0]);
    assert_eq!(frames_in(&out), ["courtyard.0008.exr", "courtyard.0020.exr", "other.0008.exr"]);
}
