//! `plan --format openjd`: the plan as an Open Job Description template (specification 2023-09).
//!
//! Two steps. `Render` has a task for each segment, or for each worker's share of a plan for several: no frame is
//! rendered twice, and none is inferred in one task only because another one needs it. `Merge` runs when all of them are
//! done. It is the same command over all frames: it reads every file and checks it, renders what is missing, and writes
//! the report of the whole, in which the tasks' own reports are put together.

use super::args::{Cli, ConvertArgs, PlanArgs, QualityArg};
use super::convert::choose_image;
use super::job::{Job, stem};
use super::plan_file::PlanFile;
use super::{one_line, parse};
use anyhow::Result;
use buzz::error::Error;
use buzz::output::NamePattern;
use buzz::plan::{Plan, Segment, Share};
use clap::parser::ValueSource;
use clap::{CommandFactory, Parser, ValueEnum};
use serde_json::{Value, json};

/// Most values that the specification lets a task parameter have.
const MOST_TASKS: usize = 1024;

/// Longest name of a job.
const LONGEST_NAME: usize = 128;

/// Seconds between the request to stop and the end by force. Stopping takes less than one.
const NOTICE: u32 = 5;

/// The template of a job that renders `plan`.
pub fn template(args: &PlanArgs, job: &Job, plan: &Plan) -> Result<Value> {
    refuse_another_plan(&args.convert)?;
    let parameters = parameters(args, job, plan);
    let options = options(args);
    let step = |frames: &str| {
        let mut command = vec!["{{Param.Input}}", "{{Param.OutputDir}}", "--quality={{Param.Quality}}"];
        let frames = format!("--frames={frames}");
        command.extend([
            "--resolution={{Param.Resolution}}",
            &frames,
            "--skip-existing",
            "--progress=openjd",
        ]);
        let command: Vec<String> =
            command.into_iter().map(String::from).chain(options.iter().cloned()).collect();
        check(&command, &parameters, job)?;
        script(command, args, job, plan)
    };
    let chunks: Vec<String> = chunks(plan, args.workers).iter().map(|(a, b)| format!("{a}-{b}")).collect();
    let name = format!("Buzz {}", stem(&args.input)).replace(['{', '}'], "");
    Ok(json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": name.chars().filter(|c| !c.is_control()).take(LONGEST_NAME).collect::<String>(),
        "parameterDefinitions": parameters,
        "steps": [
            {
                "name": "Render",
                "parameterSpace": {
                    "taskParameterDefinitions": [{"name": "Chunk", "type": "STRING", "range": chunks}],
                },
                "script": step("{{Task.Param.Chunk}}&{{Param.Frames}}")?,
            },
            {
                "name": "Merge",
                "dependencies": [{"dependsOn": "Render"}],
                "script": step("{{Param.Frames}}")?,
            },
        ],
    }))
}

/// First and last frames of the tasks.
fn chunks(plan: &Plan, workers: u32) -> Vec<(i64, i64)> {
    if workers > 1 {
        return plan.shares.iter().map(|&Share { first, last, .. }| (first, last)).collect();
    }
    let segments = plan.segments.chunks(plan.segments.len().div_ceil(MOST_TASKS).max(1));
    let ends = |group: &[Segment]| Some((group.first()?.first, group.last()?.last));
    segments.filter_map(ends).collect()
}

fn parameters(args: &PlanArgs, job: &Job, plan: &Plan) -> Vec<Value> {
    let file = |name: &str, description: &str| json!({"name": name, "type": "PATH", "objectType": "FILE", "dataFlow": "IN", "description": description});
    let text = |name: &str, default: String, description: &str| json!({"name": name, "type": "STRING", "default": default, "description": description});
    let (first, last) =
        (plan.frames.first().map_or(0, |f| f.frame), plan.frames.last().map_or(0, |f| f.frame));
    let size = format!("{}x{}", job.settings.width, job.settings.height);
    let mut quality =
        text("Quality", name_of(args.image.quality), "Accuracy of the frames that are not key frames.");
    // A plan that is replayed says which frames are inferred; only one that infers none fits full.
    let fits = |q: &QualityArg| {
        args.workers == 1 || (*q == QualityArg::Full) == (args.image.quality == QualityArg::Full)
    };
    quality["allowedValues"] =
        QualityArg::value_variants().iter().filter(|q| fits(q)).map(|&q| name_of(q)).collect();
    let mut all = vec![
        file("Input", "The scene: .gltf, .glb or .obj. Files that it refers to are read from where it says."),
        json!({
            "name": "OutputDir", "type": "PATH", "objectType": "DIRECTORY", "dataFlow": "OUT",
            "description": "Folder for the frames and reports; all tasks share it.",
        }),
        quality,
        text("Resolution", size, "Image size: 1920x1080, or a share of the scene's own: 50%."),
        text("Frames", format!("{first}-{last}"), "Frames to render: 1-100, 1-100x2, 1-10,20-30."),
    ];
    if args.scene.camera_from.is_some() {
        all.push(file("CameraFrom", "The glTF that cameras, lights and animation are taken from."));
    }
    for number in 1..=args.scene.geometry.len() {
        all.push(file(&format!("Geometry{number}"), "Static geometry: an OBJ file."));
    }
    all
}

