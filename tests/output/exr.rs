//! The files that frames become: read back by the `exr` crate, and by Python's OpenEXR and OpenImageIO.

use crate::support::{Shape, bytes_of, default_layers, frame, hash, options};
use buzz::frame::{Cover, Frame, FrameKind, Window};
use buzz::output::Compression;
use buzz::output::exr::encode;
use exr::prelude::{AnyChannels, FlatSamples, Image, Layer, ReadChannels, ReadLayers};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A channel as the documentation has it: name, whether it is half, its values.
type Expected = (String, bool, Vec<f32>);

/// The table of `docs/aovs.md`, written down once more.
fn expected_channels(frame: &Frame) -> Vec<Expected> {
    let mut all: Vec<Expected> = Vec::new();
    for (i, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        all.push((name.into(), true, frame.color.iter().map(|c| c[i]).collect()));
    }
    all.push(("depth.Z".into(), false, frame.depth.clone()));
    all.push(("pixelClass.id".into(), false, frame.class.iter().map(|&c| c.into()).collect()));
    if frame.object.is_empty() {
        return all;
    }
    all.push(("objectId.id".into(), false, frame.object.iter().map(|&o| o as f32).collect()));
    let three = [
        (["N.X", "N.Y", "N.Z"], true, &frame.normal),
        (["P.X", "P.Y", "P.Z"], false, &frame.position),
        (["diffuse.R", "diffuse.G", "diffuse.B"], true, &frame.diffuse),
        (["specular.R", "specular.G", "specular.B"], true, &frame.specular),
        (["emission.R", "emission.G", "emission.B"], true, &frame.emission),
        (["light_Key_light.R", "light_Key_light.G", "light_Key_light.B"], true, &frame.lights[0].1),
        (["light_Key_light_2.R", "light_Key_light_2.G", "light_Key_light_2.B"], true, &frame.lights[1].1),
    ];
    for (names, half, values) in three {
        for (i, name) in names.into_iter().enumerate() {
            all.push((name.into(), half, values.iter().map(|v| v[i]).collect()));
        }
    }
    // What another program makes of the names.
    let ids = [
        ("CryptoObject", [0, 0xfd0e_1d43, 0xa515_fc11, 0x7b1a_493f].map(f32::from_bits)),
        ("CryptoMaterial", [0, 0xaaf3_7ff8, 0x65c6_1f66, 0].map(f32::from_bits)),
    ];
    for ((layer, ids), matte) in ids.iter().zip(&frame.mattes) {
        // Two ranks to a layer, the second of which may be empty.
        for rank in 0..matte.ranks.next_multiple_of(2) {
            let cover = |pixel: &[Cover]| pixel.get(rank).copied().unwrap_or_default();
            let covers = || matte.covers.chunks(matte.ranks).map(cover);
            let [id, share] = if rank % 2 == 0 { ["R", "G"] } else { ["B", "A"] };
            let name = |color| format!("{layer}{:02}.{color}", rank / 2);
            all.push((name(id), false, covers().map(|cover| ids[cover.name as usize]).collect()));
            all.push((name(share), false, covers().map(|cover| cover.share).collect()));
        }
    }
    let two = [(["forward.u", "forward.v"], &frame.forward), (["backward.u", "backward.v"], &frame.backward)];
    for (names, values) in two {
        for (i, name) in names.into_iter().enumerate() {
            all.push((name.into(), false, values.iter().map(|v| v[i]).collect()));
        }
    }
    all
}

/// Every kind of file that is tried: a name, the frame, how it is packed.
fn cases() -> Vec<(&'static str, Frame, Compression)> {
    let odd = Shape::whole(37, 45);
    let window = Window { x: 5, y: 40, width: 23, height: 21 };
    let crop = Shape { image: (64, 64), window };
    let mut all: Vec<_> = Compression::ALL
        .into_iter()
        .map(|(name, c)| (name, frame(101, FrameKind::Inferred { from: 100 }, &odd), c))
        .collect();
    all.push(("crop", frame(7, FrameKind::Traced, &crop), Compression::Zip));
    all.push(("crop_piz", frame(7, FrameKind::Traced, &crop), Compression::Piz));
    all.push(("pixel", frame(0, FrameKind::Traced, &Shape::whole(1, 1)), Compression::Zip));
    all.push(("pixel_piz", frame(0, FrameKind::Traced, &Shape::whole(1, 1)), Compression::Piz));
    let mut filmed = frame(8, FrameKind::Traced, &Shape::whole(32, 18));
    filmed.view.lens.sensor_height = Some(13.365);
    all.push(("filmed", filmed, Compression::Zip));
    let wide = default_layers(frame(-3, FrameKind::Traced, &Shape::whole(16384, 16)));
    all.push(("wide", wide, Compression::Zip));
    all
}

/// A file's only layer, as the `exr` crate reads it.
fn read(bytes: Vec<u8>) -> Image<Layer<AnyChannels<FlatSamples>>> {
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(std::io::Cursor::new(bytes))
        .unwrap()
}

#[test]
fn the_exr_crate_reads_back_what_was_written() {
    for (name, frame, compression) in cases() {
        let bytes = bytes_of(&frame, compression);
        let image = read(bytes);
        let layer = &image.layer_data;
        let expected = expected_channels(&frame);
        assert_eq!(layer.channel_data.list.len(), expected.len(), "{name}");
        for (channel, half, values) in expected {
            let read = layer.channel_data.list.iter().find(|c| c.name.eq(&channel)).unwrap();
            match &read.sample_data {
                FlatSamples::F16(read) => {
                    assert!(half, "{name} {channel}");
                    assert!(
                        read.iter().zip(&values).all(|(a, b)| *a == half::f16::from_f32(*b)),
                        "{name} {channel}"
                    );
                }
                FlatSamples::F32(read) => {
                    assert!(!half && *read == values, "{name} {channel}");
                }
                FlatSamples::U32(_) => panic!("{name} {channel}: integers are misread by OpenImageIO"),
            }
        }
        assert_eq!(layer.size, (frame.window.width as usize, frame.window.height as usize).into());
        assert_eq!(layer.attributes.layer_position.0, frame.window.x as i32);
        assert_eq!(layer.attributes.layer_position.1, frame.window.y as i32);
        assert_eq!(
            image.attributes.display_window.size,
            (frame.view.width as usize, frame.view.height as usize).into()
        );
    }
}

