//! The files that frames become: read back by the `exr` crate, and by Python's OpenEXR and OpenImageIO.

mod support;

use buzz::frame::FrameKind;
use buzz::output::{Compression, ExrSink, FrameFile, NamePattern, OutputFolder};
use buzz::sequence::FrameSink;
use std::path::Path;
use support::{Shape, default_layers, frame, hash, options};

fn sink(folder: &Path, frames: impl IntoIterator<Item = i64>, compression: Compression) -> ExrSink {
    let names = NamePattern::parse("<stem>.%04d.exr", "test").unwrap();
    ExrSink::new(OutputFolder::open(folder, names, frames).unwrap(), options(compression)).unwrap()
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
    assert_eq!(seconds.iter().map(|s| s.0).collect::<Vec<_>>(), (-2..=6).collect::<Vec<_>>());
    assert!(seconds.iter().all(|s| s.1.write > 0.0));
    assert_eq!(sink.repaired(), []);
    for number in -2..=6 {
        let FrameFile::Complete(stats, kind) = sink.folder().check(number, &hash()) else {
            panic!("{number}: {:?}", sink.folder().check(number, &hash()));
        };
        assert_eq!(stats, frame(number, kind, &Shape::whole(64, 50)).stats);
        assert_eq!(kind == FrameKind::Traced, number == -2);
    }
    drop(sink);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 9, "nothing but the frames is left");
}
