//! Animations: all of them play together, as one list of channels.

use super::{
    accessor::{Accessors, Integers},
    document::Element,
    ignored::Notes,
    light_camera::{LUMENS_PER_WATT, OnNodes},
    nodes::Nodes,
};
use crate::{
    Result,
    scene::{Camera, Channel, Curve, Interpolation, Light, LocalTransform, Node, Target},
};
use std::collections::HashMap;

/// What channels may aim at.
pub(super) struct Targets<'a> {
    pub nodes: &'a mut Nodes,
    pub cameras: &'a OnNodes<Camera>,
    pub lights: &'a OnNodes<Light>,
}

/// The channels, and when they have keys.
#[derive(Default)]
pub(super) struct Animations {
    pub channels: Vec<Channel>,
    /// Seconds of the earliest and the latest key.
    pub range: Option<(f32, f32)>,
}

/// What a channel's target is made of.
struct Aim {
    targets: Vec<Target>,
    /// Numbers of a value.
    width: usize,
}

/// Reads all animations.
pub(super) fn read(accessors: Accessors, targets: Targets, notes: &Notes) -> Result<Animations> {
    let mut out = Animations::default();
    let mut taken: HashMap<Target, usize> = HashMap::new();
    for animation in accessors.document.elements("animations")? {
        let samplers = animation.items("samplers")?;
        for channel in animation.items("channels")? {
            let index = channel.required_index("sampler")?;
            let sampler = samplers.get(index).ok_or_else(|| {
                channel.error(format!("there is no sampler {index} in the animation; export the file again"))
            })?;
            let input = sampler.required_index("input")?;
            let times =
                accessors.numbers(input, &sampler.place_of("input"), &[1], Integers::AsDeclared)?.values;
            for &time in times.iter().filter(|t| t.is_finite()) {
                let (first, last) = out.range.unwrap_or((time, time));
                out.range = Some((first.min(time), last.max(time)));
            }
            let Some(target) = channel.get("target") else {
                return Err(channel.error("`target` is missing; export the file again"));
            };
            let Some(aim) = aim(&target, &targets, notes)? else { continue };
            let Some(curve) = curve(accessors, sampler, times, &aim, notes)? else { continue };
            for (i, &target) in aim.targets.iter().enumerate() {
                // The first is what was read; a camera on many nodes has a copy for each.
                let copied = if i == 0 { 0 } else { curve.values.len() * 4 + size_of::<Channel>() };
                accessors.buffers.budget.take(copied, 1, |message| sampler.error(message))?;
                make_animatable(&mut targets.nodes.nodes, target);
                let new = Channel { target, curve: fit(target, &curve) };
                match taken.get(&target) {
                    Some(&old) => {
                        notes.add(
                            "several animations of one property",
                            channel.place.clone(),
                            "the last one is used",
                        );
                        out.channels[old] = new;
                    }
                    None => {
                        taken.insert(target, out.channels.len());
                        out.channels.push(new);
                    }
                }
            }
        }
    }
    Ok(out)
}

/// What a channel moves; none, and noted, if that is nothing we render.
fn aim(target: &Element, targets: &Targets, notes: &Notes) -> Result<Option<Aim>> {
    let path = target.text("path")?.unwrap_or_default();
    if path == "pointer" {
        let extension = target.extension("KHR_animation_pointer");
        let Some(pointer) = extension.as_ref().map(|e| e.text("pointer")).transpose()?.flatten() else {
            return Err(target.error("a pointer animation without a pointer; export the file again"));
        };
        return Ok(pointer_aim(pointer, target, targets, notes));
    }
    // note: a channel without a node is legal and means nothing (glTF 2.0, 3.11).
    let Some(node) = target.index("node")? else { return Ok(None) };
    let Some(&node) = targets.nodes.scene_node.get(node) else {
        return Err(target.error(format!("there is no node {node}; export the file again")));
    };
    let aim = node_aim(path, node, targets);
    if aim.is_none() && path != "weights" {
        notes.add(format!("animation of {path}"), target.place.clone(), "it stays as it is at rest");
    }
    Ok(aim)
}

