//! What each option does to the pictures.

use crate::rig::{buzz, channels, courtyard, frames_in, fresh, json, run};
use crate::stage::Stage;
use exr::meta::MetaData;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Half precision, and a little for arithmetic on the way.
fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 2e-3 * a.abs().max(b.abs()) + 1e-5
}

fn first_frame(folder: &Path) -> std::collections::BTreeMap<String, Vec<f32>> {
    channels(&folder.join(&frames_in(folder)[0]))
}

#[test]
fn a_crop_has_the_pixels_of_the_whole() {
    let (folder, part) = fresh();
    let whole = folder.path().join("whole");
    run(&courtyard(), &whole, "-r 96x54 -q full -f 10 --aov all").ok();
    run(&courtyard(), &part, "-r 96x54 -q full -f 10 --aov all --crop 30,20,40,16").ok();
    let header = MetaData::read_from_file(part.join("courtyard.0010.exr"), false).unwrap().headers.remove(0);
    assert_eq!(
        (header.own_attributes.layer_position.x(), header.own_attributes.layer_position.y()),
        (30, 20)
    );
    assert_eq!((header.layer_size.x(), header.layer_size.y()), (40, 16));
    assert_eq!(
        (header.shared_attributes.display_window.size.x(), header.shared_attributes.display_window.size.y()),
        (96, 54)
    );
    let (whole, part) = (first_frame(&whole), first_frame(&part));
    for (name, values) in &part {
        for (i, &value) in values.iter().enumerate() {
            let (x, y) = (30 + i % 40, 20 + i / 40);
            assert!(
                close(value, whole[name][y * 96 + x]),
                "{name} at {x},{y}: {value} {}",
                whole[name][y * 96 + x]
            );
        }
    }
}

#[test]
fn transparency_cuts_the_world_away_and_nothing_else() {
    let (folder, clear) = fresh();
    let opaque = folder.path().join("opaque");
    run(&courtyard(), &opaque, "-r 96x54 -f 10").ok();
    run(&courtyard(), &clear, "-r 96x54 -f 10 --transparent").ok();
    let (opaque, clear) = (first_frame(&opaque), first_frame(&clear));
    let world: Vec<bool> = opaque["depth.Z"].iter().map(|&z| z >= 1e10).collect();
    assert!(world.contains(&true) && world.contains(&false));
    for (i, &world) in world.iter().enumerate() {
        assert!(opaque["A"][i] > 0.0);
        for channel in ["R", "G", "B", "A"] {
            assert_eq!(clear[channel][i], if world { 0.0 } else { opaque[channel][i] });
        }
    }
}

#[test]
fn what_is_blended_is_see_through_where_only_the_world_is_behind_it() {
    let (folder, clear) = fresh();
    let opaque = folder.path().join("opaque");
    let mut stage = Stage::new();
    stage.json["materials"][1]["alphaMode"] = "BLEND".into();
    stage.json["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"][3] = 0.4.into();
    stage.json["nodes"][0]["translation"] = serde_json::json!([0.0, 0.3, 6.0]);
    let scene = stage.write(&folder.path().join("s.gltf"));
    run(&scene, &opaque, "-r 96x54 --aov all -f 0 --bounces 2").ok();
    run(&scene, &clear, "-r 96x54 --aov all -f 0 --bounces 2 --transparent").ok();
    let (opaque, clear) = (first_frame(&opaque), first_frame(&clear));
    let mut seen = [0; 2];
    for (i, &alpha) in clear["A"].iter().enumerate() {
        assert_eq!(opaque["A"][i], 1.0);
        if opaque["depth.Z"][i] >= 1e10 {
            assert_eq!(alpha, 0.0);
        } else if (alpha - 0.4).abs() < 1e-3 {
            seen[0] += 1;
        } else {
            assert!((alpha - 1.0).abs() < 1e-3, "{alpha}");
            seen[1] += 1;
        }
        // The world is black: it is missing nowhere.
        for channel in ["R", "G", "B"] {
            assert!(close(clear[channel][i], opaque[channel][i]));
        }
    }
    assert!(seen.iter().all(|&pixels| pixels > 50), "{seen:?}");
}

