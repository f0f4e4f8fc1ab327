//! Plans for several machines, plans that are replayed, and jobs for render farms. (`tests/test_openjd.py` runs them by
//! `openjd`.)

use crate::rig::{
    SMALL, assert_same_bytes, buzz, courtyard, frames_in, fresh, json, leftovers, listing, reference, run,
};
use crate::stage::{CARD, Stage};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

fn plan(scene: &Path, options: &str) -> Value {
    let arguments = ["plan", scene.to_str().unwrap()].into_iter().chain(options.split_whitespace());
    serde_json::from_str(&buzz(arguments).ok().out).unwrap()
}

/// The ranges of the rendering tasks.
fn chunks(template: &Value) -> Vec<&str> {
    let parameters = template["steps"][0]["parameterSpace"]["taskParameterDefinitions"].as_array().unwrap();
    assert_eq!((parameters.len(), &parameters[0]["name"]), (1, &"Chunk".into()));
    parameters[0]["range"].as_array().unwrap().iter().map(|c| c.as_str().unwrap()).collect()
}

/// A step's command, as a worker resolves it.
fn command(template: &Value, step: usize, chunk: &str, set: &[(&str, &str)]) -> Vec<String> {
    let script = &template["steps"][step]["script"];
    let run = &script["actions"]["onRun"];
    assert_eq!(run["command"], "buzz-convert");
    let resolve = |argument: &Value| {
        let mut text = argument.as_str().unwrap().replace("{{Task.Param.Chunk}}", chunk);
        for parameter in template["parameterDefinitions"].as_array().unwrap() {
            let name = parameter["name"].as_str().unwrap();
            let value = set.iter().find(|(n, _)| *n == name).map(|(_, value)| *value);
            let value = value.or(parameter["default"].as_str()).unwrap_or("unset");
            text = text.replace(&format!("{{{{Param.{name}}}}}"), value);
        }
        text
    };
    run["args"].as_array().unwrap().iter().map(resolve).collect()
}

/// Runs all tasks of the template, then its last step.
fn work_off(template: &Value, out: &Path, set: &[(&str, &str)]) {
    let (scene, out) = (courtyard(), out.to_str().unwrap());
    let set: Vec<(&str, &str)> = [("Input", scene.to_str().unwrap()), ("OutputDir", out)]
        .into_iter()
        .chain(set.iter().copied())
        .collect();
    for chunk in chunks(template) {
        buzz(command(template, 0, chunk, &set)).ok();
    }
    buzz(command(template, 1, "", &set)).ok();
}

#[test]
fn a_template_is_refused_whose_tasks_would_be() {
    let input = courtyard();
    let plan = |options: &str| {
        let arguments = ["plan", input.to_str().unwrap(), "--format", "openjd", "--"];
        buzz(arguments.into_iter().chain(options.split_whitespace()))
    };
    plan("--report r.json").refused(2, &["--report", "own report"]);
    plan("--aov nonsense").refused(2, &["nonsense"]);
    for nonsense in
        ["--stereo -1", "--name x", "--exposure nan", "--crop 1270,0,16,9", "--threads 0", "--memory lots"]
    {
        let option = nonsense.split(' ').next().unwrap();
        plan(nonsense).refused(2, &[option]);
    }
}

#[test]
fn tasks_have_the_options_that_the_plan_was_made_with() {
    let soft = "--light-samples 8 --ambient-samples 16";
    let [hard, planned] = ["", soft].map(|soft| plan(&courtyard(), &format!("{SMALL} {soft} --format json")));
    assert_ne!(hard["segments"], planned["segments"], "the plan depends on them");
    // A task's own plan is this one.
    let (_folder, out) = fresh();
    run(&courtyard(), &out, &format!("{SMALL} {soft} -f 0")).ok();
    assert_eq!(json(&out.join("report.0-0.json"))["plan"]["segments"], planned["segments"]);
    let template = plan(&courtyard(), &format!("{SMALL} {soft} --format openjd"));
    for step in 0..2 {
        let task = command(&template, step, "0-7", &[]).join(" ");
        assert!(task.contains("--light-samples=8 --ambient-samples=16"), "{task}");
    }
    for late in ["--light-samples 8", "--camera 0", "--segment 9", "--fps 25", "--plan p.json"] {
        let options = format!("plan {} --format openjd -- {late}", courtyard().display());
        buzz(options.split(' ')).refused(2, &[late.split(' ').next().unwrap(), "before the --"]);
    }
}

