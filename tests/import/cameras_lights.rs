//! Cameras, lights and extras. Each feature, and each way to be broken.

use crate::gltf_file::{Gltf, png};
use crate::read::{Read, features};
use buzz::import::{ImportOptions, import};
use buzz::scene::{LightKind, Projection, Rational};
use glam::{DVec3, Vec3};
use serde_json::json;
use std::fs;
use tempfile::TempDir;

#[test]
fn orthographic_lenses_infinite_far_planes_and_shift_are_read() {
    let mut gltf = Gltf::new();
    assert_eq!(gltf.scene().cameras[0].lens.far, f64::INFINITY);
    gltf.json["cameras"][0] = json!({
        "type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 10},
        "extras": {"shift": [0.25, -0.5], "dof": {"fstop": 2}},
    });
    let scene = gltf.scene();
    let lens = scene.cameras[0].lens;
    assert_eq!(lens.projection, Projection::Orthographic { xmag: 3.0, ymag: 2.0 });
    assert_eq!((lens.shift.x, lens.shift.y, lens.far), (0.25, -0.5, 10.0));
    assert_eq!(features(&scene), ["depth of field"]);
    for broken in [
        json!({"type": "perspective"}),
        json!({"type": "fisheye"}),
        json!({"type": "perspective", "perspective": {"yfov": 0}}),
        json!({"type": "perspective", "perspective": {"yfov": 4}}),
        json!({"type": "perspective", "perspective": {"yfov": -0.5}}),
        json!({"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1}}),
    ] {
        gltf.json["cameras"][0] = broken;
        assert!(gltf.refused().contains("/cameras/0"));
    }
}

#[test]
fn sensors_are_read_for_focal_lengths() {
    let mut gltf = Gltf::new();
    assert_eq!(gltf.scene().cameras[0].lens.sensor_height, None);
    gltf.json["cameras"][0]["extras"] = json!({"sensor": [23.76, 13.365]});
    assert_eq!(gltf.scene().cameras[0].lens.sensor_height, Some(13.365));
    for broken in [json!([36, 0]), json!([-36, 24]), json!([36, 1e9]), json!([36]), json!(36)] {
        gltf.json["cameras"][0]["extras"]["sensor"] = broken;
        assert!(gltf.refused().contains("/cameras/0/extras/sensor"));
    }
}

#[test]
fn lights_are_radiometric_whatever_their_parents_scale() {
    let mut gltf = Gltf::new();
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 1366, "color": [1, 0.5, 0], "range": 9, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4},
         "extras": {"radius": 0.1}},
        {"type": "directional"},
    ]}});
    gltf.node(json!({"scale": [3, 3, 3], "children": [2]}));
    gltf.push("nodes", json!({"name": "Spot", "extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [1, 0, 0]}));
    let scene = gltf.scene();
    let light = &scene.lights[0];
    assert_eq!((light.name.as_str(), light.intensity, light.range), ("Spot", 2.0, Some(9.0)));
    assert_eq!(light.kind, LightKind::Spot { inner_cone: 0.2, outer_cone: 0.4 });
    assert_eq!((light.size, features(&scene)), (0.1, vec![]));
    let posed = &scene.pose(0.0).lights[0];
    assert_eq!((posed.position, posed.direction), (DVec3::new(3.0, 0.0, 0.0), DVec3::NEG_Z));
    gltf.json["nodes"][2]["extensions"]["KHR_lights_punctual"]["light"] = json!(2);
    assert!(gltf.refused().contains("there is no light 2"));
}

#[test]
fn a_scale_of_zero_turns_neither_cameras_nor_lights() {
    let mut gltf = Gltf::new();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {}}]}});
    gltf.json["nodes"][0] = json!({"camera": 0, "rotation": [0, 0, half, half]});
    gltf.push("nodes", json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    // A quarter of a turn to the left, below it one about the axis of sight for the camera.
    gltf.json["scenes"][0]["nodes"] = json!([2]);
    for scale in [[1, 1, 1], [0, 0, 0], [1, 1, 0], [0, 1, 1]] {
        let parent = json!({"rotation": [0, half, 0, half], "scale": scale, "children": [0, 1]});
        gltf.json["nodes"].as_array_mut().unwrap().truncate(2);
        gltf.push("nodes", parent);
        let scene = gltf.scene();
        let pose = scene.pose(0.0);
        let (view, light) = (scene.view(&pose, 0, 4, 4), &pose.lights[0]);
        for (is, wanted) in [
            (view.forward, DVec3::NEG_X),
            (view.right, DVec3::Y),
            (view.up, DVec3::Z),
            (light.direction, DVec3::NEG_X),
            (light.right, DVec3::NEG_Z),
        ] {
            assert!((is - wanted).length() < 1e-9, "{scale:?}: {is} {wanted}");
        }
    }
}

