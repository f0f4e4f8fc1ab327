//! Renders animated camera moves: traces key frames, infers the frames between them.

pub mod accel;
pub mod error;
pub mod frame;
pub mod import;
pub mod infer;
pub mod measure;
pub mod output;
pub mod plan;
pub mod scene;
pub mod sequence;
pub mod trace;

pub use error::{Error, Result};