fn node_aim(path: &str, node: usize, targets: &Targets) -> Option<Aim> {
    let (target, width) = match path {
        "translation" => (Target::Translation(node), 3),
        "rotation" => (Target::Rotation(node), 4),
        "scale" => (Target::Scale(node), 3),
        "weights" => (Target::Weights(node), targets.nodes.nodes.get(node)?.weights.len()),
        _ => return None,
    };
    (width > 0).then(|| Aim { targets: vec![target], width })
}

/// What a `KHR_animation_pointer` moves.
fn pointer_aim(pointer: &str, element: &Element, targets: &Targets, notes: &Notes) -> Option<Aim> {
    // Blender's exporter writes `spot.innerConeAngle` where it means `spot/innerConeAngle`.
    let pointer = pointer.replace("/spot.", "/spot/");
    let parts: Vec<&str> = pointer.split('/').skip(1).collect();
    let each = |sources: &[usize], source: &str, make: fn(usize) -> Target, width| {
        let source: usize = source.parse().ok()?;
        let users = sources.iter().enumerate().filter(|(_, s)| **s == source);
        Some(Aim { targets: users.map(|(i, _)| make(i)).collect(), width })
    };
    let camera = |source, make| each(&targets.cameras.sources, source, make, 1);
    // A file may animate both lenses of a camera, which has one.
    let has_lens = |source: &str, kind: &str| {
        let source = source.parse::<usize>().ok();
        let mut users = targets.cameras.sources.iter().zip(&targets.cameras.items);
        users.all(|(s, camera)| Some(*s) != source || camera.lens.projection.name() == kind)
            && matches!(kind, "perspective" | "orthographic")
    };
    let light = |source, make, width| each(&targets.lights.sources, source, make, width);
    let node = |index: &str| targets.nodes.scene_node.get(index.parse::<usize>().ok()?).copied();
    let aim = match parts.as_slice() {
        ["nodes", index, "extensions", "KHR_node_visibility", "visible"] => {
            node(index).map(|node| Aim { targets: vec![Target::Visible(node)], width: 1 })
        }
        ["nodes", index, path] => node(index).and_then(|node| node_aim(path, node, targets)),
        ["cameras", index, kind, property] if has_lens(index, kind) => match (*kind, *property) {
            ("perspective", "yfov") => camera(index, Target::CameraYfov),
            ("orthographic", "xmag") => camera(index, Target::CameraXmag),
            ("orthographic", "ymag") => camera(index, Target::CameraYmag),
            (_, "znear") => camera(index, Target::CameraNear),
            (_, "zfar") => camera(index, Target::CameraFar),
            _ => None,
        },
        ["cameras", index, "extras", "shift"] => {
            each(&targets.cameras.sources, index, Target::CameraShift, 2)
        }
        ["extensions", "KHR_lights_punctual", "lights", index, rest @ ..] => match rest {
            ["color"] => light(index, Target::LightColor, 3),
            ["intensity"] => light(index, Target::LightIntensity, 1),
            ["range"] => light(index, Target::LightRange, 1),
            ["spot", "innerConeAngle"] => light(index, Target::LightInnerCone, 1),
            ["spot", "outerConeAngle"] => light(index, Target::LightOuterCone, 1),
            ["extras", "radius" | "angle"] => light(index, Target::LightSize, 1),
            ["extras", "area", "size"] => light(index, Target::LightArea, 2),
            _ => None,
        },
        _ => None,
    };
    if aim.is_none() {
        // The place says which; each kind is noted once.
        let kind: Vec<&str> =
            pointer.split('/').map(|p| if p.parse::<u32>().is_ok() { "*" } else { p }).collect();
        let feature = format!("animation of {}", kind.join("/"));
        notes.add(feature, element.place.clone(), "it stays as it is at rest");
    }
    if aim.as_ref().is_some_and(|aim| aim.targets.is_empty()) {
        notes.add("animation of what is not in the scene", element.place.clone(), "it moves nothing");
        return None;
    }
    aim
}

