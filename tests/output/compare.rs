//! Sequences of files against each other, ours and another renderer's.

use crate::support::{Shape, default_layers, frame, options};
use buzz::frame::{Frame, FrameKind, Window};
use buzz::measure::{Comparison, Exposure, compare, psnr, read_frame};
use buzz::output::Compression;
use buzz::output::exr::encode;
use std::fs;
use std::path::Path;

fn plain(number: i64, kind: FrameKind) -> Frame {
    default_layers(frame(number, kind, &Shape::whole(24, 16)))
}

fn write(folder: &Path, name: &str, frame: &Frame) {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join(name), encode(frame, &options(Compression::Zip)).unwrap().parts.concat()).unwrap();
}

#[test]
fn a_sequence_is_compared_frame_by_frame() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    for number in 1..=4 {
        let kind = if number == 1 { FrameKind::Traced } else { FrameKind::Inferred { from: 1 } };
        let mut frame = plain(number, kind);
        write(&b, &format!("other_{number:03}.exr"), &frame);
        // Frames 1 and 2 stay as they are, 3 is a little off, 4 more so.
        frame.color[5][1] += 0.1 * (number - 2).max(0) as f32;
        write(&a, &format!("walk.{number:04}.exr"), &frame);
    }
    write(&a, "walk.0009.exr", &plain(9, FrameKind::Traced));
    write(&b, "other_000.exr", &plain(0, FrameKind::Traced));
    fs::write(a.join(".walk.0008.exr.12.tmp"), "").unwrap();
    fs::write(a.join("report.json"), "").unwrap();

    let result = compare(&a, &b, None).unwrap();
    assert_eq!(result.frames.iter().map(|f| f.frame).collect::<Vec<_>>(), [1, 2, 3, 4]);
    assert_eq!(result.unmatched.sequence, ["walk.0009.exr"]);
    assert_eq!(result.unmatched.reference, ["other_000.exr"]);
    assert_eq!(result.frames[0].error.psnr_db, None);
    assert_eq!(result.worst.frame, 4);
    assert_eq!((result.mean.frames, result.inferred_mean.frames), (2, 2));
    let db: Vec<f64> = result.frames.iter().filter_map(|f| f.error.psnr_db).collect();
    assert!((result.mean.psnr_db.unwrap() - (db[0] + db[1]) / 2.0).abs() < 1e-12);
    assert!(result.frames[3].error.over_5_percent > 0.0 && result.frames[3].error.flip_mean > 0.0);

    // The same by the functions on memory.
    let read = |folder: &Path, name: &str| read_frame(&folder.join(name)).unwrap().color;
    let all: Vec<_> = (0..=4).map(|n| read(&b, &format!("other_{n:03}.exr"))).collect();
    let exposure = Exposure::of(all.iter().map(Vec::as_slice));
    assert_eq!(exposure.scale, result.exposure);
    assert_eq!(psnr(&read(&a, "walk.0004.exr"), &all[4], exposure), result.frames[3].error.psnr_db);

    let json = serde_json::to_value(&result).unwrap();
    assert!(json["frames"][0]["psnr_db"].is_null());
    for key in ["frame", "psnr_db", "flip_mean", "max_abs", "over_5_percent"] {
        assert!(json["frames"][3][key].is_number() && json["worst"][key].is_number(), "{key}");
    }
    assert!(json["mean"]["psnr_db"].is_number());
    assert_eq!(serde_json::from_value::<Comparison>(json).unwrap().frames.len(), 4);
    let text = result.to_string();
    assert!(
        text.contains("worst (4)")
            && !text.contains("walk.0004.exr")
            && text.contains("same")
            && text.contains("only in the reference"),
        "{text}"
    );
}

#[test]
fn a_frames_error_does_not_hang_on_the_frames_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    for number in 1..=3 {
        let mut frame = plain(number, FrameKind::Traced);
        frame.color.iter_mut().flatten().for_each(|value| *value *= (1 << number) as f32);
        write(&b, &format!("walk.{number:04}.exr"), &frame);
        frame.color[5][1] += 0.5;
        write(&a, &format!("walk.{number:04}.exr"), &frame);
    }
    // Of another sequence nothing is compared.
    let mut bright = plain(1, FrameKind::Traced);
    bright.color.fill([1000.0; 4]);
    write(&b, "other.0001.exr", &bright);
    write(&a, "third.0001.exr", &bright);
    let whole = compare(&a, &b, None).unwrap();
    assert!(whole.exposure > 1e-3);
    for name in ["walk.0002.exr", "walk.0003.exr"] {
        fs::remove_file(a.join(name)).unwrap();
    }
    let part = compare(&a, &b, None).unwrap();
    assert_eq!((part.exposure, &part.frames[..]), (whole.exposure, &whole.frames[..1]));
}

