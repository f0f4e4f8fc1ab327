//! Everything that leaves the program: EXR files, their names, locks and resumption, and the report.
//!
//! The renderer pushes finished frames into a [`crate::sequence::FrameSink`]; the sinks are here. [`ExrSink`] encodes
//! beside the rendering of the next frame and never leaves a partial file under a frame's name.

pub mod exr;
mod folder;
mod hash;
mod lock;
mod memory;
mod naming;
mod page;
mod peak;
mod report;
mod resume;
mod review;
mod runs;
mod sink;
mod temporary;
mod thumbnails;
mod write;

pub use exr::{Compression, FileOptions};
pub use folder::OutputFolder;
pub use hash::{SettingsHash, SettingsHasher};
pub use lock::FrameLock;
pub use memory::{MemorySink, NullSink};
pub use naming::{NamePattern, NumberInName, number_in_name, numbers_in_name};
pub use peak::{most_bytes, peak_bytes};
pub use report::{
    FrameRecord, FrameReport, IgnoredFeature, KeyFrame, Plan, Report, ReportInput, Run, RunSeconds,
    SceneSummary, SegmentRange, Settings, TotalSeconds, Totals,
};
pub use resume::FrameFile;
pub use review::Review;
pub use runs::earlier_runs;
pub use sink::ExrSink;
pub use temporary::remove_temporary_files;
pub use thumbnails::{Thumbnail, Thumbnails, WithThumbnails};
pub use write::{is_anothers, is_too_long, write_alone};
