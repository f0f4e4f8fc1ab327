//! The files that frames become: read back by the `exr` crate, and by Python's OpenEXR and OpenImageIO.

use crate::support::{Shape, default_layers, frame, hash, options};
use buzz::frame::{Cover, Frame, FrameId, FrameKind, StereoEye, Window};
use buzz::output::exr::encode;
use buzz::output::{Compression, ExrSink, FrameFile, NamePattern, OutputFolder, SettingsHasher};
use buzz::sequence::FrameSink;
use exr::prelude::{AnyChannels, FlatSamples, Image, Layer, ReadChannels, ReadLayers};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn sink(folder: &Path, frames: impl IntoIterator<Item = i64>, compression: Compression) -> ExrSink {
    let names = NamePattern::parse("<stem>.%04d.exr", "test").unwrap();
    ExrSink::new(
        OutputFolder::open(folder, names, frames.into_iter().map(Into::into)).unwrap(),
        options(compression),
    )
    .unwrap()
}

fn bytes_of(frame: &Frame, compression: Compression) -> Vec<u8> {
    encode(frame, &options(compression)).unwrap().parts.concat()
}

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

#[test]
fn a_sequence_is_written_whole_and_recognised() {
    let folder = tempfile::tempdir().unwrap();
    let mut sink = sink(folder.path(), -2..=6, Compression::Zip);
    for number in -2..=6 {
        let kind = if number == -2 { FrameKind::Traced } else { FrameKind::Inferred { from: number - 1 } };
        sink.blank();
        sink.put(default_layers(frame(number, kind, &Shape::whole(64, 50)))).unwrap();
    }
    let seconds = sink.finish().unwrap();
    assert_eq!(seconds.iter().map(|s| s.0.number).collect::<Vec<_>>(), (-2..=6).collect::<Vec<_>>());
    assert!(seconds.iter().all(|s| s.1.write > 0.0));
    assert_eq!(sink.repaired(), []);
    for number in -2..=6 {
        let FrameFile::Complete(stats, kind) = sink.folder().check(number.into(), &hash()) else {
            panic!("{number}: {:?}", sink.folder().check(number.into(), &hash()));
        };
        assert_eq!(stats, frame(number, kind, &Shape::whole(64, 50)).stats);
        assert_eq!(kind == FrameKind::Traced, number == -2);
    }
    drop(sink);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 9, "nothing but the frames is left");
}

#[test]
fn the_bytes_do_not_depend_on_threads() {
    let frame = frame(1, FrameKind::Traced, &Shape::whole(200, 100));
    for (name, compression) in Compression::ALL {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| bytes_of(&frame, compression))
        };
        assert_eq!(with(1), with(3), "{name}");
    }
}

#[test]
fn one_thread_is_enough_inside_the_pool_and_out() {
    let folder = tempfile::tempdir().unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let mut sink = sink(folder.path(), 0..6, Compression::Zip);
        for number in 0..6 {
            sink.put(frame(number, FrameKind::Traced, &Shape::whole(40, 40))).unwrap();
        }
        assert_eq!(sink.finish().unwrap().len(), 6);
        assert!(sink.blank().is_some(), "buffers come back");
    });
}

#[test]
fn a_failure_stops_the_sink_and_leaves_no_partial_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut sink = sink(folder.path(), 0..6, Compression::Zip);
    // A folder under the frame's name: the rename fails.
    fs::create_dir_all(folder.path().join("test.0002.exr/inside")).unwrap();
    let put = |number| sink.put(frame(number, FrameKind::Traced, &Shape::whole(40, 40)));
    let first_error = (0..6).map(put).find_map(Result::err);
    let error = first_error.or_else(|| sink.finish().err()).unwrap();
    assert_eq!(error.exit_code(), 4);
    assert!(error.to_string().contains("test.0002.exr"), "{error}");
    assert!(sink.finish().is_err(), "it stays failed");
    drop(sink);
    // Frames that were under way beside the failing one may be there, but whole; nothing else is.
    let names: Vec<String> =
        fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    let number = |name: &str| buzz::output::number_in_name(name).unwrap().1;
    for name in names.iter().filter(|n| *n != "test.0002.exr") {
        assert!(name.starts_with("test.000") && name.ends_with(".exr"), "{names:?}");
        assert!(
            matches!(
                FrameFile::check(&folder.path().join(name), number(name).into(), &hash()),
                FrameFile::Complete(..)
            ),
            "{name}"
        );
    }
}

#[test]
fn a_broken_frame_is_an_error_of_that_frame() {
    let mut broken = frame(9, FrameKind::Traced, &Shape::whole(4, 4));
    broken.depth.pop();
    assert!(matches!(encode(&broken, &options(Compression::Zip)), Err(buzz::Error::Frame { frame: 9, .. })));
    let mut outside = frame(9, FrameKind::Traced, &Shape::whole(4, 4));
    outside.view.width = 3;
    assert!(matches!(encode(&outside, &options(Compression::Zip)), Err(buzz::Error::Frame { frame: 9, .. })));
}

#[test]
fn damaged_files_are_never_taken_for_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("f.exr");
    let check = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        FrameFile::check(&path, 1.into(), &hash())
    };
    assert_eq!(FrameFile::check(&path, 1.into(), &hash()), FrameFile::Missing);
    for compression in [Compression::Zip, Compression::None, Compression::Piz] {
        let small = default_layers(frame(1, FrameKind::Traced, &Shape::whole(5, 40)));
        let whole = bytes_of(&small, compression);
        assert!(matches!(check(&whole), FrameFile::Complete(..)));
        for length in (0..whole.len()).step_by(7) {
            assert!(
                matches!(check(&whole[..length]), FrameFile::Stale(_)),
                "{compression:?} cut to {length}"
            );
        }
        let longer = [whole.as_slice(), &[0]].concat();
        assert!(matches!(check(&longer), FrameFile::Stale(_)));
        for (step, value) in [(3, 0x01), (5, 0x80), (7, 0xff)] {
            for at in (0..whole.len()).step_by(step) {
                let mut damaged = whole.clone();
                damaged[at] ^= value;
                assert!(matches!(check(&damaged), FrameFile::Stale(_)), "{compression:?} byte {at}");
            }
        }
    }
}

#[test]
fn files_of_other_settings_programs_and_kinds_are_stale() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("f.exr");
    fs::write(&path, bytes_of(&frame(1, FrameKind::Traced, &Shape::whole(9, 9)), Compression::Zip)).unwrap();
    assert!(matches!(FrameFile::check(&path, 1.into(), &hash()), FrameFile::Complete(..)));
    // Frames that were renamed, and eyes that were exchanged.
    let left = FrameId { number: 1, eye: Some(StereoEye::Left) };
    for other in [2.into(), left] {
        assert_eq!(FrameFile::check(&path, other, &hash()), FrameFile::Stale("it is another frame".into()));
    }
    let other = SettingsHasher::new().feed("test", "2").finish();
    assert!(matches!(FrameFile::check(&path, 1.into(), &other), FrameFile::Stale(_)));
    exr::prelude::write_rgb_file(&path, 8, 8, |_, _| (0.0f32, 0.0f32, 0.0f32)).unwrap();
    assert!(matches!(FrameFile::check(&path, 1.into(), &hash()), FrameFile::Stale(_)));
    assert!(matches!(FrameFile::check(folder.path(), 1.into(), &hash()), FrameFile::Stale(_)));
}
