//! Which picture of a pair a frame is.

use serde::{Deserialize, Serialize};
use std::fmt;

/// An eye of a stereo pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StereoEye {
    /// Inferred through time.
    Left,
    /// Inferred from the left one.
    Right,
}

impl StereoEye {
    /// The word in file names and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// A frame's number and, in stereo, whose it is. In order of time, left before right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FrameId {
    /// Frame number.
    pub number: i64,
    /// None where there is one picture a frame.
    pub eye: Option<StereoEye>,
}

impl From<i64> for FrameId {
    fn from(number: i64) -> Self {
        Self { number, eye: None }
    }
}

impl fmt::Display for FrameId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.number)?;
        self.eye.map_or(Ok(()), |eye| write!(f, " {}", eye.name()))
    }
}
