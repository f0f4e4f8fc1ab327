//! The same bytes, however the work is cut up. (However often it is killed: `faults.rs`.)

use crate::rig::{SMALL, assert_same_bytes, courtyard, fresh, reference, run};
use std::path::Path;

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
fn what_moves_moves_alike_in_chunks_and_on_one_thread() {
    let stage = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/stage/stage.gltf");
    let (_folder, whole) = fresh();
    run(&stage, &whole, &format!("{SMALL} -f 20-40")).ok();
    for (frames, count) in [("20-29", 10), ("30-40", 11), ("35", 1)] {
        let (_folder, out) = fresh();
        run(&stage, &out, &format!("{SMALL} -j 1 -f {frames}")).ok();
        assert_eq!(assert_same_bytes(&out, &whole), count, "{frames}");
    }
}
