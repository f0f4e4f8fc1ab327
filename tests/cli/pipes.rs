//! What goes to standard output, what to standard error, and readers that go away.

use crate::rig::{BINARY, Outcome, Running, buzz, courtyard, frames_in, fresh, run};
use crate::stage::Stage;
use std::process::{Command, Stdio};

#[test]
fn results_go_to_standard_output_and_progress_to_standard_error() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let plain = run(&scene, &out, "-r 32x18").ok();
    let summary: Vec<&str> = plain.out.lines().collect();
    assert_eq!(summary.len(), 4, "{}", plain.out);
    assert!(summary[0].starts_with("4 frames: 1 traced, 3 inferred, in "), "{}", summary[0]);
    assert!(summary[1].ends_with(" of camera and shadow rays saved") && summary[2].starts_with("seconds: "));
    assert_eq!(summary[3], format!("report: {}", out.join("report.html").display()));
    assert_eq!(plain.err.lines().count(), 4);
    assert!(plain.err.lines().all(|l| l.starts_with("frame ") && l.contains(" left")), "{}", plain.err);

    let one = run(&scene, &out, "-r 32x18 --overwrite -f 0").ok();
    assert!(one.out.starts_with("1 frame: ") && !one.err.contains(", ,"), "{one:?}");
    assert_eq!(run(&scene, &out, "-r 32x18 --overwrite --progress none").ok().err, "");
    // A bar on what is no terminal draws nothing that would fill a log.
    assert_eq!(run(&scene, &out, "-r 32x18 --overwrite --progress bar").ok().err, "");
}

#[test]
fn open_job_description_reads_its_messages_on_standard_output() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let Outcome { out, err, .. } = run(&scene, &out, "-r 32x18 --progress openjd").ok();
    assert_eq!(err, "");
    let progress: Vec<&str> = out.lines().filter_map(|l| l.strip_prefix("openjd_progress: ")).collect();
    assert_eq!(progress, ["25.0", "50.0", "75.0", "100.0"]);
    let status: Vec<&str> = out.lines().filter_map(|l| l.strip_prefix("openjd_status: frame ")).collect();
    assert!(status.len() == 4 && status.iter().all(|s| s.ends_with(" left")), "{status:?}");
    assert_eq!(out.lines().count(), 4 + 4 + 4);
}

/// A reader that goes away before the first byte is no error, and no panic.
#[test]
fn closed_pipes_do_not_stop_a_run() {
    let (folder, out) = fresh();
    let courtyard = courtyard();
    for arguments in
        ["plan -r 32x18", "plan -r 32x18 --format json", "inspect", "inspect --format json", "--help"]
    {
        let mut command = Command::new(BINARY);
        command.args(arguments.split(' ').take(1)).arg(&courtyard).args(arguments.split(' ').skip(1));
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(
            (output.status.code(), String::from_utf8(output.stderr).unwrap()),
            (Some(0), String::new()),
            "{arguments}"
        );
    }
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    for progress in ["openjd", "plain", "bar"] {
        let out = out.join(progress);
        let mut running = Running::start(&scene, &out, &format!("-r 32x18 --progress {progress}"));
        drop((running.0.stdout.take(), running.0.stderr.take()));
        assert_eq!(running.0.wait().unwrap().code(), Some(0), "{progress}");
        assert_eq!(frames_in(&out).len(), 4);
        assert!(out.join("report.json").exists());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_standard_output_is_an_error() {
    let full = || Stdio::from(std::fs::File::options().write(true).open("/dev/full").unwrap());
    let mut command = Command::new(BINARY);
    let output = command.args(["inspect"]).arg(courtyard()).stdout(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(4));
    assert!(String::from_utf8(output.stderr).unwrap().contains("standard output"));
}

#[test]
fn help_lists_every_option() {
    let help = buzz(["--help"]).ok();
    assert_eq!(help.err, "");
    for option in [
        "--quality",
        "--frames",
        "--fps",
        "--resolution",
        "--crop",
        "--transparent",
        "--camera",
        "--start-frame",
        "--turntable",
        "--exposure",
        "--audit",
        "--bounces",
        "--segment",
        "--aov",
        "--compression",
        "--name",
        "--threads",
        "--skip-existing",
        "--overwrite",
        "--report",
        "--progress",
        "--plan",
        "--memory",
        "--strict",
        "--geometry",
        "--camera-from",
        "-q",
        "-f",
        "-r",
        "-c",
        "-j",
    ] {
        assert!(
            help.out.contains(&format!("{option} "))
                || help.out.contains(&format!("{option},"))
                || help.out.contains(&format!("{option}\n")),
            "{option}"
        );
    }
    for text in ["plan", "inspect", "compare", "Exit status", "130/143", "Example:"] {
        assert!(help.out.contains(text), "{text}");
    }
    assert!(buzz(["compare", "--help"]).ok().out.contains("--fail-below"));
    for command in ["plan", "inspect", "compare"] {
        assert!(buzz([command, "--help"]).ok().out.contains("--format"));
    }
    assert!(buzz(["--version"]).ok().out.starts_with("buzz-convert "));
}
