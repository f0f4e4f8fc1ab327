//! The same bytes, however the work is cut up and however often it is killed.

use crate::rig::{
    Running, SMALL, assert_same_bytes, courtyard, frames_in, fresh, json, leftovers, reference, run, wait_for,
};

#[test]
fn one_thread_and_three_chunks_give_the_bytes_of_two_threads_and_one_run() {
    for range in ["0-31", "32-63", "64-95"] {
        let (_folder, out) = fresh();
        run(&courtyard(), &out, &format!("{SMALL} -j 1 -f {range}")).ok();
        assert_eq!(assert_same_bytes(&out, reference()), 32);
    }
}

#[test]
fn chunks_that_share_a_folder_keep_reports_of_their_own() {
    let (_folder, out) = fresh();
    for range in ["0-9", "10-19", "20-29"] {
        run(&courtyard(), &out, &format!("{SMALL} -f {range}")).ok();
        assert!(out.join(format!("report.{range}.json")).is_file());
    }
    assert_eq!(assert_same_bytes(&out, reference()), 30);
    assert!(!out.join("report.json").exists());
}

#[test]
fn chunks_that_begin_and_end_within_segments_give_the_same_bytes() {
    for (frames, count) in
        [("3-5", 3), ("16-19", 4), ("37-57x4", 6), ("59-60", 2), ("95", 1), ("90,1,40-41", 4)]
    {
        let (_folder, out) = fresh();
        run(&courtyard(), &out, &format!("{SMALL} -f {frames}")).ok();
        assert_eq!(assert_same_bytes(&out, reference()), count, "{frames}");
    }
}

#[test]
fn a_killed_run_is_resumed_to_the_same_bytes() {
    let (_folder, out) = fresh();
    for frames in [3, 30] {
        let mut running = Running::start(&courtyard(), &out, &format!("{SMALL} -j 1 --skip-existing"));
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
