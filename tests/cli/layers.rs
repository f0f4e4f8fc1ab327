//! What the layers say agrees with each other and with the matrices in the header.

use crate::rig::{channels, courtyard, fresh, json, run};
use crate::stage::{CARD, Stage};
use exr::meta::MetaData;
use glam::{Mat4, Vec3, Vec3Swizzles};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A frame's file: its channels, its size, and its matrices from the world to the camera and to normalised device
/// coordinates.
struct Layers {
    channels: BTreeMap<String, Vec<f32>>,
    width: usize,
    height: usize,
    camera_from_world: Mat4,
    ndc_from_world: Mat4,
}

impl Layers {
    fn read(path: &Path) -> Self {
        let meta = MetaData::read_from_file(path, false).unwrap();
        let header = &meta.headers[0];
        let attributes = &header.own_attributes;
        // For row vectors, row by row: for column vectors, column by column.
        let [camera_from_world, ndc_from_world] =
            [attributes.world_to_camera, attributes.world_to_normalized_device]
                .map(|matrix| Mat4::from_cols_array(&matrix.unwrap()));
        Self {
            channels: channels(path),
            width: header.layer_size.0,
            height: header.layer_size.1,
            camera_from_world,
            ndc_from_world,
        }
    }

    fn at(&self, channel: &str, i: usize) -> f32 {
        self.channels[channel][i]
    }

    fn position(&self, i: usize) -> Vec3 {
        ["P.X", "P.Y", "P.Z"].map(|c| self.at(c, i)).into()
    }

    /// Where a point of the world is in the picture, pixels from the upper left.
    fn raster(&self, world: Vec3) -> glam::Vec2 {
        self.ndc_from_world.project_point3(world).xy() * glam::vec2(self.width as f32, self.height as f32)
    }

    fn center(&self, i: usize) -> glam::Vec2 {
        glam::vec2((i % self.width) as f32 + 0.5, (i / self.width) as f32 + 0.5)
    }

    /// Pixels that show a surface.
    fn surfaces(&self) -> impl Iterator<Item = usize> {
        let objects = &self.channels["objectId.id"];
        (0..objects.len()).filter(|&i| objects[i] != 0.0)
    }

    /// The pixel that a place in the picture belongs to.
    fn pixel(&self, place: glam::Vec2) -> Option<usize> {
        let inside = place.cmpge(glam::Vec2::ZERO).all()
            && place.x < self.width as f32
            && place.y < self.height as f32;
        inside.then(|| place.y as usize * self.width + place.x as usize)
    }
}

fn gallery() -> PathBuf {
    courtyard().parent().unwrap().with_file_name("gallery").join("gallery.gltf")
}

#[test]
fn the_parts_add_up_to_the_beauty() {
    let (_folder, out) = fresh();
    run(&gallery(), &out, "-r 160x90 -f 10-12 --aov diffuse,specular,emission,lights").ok();
    let layers = channels(&out.join("gallery.0011.exr"));
    let lights: Vec<&String> =
        layers.keys().filter(|k| k.starts_with("light_") && k.ends_with(".R")).collect();
    assert_eq!(lights.len(), 4, "two lamps and two spots");
    for color in ["R", "G", "B"] {
        let mut seen = [0.0f32; 3];
        for (i, &beauty) in layers[color].iter().enumerate() {
            let parts = ["diffuse", "specular", "emission"].map(|part| layers[&format!("{part}.{color}")][i]);
            seen.iter_mut().zip(parts).for_each(|(s, p)| *s = s.max(p));
            // A half is off by 2^-11 of itself, or by 2^-25 where it is denormal: four of them.
            let allowed =
                (parts.iter().map(|p| p.abs()).sum::<f32>() + beauty.abs()) / 2048.0 + 4.0 / 33_554_432.0;
            let error = (parts.iter().sum::<f32>() - beauty).abs();
            assert!(error <= allowed, "{color} of pixel {i}: {parts:?} are not {beauty}");
        }
        assert!(seen[0] > 0.1 && seen[1] > 0.1, "nothing was to be added: {seen:?}");
    }
}

