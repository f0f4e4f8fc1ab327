//! `--aa`: super-sampling where neighbours differ, in every quality.

use crate::rig::{assert_same_bytes, buzz, channels, courtyard, frames_in, fresh, json, run};
use crate::stage::{CAMERA, CARD, Stage};
use serde_json::{Value, json};
use std::path::Path;

/// Sub-pixels of a report's totals or of one of its frames: sampled, reused, wasted.
fn subpixels(of: &Value) -> [u64; 3] {
    ["sampled", "reused", "wasted"].map(|key| of["subpixels"][key].as_u64().unwrap())
}

/// Camera and shadow rays of a report's totals.
fn rays(report: &Value) -> u64 {
    ["primary", "visibility", "shadow"]
        .map(|key| report["totals"]["rays"][key].as_u64().unwrap())
        .iter()
        .sum()
}

/// The share of the pixel at column `x` and row `y`, from the image's centre, that lies above a line through the centre.
fn share_above(slope: f64, x: f64, y: f64) -> f64 {
    const FINE: usize = 64;
    let at = |i: usize| (i as f64 + 0.5) / FINE as f64;
    let above = |i: usize| (0..FINE).filter(|&j| -(y + at(j)) > slope * (x + at(i))).count();
    (0..FINE).map(above).sum::<usize>() as f64 / (FINE * FINE) as f64
}

#[test]
fn an_edge_covers_what_it_should() {
    let mut stage = Stage::new();
    stage.json["scenes"][0]["nodes"] = json!([CAMERA, CARD]);
    stage.json["extensionsUsed"].as_array_mut().unwrap().push("KHR_materials_unlit".into());
    stage.json["materials"][1] = json!({"doubleSided": true, "extensions": {"KHR_materials_unlit": {}}});
    // A card larger than the image; its lower edge passes the image's centre at this slope.
    let angle = 0.35f64;
    let card = &mut stage.json["nodes"][CARD];
    card["translation"] = json!([0, 1, 0]);
    card["rotation"] = json!([0, 0, (angle / 2.0).sin(), (angle / 2.0).cos()]);
    card["scale"] = json!([20, 20, 20]);
    let (folder, out) = fresh();
    let scene = stage.write(&folder.path().join("edge.gltf"));
    let mut errors = Vec::new();
    for aa in 1..=3 {
        run(&scene, &out.join(aa.to_string()), &format!("-r 64x36 -f 0 --aa {aa} --compression none")).ok();
        let image = channels(&out.join(format!("{aa}/edge.0000.exr")));
        let off = |i: usize| {
            let (x, y) = ((i % 64) as f64 - 32.0, (i / 64) as f64 - 18.0);
            (f64::from(image["R"][i]) - share_above(angle.tan(), x, y)).abs()
        };
        let wrong: Vec<f64> = (0..64 * 36).map(off).filter(|&e| e > 0.01).collect();
        let mean = wrong.iter().sum::<f64>() / wrong.len() as f64;
        errors.push((mean, wrong.into_iter().fold(0.0, f64::max)));
    }
    // One sample is off by half a pixel at worst. The finest lattice is off by a twelfth at worst, a sixteenth on average.
    assert!(errors[0].1 > 0.4 && errors[1].1 < 0.2, "{errors:?}");
    assert!(errors[2].0 < 1.0 / 16.0 && errors[2].1 < 1.0 / 12.0, "{errors:?}");
}

