//! Signals, and runs that meet.
#![cfg(unix)]

use crate::rig::{
    Running, SMALL, assert_same_bytes, courtyard, frames_in, fresh, leftovers, listing, reference, run,
    wait_for,
};
use std::path::Path;
use std::time::{Duration, Instant};

/// One frame that takes far longer than any of these tests.
const LONG: &str = "-r 3840x2160 -f 8 -j 1 --bounces 8 --progress none";

fn is_locked(folder: &Path) -> bool {
    listing(folder).iter().any(|n| n.starts_with(".buzz-"))
}

#[test]
fn a_signal_ends_the_run_with_its_code_and_leaves_whole_frames() {
    for (signal, name, code) in [("-INT", "Ctrl-C", 130), ("-TERM", "SIGTERM", 143)] {
        let (_folder, out) = fresh();
        let running = Running::start(&courtyard(), &out, &format!("{SMALL} -j 1 --progress none"));
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
    let (_folder, out) = fresh();
    let running = Running::start(&courtyard(), &out, &format!("{SMALL} -j 1 --progress none"));
    wait_for("frames", || frames_in(&out).len() >= 2);
    running.signal("-INT");
    running.signal("-TERM");
    let outcome = running.end();
    assert!([130, 143].contains(&outcome.code), "{outcome:?}");
    assert_same_bytes(&out, reference());
    run(&courtyard(), &out, &format!("{SMALL} -f 0-40 --skip-existing")).ok();
    assert_same_bytes(&out, reference());
    assert_eq!(leftovers(&out), [""; 0]);
}

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
    // A dead run claims nothing.
    first.0.kill().unwrap();
    first.0.wait().unwrap();
    run(&courtyard(), &out, &format!("{SMALL} -f 8")).ok();
    assert_eq!(leftovers(&out), [""; 0]);
    assert_eq!(frames_in(&out), ["courtyard.0008.exr", "courtyard.0020.exr", "other.0008.exr"]);
}

#[test]
fn a_folder_that_vanishes_ends_the_run_with_4() {
    let (folder, out) = fresh();
    let running = Running::start(&courtyard(), &out, &format!("{SMALL} -j 1 --progress none"));
    wait_for("frames", || frames_in(&out).len() >= 2);
    let away = folder.path().join("away");
    std::fs::rename(&out, &away).unwrap();
    running.end().refused(4, &["courtyard.", "folder"]);
    assert!(!out.exists());
    // Put back, it is taken up again, whatever is left of the run that lost it.
    std::fs::rename(&away, &out).unwrap();
    run(&courtyard(), &out, &format!("{SMALL} -f 0-40 --skip-existing")).ok();
    assert_same_bytes(&out, reference());
    assert_eq!(leftovers(&out), [""; 0]);
}