#[test]
fn positions_and_depths_agree_with_the_matrices() {
    for (scene, name) in [(courtyard(), "courtyard.0030.exr"), (gallery(), "gallery.0030.exr")] {
        // A point lies on the ray through its pixel's centre; one that half-pixel reuses, anywhere in its pixel.
        for (quality, allowed) in [("full", 0.02), ("centred", 0.02), ("half-pixel", 0.5 + 0.02)] {
            let (_folder, out) = fresh();
            run(&scene, &out, &format!("-r 320x180 -f 30 -q {quality} --aov position,object,depth,class"))
                .ok();
            let layers = Layers::read(&out.join(name));
            let (mut count, mut reused) = (0, 0);
            for i in layers.surfaces() {
                let off = (layers.raster(layers.position(i)) - layers.center(i)).abs().max_element();
                assert!(off <= allowed, "{name}, {quality}, pixel {i}: {off}");
                let z = layers.camera_from_world.transform_point3(layers.position(i)).z;
                let depth = layers.at("depth.Z", i);
                assert!((z - depth).abs() <= 1e-4 * depth, "{name}, {quality}, pixel {i}: {z}, not {depth}");
                count += 1;
                reused += usize::from([1.0, 2.0, 9.0].contains(&layers.at("pixelClass.id", i)));
            }
            assert!(count > 10_000, "{name}: {count} pixels show a surface");
            assert!(quality == "full" || reused > 10_000, "{name}, {quality}: {reused} pixels are reused");
        }
    }
}

/// Warps `now` by its `layer` onto `next`, where a pixel's point has moved by `moved`: the share of the pixels visible in both
/// that land within half a pixel of where they should, and the number of those of object `tag`.
fn warped(now: &Layers, next: &Layers, layer: &str, tag: f32, moved: impl Fn(f32) -> Vec3) -> (f64, usize) {
    let (mut visible, mut right, mut tagged) = (0, 0, 0);
    for i in now.surfaces() {
        let [u, v] = ["u", "v"].map(|axis| now.at(&format!("{layer}.{axis}"), i));
        let landed = now.center(i) + glam::vec2(u, -v);
        let object = now.at("objectId.id", i);
        let there = now.position(i) + moved(object);
        let Some(pixel) = next.pixel(landed) else { continue };
        let shown = next.position(pixel);
        let near = (shown - there).length() <= 0.01 * next.at("depth.Z", pixel);
        if next.at("objectId.id", pixel) == object && near {
            visible += 1;
            tagged += usize::from(object == tag);
            right += usize::from((landed - next.raster(there)).length() <= 0.5);
        }
    }
    (right as f64 / visible as f64, tagged)
}

#[test]
fn motion_carries_a_frame_onto_the_next_and_back_where_objects_move() {
    let (folder, out) = fresh();
    let mut stage = Stage::drifting(4);
    let place = |i: usize| [0.15 * i as f32, 0.0, 0.1 * i as f32];
    stage.translate(CARD, &(0..4).map(place).collect::<Vec<_>>());
    let scene = stage.write(&folder.path().join("s.gltf"));
    // The floor is the first node with a mesh, the card the second.
    let card = 2.0;
    let moved = |object: f32| if object == card { Vec3::new(0.15, 0.0, 0.1) } else { Vec3::ZERO };
    for quality in ["full", "centred"] {
        let out = out.join(quality);
        run(&scene, &out, &format!("-r 640x360 -q {quality} -f 1-2 --aov motion,position,object,depth")).ok();
        let [now, next] = [1, 2].map(|n| Layers::read(&out.join(format!("s.{n:04}.exr"))));
        for (from, to, sign, layer) in [(&now, &next, 1.0, "forward"), (&next, &now, -1.0, "backward")] {
            let (share, cards) = warped(from, to, layer, card, |object| moved(object) * sign);
            assert!(share >= 0.999, "{quality}, {layer}: {share}");
            assert!(cards > 5_000, "{quality}, {layer}: {cards} pixels of the card are visible in both");
        }
    }
}

#[test]
fn motion_carries_inferred_frames_onto_the_next() {
    let (_folder, out) = fresh();
    run(&courtyard(), &out, "-r 320x180 -f 70-73 --aov motion,position,object,depth").ok();
    let report = json(&out.join("report.70-73.json"));
    assert!(report["totals"]["inferred_frames"].as_i64().unwrap() >= 3, "{}", report["totals"]);
    let frames: Vec<Layers> =
        (70..=73).map(|n| Layers::read(&out.join(format!("courtyard.{n:04}.exr")))).collect();
    for pair in frames.windows(2) {
        let (share, _) = warped(&pair[0], &pair[1], "forward", 0.0, |_| Vec3::ZERO);
        assert!(share >= 0.999, "{share}");
    }
}
