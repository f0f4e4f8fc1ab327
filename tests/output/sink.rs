//! Sequences as they are written: whole or not at all, the same by any number of threads, and known again.

use crate::support::{Shape, bytes_of, default_layers, frame, hash, options};
use buzz::frame::{FrameId, FrameKind, StereoEye};
use buzz::output::exr::encode;
use buzz::output::{Compression, ExrSink, FrameFile, NamePattern, OutputFolder, SettingsHasher};
use buzz::sequence::FrameSink;
use std::fs;
use std::path::Path;

fn sink(folder: &Path, frames: impl IntoIterator<Item = i64>, compression: Compression) -> ExrSink {
    let names = NamePattern::parse("<stem>.%04d.exr", "test").unwrap();
    ExrSink::new(
        OutputFolder::open(folder, names, frames.into_iter().map(Into::into)).unwrap(),
        options(compression),
    )
    .unwrap()
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
