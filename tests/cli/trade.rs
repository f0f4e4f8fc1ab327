//! `buzz-convert trade` measures what separate runs would.

use crate::rig::{buzz, courtyard, fresh, json, listing, run};
use crate::stage::Stage;
use serde_json::Value;
use std::fs;

fn trade(arguments: &[&str]) -> crate::rig::Outcome {
    buzz(["trade"].iter().chain(arguments))
}

#[test]
fn the_figures_are_those_of_separate_runs() {
    let (folder, out) = fresh();
    let (scene, small) = (courtyard(), ["-r", "64x36", "--ambient-samples", "4", "-f", "0-40"]);
    let scene_text = scene.to_str().unwrap();
    let done = trade(&[&[scene_text, out.to_str().unwrap(), "-j", "2"], &small[..]].concat()).ok();
    assert_eq!(listing(&out), ["trade.csv", "trade.html", "trade.json", "trade.txt"]);
    assert_eq!(std::fs::read_to_string(out.join("trade.txt")).unwrap(), done.out);
    let trade = json(&out.join("trade.json"));
    assert_eq!(trade["schema"], "buzz-trade/1");
    let qualities = trade["qualities"].as_array().unwrap();
    assert_eq!(qualities[0]["quality"], "full", "the truth comes first");
    let spans: Vec<String> =
        trade["spans"].as_array().unwrap().iter().map(|s| format!("{}-{}", s[0], s[1])).collect();
    let (frames, full) = (spans.join(","), folder.path().join("full"));
    run(&scene, &full, &format!("-r 64x36 --ambient-samples 4 -q full -f {frames}")).ok();
    for measured in qualities {
        let name = measured["quality"].as_str().unwrap();
        assert!(done.out.contains(name), "{name} is not in the table");
        let alone = folder.path().join(format!("{name}-alone"));
        let report = alone.join("r.json");
        run(
            &scene,
            &alone,
            &format!(
                "-r 64x36 --ambient-samples 4 -q {name} --audit -f {frames} --report {}",
                report.display()
            ),
        )
        .ok();
        let compared =
            buzz(["compare", alone.to_str().unwrap(), full.to_str().unwrap(), "--format", "json"]).ok();
        let compared: Value = serde_json::from_str(&compared.out).unwrap();
        let report = json(&report);
        let number = |v: &Value| v["frame"].as_i64().unwrap();
        let find =
            |list: &Value, frame: i64| list.as_array().unwrap().iter().find(|f| number(f) == frame).cloned();
        let mut seen = 0;
        for frame in measured["frames"].as_array().unwrap() {
            let (Some(done), Some(error)) =
                (find(&report["frames"], number(frame)), find(&compared["frames"], number(frame)))
            else {
                continue;
            };
            seen += 1;
            for key in ["rays", "from"] {
                assert_eq!(frame[key], done[key], "{name}, frame {}: {key}", number(frame));
            }
            if name != "full" {
                assert_eq!(frame["hidden"], done["hidden"], "{name}, frame {}", number(frame));
            }
            for key in ["psnr_db", "flip_mean", "max_abs", "over_5_percent"] {
                let (have, want) = (frame["error"][key].as_f64(), error[key].as_f64());
                let near =
                    have.zip(want).is_some_and(|(a, b)| (a - b).abs() < 1e-4) || (have, want) == (None, None);
                assert!(near, "{name}, frame {}: {key} {have:?}, not {want:?}", number(frame));
            }
        }
        assert_eq!(
            seen,
            compared["frames"].as_array().unwrap().len(),
            "{name}: all sampled frames are measured"
        );
    }
}

