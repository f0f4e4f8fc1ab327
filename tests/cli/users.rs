//! Users who share a folder. Only root can be two of them: for anybody else there is nothing to see here.

use crate::rig::{BINARY, Outcome, Running, fresh, leftovers, listing, run, wait_for};
use crate::stage::Stage;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// A scene that all may read, and a folder that all may write to; none where there is but one user.
fn shared() -> Option<(TempDir, PathBuf, PathBuf)> {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    fs::create_dir(&out).unwrap();
    for path in [folder.path(), &out] {
        fs::set_permissions(path, Permissions::from_mode(0o777)).unwrap();
    }
    if as_nobody(&["-V".as_ref()]).is_none_or(|outcome| outcome.code != 0) {
        println!("skipped: the program cannot be run as another user");
        return None;
    }
    Some((folder, scene, out))
}

/// Runs the binary as the user who owns nothing.
fn as_nobody(arguments: &[&Path]) -> Option<Outcome> {
    let mut command = Command::new("setpriv");
    command.args(["--reuid", "65534", "--regid", "65534", "--clear-groups", BINARY]).args(arguments);
    let output = command.output().ok()?;
    Some(Outcome {
        code: output.status.code()?,
        out: String::from_utf8(output.stdout).ok()?,
        err: String::from_utf8(output.stderr).ok()?,
    })
}

fn others_run(scene: &Path, out: &Path, frames: &str) -> Outcome {
    as_nobody(&[scene, out, "-r".as_ref(), "32x18".as_ref(), "-f".as_ref(), frames.as_ref()]).unwrap()
}

fn write(path: &Path, mode: u32) {
    fs::write(path, "").unwrap();
    fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
}

#[test]
fn what_another_users_run_has_left_holds_nobody_up() {
    let Some((_folder, scene, out)) = shared() else { return };
    write(&out.join(".buzz.lock"), 0o644);
    write(&out.join(".buzz-1-0.lock"), 0o644);
    others_run(&scene, &out, "0").ok();
    assert_eq!(leftovers(&out), [""; 0]);
    // What may not even be read cannot be told from a live run's.
    for name in [".buzz.lock", ".buzz-1-0.lock"] {
        write(&out.join(name), 0o600);
        others_run(&scene, &out, "1").refused(4, &[name, "another user", "remove"]);
        fs::remove_file(out.join(name)).unwrap();
    }
}

#[test]
fn another_users_frames_are_claimed_whatever_the_mask() {
    let Some((folder, scene, out)) = shared() else { return };
    let script = folder.path().join("masked");
    fs::write(&script, format!("#!/bin/sh\numask 077; exec '{BINARY}' \"$@\"\n")).unwrap();
    fs::set_permissions(&script, Permissions::from_mode(0o755)).unwrap();
    let long = "-r 3840x2160 -f 1 -j 1 --bounces 8 --progress none";
    let mut first =
        Running(Command::new(&script).arg(&scene).arg(&out).args(long.split(' ')).spawn().unwrap());
    let lock = || listing(&out).into_iter().find(|name| name.starts_with(".buzz-"));
    wait_for("the lock", || {
        lock().is_some_and(|name| fs::metadata(out.join(name)).is_ok_and(|m| m.len() > 0))
    });
    others_run(&scene, &out, "1").refused(4, &["s.0001.exr", "another run"]);
    others_run(&scene, &out, "2").ok();
    first.0.kill().unwrap();
    first.0.wait().unwrap();
    assert!(lock().is_some());
    others_run(&scene, &out, "1").ok();
    run(&scene, &out, "-r 32x18 -f 1-2 --skip-existing").ok();
}