#[test]
fn a_template_has_a_task_for_each_segment_and_one_that_follows_on_all() {
    let template = plan(&courtyard(), &format!("{SMALL} --format openjd -- --aov all"));
    assert_eq!(template["specificationVersion"], "jobtemplate-2023-09");
    let segments = json(&reference().join("report.json"))["plan"]["segments"].clone();
    let borders = segments.as_array().unwrap().iter().map(|s| format!("{}-{}", s["first"], s["last"]));
    assert_eq!(chunks(&template), borders.collect::<Vec<_>>());
    assert_eq!(template["steps"][1]["dependencies"][0]["dependsOn"], template["steps"][0]["name"]);
    let names =
        template["parameterDefinitions"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap());
    assert_eq!(names.collect::<Vec<_>>(), ["Input", "OutputDir", "Quality", "Resolution", "Frames"]);
    let task = command(&template, 0, "0-7", &[("Quality", "full"), ("Frames", "1-20x2")]).join(" ");
    assert!(task.contains("--quality=full --resolution=96x54 --frames=0-7&1-20x2 --skip-existing"), "{task}");
    assert!(task.ends_with("--aov all"), "{task}");
}

#[test]
fn a_template_of_more_segments_than_a_parameter_may_have_values_groups_them() {
    let (folder, _) = fresh();
    let scene = Stage::drifting(1100).write(&folder.path().join("s.gltf"));
    let template = plan(&scene, "-r 16x9 -q full --format openjd");
    let chunks = chunks(&template);
    assert!((500..=1024).contains(&chunks.len()), "{}", chunks.len());
    assert_eq!((chunks[0], chunks[549]), ("0-1", "1098-1099"));
}

#[test]
fn the_tasks_give_the_whole_and_the_last_step_its_report() {
    let (_folder, out) = fresh();
    let template = plan(&courtyard(), &format!("{SMALL} -j 1 --format openjd"));
    work_off(&template, &out, &[]);
    assert_eq!(assert_same_bytes(&out, reference()), 96);
    assert_eq!(leftovers(&out), [""; 0]);

    let (merged, whole) = (json(&out.join("report.json")), json(&reference().join("report.json")));
    for key in ["pixels", "rays", "frames", "traced_frames", "inferred_frames", "hidden"] {
        assert_eq!(merged["totals"][key], whole["totals"][key], "{key}");
    }
    for key in ["plan", "scene", "settings_hash"] {
        assert_eq!(merged[key], whole[key], "{key}");
    }
    // Every part's times are in it, and its own.
    let parts: Vec<Value> =
        chunks(&template).iter().map(|c| json(&out.join(format!("report.{c}.json")))).collect();
    let runs = merged["runs"].as_array().unwrap();
    assert_eq!(runs.len(), parts.len() + 1);
    assert_eq!(runs.last().unwrap()["report"], "report.json");
    let seconds = |report: &Value, stage: &str| report["totals"]["seconds"][stage].as_f64().unwrap();
    for stage in ["infer", "trace", "enhance", "write"] {
        let sum: f64 = parts.iter().map(|p| seconds(p, stage)).sum();
        assert!(sum > 0.0 && (seconds(&merged, stage) - sum).abs() < 1e-3, "{stage}");
    }
    for stage in ["import", "accel", "plan", "wall"] {
        let own = runs.last().unwrap()["seconds"][stage].as_f64().unwrap();
        let sum: f64 = own + parts.iter().map(|p| seconds(p, stage)).sum::<f64>();
        assert!((seconds(&merged, stage) - sum).abs() < 1e-3, "{stage}");
    }
    let peaks = parts.iter().map(|p| p["totals"]["peak_bytes"].as_u64().unwrap());
    assert!(merged["totals"]["peak_bytes"].as_u64().unwrap() >= peaks.max().unwrap());
    for frame in merged["frames"].as_array().unwrap() {
        assert!(frame["seconds"]["enhance"].as_f64().unwrap() > 0.0 && frame["skipped"] == true, "{frame}");
    }
    assert!(fs::read_to_string(out.join("report.html")).unwrap().contains("runs added up"));
}

