//! The driver: knows plan, trace and infer, and pushes finished frames into a [`FrameSink`].

use crate::error::Result;
use crate::frame::{Frame, StageSeconds};

/// Where finished frames go: EXR files, memory, or nowhere.
pub trait FrameSink {
    /// A frame whose buffers may be filled: one that has been written already, or a new one.
    fn blank(&mut self) -> Option<Frame>;

    /// Takes a finished frame. May return before it is written: encoding runs beside the next frame's rendering.
    fn put(&mut self, frame: Frame) -> Result<()>;

    /// Waits until all frames are written. Returns the seconds that each frame's encoding and writing took.
    fn finish(&mut self) -> Result<Vec<(i64, StageSeconds)>>;
}