#[test]
fn a_stop_doubles_colours_and_nothing_else() {
    let (folder, brighter) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    let plain = folder.path().join("plain");
    run(&scene, &plain, "-r 48x27 -f 0 --aov all").ok();
    run(&scene, &brighter, "-r 48x27 -f 0 --aov all --exposure 1").ok();
    let (plain, brighter) = (first_frame(&plain), first_frame(&brighter));
    assert!(plain["R"].iter().any(|&v| v > 0.01), "the lamp shines");
    for (name, values) in &plain {
        // The channels of a matte have these names too, but hold ids.
        let is_colour = name.ends_with(['R', 'G', 'B']) && !name.starts_with("Crypto");
        let gain = if is_colour { 2.0 } else { 1.0 };
        for (a, b) in values.iter().zip(&brighter[name]) {
            assert!(close(a * gain, *b), "{name}: {a} {b}");
        }
    }
}

#[test]
fn frames_are_renumbered_and_named() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(3).write(&folder.path().join("s.gltf"));
    run(&scene, &out, "-r 32x18").ok();
    let moved = folder.path().join("moved");
    run(&scene, &moved, "-r 32x18 --start-frame 1001 --name shot_####.exr").ok();
    assert_eq!(frames_in(&moved), ["shot_1001.exr", "shot_1002.exr", "shot_1003.exr"]);
    for (a, b) in frames_in(&out).iter().zip(frames_in(&moved)) {
        assert!(channels(&out.join(a)) == channels(&moved.join(b)));
    }
    assert_eq!(json(&moved.join("report.json"))["frames"][0]["frame"], 1001);
    let before = folder.path().join("before");
    run(&scene, &before, "-r 32x18 --start-frame -2 --name a.%03d.exr -f -2--1").ok();
    assert_eq!(frames_in(&before), ["a.-01.exr", "a.-02.exr"]);
}

#[test]
fn every_compression_reads_back_the_same() {
    let (folder, _) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    let read = |compression: &str| {
        let out = folder.path().join(compression);
        run(&scene, &out, &format!("-r 40x33 -f 1 --aov all --compression {compression}")).ok();
        first_frame(&out)
    };
    let plain = read("none");
    for compression in ["rle", "zips", "zip", "piz"] {
        assert!(read(compression) == plain, "{compression}");
    }
}

#[test]
fn layers_are_those_that_were_asked_for() {
    let (folder, _) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    let names = |aov: &str| -> BTreeSet<String> {
        let out = folder.path().join(aov);
        run(&scene, &out, &format!("-r 16x9 -f 0 --aov {aov}")).ok();
        first_frame(&out).into_keys().collect()
    };
    let set = |text: &str| text.split(' ').map(String::from).collect::<BTreeSet<_>>();
    assert_eq!(names("depth"), set("A B G R depth.Z"));
    assert_eq!(names("beauty"), set("A B G R depth.Z pixelClass.id"));
    assert_eq!(names("normal,object"), set("A B G R N.X N.Y N.Z objectId.id"));
    assert_eq!(
        names("all"),
        set(
            "A B G R depth.Z pixelClass.id N.X N.Y N.Z P.X P.Y P.Z forward.u forward.v backward.u backward.v \
             objectId.id diffuse.R diffuse.G diffuse.B specular.R specular.G specular.B emission.R emission.G \
             emission.B light_Lamp.R light_Lamp.G light_Lamp.B CryptoObject00.R CryptoObject00.G CryptoObject00.B \
             CryptoObject00.A CryptoMaterial00.R CryptoMaterial00.G CryptoMaterial00.B CryptoMaterial00.A"
        )
    );
}

#[test]
fn a_file_without_a_camera_goes_round_on_a_turntable() {
    let (folder, out) = fresh();
    let mut stage = Stage::new();
    stage.json["nodes"][0].as_object_mut().unwrap().remove("camera");
    stage.json.as_object_mut().unwrap().remove("cameras");
    let scene = stage.write(&folder.path().join("s.gltf"));
    run(&scene, &out, "-r 32x18 --turntable 4").ok();
    assert_eq!(frames_in(&out).len(), 4);
    let pictures: Vec<_> = frames_in(&out).iter().map(|n| channels(&out.join(n))["R"].clone()).collect();
    assert!(pictures.windows(2).all(|p| p[0] != p[1]));
}

#[test]
fn a_model_in_which_nothing_shines_is_lit_on_a_turntable_and_said_to_be_black_elsewhere() {
    let (folder, out) = fresh();
    let mut stage = Stage::drifting(2);
    let unlit = stage.json["nodes"].as_array_mut().unwrap();
    unlit.iter_mut().for_each(|node| drop(node.as_object_mut().unwrap().remove("extensions")));
    stage.json["extensions"].as_object_mut().unwrap().remove("KHR_lights_punctual");
    stage.json["scenes"][0].as_object_mut().unwrap().remove("extras");
    let scene = stage.write(&folder.path().join("s.gltf"));
    let brightest = |out: &Path| first_frame(out)["G"].iter().copied().fold(0.0, f32::max);
    let said = run(&scene, &out, "-r 32x18 --progress none").ok().err;
    assert!(said.contains("nothing in the scene shines"), "{said}");
    assert_eq!(brightest(&out), 0.0);
    let lit = folder.path().join("lit");
    let said = run(&scene, &lit, "-r 32x18 --progress none --turntable 3").ok().err;
    assert!(!said.contains("shines"), "{said}");
    assert!(brightest(&lit) > 0.2);
}