#[test]
fn tasks_may_be_repeated_and_what_one_left_out_is_made_up_for() {
    let (_folder, out) = fresh();
    let template = plan(&courtyard(), &format!("{SMALL} --format openjd"));
    let (scene, folder) = (courtyard(), out.to_str().unwrap().to_owned());
    let set = [("Input", scene.to_str().unwrap()), ("OutputDir", &folder), ("Frames", "0-70")];
    let first = chunks(&template)[0];
    let task = command(&template, 0, first, &set);
    buzz(&task).ok();
    let report = out.join(format!("report.{first}.json"));
    let before = json(&report);
    // A farm that lost track of a task runs it again: its frames' times are not forgotten.
    buzz(&task).ok();
    let after = json(&report);
    let traced = |report: &Value| report["totals"]["seconds"]["trace"].as_f64().unwrap();
    assert!(traced(&before) > 0.0 && (traced(&after) - traced(&before)).abs() < 1e-3);
    assert_eq!(after["runs"].as_array().unwrap().len(), 2);
    buzz(command(&template, 1, "", &set)).ok();
    assert_eq!(assert_same_bytes(&out, reference()), 71);
    assert_eq!(json(&out.join("report.0-70.json"))["totals"]["frames"], 71);
}

#[test]
fn a_task_of_which_no_frame_is_asked_for_does_nothing() {
    let (_folder, out) = fresh();
    let said = run(&courtyard(), &out, &format!("{SMALL} -f 60-95&0-20x5 --progress openjd")).ok();
    assert!(said.err.contains("nothing to do"), "{}", said.err);
    assert!(!out.exists());
    run(&courtyard(), &out, &format!("{SMALL} -f 0-31&20-40x10")).ok();
    assert_eq!(frames_in(&out), ["courtyard.0020.exr", "courtyard.0030.exr"]);
}

#[test]
fn progress_is_told_as_openjd_reads_it() {
    let (_folder, out) = fresh();
    let said = run(&courtyard(), &out, &format!("{SMALL} -f 0-3 --progress openjd")).ok().out;
    let progress: Vec<&str> = said.lines().filter_map(|l| l.strip_prefix("openjd_progress: ")).collect();
    assert_eq!(progress, ["25.0", "50.0", "75.0", "100.0"]);
    assert_eq!(said.lines().filter(|l| l.starts_with("openjd_status: frame ")).count(), 4);
}

#[test]
fn options_that_tasks_cannot_have_are_refused() {
    let scene = courtyard();
    let scene = scene.to_str().unwrap();
    for (options, part) in [
        ("--format openjd -- --no-such-option", "--no-such-option"),
        ("--format openjd -- --frames 1-2", "--frames"),
        ("--format openjd -- --overwrite", "--overwrite"),
        ("--format openjd -- --name {{x}}.%d.exr", "{{"),
        ("--format json -- --aov all", "--aov"),
        ("--workers 0", "--workers"),
        ("--workers many", "--workers"),
    ] {
        buzz(["plan", scene, "-r", "16x9"].into_iter().chain(options.split_whitespace())).refused(2, &[part]);
    }
}

