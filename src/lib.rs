//! Renders animated camera moves: traces key frames, infers the frames between them.

pub mod error;
pub mod frame;
pub mod measure;
pub mod output;
pub mod scene;
pub mod sequence;

pub use error::{Error, Result};
