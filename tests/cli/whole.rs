//! A whole run: one file a frame, and a report that adds up.

use crate::rig::{SMALL, buzz, courtyard, frames_in, fresh, json, leftovers, listing, reference, run};
use buzz::frame::{FrameKind, PixelClass};
use buzz::measure::read_frame;
use serde_json::Value;

const PIXELS: u64 = 96 * 54;

#[test]
fn there_is_one_file_for_each_frame_and_nothing_half_done() {
    let folder = reference();
    let names: Vec<String> = (0..96).map(|n| format!("courtyard.{n:04}.exr")).collect();
    assert_eq!(frames_in(folder), names);
    assert_eq!(leftovers(folder), [""; 0]);
    assert!(
        listing(folder).contains(&"report.json".into()) && listing(folder).contains(&"report.html".into())
    );
}

#[test]
fn the_report_has_every_key_of_its_format() {
    let report = json(&reference().join("report.json"));
    let classes = "good overlapped missed bad creeping entering edge moved filled traced";
    let rays = "primary shadow ambient reflection refraction visibility";
    for (place, keys) in [
        ("", "schema input settings scene plan totals frames"),
        ("/settings", "quality width height fps threads aa"),
        ("/scene", "triangles shapes instances lights requires ignored bytes_per_pixel"),
        ("/plan", "keyframes segments cuts"),
        ("/plan/keyframes/0", "frame reason"),
        ("/plan/segments/0", "key first last"),
        ("/totals", "frames traced_frames inferred_frames pixels rays seconds hidden peak_bytes"),
        ("/totals/pixels", classes),
        ("/totals/rays", rays),
        ("/totals/seconds", "import accel plan infer trace enhance write wall"),
        ("/frames/0", "frame kind from pixels rays seconds"),
        ("/frames/0/pixels", classes),
        ("/frames/0/rays", rays),
        ("/frames/0/seconds", "infer trace enhance write"),
    ] {
        let object = report.pointer(place).unwrap().as_object().unwrap();
        for key in keys.split(' ') {
            assert!(object.contains_key(key), "{place}/{key}");
        }
    }
    assert_eq!(report["schema"], "buzz-report/1");
    assert_eq!((&report["settings"]["width"], &report["settings"]["height"]), (&96.into(), &54.into()));
    assert!(report["totals"]["peak_bytes"].as_u64().unwrap() > 0);
    assert!(report["totals"]["hidden"].is_null());
    assert!(report["totals"]["seconds"]["wall"].as_f64().unwrap() > 0.0);
}

#[test]
fn pixels_and_rays_add_up() {
    let report = json(&reference().join("report.json"));
    let frames = report["frames"].as_array().unwrap();
    assert_eq!(
        frames.iter().map(|f| f["frame"].as_i64().unwrap()).collect::<Vec<_>>(),
        (0..96).collect::<Vec<_>>()
    );
    let number = |v: &Value| v.as_u64().unwrap();
    for frame in frames {
        let pixels = frame["pixels"].as_object().unwrap();
        assert_eq!(pixels.values().map(number).sum::<u64>(), PIXELS);
        let reused: u64 = ["good", "overlapped", "filled"].iter().map(|c| number(&pixels[*c])).sum();
        assert_eq!(number(&frame["rays"]["primary"]), PIXELS - reused);
        // One pixel in 256, on a grid of 6 x 4, and what may be hidden beside those that were cast.
        assert!(number(&frame["rays"]["visibility"]) <= 6 * 4 + number(&frame["rays"]["primary"]));
        if frame["kind"] == "traced" {
            assert_eq!(number(&frame["rays"]["visibility"]), 0);
            assert_eq!(number(&pixels["traced"]), PIXELS);
            assert!(frame["from"].is_null());
        } else {
            assert_eq!(number(&pixels["traced"]), 0);
            assert_eq!(frame["from"].as_i64().unwrap().abs_diff(frame["frame"].as_i64().unwrap()), 1);
        }
    }
    for group in ["pixels", "rays"] {
        for (key, total) in report["totals"][group].as_object().unwrap() {
            assert_eq!(number(total), frames.iter().map(|f| number(&f[group][key])).sum::<u64>(), "{key}");
        }
    }
    let traced = frames.iter().filter(|f| f["kind"] == "traced").count();
    assert_eq!(report["totals"]["traced_frames"], traced);
    assert_eq!(report["totals"]["inferred_frames"], 96 - traced);
    assert_eq!(report["plan"]["keyframes"].as_array().unwrap().len(), traced);
}

#[test]
fn files_and_report_tell_the_same() {
    let report = json(&reference().join("report.json"));
    for number in [0, 33, 60, 95] {
        let read = read_frame(&reference().join(format!("courtyard.{number:04}.exr"))).unwrap();
        let frame = &report["frames"][number];
        for class in PixelClass::ALL {
            let count = read.class.iter().filter(|&&c| c == class as u8).count();
            assert_eq!(frame["pixels"][class.name()], count, "frame {number}, {}", class.name());
        }
        let from = match read.kind.unwrap() {
            FrameKind::Traced => Value::Null,
            FrameKind::Inferred { from } => from.into(),
        };
        assert_eq!(frame["from"], from);
    }
}

#[test]
fn the_plan_that_is_printed_is_the_one_that_is_carried_out() {
    let report = json(&reference().join("report.json"));
    let courtyard = courtyard();
    let arguments = ["plan", courtyard.to_str().unwrap(), "--format", "json", "-r", "96x54"];
    let printed = buzz(arguments).ok();
    assert_eq!(printed.err, "");
    let plan: Value = serde_json::from_str(&printed.out).unwrap();
    for key in ["keyframes", "segments", "cuts"] {
        assert_eq!(plan[key], report["plan"][key]);
    }
    assert_eq!(plan["cuts"], serde_json::json!([60]));
    for (planned, done) in plan["frames"].as_array().unwrap().iter().zip(report["frames"].as_array().unwrap())
    {
        for key in ["frame", "kind", "from"] {
            assert_eq!(planned[key], done[key]);
        }
    }
}

#[test]
fn an_audit_counts_hidden_samples_and_changes_no_pixel() {
    let (_folder, out) = fresh();
    run(&courtyard(), &out, &format!("{SMALL} -f 0-9 --audit")).ok();
    let report = json(&out.join("report.0-9.json"));
    let hidden = report["totals"]["hidden"].as_u64().unwrap();
    let reused = report["totals"]["pixels"]["good"].as_u64().unwrap();
    // At this size the leaves are narrower than a pixel.
    assert!(hidden * 30 < reused, "{hidden} of {reused}");
    for name in frames_in(&out) {
        assert_eq!(read_frame(&out.join(&name)).unwrap(), read_frame(&reference().join(&name)).unwrap());
    }
}