#[test]
fn workers_share_the_frames_and_replay_one_plan() {
    let options = format!("{SMALL} --workers 3 --format");
    let planned = plan(&courtyard(), &format!("{options} json"));
    let shares = planned["shares"].as_array().unwrap();
    assert_eq!(shares.len(), 3);
    assert_eq!((&shares[0]["first"], &shares[2]["last"]), (&0.into(), &95.into()));
    let cost = |s: &Value| s["cost"].as_f64().unwrap();
    let alone = plan(&courtyard(), &format!("{SMALL} --format json"));
    let (work, dearest) = (cost(&alone["shares"][0]), shares.iter().map(cost).fold(0.0, f64::max));
    assert!((work / 3.0..work * 0.5).contains(&dearest), "{dearest} of {work}");
    let text = buzz(["plan", courtyard().to_str().unwrap(), "-r", "96x54", "--workers", "3"]).ok().out;
    assert_eq!(text.lines().filter(|l| l.starts_with("worker ")).count(), 3, "{text}");

    let template = plan(&courtyard(), &format!("{options} openjd"));
    let borders = shares.iter().map(|s| format!("{}-{}", s["first"], s["last"]));
    assert_eq!(chunks(&template), borders.collect::<Vec<_>>());
    let qualities = template["parameterDefinitions"][2]["allowedValues"].as_array().unwrap();
    assert!(qualities.contains(&"centred".into()) && !qualities.contains(&"full".into()));

    // One by one or at once, from the template's own copy of the plan or from a file of it.
    let (folder, out) = fresh();
    let whole = folder.path().join("whole");
    let files =
        [0, 1].map(|step| template["steps"][step]["script"]["embeddedFiles"][0]["data"].as_str().unwrap());
    assert_eq!(files[0], files[1]);
    let file = folder.path().join("plan.json");
    fs::write(&file, planned.to_string()).unwrap();
    run(&courtyard(), &whole, &format!("{SMALL} --plan {}", file.display())).ok();
    let report = json(&whole.join("report.json"));
    for key in ["keyframes", "segments", "cuts"] {
        assert_eq!(report["plan"][key], planned[key], "{key}");
    }
    fs::write(&file, files[0]).unwrap();
    let mut with_file = template.clone();
    for step in 0..2 {
        for argument in with_file["steps"][step]["script"]["actions"]["onRun"]["args"].as_array_mut().unwrap()
        {
            *argument =
                argument.as_str().unwrap().replace("{{Task.File.Plan}}", file.to_str().unwrap()).into();
        }
    }
    work_off(&with_file, &out, &[]);
    assert_eq!(assert_same_bytes(&out, &whole), 96);
}

#[test]
fn the_plan_that_is_made_anyway_gives_the_same_bytes_when_it_is_replayed() {
    let (folder, out) = fresh();
    let file = folder.path().join("plan.json");
    fs::write(&file, plan(&courtyard(), &format!("{SMALL} --format json")).to_string()).unwrap();
    run(&courtyard(), &out, &format!("{SMALL} -f 16-40 --plan {}", file.display())).ok();
    assert_eq!(assert_same_bytes(&out, reference()), 25);
}

#[test]
fn a_plan_that_does_not_fit_is_refused() {
    let (folder, out) = fresh();
    let path = |name: &str| folder.path().join(name);
    let mut stage = Stage::drifting(12);
    let place = |i: i32| [0.2 * (i.clamp(4, 8) - 4) as f32, 0.0, 0.0];
    stage.translate(CARD, &(0..12).map(place).collect::<Vec<_>>());
    let scene = stage.write(&path("s.gltf"));
    let good = plan(&scene, "-r 32x18 --segment 5 --format json");
    let attempt = |name: &str, change: &dyn Fn(&mut Value)| -> PathBuf {
        let mut changed = good.clone();
        change(&mut changed);
        fs::write(path(name), changed.to_string()).unwrap();
        path(name)
    };
    let refused = |file: &Path, options: &str, code: i32, parts: &[&str]| {
        run(&scene, &out, &format!("-r 32x18 {options} --plan {}", file.display())).refused(code, parts);
    };
    refused(&path("none.json"), "", 3, &["none.json", "there is no such file"]);
    fs::write(path("broken.json"), "{\"schema\": \"buzz-plan/1\",\n 7}").unwrap();
    refused(&path("broken.json"), "", 3, &["broken.json: line 2", "plan --format json"]);
    let next = attempt("next.json", &|p| p["schema"] = "buzz-plan/2".into());
    refused(&next, "", 3, &["/schema", "buzz-plan/1"]);
    let short = attempt("short.json", &|p| {
        p["segments"].as_array_mut().unwrap().pop();
        p["keyframes"].as_array_mut().unwrap().pop();
    });
    refused(&short, "", 3, &["/segments", "no segment holds frame"]);
    let gap = attempt("gap.json", &|p| {
        p["segments"].as_array_mut().unwrap().remove(0);
        p["keyframes"].as_array_mut().unwrap().remove(0);
    });
    refused(&gap, "", 3, &["/segments", "frame 0, which is next"]);
    for (name, key, first, last) in [
        ("long", 0, 0, 99),
        ("back", 0, 5, 4),
        ("far", 0, i64::MAX, i64::MAX),
        ("low", i64::MIN, i64::MIN, 0),
    ] {
        let file = attempt(&format!("{name}.json"), &|p| {
            p["segments"] = serde_json::json!([{"key": key, "first": first, "last": last}]);
            p["keyframes"] = serde_json::json!([{"frame": key, "reason": "first"}]);
        });
        refused(&file, "", 3, &["/segments", "is next"]);
    }
    let keyless = attempt("keyless.json", &|p| p["segments"][0]["key"] = 11.into());
    refused(&keyless, "", 3, &["/keyframes/0"]);
    let unknown = attempt("reason.json", &|p| p["keyframes"][1]["reason"] = "whim".into());
    refused(&unknown, "", 3, &["/keyframes/1", "reasons"]);
    let second = good["segments"][1]["first"].as_i64().unwrap();
    for (name, cuts, place) in [
        ("within", vec![2], "/cuts/0"),
        ("outside", vec![second, 900], "/cuts/1"),
        ("twice", vec![second, second], "/cuts/1"),
        ("turned", vec![second, 0], "/cuts/1"),
    ] {
        let file = attempt(&format!("{name}.json"), &|p| p["cuts"] = serde_json::json!(cuts));
        refused(&file, "", 3, &[place, &cuts[cuts.len() - 1].to_string(), "segment"]);
    }
    let rate = attempt("rate.json", &|p| p["fps"] = serde_json::json!([25, 1]));
    refused(&rate, "", 3, &["/fps", "25/1", "24/1"]);
    let as_made = attempt("good.json", &|_| ());
    refused(&as_made, "-q full", 2, &["--plan", "full"]);
    refused(&as_made, "--segment 4", 2, &["--plan", "--segment"]);
    assert_eq!(listing(&out).iter().filter(|n| !n.starts_with('.')).count(), 0);
    run(&scene, &out, &format!("-r 32x18 --plan {}", as_made.display())).ok();
}

