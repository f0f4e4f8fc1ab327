//! Bad input, bad options, bad places to write to: one clear line, and the right code.

use crate::rig::{buzz, frames_in, fresh, listing, run};
use crate::stage::Stage;
use std::fs;

#[test]
fn input_that_cannot_be_rendered_is_refused_with_3() {
    let (folder, out) = fresh();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("broken.gltf"), r#"{"asset": {"version": "2.0"}, "#).unwrap();
    fs::write(path("empty.gltf"), "").unwrap();
    fs::write(path("noise.glb"), [7; 100]).unwrap();
    fs::write(path("walk.fbx"), "Kaydara FBX Binary").unwrap();
    fs::create_dir(path("folder.gltf")).unwrap();
    fs::write(path("shot.blend"), b"BLENDER-v405").unwrap();
    fs::write(path("shot.png"), b"\x89PNG\r\n\x1a\n\0\0\0").unwrap();
    let mut stage = Stage::drifting(2);
    stage.json["extensionsUsed"].as_array_mut().unwrap().push("EXT_nobody_knows".into());
    stage.json["extensionsRequired"] = serde_json::json!(["EXT_nobody_knows"]);
    stage.write(&path("required.gltf"));
    let mut stage = Stage::drifting(2);
    stage.json["nodes"][0].as_object_mut().unwrap().remove("camera");
    stage.json.as_object_mut().unwrap().remove("cameras");
    stage.write(&path("blind.gltf"));
    for (name, parts) in [
        ("missing.gltf", ["there is no such file; give the path", "missing.gltf"]),
        ("folder.gltf", ["folder.gltf", "not a regular file"]),
        ("walk.fbx", ["walk.fbx", "glTF"]),
        ("shot.blend", ["shot.blend: file: is a Blender file", "pipeline.md"]),
        ("shot.png", ["shot.png: file: is no glTF file", ".glb"]),
        ("broken.gltf", ["broken.gltf", "line 1 column"]),
        ("empty.gltf", ["empty.gltf", "JSON"]),
        ("noise.glb", ["noise.glb", ""]),
        ("required.gltf", ["EXT_nobody_knows", "required.gltf"]),
        ("blind.gltf", ["camera", "--turntable"]),
    ] {
        run(&path(name), &out, "-r 8x8").refused(3, &parts);
        let scene = path(name);
        let said = buzz(["plan", scene.to_str().unwrap(), "-r", "8x8"]).refused(3, &parts).err;
        assert!(said.matches("column").count() < 2 && !said.contains("os error"), "{said}");
    }
    assert!(!out.exists());
}

#[test]
fn a_scene_where_the_output_folder_is_named_is_told_from_a_missing_one() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    let reversed = ["is the order reversed? INPUT comes first", "s.gltf"];
    for input in [&out, folder.path()] {
        run(input, &scene, "").refused(3, &reversed);
        buzz(["trade".as_ref(), input.as_os_str(), scene.as_os_str()]).refused(3, &reversed);
    }
}

#[test]
fn what_is_nearly_right_is_told_what_is_wrong() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    for (options, said) in [
        ("-f 0:5", "was 0-5 meant?"),
        (
            "--crop 0,0,100,40",
            "36 pixels beyond the right edge and 4 pixels beyond the lower edge of the 64x36",
        ),
        ("--aov lights,", "--aov lights,: there is a comma too many"),
        ("--stereo 6.5cm", "expected a number of metres, without a unit"),
        ("--stereo 0.1 --convergence 2m", "expected a number of metres, without a unit"),
        ("--exposure 2stops", "expected a number of stops, without a unit"),
        ("--aov crypto normal", "unexpected argument 'normal'"),
        ("-- -f 0-3", "unexpected argument '-f'"),
    ] {
        run(&scene, &out, &format!("-r 64x36 {options}")).refused(2, &[said]);
    }
    assert!(!out.exists());
}

#[test]
fn an_animation_without_end_is_refused_before_it_fills_the_memory() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(100).write(&folder.path().join("s.gltf"));
    run(&scene, &out, "--fps 99999 -r 8x8").refused(3, &["frames", "--fps"]);
}