#[test]
fn what_is_no_obj_is_refused() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(2).write(&folder.path().join("s.gltf"));
    let junk = folder.path().join("junk.obj");
    fs::write(&junk, "hallo\n").unwrap();
    run(&scene, &out, &format!("-r 32x18 --geometry {}", junk.display())).refused(3, &["junk.obj", "OBJ"]);
    run(&scene, &out, &format!("-r 32x18 --geometry {}", scene.display())).refused(3, &["s.gltf", "OBJ"]);
}

#[test]
fn frames_outside_of_the_range_are_rendered_and_warned_of() {
    let (folder, out) = fresh();
    let scene = Stage::drifting(3).write(&folder.path().join("s.gltf"));
    let said = run(&scene, &out, "-r 16x9 -f 1-6 --progress none").ok().err;
    assert!(said.contains("4 of them are not in the scene's range, 0-2"), "{said}");
    let report = json(&out.join("report.1-6.json"));
    assert_eq!(report["warnings"].as_array().unwrap().len(), 1, "{}", report["warnings"]);
}

#[test]
fn frames_on_the_way_are_told_and_counted() {
    let (_folder, out) = fresh();
    let said = run(&courtyard(), &out, "-r 32x18 -f 0 --progress plain").ok();
    assert!(said.out.contains("not known, as their key frame (") && said.out.contains("made on the way"));
    let lines = said.err.lines().filter(|l| l.contains("on the way, ")).count();
    assert!(lines > 0 && said.err.lines().all(|l| l.starts_with("frame ")), "{}", said.err);
    assert!(said.out.contains("frames on the way"), "{}", said.out);
    let report = json(&out.join("report.0-0.json"));
    assert!(report["totals"]["seconds"]["on_the_way"].as_f64().unwrap() > 0.0);
}

#[test]
fn an_obj_is_seen_through_another_files_camera() {
    let (folder, out) = fresh();
    let path = |name: &str| folder.path().join(name);
    let scene = Stage::drifting(3).write(&path("s.gltf"));
    fs::write(path("card.obj"), "v -1 0 1\nv 1 0 1\nv 1 2 1\nv -1 2 1\nf 1 2 3 4\n").unwrap();
    run(&path("card.obj"), &out, &format!("-r 32x18 --camera-from {}", scene.display())).ok();
    assert_eq!(frames_in(&out), ["card.0000.exr", "card.0001.exr", "card.0002.exr"]);
    run(&path("card.obj"), &path("no"), "-r 32x18").refused(3, &["camera"]);

    let added = path("added");
    run(&scene, &added, &format!("-r 32x18 --geometry {}", path("card.obj").display())).ok();
    let middle = |folder: &Path| first_frame(folder)["depth.Z"][9 * 32 + 16];
    assert_eq!(middle(&added), 5.0, "the card of the OBJ stands before that of the glTF");
}

#[test]
fn cameras_are_chosen_by_name_and_number() {
    let (_folder, out) = fresh();
    run(&courtyard(), &out, "-r 32x18 -f 0 -c Low --name name.%d.exr").ok();
    run(&courtyard(), &out, "-r 32x18 -f 0 -c 1 --name number.%d.exr").ok();
    run(&courtyard(), &out, "-r 32x18 -f 0 --name own.%d.exr").ok();
    let picture = |name: &str| channels(&out.join(name));
    assert!(picture("name.0.exr") == picture("number.0.exr"));
    assert!(picture("name.0.exr")["R"] != picture("own.0.exr")["R"]);
}

#[test]
fn an_inspection_is_json_on_request() {
    let courtyard = courtyard();
    let text = buzz(["inspect", courtyard.to_str().unwrap(), "--format", "json"]).ok().out;
    let scene: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(scene["schema"], "buzz-scene/1");
    for key in "triangles shapes instances cameras lights animations requires ignored bytes_per_pixel held_bytes_per_pixel stages"
        .split(' ')
    {
        assert!(scene.get(key).is_some(), "{key}");
    }
}