/// The Python of the tests, and whether it has what they need.
fn python() -> PathBuf {
    std::env::var_os("PYTHON").map_or_else(
        || {
            let venv = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python");
            if venv.exists() { venv } else { "python3".into() }
        },
        PathBuf::from,
    )
}

/// Runs a script of the tests. False (and a line that says so) if Python or one of its modules is missing.
fn run_python(script: &str, arguments: &[&Path]) -> bool {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(script);
    let output = match Command::new(python()).arg(script).args(arguments).output() {
        Ok(output) => output,
        Err(error) => {
            println!("skipped: {}: {error}", python().display());
            return false;
        }
    };
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}");
    let missing = output.status.code() == Some(77);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(missing || output.status.success(), "{text}\n{errors}");
    !missing
}

/// What the header of `frame` must say.
fn expected_attributes(frame: &Frame) -> Value {
    let view = &frame.view;
    let [x, y, z] = [view.right, view.up, view.forward];
    let e = |v: glam::DVec3| -v.dot(view.eye);
    let mut attributes = json!({
        "worldToCamera": [x.x, y.x, z.x, 0.0, x.y, y.y, z.y, 0.0, x.z, y.z, z.z, 0.0, e(x), e(y), e(z), 1.0],
        "framesPerSecond": [24000, 1001],
        "imageCounter": frame.number,
        "expTime": 0.0,
        "pixelAspectRatio": 1.0,
        "cameraLabel": "Caméra 1",
        "chromaticities": [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290],
        "colorInteropID": "lin_rec709_scene",
        "software": concat!("Buzz ", env!("CARGO_PKG_VERSION")),
        "Software": concat!("Buzz ", env!("CARGO_PKG_VERSION")),
        "buzz/quality": "half-pixel",
        "buzz/settingsHash": hash().as_str(),
        "buzz/pixelClasses": "0 traced, 1 good, 2 overlapped, 3 missed, 4 bad, 5 creeping, 6 entering, 7 edge, 8 moved, 9 filled",
    });
    match frame.kind {
        FrameKind::Traced => attributes["buzz/frameKind"] = "traced".into(),
        FrameKind::Inferred { from } => {
            attributes["buzz/frameKind"] = "inferred".into();
            attributes["buzz/inferredFrom"] = from.into();
        }
    }
    // 24 frames a second, counted without drops; before frame 0 it is the day before.
    attributes["timeCode"] = match frame.number {
        101 => json!([0, 0, 4, 5]),
        -3 => json!([23, 59, 59, 21]),
        n => json!([0, 0, 0, n]),
    };
    let aspect = f64::from(view.width) / f64::from(view.height);
    let assumed = if aspect >= 1.0 { [36.0, 36.0 / aspect] } else { [36.0 * aspect, 36.0] };
    let sensor = view.lens.sensor_height.map_or(assumed, |height| [height * aspect, height]);
    attributes["sensorOverallDimensions"] = json!(sensor);
    attributes["pinholeFocalLength"] = json!(sensor[1] / 2.0 / 0.4f64.tan());
    attributes
}

#[test]
fn openexr_and_openimageio_read_back_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let mut manifest = Vec::new();
    for (name, frame, compression) in cases() {
        let file = folder.path().join(format!("{name}.exr"));
        fs::write(&file, bytes_of(&frame, compression)).unwrap();
        let channels: Vec<Value> = expected_channels(&frame)
            .into_iter()
            .map(|(channel, half, values)| {
                let raw = folder.path().join(format!("{name}.{channel}.raw"));
                fs::write(&raw, values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>()).unwrap();
                json!({"name": channel, "half": half, "raw": raw})
            })
            .collect();
        let window = frame.window;
        manifest.push(json!({
            "file": file,
            "data": [window.x, window.y, window.width, window.height],
            "display": [0, 0, frame.view.width, frame.view.height],
            "channels": channels,
            "attributes": expected_attributes(&frame),
        }));
    }
    let path = folder.path().join("manifest.json");
    fs::write(&path, serde_json::to_string(&manifest).unwrap()).unwrap();
    run_python("read_exr.py", &[&path]);
}

#[test]
fn no_nan_and_no_infinity_is_written() {
    let mut frame = frame(1, FrameKind::Traced, &Shape::whole(4, 1));
    frame.color[0] = [f32::NAN, 1e6, f32::NEG_INFINITY, -7e4];
    frame.depth = vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
    let encoded = encode(&frame, &options(Compression::Zip)).unwrap();
    assert_eq!(encoded.repaired, 7);
    let image = read(encoded.parts.concat());
    let values = |name: &str| {
        let channels = &image.layer_data.channel_data.list;
        channels.iter().find(|c| c.name.eq(name)).unwrap().sample_data.values_as_f32().collect::<Vec<_>>()
    };
    assert_eq!(values("depth.Z"), [0.0, 1e10, -1e10, f32::MAX]);
    assert_eq!(["R", "G", "B", "A"].map(|c| values(c)[0]), [0.0, 65504.0, -65504.0, -65504.0]);
}
