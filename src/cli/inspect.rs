//! `buzz-convert inspect`: what the scene holds, what it requires, what will be ignored.

use super::args::{Format, InspectArgs};
use super::job;
use super::memory::held_per_pixel;
use super::say::{self, count, escaped};
use anyhow::Result;
use buzz::infer::BuzzBuffer;
use buzz::scene::{
    Ignored, Interpolation, Light, LightKind, Outline, Projection, Requirements, Scene, Target,
};
use buzz::sequence::Settings;
use buzz::trace::{TraceOptions, lit_words};
use serde_json::{Value, json};
use std::process::ExitCode;

pub fn run(args: InspectArgs) -> Result<ExitCode> {
    let (scene, camera) = job::read(&args.input, &args.scene, None)?;
    say::result(&match args.format {
        Format::Json => serde_json::to_string_pretty(&as_json(&scene, camera))? + "\n",
        Format::Text => as_text(&scene, camera),
    })?;
    Ok(ExitCode::SUCCESS)
}

fn as_json(scene: &Scene, camera: Option<usize>) -> Value {
    let needs = Requirements::of(scene);
    let cameras = scene.cameras.iter().map(|c| match c.lens.projection {
        Projection::Perspective { yfov } => json!({"name": c.name, "type": "perspective", "yfov": yfov}),
        Projection::Orthographic { ymag, .. } => {
            json!({"name": c.name, "type": "orthographic", "ymag": ymag})
        }
    });
    let lights =
        scene.lights.iter().map(|l| json!({"name": l.name, "type": light_kind(l), "size": light_size(l)}));
    let animations = scene.channels.iter().map(|c| {
        let (property, of) = target(scene, c.target);
        json!({"property": property, "of": of, "keys": c.curve.times.len(), "interpolation": interpolation(c.curve.interpolation)})
    });
    let ignored =
        scene.ignored.iter().map(|i| json!({"feature": i.feature, "where": i.place, "effect": i.effect}));
    let timing = &scene.timing;
    json!({
        "schema": "buzz-scene/1",
        "triangles": scene.triangle_count(),
        "shapes": scene.shape_count(),
        "instances": scene.instances.len(),
        "cameras": cameras.collect::<Vec<_>>(),
        "lights": lights.collect::<Vec<_>>(),
        "animations": animations.collect::<Vec<_>>(),
        "requires": needs.names(),
        "ignored": ignored.collect::<Vec<_>>(),
        "bytes_per_pixel": bytes_per_pixel(scene),
        "held_bytes_per_pixel": held_bytes_per_pixel(scene),
        "stages": needs.stages(),
        "fps": [timing.fps.numerator, timing.fps.denominator],
        "frames": [timing.first, timing.last],
        "resolution": timing.resolution,
        "camera": camera,
    })
}

fn as_text(scene: &Scene, chosen: Option<usize>) -> String {
    let needs = Requirements::of(scene);
    let timing = &scene.timing;
    let mut text = format!(
        "{} and {} in {}, {}, {}, {}, {}\n",
        count(scene.triangle_count(), "triangle"),
        count(scene.shape_count(), "shape"),
        count(scene.instances.len(), "instance"),
        count(scene.materials.len(), "material"),
        count(scene.images.len(), "image"),
        count(scene.lights.len(), "light"),
        count(scene.cameras.len(), "camera")
    );
    text += &format!("frames {}-{} at {:.3} a second\n", timing.first, timing.last, timing.fps.value());
    for (i, camera) in scene.cameras.iter().enumerate() {
        let mark = if chosen == Some(i) { " (chosen)" } else { "" };
        text += &format!("camera {i}: {}{mark}\n", escaped(&camera.name));
    }
    for light in &scene.lights {
        let size: Vec<String> = light_size(light).iter().map(f32::to_string).collect();
        let size = if size.is_empty() { String::new() } else { format!(" {}", size.join(" x ")) };
        text += &format!("light: {} ({}{size})\n", escaped(&light.name), light_kind(light));
    }
    if scene.is_dark() {
        text += "nothing in it shines: all is black\n";
    }
    let names = needs.names();
    let names = if names.is_empty() { "nothing special".into() } else { names.join(", ") };
    text += &format!("requires: {names}\nstages: {}\n", needs.stages().join(", "));
    text += &format!(
        "bytes a pixel: {} in a Buzzbuffer, {} in all while frames are inferred\n",
        bytes_per_pixel(scene),
        held_bytes_per_pixel(scene)
    );
    if scene.ignored.is_empty() {
        text += "ignored: nothing\n";
    }
    for ignored in &scene.ignored {
        let Ignored { feature, place, effect } = ignored;
        text += &format!("ignored: {}\n", escaped(format_args!("{feature} at {place}: {effect}")));
    }
    text
}

/// As it is rendered by default; several shadow rays a light and rays to the world take more.
fn bytes_per_pixel(scene: &Scene) -> usize {
    BuzzBuffer::bytes_per_pixel(lit_words(scene, TraceOptions::default()))
}

fn held_bytes_per_pixel(scene: &Scene) -> usize {
    // Any size will do: it is said for one pixel.
    held_per_pixel(scene, &Settings::new(1, 1))
}

fn light_kind(light: &Light) -> &'static str {
    match light.kind {
        LightKind::Point => "point",
        LightKind::Spot { .. } => "spot",
        LightKind::Directional => "directional",
        LightKind::Area { outline: Outline::Rectangle, .. } => "rectangle",
        LightKind::Area { outline: Outline::Ellipse, .. } => "ellipse",
    }
}

/// Radius, angle, or width and height; nothing for a light without size.
fn light_size(light: &Light) -> Vec<f32> {
    match light.kind {
        LightKind::Area { size, .. } => size.to_array().to_vec(),
        _ if light.size > 0.0 => vec![light.size],
        _ => Vec::new(),
    }
}

fn interpolation(interpolation: Interpolation) -> &'static str {
    match interpolation {
        Interpolation::Linear => "LINEAR",
        Interpolation::Step => "STEP",
        Interpolation::CubicSpline => "CUBICSPLINE",
    }
}

/// A property's name, and the name of what has it.
fn target(scene: &Scene, target: Target) -> (&'static str, &str) {
    let node = |n: usize| scene.nodes[n].name.as_str();
    let camera = |c: usize| scene.cameras[c].name.as_str();
    let light = |l: usize| scene.lights[l].name.as_str();
    match target {
        Target::Translation(n) => ("translation", node(n)),
        Target::Rotation(n) => ("rotation", node(n)),
        Target::Scale(n) => ("scale", node(n)),
        Target::Weights(n) => ("weights", node(n)),
        Target::Visible(n) => ("visible", node(n)),
        Target::CameraYfov(c) => ("yfov", camera(c)),
        Target::CameraXmag(c) => ("xmag", camera(c)),
        Target::CameraYmag(c) => ("ymag", camera(c)),
        Target::CameraNear(c) => ("znear", camera(c)),
        Target::CameraFar(c) => ("zfar", camera(c)),
        Target::CameraShift(c) => ("shift", camera(c)),
        Target::LightColor(l) => ("color", light(l)),
        Target::LightIntensity(l) => ("intensity", light(l)),
        Target::LightRange(l) => ("range", light(l)),
        Target::LightInnerCone(l) => ("innerConeAngle", light(l)),
        Target::LightOuterCone(l) => ("outerConeAngle", light(l)),
        Target::LightSize(l) => ("size", light(l)),
        Target::LightArea(l) => ("area", light(l)),
    }
}
