//! A glTF file into a scene: the order in which its parts are read.

use super::{
    ImportOptions,
    accessor::Accessors,
    animation::{self, Animations, Targets},
    budget::Pictures,
    buffers::Buffers,
    document::Document,
    extras::{self, CutEntry, Extras},
    ignored::{self, Notes},
    image, instances, light_camera,
    nodes::{self, Nodes},
};
use crate::{
    Result,
    scene::{Camera, Cut, Rational, Scene, Timing, World},
};
use std::{collections::HashMap, path::Path};

/// Frames that a scene may be long; more would keep a renderer busy for ever over a broken key time.
const LONGEST: i64 = 10_000_000;

/// Reads a `.gltf` or `.glb`; without its meshes unless `geometry`.
pub(super) fn read(
    file: &Path,
    options: &ImportOptions,
    pictures: &Pictures,
    geometry: bool,
) -> Result<Scene> {
    let document = Document::read(file)?;
    let notes = Notes::default();
    ignored::check_extensions(&document, &notes)?;
    let buffers = Buffers::load(&document)?;
    let accessors = Accessors { document: &document, buffers: &buffers };
    let mut nodes = nodes::read(&document)?;
    let mut scene = Scene::default();
    if geometry {
        instances::read(accessors, pictures, &mut nodes, &mut scene, &notes)?;
    }
    let cameras = light_camera::cameras(&document, &nodes, &notes)?;
    let lights = light_camera::lights(&document, &nodes, &notes)?;
    let targets = Targets { nodes: &mut nodes, cameras: &cameras, lights: &lights };
    let animations = animation::read(accessors, targets, &notes)?;
    let mut extras = Extras::default();
    if let Some(place) = &nodes.scene_place {
        let index = place.rsplit('/').next().and_then(|i| i.parse().ok()).unwrap_or(0);
        let element = document.element("scenes", index, "/scene")?;
        extras = extras::read(&element, &notes)?;
        scene.name = element.name();
    }
    scene.timing = timing(&document, &extras, &animations, options)?;
    scene.cuts = cuts(&document, &extras, &nodes, &cameras.items, &scene.timing)?;
    if let Some(world) = extras.world {
        scene.world = World { color: world.color, image: None, rotation: world.rotation };
        if let Some((uri, place)) = world.image {
            scene.world.image = Some(scene.images.len());
            scene.images.push(image::load_world(&document, &uri, &place, pictures)?);
        }
    }
    scene.cameras = cameras.items;
    scene.lights = lights.items;
    scene.channels = animations.channels;
    scene.nodes = nodes.nodes;
    scene.ignored = notes.into_entries();
    scene.files = document.folder.into_files();
    Ok(scene)
}

fn timing(
    document: &Document,
    extras: &Extras,
    animations: &Animations,
    options: &ImportOptions,
) -> Result<Timing> {
    let own_fps = extras.fps.unwrap_or(Timing::default().fps);
    let fps = options.fps.unwrap_or(own_fps);
    let frame_start = extras.frame_start.unwrap_or(0);
    let mut timing = Timing {
        fps,
        frame_start,
        first: frame_start,
        last: frame_start,
        resolution: extras.resolution,
        pixel_aspect: extras.pixel_aspect.unwrap_or(1.0),
    };
    if let Some((first, last)) = animations.range {
        for time in [first, last] {
            if (f64::from(time) * fps.value()).abs() > LONGEST as f64 {
                let message =
                    format!("a key at {time} s is more than {LONGEST} frames away; correct its time");
                return Err(document.error("/animations", message));
            }
        }
        timing.last = timing.frame_at(f64::from(last));
        if extras.frame_start.is_none() {
            timing.first = timing.frame_at(f64::from(first));
        }
    }
    if let Some(end) = extras.frame_end {
        timing.last = at_rate(end, frame_start, own_fps, fps);
    }
    timing.last = timing.last.max(timing.first);
    Ok(timing)
}

/// The number of the frame that stands where `frame` stood at the file's own rate: a new rate samples the same
/// movement, it does not change its speed.
fn at_rate(frame: i64, frame_start: i64, own: Rational, fps: Rational) -> i64 {
    if own == fps {
        return frame;
    }
    frame_start + ((frame - frame_start) as f64 * fps.value() / own.value()).round() as i64
}

fn cuts(
    document: &Document,
    extras: &Extras,
    nodes: &Nodes,
    cameras: &[Camera],
    timing: &Timing,
) -> Result<Vec<Cut>> {
    let own_fps = extras.fps.unwrap_or(Timing::default().fps);
    let mut cuts: Vec<Cut> = Vec::new();
    // In reverse, so that the first of several wins.
    let by_node: HashMap<usize, usize> = cameras.iter().enumerate().rev().map(|(i, c)| (c.node, i)).collect();
    let by_name: HashMap<&str, usize> =
        cameras.iter().enumerate().rev().map(|(i, c)| (c.name.as_str(), i)).collect();
    for CutEntry { frame, camera: name, node, place } in &extras.cuts {
        let node = node.and_then(|node| nodes.scene_node.get(node));
        let camera = node.and_then(|node| by_node.get(node));
        let camera = camera.or_else(|| name.as_deref().and_then(|name| by_name.get(name)));
        let Some(&camera) = camera else {
            return Err(
                document.error(place.clone(), "there is no camera on that node or of that name; export it")
            );
        };
        // Two neighbouring entries with one camera are no cut.
        if cuts.last().is_none_or(|last| last.camera != camera) {
            let frame = at_rate(*frame, timing.frame_start, own_fps, timing.fps);
            cuts.push(Cut { frame, camera });
        }
    }
    Ok(cuts)
}