/// Reads a sampler's values and drops keys that cannot be used; none if no key is left.
fn curve(
    accessors: Accessors,
    sampler: &Element,
    times: Vec<f32>,
    aim: &Aim,
    notes: &Notes,
) -> Result<Option<Curve>> {
    let place = sampler.place_of("output");
    let rotation = matches!(aim.targets[0], Target::Rotation(_));
    let weights = matches!(aim.targets[0], Target::Weights(_));
    let interpolation = match sampler.text("interpolation")? {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::CubicSpline,
        Some(other) => {
            return Err(sampler.error(format!("unknown interpolation {other}; export the file again")));
        }
    };
    let integers = if rotation || weights { Integers::Normalized } else { Integers::AsDeclared };
    let widths = if weights { &[1][..] } else { &[aim.width] };
    let values = accessors.numbers(sampler.required_index("output")?, &place, widths, integers)?.values;
    let each = aim.width * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    // Nor more: which of them belong to which key is anyone's guess.
    if values.len() != times.len().saturating_mul(each) {
        let message =
            format!("{} values for {} keys of {each} each; export the file again", values.len(), times.len());
        return Err(accessors.document.error(place, message));
    }
    let mut kept_times: Vec<f32> = Vec::with_capacity(times.len());
    let mut kept_values: Vec<f32> = Vec::with_capacity(values.len());
    for (&time, value) in times.iter().zip(values.chunks_exact(each)) {
        if !time.is_finite() || value.iter().any(|v| !v.is_finite()) {
            notes.add(
                "animation keys that are not numbers",
                sampler.place.clone(),
                "those keys are left out",
            );
            continue;
        }
        match kept_times.last().copied() {
            Some(last) if time < last => {
                notes.add("animation keys out of order", sampler.place.clone(), "those keys are left out");
                continue;
            }
            // Two keys at one time are how some tools write a jump: the first moves to just before the second.
            Some(last) if time == last => {
                let before = kept_times.len().checked_sub(2).map(|i| kept_times[i]);
                if before.is_none_or(|t| t < last.next_down()) {
                    if let Some(last) = kept_times.last_mut() {
                        *last = last.next_down();
                    }
                } else {
                    kept_times.pop();
                    kept_values.truncate(kept_values.len() - each);
                }
            }
            _ => {}
        }
        kept_times.push(time);
        kept_values.extend_from_slice(value);
    }
    if kept_times.is_empty() {
        notes.add("animation without keys", sampler.place.clone(), "it is left out");
        return Ok(None);
    }
    Ok(Some(Curve { times: kept_times, values: kept_values, width: aim.width, interpolation, rotation }))
}

/// The curve in the scene's units and within the property's bounds.
fn fit(target: Target, curve: &Curve) -> Curve {
    let mut curve = curve.clone();
    // The tangents of cubic splines scale with their values, and are not bounded as they are: what they swing to is.
    let tangents = curve.interpolation == Interpolation::CubicSpline;
    let bounds = target.bounds();
    let factor = if matches!(target, Target::LightIntensity(_)) { LUMENS_PER_WATT.recip() } else { 1.0 };
    for (i, value) in curve.values.iter_mut().enumerate() {
        let is_tangent = tangents && i / curve.width % 3 != 1;
        *value = if is_tangent { *value * factor } else { (*value * factor).clamp(bounds.0, bounds.1) };
    }
    if matches!(target, Target::Visible(_)) && curve.interpolation == Interpolation::Linear {
        curve.interpolation = Interpolation::Step;
    }
    curve
}

/// Takes apart the matrix of a node that is animated: only the parts can be.
fn make_animatable(nodes: &mut [Node], target: Target) {
    if let Target::Translation(n) | Target::Rotation(n) | Target::Scale(n) = target
        && let LocalTransform::Matrix(matrix) = nodes[n].transform
    {
        let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
        if rotation.is_finite() && scale.is_finite() {
            nodes[n].transform = LocalTransform::Trs { translation, rotation, scale };
        }
    }
}
