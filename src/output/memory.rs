//! Sinks that write no files: for tests, measurements and callers of the library.

use crate::Result;
use crate::frame::{Frame, FrameId, StageSeconds};
use crate::sequence::FrameSink;

/// Keeps every frame.
#[derive(Debug, Default)]
pub struct MemorySink {
    /// The frames, in the order in which they were finished.
    pub frames: Vec<Frame>,
}

impl FrameSink for MemorySink {
    fn blank(&mut self) -> Option<Frame> {
        None
    }

    fn put(&mut self, frame: Frame) -> Result<()> {
        self.frames.push(frame);
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<(FrameId, StageSeconds)>> {
        Ok(Vec::new())
    }
}

/// Forgets every frame, and gives its buffers back.
#[derive(Debug, Default)]
pub struct NullSink {
    free: Option<Frame>,
}

impl FrameSink for NullSink {
    fn blank(&mut self) -> Option<Frame> {
        self.free.take()
    }

    fn put(&mut self, frame: Frame) -> Result<()> {
        self.free = Some(frame);
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<(FrameId, StageSeconds)>> {
        Ok(Vec::new())
    }
}