#[test]
fn every_quality_of_the_command_line_is_measured_and_drawn() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(10).write(&folder.path().join("s.gltf"));
    trade(&[scene.to_str().unwrap(), out.to_str().unwrap(), "-r", "64x36"]).ok();
    let refused = run(&scene, &out, "-q nonsense");
    let offered = refused.err.split("possible values: ").nth(1).unwrap().split(']').next().unwrap();
    let trade = json(&out.join("trade.json"));
    let measured: Vec<&str> =
        trade["qualities"].as_array().unwrap().iter().map(|q| q["quality"].as_str().unwrap()).collect();
    for quality in offered.split(", ") {
        assert!(measured.contains(&quality), "{quality} is not in {measured:?}");
    }
    let page = std::fs::read_to_string(out.join("trade.html")).unwrap();
    let csv = std::fs::read_to_string(out.join("trade.csv")).unwrap();
    let columns = csv.lines().next().unwrap().split(',').count();
    assert!(csv.lines().all(|line| line.split(',').count() == columns));
    for quality in trade["qualities"].as_array().unwrap() {
        let name = quality["quality"].as_str().unwrap();
        let rows = csv.lines().filter(|line| line.starts_with(&format!("{name},"))).count();
        assert_eq!(rows, quality["frames"].as_array().unwrap().len());
        let summary = &quality["summary"];
        assert!(summary["seconds"]["mean"].as_f64().unwrap() > 0.0);
        if name == "full" {
            assert!(summary["error"]["psnr_db"].is_null() && quality["worst"].as_array().unwrap().is_empty());
            continue;
        }
        if summary["error"]["psnr_db"].is_null() {
            // On a scene as simple as this one, some qualities make no error at all.
            assert!(page.contains(&format!("{name}: no error")) && name != "half-pixel");
            continue;
        }
        // In the picture of cost and error, and in that of the chain.
        assert!(page.matches(&format!("<title>{name}: ")).count() >= 2, "{name} is not drawn");
        assert!(page.contains(&format!("Worst places: {name}")));
        assert!(quality["chain"].as_array().unwrap().iter().all(|s| s["distance"].as_u64().unwrap() > 0));
        let worst = quality["worst"].as_array().unwrap();
        assert!(
            !worst.is_empty() && worst.windows(2).all(|w| w[0]["flip"].as_f64() >= w[1]["flip"].as_f64())
        );
    }
    assert!(page.contains("data:image/png;base64,") && !page.contains("NaN"));
}

#[test]
fn frames_that_are_not_there_are_a_usage_error() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let arguments = [scene.to_str().unwrap(), out.to_str().unwrap(), "-r", "16x9", "-f", "500"];
    trade(&arguments).refused(2, &["--frames 500", "0-3"]);
    assert!(!out.exists());
}

#[test]
fn files_that_cannot_be_replaced_are_found_out_before_the_measurement() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let measure = || trade(&[scene.to_str().unwrap(), out.to_str().unwrap(), "-r", "16x9"]);
    for name in ["trade.txt", "trade.json", "trade.csv", "trade.html"] {
        fs::create_dir_all(out.join(name)).unwrap();
        measure().refused(4, &[name, "folder"]);
        fs::remove_dir(out.join(name)).unwrap();
        fs::write(out.join(name), "Sold: 12 shares").unwrap();
        measure().refused(4, &[name, "another folder"]);
        assert_eq!(fs::read_to_string(out.join(name)).unwrap(), "Sold: 12 shares");
        fs::remove_file(out.join(name)).unwrap();
    }
    fs::remove_dir(&out).unwrap();
    measure().ok();
    // Its own files are replaced.
    measure().ok();
}

#[test]
fn differences_are_drawn_on_request() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(4).write(&folder.path().join("s.gltf"));
    let full = folder.path().join("full");
    run(&scene, &out, "-r 32x18 -q half-pixel").ok();
    run(&scene, &full, "-r 32x18 -q full").ok();
    let pictures = folder.path().join("pictures");
    let paths = [&out, &full, &pictures].map(|p| p.to_str().unwrap().to_string());
    let text = buzz(["compare", &paths[0], &paths[1], "--differences", &paths[2]]).ok().out;
    assert!(text.contains("worst place") && text.contains("in the 18x18 block at "), "{text}");
    assert_eq!(listing(&pictures), ["s.0000.png", "s.0001.png", "s.0002.png", "s.0003.png"]);
    let picture = image::open(pictures.join("s.0002.png")).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (3 * 32 + 4 * 4, 18 + 2 * 4));
    // Again, after one that was ended; but not over what somebody has painted.
    let compare = || buzz(["compare", &paths[0], &paths[1], "--differences", &paths[2]]);
    fs::write(pictures.join(".s.0001.png.x3Yz.tmp"), "half").unwrap();
    compare().ok();
    assert_eq!(listing(&pictures).len(), 4);
    picture.save(pictures.join("s.0002.png")).unwrap();
    compare().refused(4, &["s.0002.png", "another folder"]);
}

#[test]
fn more_samples_than_can_be_numbered_are_refused() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    let (scene, folder) = (scene.to_string_lossy(), out.to_string_lossy());
    trade(&[&scene, &folder, "-r", "65536x60000"]).refused(2, &["--resolution, --aa", "2^30 pixels"]);
    assert!(!out.exists());
}