#[test]
fn options_that_mean_nothing_are_refused_with_2() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    for options in [
        "--frames 9-1",
        "--frames 1-",
        "--frames 1-2x0",
        "--frames one",
        "--frames 0-99999999999999999999",
        "--frames 5000000000",
        "--frames 0-100000000",
        "--fps 0",
        "--fps -24",
        "--fps 24/0",
        "--fps 0.0001",
        "--resolution 0x0",
        "--resolution 64",
        "--resolution 99999999x1",
        "--resolution 0%",
        "--crop 0,0,0,0",
        "--crop 60,0,8,8",
        "--crop 1,2,3",
        "--crop -1,0,8,8",
        "--aov colour",
        "--camera Nobody",
        "--camera 7",
        "--name s.exr",
        "--name s.%04d.png",
        "--name folder/s.%04d.exr",
        "--name %d.%d.exr",
        "--threads 0",
        "--threads 99999999",
        "--threads many",
        "--segment 0",
        "--segment long",
        "--exposure nan",
        "--exposure inf",
        "--bounces 65",
        "--bounces -1",
        "--start-frame 9223372036854775807",
        "--start-frame x",
        "--turntable 0",
        "--turntable 4294967295",
        "--quality best",
        "--compression zstd",
        "--progress loud",
        "--memory lots",
        "--report page.html",
        "--no-such-option",
        "stray",
    ] {
        let option = options.split(' ').next().unwrap();
        let size = if option == "--resolution" { "" } else { "-r 64x36" };
        run(&scene, &out, &format!("{size} {options}")).refused(2, &[option]);
    }
    buzz(["scene.gltf"]).refused(2, &["<OUT_DIR>"]);
    buzz([""; 0]).refused(2, &["<INPUT>", "--help"]);
    assert!(!out.exists());
}

#[test]
fn output_that_cannot_be_written_is_refused_with_4() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    run(&scene, &scene, "-r 8x8").refused(4, &["s.gltf"]);
    run(&scene, &scene.join("in"), "-r 8x8").refused(4, &["s.gltf/in", "folder"]);
    // Not even root can write there.
    #[cfg(target_os = "linux")]
    for place in ["/proc/buzz", "/proc/self/buzz"] {
        run(&scene, place.as_ref(), "-r 8x8").refused(4, &[place]);
        run(&scene, &out, &format!("-r 8x8 --report {place}/report.json")).refused(4, &["report.json"]);
    }
    let report = folder.path().join("r.json");
    fs::create_dir(&report).unwrap();
    run(&scene, &out, &format!("-r 8x8 --report {}", report.display())).refused(4, &["r.json", "folder"]);
    let review = folder.path().join("q.review");
    fs::write(&review, "").unwrap();
    let with_review = format!("-r 8x8 --report {}", folder.path().join("q.json").display());
    run(&scene, &out, &with_review).refused(4, &["q.review", "--report"]);
    fs::remove_file(&review).unwrap();
    fs::create_dir_all(review.join("sheet.png")).unwrap();
    run(&scene, &out, &with_review).refused(4, &["sheet.png", "folder"]);
    assert!(!out.exists(), "it was found out before the rendering: {:?}", listing(&out));
    // The folder in the way of a frame is named, too.
    fs::create_dir_all(out.join("s.0001.exr/x")).unwrap();
    for options in ["--overwrite", "--skip-existing", ""] {
        run(&scene, &out, &format!("-r 8x8 {options}")).refused(4, &["s.0001.exr", "folder"]);
    }
    assert_eq!(listing(&out), ["s.0001.exr"], "it was found out before the rendering");
}

#[cfg(unix)]
#[test]
fn names_that_are_too_long_are_refused_before_the_rendering() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    // File names have 255 bytes at most, and while a file is written its own is longer.
    let long = "l".repeat(240);
    run(&scene, &out, &format!("-r 8x8 --name {long}.%04d.exr")).refused(4, &["too long", "--name"]);
    let report = folder.path().join(format!("new/{long}x.json"));
    run(&scene, &out, &format!("-r 8x8 --report {}", report.display())).refused(4, &["too long", "--report"]);
    assert!(!out.exists());
    run(&scene, &out, &format!("-r 8x8 --name {}.%d.exr", "l".repeat(237))).ok();
}

#[test]
fn a_picture_of_the_scenes_is_not_replaced_by_a_frame() {
    let (folder, _) = fresh();
    let place = folder.path();
    let sky = place.join("sky.0001.exr");
    exr::prelude::write_rgb_file(&sky, 4, 2, |_, _| (0.2, 0.3, 0.5)).unwrap();
    let mut stage = Stage::drifting(4);
    stage.json["scenes"][0]["extras"] = serde_json::json!({"buzz": {"world": {"image": "sky.0001.exr"}}});
    let scene = stage.write(&place.join("sky.gltf"));
    let before = (fs::read(&sky).unwrap(), listing(place));
    for options in ["--skip-existing", "--overwrite", ""] {
        run(&scene, place, &format!("-r 32x18 {options}"))
            .refused(2, &["sky.0001.exr", "reads it", "--name"]);
    }
    assert_eq!(listing(place), before.1);
    run(&scene, place, "-r 32x18 -f 0").ok();
    assert_eq!(fs::read(&sky).unwrap(), before.0);
    // What stands in the folder for review is no less an input.
    let review = place.join("r.review");
    fs::create_dir(&review).unwrap();
    fs::rename(&sky, review.join("sheet.png")).unwrap();
    stage.json["scenes"][0]["extras"]["buzz"]["world"]["image"] = "r.review/sheet.png".into();
    stage.write(&scene);
    let report = format!("-r 32x18 -f 2 --report {}", place.join("r.json").display());
    run(&scene, place, &report).refused(2, &["sheet.png", "--report"]);
}