#[test]
fn a_place_in_a_crop_is_one_of_the_whole_image() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    let window = Window { x: 30, y: 20, width: 24, height: 16 };
    let shape = Shape { image: (64, 48), window };
    let mut frame = default_layers(frame(1, FrameKind::Traced, &shape));
    write(&b, "walk.0001.exr", &frame);
    frame.color[2 * 24 + 3][1] += 0.5;
    write(&a, "walk.0001.exr", &frame);
    let result = compare(&a, &b, None).unwrap();
    let place = result.frames[0].worst_place.unwrap();
    assert_eq!((place.x, place.y, place.side), (30, 20, 16));
    let json = serde_json::to_value(&result).unwrap();
    assert_eq!(json["worst"]["worst_place"]["x"], 30);
    assert!(result.to_string().contains(" in the 16x16 block at 30,20"), "{result}");
}

#[test]
fn several_sequences_in_a_folder_are_kept_apart() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    for side in ["left", "right"] {
        for number in [-1, 1] {
            let name = format!("walk.{side}.{number:04}.exr");
            write(&a, &name, &plain(number, FrameKind::Traced));
            write(&b, &name, &plain(number, FrameKind::Traced));
        }
    }
    let result = compare(&a, &b, None).unwrap();
    assert_eq!(result.frames.iter().map(|f| f.frame).collect::<Vec<_>>(), [-1, 1, -1, 1]);
    assert_eq!((result.worst.error.psnr_db, result.mean.psnr_db), (None, None));
    let files: Vec<_> = result.frames.iter().map(|f| f.file.as_str()).collect();
    assert_eq!(
        files,
        ["walk.left.-001.exr", "walk.left.0001.exr", "walk.right.-001.exr", "walk.right.0001.exr"]
    );
    assert!(result.to_string().contains("walk.right.0001.exr  "), "{result}");
}

#[test]
fn frames_are_known_by_the_numbers_that_they_state() {
    for (pattern, names) in [
        ("s.%04d_v2.exr", ["s.-001_v2.exr", "s.0002_v2.exr"]),
        ("walk%04d.exr", ["walk-001.exr", "walk0002.exr"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        for (name, number) in names.into_iter().zip([-1, 2]) {
            write(&a, name, &plain(number, FrameKind::Traced));
            write(&b, &format!("other.{number:04}.exr"), &plain(number, FrameKind::Traced));
        }
        let frames = compare(&a, &b, None).unwrap().frames;
        assert_eq!(frames.iter().map(|f| f.frame).collect::<Vec<_>>(), [-1, 2], "{pattern}");
    }
}

#[test]
fn shots_with_numbers_in_their_names_are_kept_apart() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    for shot in ["s010", "s020"] {
        for place in [&a, &b] {
            write(place, &format!("{shot}.0001.exr"), &plain(1, FrameKind::Traced));
        }
    }
    let files = |of: &Comparison| of.frames.iter().map(|f| f.file.clone()).collect::<Vec<_>>();
    assert_eq!(files(&compare(&a, &b, None).unwrap()), ["s010.0001.exr", "s020.0001.exr"]);
}

#[test]
fn what_cannot_be_compared_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    assert_eq!(compare(&a, &b, None).unwrap_err().exit_code(), 3);
    write(&a, "walk.0001.exr", &plain(1, FrameKind::Traced));
    write(&b, "walk.0002.exr", &plain(1, FrameKind::Traced));
    assert!(compare(&a, &b, None).unwrap_err().to_string().contains("the name and number of one"));
    write(&b, "walk.0001.exr", &default_layers(frame(1, FrameKind::Traced, &Shape::whole(12, 16))));
    assert!(compare(&a, &b, None).unwrap_err().to_string().contains("24x16"));
    fs::write(b.join("walk.0001.exr"), "not an image").unwrap();
    let error = compare(&a, &b, None).unwrap_err();
    assert!(error.to_string().contains("walk.0001.exr"), "{error}");
}

#[test]
fn colours_are_read_from_whichever_part_has_them() {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
        LayerAttributes, WritableImage,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.1.exr");
    let part = |name: &str, channels: &[(&str, f32)]| {
        let channel = |&(name, value): &(&str, f32)| AnyChannel::new(name, FlatSamples::F32(vec![value; 6]));
        let channels = AnyChannels::sort(channels.iter().map(channel).collect());
        Layer::new((3, 2), LayerAttributes::named(name), Encoding::UNCOMPRESSED, channels)
    };
    let parts = [
        part("depth", &[("Z", 7.0)]),
        part("beauty", &[("R", 0.1), ("G", 0.2), ("B", 0.3), ("depth.Z", 4.0)]),
        part("other", &[("R", 0.5), ("G", 0.5), ("B", 0.5)]),
    ];
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((3, 2)));
    Image::from_layers(attributes, parts.to_vec()).write().to_file(&path).unwrap();
    let read = read_frame(&path).unwrap();
    assert_eq!((read.color, read.depth), (vec![[0.1, 0.2, 0.3, 1.0]; 6], vec![4.0; 6]));
}

#[test]
fn other_layers_come_back_too() {
    let folder = tempfile::tempdir().unwrap();
    let frame = plain(3, FrameKind::Inferred { from: 2 });
    write(folder.path(), "a.1.exr", &frame);
    let read = read_frame(&folder.path().join("a.1.exr")).unwrap();
    assert_eq!((read.width, read.height, read.kind), (24, 16, Some(frame.kind)));
    assert_eq!((read.depth, read.class), (frame.depth, frame.class));
}