#[test]
fn inferred_frames_are_close_to_traced_ones_and_cost_less() {
    for (aa, decibels, part) in [(2, "36", 0.5), (3, "38", 0.5)] {
        let (folder, full) = fresh();
        let inferred = folder.path().join("inferred");
        let options = format!("-r 240x135 -f 0-5 --aa {aa} --report");
        let report = |name: &str| folder.path().join(format!("{name}.json"));
        run(&courtyard(), &full, &format!("{options} {} -q full", report("full").display())).ok();
        run(&courtyard(), &inferred, &format!("{options} {}", report("inferred").display())).ok();
        let [full_dir, dir] = [&full, &inferred].map(|path| path.to_str().unwrap());
        buzz(["compare", dir, full_dir, "--fail-below", decibels]).ok();
        let (full, inferred) = (json(&report("full")), json(&report("inferred")));
        assert_eq!(inferred["settings"]["aa"], aa);
        let cost = rays(&inferred) as f64 / rays(&full) as f64;
        assert!(cost < part, "{cost}");
        // A key frame reuses nothing; what is reported of the whole is the sum of what is reported of frames.
        assert_eq!(subpixels(&full["totals"])[1..], [0, 0]);
        let mut sum = [0; 3];
        for frame in inferred["frames"].as_array().unwrap() {
            let counts = subpixels(frame);
            assert!(counts[0] > 0 && counts[1] <= counts[0], "{counts:?}");
            assert_eq!(frame["kind"] == "traced", counts[1] == 0);
            sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        assert_eq!(subpixels(&inferred["totals"]), sum);
        assert!(sum[2] > 0, "{sum:?}");
    }
}

#[test]
fn a_still_camera_repeats_its_frame() {
    let mut stage = Stage::new();
    stage.translate(CAMERA, &[[0.0, 1.0, 6.0]; 3]);
    let (folder, out) = fresh();
    let scene = stage.write(&folder.path().join("still.gltf"));
    run(&scene, &out, "-r 96x54 -f 0-2 --aa 3 --aov all").ok();
    let report = json(&out.join("report.json"));
    let inferred: Vec<&Value> =
        report["frames"].as_array().unwrap().iter().filter(|f| f["kind"] == "inferred").collect();
    assert_eq!(inferred.len(), 2);
    for frame in inferred {
        let [sampled, reused, _] = subpixels(frame);
        assert!((sampled - reused) * 100 < sampled, "{frame}");
    }
    let first = channels(&out.join("still.0000.exr"));
    for number in 1..=2 {
        let mut repeated = channels(&out.join(format!("still.{number:04}.exr")));
        repeated.insert("pixelClass.id".into(), first["pixelClass.id"].clone());
        for (name, values) in &repeated {
            assert!(values == &first[name], "{name} differs");
        }
    }
}

#[test]
fn frames_depend_on_neither_threads_nor_chunks() {
    for options in ["-q centred", "-q verified", "-q half-pixel --light-samples 4 --ambient-samples 2"] {
        let (folder, whole) = fresh();
        let part = folder.path().join("part");
        let options = format!("-r 96x54 --aa 3 --aov all {options}");
        run(&courtyard(), &whole, &format!("{options} -f 0-4 -j 2")).ok();
        run(&courtyard(), &part, &format!("{options} -f 3-4 -j 1")).ok();
        assert_eq!(assert_same_bytes(&part, &whole), 2);
    }
}

#[test]
fn layers_add_up_to_the_beauty() {
    let (_folder, out) = fresh();
    run(&courtyard(), &out, "-r 96x54 -f 3 --aa 3 --aov all").ok();
    let image = channels(&out.join(&frames_in(&out)[0]));
    let lights: Vec<&String> =
        image.keys().filter(|name| name.starts_with("light") && name.ends_with(".G")).collect();
    assert!(!lights.is_empty(), "{:?}", image.keys());
    for (i, green) in image["G"].iter().enumerate() {
        let parts: f32 = ["diffuse.G", "specular.G", "emission.G"].map(|name| image[name][i]).iter().sum();
        assert!((parts - green).abs() <= 4e-3 * green.abs() + 1e-4, "{i}: {parts} {green}");
        // The world brings the rest.
        let lit: f32 = lights.iter().map(|&name| image[name][i]).sum();
        assert!(lit <= image["diffuse.G"][i] * 1.004 + 1e-4, "{i}");
    }
}

#[test]
fn what_moves_and_the_other_eye_are_super_sampled_too() {
    let mut stage = Stage::drifting(6);
    let path: Vec<[f32; 3]> = (0..6).map(|i| [0.0, 0.1 * i as f32, 0.0]).collect();
    stage.translate(CARD, &path);
    let (folder, full) = fresh();
    let inferred = folder.path().join("inferred");
    let scene = stage.write(&folder.path().join("moving.gltf"));
    let options = "-r 192x108 --aa 3 --stereo 0.1 --convergence 6";
    run(&scene, &full, &format!("{options} -q full")).ok();
    run(&scene, &inferred, options).ok();
    buzz(["compare", inferred.to_str().unwrap(), full.to_str().unwrap(), "--fail-below", "40"]).ok();
    let report = json(&inferred.join("report.json"));
    let frames = report["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 12);
    for frame in frames.iter().filter(|frame| frame["kind"] == "inferred") {
        let [sampled, reused, _] = subpixels(frame);
        assert!(2 * reused > sampled, "{frame}");
    }
}

#[test]
fn resuming_knows_the_levels_and_their_counts() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(3).write(&folder.path().join("drift.gltf"));
    let convert = |aa: u32| {
        run(&scene, &out, &format!("-r 64x36 --aa {aa} --skip-existing")).ok();
        json(&out.join("report.json"))
    };
    let skipped = |report: &Value| report["frames"].as_array().unwrap().iter().all(|f| f["skipped"] == true);
    assert_eq!(subpixels(&convert(1)["totals"]), [0; 3]);
    let first = convert(2);
    assert!(!skipped(&first) && subpixels(&first["totals"])[0] > 0);
    let second = convert(2);
    assert!(skipped(&second));
    assert_eq!(second["totals"]["subpixels"], first["totals"]["subpixels"]);
}

#[test]
fn levels_are_one_to_three() {
    // Not `out`: README's first command leaves that in the repository.
    let folder = "refused-levels";
    for levels in ["0", "4", "-1", "x"] {
        let arguments = ["in.gltf", folder, &format!("--aa={levels}")];
        assert_eq!(buzz(arguments).refused(2, &["--aa", levels]).out, "");
        assert!(!Path::new(folder).exists());
    }
}

#[test]
fn no_more_pixels_are_traced_than_there_are() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(3).write(&folder.path().join("s.gltf"));
    let said = run(&scene, &out, "-r 32x18 --aa 3 --progress plain").ok().err;
    let shares = said
        .lines()
        .filter_map(|line| line.split_once(" % of pixels traced")?.0.rsplit(' ').next()?.parse::<f64>().ok());
    let shares: Vec<f64> = shares.collect();
    assert!(shares.len() == 3 && shares.iter().all(|&share| share <= 100.0), "{said}");
}