fn name_of(quality: QualityArg) -> String {
    quality.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// What was asked of the plan, as options of a task.
fn options(args: &PlanArgs) -> Vec<String> {
    let (scene, image) = (&args.scene, &args.image);
    let mut all = Vec::new();
    let mut add = |name: &str, value: Option<String>| all.extend(value.map(|v| format!("--{name}={v}")));
    add("fps", scene.fps.clone());
    add("camera", scene.camera.clone());
    add("start-frame", scene.start_frame.map(|n| n.to_string()));
    add("turntable", scene.turntable.map(|n| n.to_string()));
    add("camera-from", scene.camera_from.as_ref().map(|_| "{{Param.CameraFrom}}".into()));
    for number in 1..=scene.geometry.len() {
        add("geometry", Some(format!("{{{{Param.Geometry{number}}}}}")));
    }
    add("light-samples", Some(image.render.light_samples.to_string()).filter(|n| n != "1"));
    add("ambient-samples", Some(image.render.ambient_samples.to_string()).filter(|n| n != "0"));
    add("threads", image.render.threads.map(|n| n.to_string()));
    if args.workers > 1 {
        // The other machines cannot know for how many it is; without this, each makes the same plan for itself.
        add("plan", Some("{{Task.File.Plan}}".into()));
    } else {
        add("segment", Some(image.render.segment.clone()).filter(|s| s != "auto"));
    }
    all.extend(scene.strict.then(|| "--strict".into()));
    all.extend(args.convert.iter().cloned());
    all
}

/// Options on which the plan depends, so that the tasks must have those that it was made with.
const OF_THE_PLAN: [&str; 10] = [
    "fps",
    "camera",
    "start_frame",
    "turntable",
    "geometry",
    "camera_from",
    "light_samples",
    "ambient_samples",
    "segment",
    "plan",
];

/// An error if an option of the tasks would change the plan.
fn refuse_another_plan(convert: &[String]) -> Result<()> {
    let task =
        ["buzz-convert", "input", "folder"].map(String::from).into_iter().chain(convert.iter().cloned());
    let given = Cli::command().try_get_matches_from(task).map_err(unparsed)?;
    match OF_THE_PLAN.iter().find(|option| given.value_source(option) == Some(ValueSource::CommandLine)) {
        Some(option) => {
            let message =
                format!("--{}: the plan depends on it; give it before the --", option.replace('_', "-"));
            Err(Error::Usage(message).into())
        }
        None => Ok(()),
    }
}

fn unparsed(error: clap::Error) -> Error {
    Error::Usage(one_line(&error.to_string(), ""))
}

/// An error if a task could not run its command, or would not run it as it stands here.
fn check(command: &[String], parameters: &[Value], job: &Job) -> Result<()> {
    let value = |argument: &String| {
        let mut resolved = argument.clone();
        for parameter in parameters {
            let name = parameter["name"].as_str().unwrap_or_default();
            let default = parameter["default"].as_str().unwrap_or("file");
            resolved = resolved.replace(&format!("{{{{Param.{name}}}}}"), default);
        }
        resolved.replace("{{Task.Param.Chunk}}", "1-1").replace("{{Task.File.Plan}}", "file")
    };
    let resolved: Vec<String> = command.iter().map(value).collect();
    if let Some(argument) = resolved.iter().find(|a| a.contains("{{") || a.contains(|c: char| c.is_control()))
    {
        let message = format!("{argument:?}: templates cannot hold {{{{ or control characters");
        return Err(Error::Usage(message).into());
    }
    let parsed = Cli::try_parse_from(std::iter::once("buzz-convert".to_owned()).chain(resolved));
    let ConvertArgs { image, output, .. } = parsed.map_err(unparsed)?.convert;
    if output.report.is_some() {
        return Err(Error::Usage("--report: each task writes its own report; leave it out".into()).into());
    }
    // What a task would find out before it renders.
    parse::threads(image.render.threads)?;
    choose_image(&mut job.settings.clone(), &job.scene, &output)?;
    output.memory.as_deref().map(parse::memory).transpose()?;
    NamePattern::parse(output.name.as_deref().unwrap_or(NamePattern::DEFAULT), "shot")?;
    Ok(())
}

fn script(command: Vec<String>, args: &PlanArgs, job: &Job, plan: &Plan) -> Result<Value> {
    let run = json!({
        "command": "buzz-convert",
        "args": command,
        "cancelation": {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": NOTICE},
    });
    let mut script = json!({"actions": {"onRun": run}});
    if args.workers > 1 {
        let data = serde_json::to_string(&PlanFile::new(plan, job.scene.timing.fps))?;
        script["embeddedFiles"] =
            json!([{"name": "Plan", "type": "TEXT", "filename": "plan.json", "data": data}]);
    }
    Ok(script)
}