#[test]
fn what_is_ignored_is_said_once_and_refused_if_strict() {
    let (folder, out) = fresh();
    let mut stage = Stage::drifting(3);
    stage.json["meshes"][1]["primitives"][0]["mode"] = 1.into();
    let scene = stage.write(&folder.path().join("s.gltf"));
    let said = run(&scene, &out, "-r 8x8 --progress none").ok().err;
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains("warning") && said.contains("/meshes/1/primitives/0"), "{said}");
    let report = crate::rig::json(&out.join("report.json"));
    assert_eq!(report["scene"]["ignored"].as_array().unwrap().len(), 1);
    run(&scene, &out, "-r 8x8 --overwrite --strict").refused(3, &["/meshes/1/primitives/0"]);
}

#[test]
fn comparisons_tell_what_they_miss() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    let other = folder.path().join("other");
    run(&scene, &out, "-r 32x18 --progress none").ok();
    run(&scene, &other, "-r 32x18 --progress none --exposure 0.5").ok();
    let compare = |a: &std::path::Path, b: &std::path::Path, rest: &str| {
        let (a, b) = (a.to_str().unwrap(), b.to_str().unwrap());
        buzz(["compare", a, b].into_iter().chain(rest.split_whitespace()))
    };
    compare(&folder.path().join("none"), &out, "").refused(3, &["none"]);
    compare(&out, &folder.path().join("none"), "").refused(3, &["none"]);
    compare(&scene, &out, "").refused(3, &["s.gltf", "expected a folder with EXR frames"]);
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    compare(&out, &empty, "").refused(3, &["no EXR"]);

    let same = compare(&out, &out, "--format json --fail-below 99").ok();
    let same: serde_json::Value = serde_json::from_str(&same.out).unwrap();
    assert!(same["frames"][0]["psnr_db"].is_null() && same["worst"]["psnr_db"].is_null());
    assert!(same["mean"]["psnr_db"].is_null());
    assert_eq!(same["frames"][0]["max_abs"], 0.0);

    let differs = compare(&out, &other, "--format json").ok();
    let differs: serde_json::Value = serde_json::from_str(&differs.out).unwrap();
    let worst = differs["worst"]["psnr_db"].as_f64().unwrap();
    assert_eq!(compare(&out, &other, &format!("--fail-below {}", worst + 0.1)).code, 1);
    compare(&out, &other, &format!("--fail-below {}", worst - 0.1)).ok();
    // A frame that is not there fails, too.
    fs::remove_file(other.join("s.0001.exr")).unwrap();
    let missing = compare(&other, &out, "--fail-below 0");
    assert_eq!(missing.code, 1);
    assert!(missing.err.contains(": frames only in the reference: 1\n"), "{}", missing.err);
    compare(&out, &other, "--fail-below nan").refused(2, &["--fail-below"]);
}

#[test]
fn what_is_no_number_is_not_the_same_as_black() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(1).write(&folder.path().join("s.gltf"));
    run(&scene, &out, "-r 16x9").ok();
    let nan = folder.path().join("nan");
    fs::create_dir(&nan).unwrap();
    let color = |x: usize, y: usize| if (x, y) == (3, 2) { (f32::NAN, 0.0, 0.0) } else { (0.0, 0.0, 0.0) };
    exr::prelude::write_rgb_file(nan.join("s.0000.exr"), 16, 9, color).unwrap();
    for (one, other) in [(&nan, &out), (&out, &nan), (&nan, &nan)] {
        buzz(["compare".as_ref(), one.as_os_str(), other.as_os_str()])
            .refused(3, &["nan/s.0000.exr", "pixel 3,2", "pixels: 1"]);
    }
}

#[test]
fn an_image_that_no_memory_can_hold_is_refused_before_it_is_rendered() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    // Even where everything else is shared, a pixel takes a hundred bytes.
    let deep = out.join("shot 1").join("v2");
    run(&scene, &deep, "-r 32768x32767 --progress none").refused(2, &["--memory", "MiB", "--resolution"]);
    // Not even the folders that were made for it remain.
    assert!(!out.exists());
}

#[test]
fn more_samples_than_can_be_numbered_are_refused_but_in_parts() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    for options in ["-r 65536x60000", "-r 16384x16384 --aa 3"] {
        run(&scene, &out, options).refused(2, &["--resolution, --aa", "--crop"]);
    }
    run(&scene, &out, "-r 65536x60000 --crop 30000,30000,16,16 -f 0").ok();
    assert_eq!(frames_in(&out).len(), 1);
}