#[test]
fn extras_give_rate_range_size_cuts_and_world() {
    let mut gltf = Gltf::new();
    gltf.node(json!({"name": "Cam.B", "camera": 0}));
    gltf.json["scenes"][0]["extras"] = json!({"buzz": {
        "version": 1, "fps": [24000, 1001], "frame_start": 101, "frame_end": 148, "resolution": [1920, 1080],
        "pixel_aspect": 2, "shutter": 0.5, "something": "else",
        "cuts": [{"frame": 101, "camera": "Cam", "node": 0}, {"frame": 120, "node": 0}, {"frame": 125, "camera": "Cam.B"}],
        "world": {"color": [1, 0.5, 0], "strength": 2, "rotation": 1.5},
        "lost": [{"object": "Smoke", "feature": "volume", "action": "render it separately"}],
    }});
    let scene = gltf.scene();
    let timing = scene.timing;
    assert_eq!(timing.fps, Rational { numerator: 24000, denominator: 1001 });
    assert_eq!((timing.frame_start, timing.first, timing.last), (101, 101, 148));
    assert_eq!((timing.resolution, timing.pixel_aspect), (Some((1920, 1080)), 2.0));
    let cuts: Vec<(i64, usize)> = scene.cuts.iter().map(|c| (c.frame, c.camera)).collect();
    assert_eq!(cuts, [(101, 0), (125, 1)]);
    assert_eq!((scene.world.color, scene.world.rotation), (Vec3::new(2.0, 1.0, 0.0), 1.5));
    assert_eq!(features(&scene), ["shutter", "volume of Smoke"]);
    // Another rate samples the same movement more finely.
    let fps = Some(Rational { numerator: 48000, denominator: 1001 });
    let scene = gltf.read_with(&ImportOptions { fps, ..ImportOptions::default() }).unwrap();
    assert_eq!((scene.timing.first, scene.timing.last, scene.cuts[1].frame), (101, 195, 149));
}

#[test]
fn extras_of_the_wrong_kind_are_named() {
    for (key, value) in [
        ("fps", json!([24, 0])),
        ("fps", json!(24)),
        ("fps", json!([24])),
        ("frame_start", json!(1.5)),
        ("frame_end", json!(1e300)),
        ("resolution", json!([0, 5])),
        ("resolution", json!([1, 2, 3])),
        ("pixel_aspect", json!(0)),
        ("shutter", json!("half")),
        ("cuts", json!([{"camera": "x"}])),
        ("cuts", json!([{"frame": 1, "node": 99}])),
        ("world", json!({"color": [1, 2]})),
        ("world", json!({"strength": -1})),
        ("world", json!({"image": "gone.hdr"})),
        ("lost", json!({})),
    ] {
        let mut gltf = Gltf::new();
        gltf.json["scenes"][0]["extras"] = json!({"buzz": {key: value}});
        let message = gltf.refused();
        assert!(message.contains(&format!("/scenes/0/extras/buzz/{key}")), "{key}: {message}");
    }
}

#[test]
fn a_worlds_picture_is_loaded_from_beside_the_file() {
    let folder = TempDir::new().unwrap();
    let picture = image::Rgb32FImage::from_pixel(4, 2, image::Rgb([2.0, 1.0, 0.5]));
    image::DynamicImage::ImageRgb32F(picture).save(folder.path().join("sky.hdr")).unwrap();
    fs::write(folder.path().join("sky.png"), png(4, 2)).unwrap();
    let mut gltf = Gltf::new();
    for name in ["sky.hdr", "sky.png"] {
        gltf.json["scenes"][0]["extras"] = json!({"buzz": {"world": {"image": name}}});
        let file = folder.path().join("scene.gltf");
        fs::write(&file, gltf.text()).unwrap();
        let scene = import(&file, &ImportOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((scene.world.image, scene.images.len()), (Some(0), 1));
        assert_eq!(scene.images[0].name, name);
    }
}

#[test]
fn pictures_that_are_not_whole_are_refused() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("scene.gltf");
    let read = |name: &str| {
        let mut gltf = Gltf::new();
        gltf.json["scenes"][0]["extras"] = json!({"buzz": {"world": {"image": name}}});
        fs::write(&file, gltf.text()).unwrap();
        import(&file, &ImportOptions::default()).map(|_| ()).map_err(|e| e.to_string())
    };
    let noise =
        image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([(x * y) as u8, (x * 7) as u8, (y * 13) as u8]));
    let whole = folder.path().join("whole.jpg");
    noise.save(&whole).unwrap();
    let bytes = fs::read(&whole).unwrap();
    fs::write(folder.path().join("cut.jpg"), &bytes[..bytes.len() / 2]).unwrap();
    assert_eq!(read("whole.jpg"), Ok(()));
    assert!(read("cut.jpg").unwrap_err().contains("cut off"));

    // What an EXR stores is its data window, which may be far larger than the picture that it shows.
    let picture = image::Rgb32FImage::from_pixel(4, 2, image::Rgb([2.0, 1.0, 0.5]));
    image::DynamicImage::ImageRgb32F(picture).save(folder.path().join("sky.exr")).unwrap();
    let mut bytes = fs::read(folder.path().join("sky.exr")).unwrap();
    assert_eq!(read("sky.exr"), Ok(()));
    let name = b"dataWindow\0box2i\0";
    let at = bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len() + 4;
    bytes[at + 8..at + 12].copy_from_slice(&160_000_000_i32.to_le_bytes());
    fs::write(folder.path().join("sky.exr"), bytes).unwrap();
    let refused = read("sky.exr").unwrap_err();
    assert!(refused.contains("world/image: the image cannot be read"), "{refused}");
}
