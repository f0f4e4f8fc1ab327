//! `buzz-convert plan`: what would be rendered, and why.

use super::args::{PlanArgs, PlanFormat};
use super::job::{Job, warn_of_ignored};
use super::plan_file::PlanFile;
use super::{memory, openjd, say};
use anyhow::Result;
use buzz::error::Error;
use buzz::frame::FrameKind;
use buzz::plan::Plan;
use buzz::scene::Projection;
use buzz::sequence::Unwatched;
use serde_json::{Value, json};
use std::process::ExitCode;

pub fn run(args: PlanArgs) -> Result<ExitCode> {
    if !args.convert.is_empty() && args.format != PlanFormat::Openjd {
        let message =
            format!("{}: a plan takes it only for the tasks of --format openjd", args.convert.join(" "));
        return Err(Error::Usage(message).into());
    }
    let mut job = Job::new(&args.input, &args.scene, &args.image.render, args.image.quality, None)?;
    warn_of_ignored(&job.scene);
    memory::refuse_planning_over(None, &job)?;
    let plan = job.plan(args.workers as usize, &Unwatched)?;
    say::result(&match args.format {
        PlanFormat::Json => serde_json::to_string_pretty(&as_json(&job, &plan)?)? + "\n",
        PlanFormat::Openjd => serde_json::to_string_pretty(&openjd::template(&args, &job, &plan)?)? + "\n",
        PlanFormat::Text => as_text(&plan),
    })?;
    Ok(ExitCode::SUCCESS)
}

fn as_json(job: &Job, plan: &Plan) -> Result<Value> {
    let mut value = serde_json::to_value(PlanFile::new(plan, job.scene.timing.fps))?;
    value["frames"] = plan.frames.iter().map(|f| frame_as_json(job, f)).collect();
    value["shares"] =
        plan.shares.iter().map(|s| json!({"first": s.first, "last": s.last, "cost": s.cost})).collect();
    Ok(value)
}

fn frame_as_json(job: &Job, planned: &buzz::plan::PlannedFrame) -> Value {
    let scene = &job.scene;
    let time = scene.timing.time_of(planned.frame);
    let pose = scene.pose(time);
    let camera = scene.camera_at(planned.frame, job.settings.camera);
    let view = scene.view(&pose, camera, job.settings.width, job.settings.height);
    // glTF's camera looks along -Z, so the third column is where it looks away from.
    let columns =
        [view.right.extend(0.0), view.up.extend(0.0), (-view.forward).extend(0.0), view.eye.extend(1.0)];
    let matrix: Vec<f64> = columns.iter().flat_map(|c| c.to_array()).collect();
    let (yfov, ymag) = match view.lens.projection {
        Projection::Perspective { yfov } => (Some(yfov), None),
        Projection::Orthographic { ymag, .. } => (None, Some(ymag)),
    };
    let (kind, from) = match planned.kind {
        FrameKind::Traced => ("traced", None),
        FrameKind::Inferred { from } => ("inferred", Some(from)),
    };
    json!({
        "frame": planned.frame, "time": time, "camera": scene.cameras[camera].name, "world_from_camera": matrix,
        "yfov": yfov, "ymag": ymag, "shift": [view.lens.shift.x, view.lens.shift.y],
        "kind": kind, "from": from, "predicted_traced": planned.predicted_traced,
    })
}

fn as_text(plan: &Plan) -> String {
    let mut text = String::new();
    for (segment, key) in plan.segments.iter().zip(&plan.keyframes) {
        let frames: Vec<_> =
            plan.frames.iter().filter(|f| (segment.first..=segment.last).contains(&f.frame)).collect();
        let traced: f64 = frames.iter().map(|f| f.predicted_traced).sum::<f64>() / frames.len().max(1) as f64;
        text += &format!(
            "frames {:>5}-{:<5} key {:>5} ({}), {:.0} % of pixels traced, predicted\n",
            segment.first,
            segment.last,
            key.frame,
            key.reason.name(),
            traced * 100.0
        );
    }
    if let [_, _, ..] = plan.shares.as_slice() {
        for (i, share) in plan.shares.iter().enumerate() {
            text += &format!(
                "worker {}: frames {}-{}, the work of {:.1} frames traced in full, predicted\n",
                i + 1,
                share.first,
                share.last,
                share.cost
            );
        }
    }
    let traced: f64 = plan.frames.iter().map(|f| f.predicted_traced).sum();
    text += &format!(
        "{}, {}, {}; {:.0} % of camera rays saved, predicted\n",
        say::count(plan.frames.len(), "frame"),
        say::count(plan.keyframes.len(), "key frame"),
        say::count(plan.cuts.len(), "cut"),
        100.0 * (1.0 - traced / plan.frames.len().max(1) as f64)
    );
    text
}