/// What a refusal says that rendering would take, in MiB. The pictures alone are allowed.
fn estimate(scene: &Path, out: &Path, options: &str) -> f64 {
    let refused = run(scene, out, &format!("{options} --memory 12MiB --skip-existing"));
    let err = refused.err.clone();
    refused.refused(2, &["--memory", "over the 12 MiB allowed"]);
    let (_, after) = err.split_once("estimated to take ").unwrap();
    after.split(' ').next().unwrap().parse().unwrap()
}

/// The factor is that of `docs/farm.md`.
#[cfg(target_os = "linux")]
#[test]
fn memory_is_estimated_from_above_and_within_a_factor() {
    const FACTOR: f64 = 4.0;
    let scenes = courtyard().parent().unwrap().parent().unwrap().to_path_buf();
    for (name, options) in [
        ("courtyard", "-r 960x540 -f 0-3"),
        ("courtyard", "-r 960x540 -f 0-3 --aov all -j 1 --compression none"),
        ("courtyard", "-r 32x18 -f 0-3"),
        ("gallery", "-r 640x360 -f 0-2 --compression piz"),
        ("buzz-city", "-r 960x540 -f 30-33"),
        ("stage", "-r 960x540 -f 32-33 --aov all"),
        ("stage", "-r 960x540 -f 32-33 --aov all -q full"),
    ] {
        let (_folder, out) = fresh();
        let scene = scenes.join(name).join(format!("{name}.gltf"));
        let estimate = estimate(&scene, &out, options);
        assert_eq!(frames_in(&out), [""; 0], "nothing was rendered");
        let enough = (estimate * 1.1) as u64 + 1;
        run(&scene, &out, &format!("{options} --memory {enough}MiB")).ok();
        let report =
            listing(&out).into_iter().find(|n| n.starts_with("report.") && n.ends_with(".json")).unwrap();
        let peak = json(&out.join(report))["totals"]["peak_bytes"].as_f64().unwrap() / f64::from(1 << 20);
        println!("{name} {options}: estimated {estimate} MiB, peak {peak:.0} MiB");
        assert!(peak <= estimate && estimate <= FACTOR * peak, "{name} {options}: {estimate} for {peak} MiB");
    }
}
