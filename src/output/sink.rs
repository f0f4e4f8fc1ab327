//! Frames to EXR files, beside the rendering of the next frame.
//!
//! `put` hands a frame to the pool that also renders (so that `-j` holds for everything); a thread that mostly waits for
//! the disk writes what the pool has encoded. At most [`ExrSink::IN_FLIGHT`] frames are on their way at a time.

use super::exr::{EncodedFrame, FileOptions, encode};
use super::folder::OutputFolder;
use super::write::write_whole;
use crate::frame::{Frame, FrameId, StageSeconds};
use crate::sequence::FrameSink;
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Writes each frame as a file of an [`OutputFolder`].
///
/// When it is dropped, frames that were put are still written; nothing is ever left half-written under a frame's name.
#[derive(Debug)]
pub struct ExrSink {
    folder: OutputFolder,
    options: Arc<FileOptions>,
    shared: Arc<Shared>,
    /// To the writer; `None` once the sink is being dropped.
    encoded: Option<Sender<Job>>,
    writer: Option<JoinHandle<()>>,
}

/// A frame on its way to the disk.
struct Job {
    id: FrameId,
    path: PathBuf,
    file: EncodedFrame,
    /// Seconds that encoding took.
    seconds: f64,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    in_flight: usize,
    free: Vec<Frame>,
    error: Option<Error>,
    failed: bool,
    seconds: Vec<(FrameId, StageSeconds)>,
    repaired: Vec<(FrameId, u64)>,
}

impl ExrSink {
    /// Frames that may be encoded or written at a time; `put` waits when there are so many. One is encoded while one is
    /// written; more would only take memory.
    pub const IN_FLIGHT: usize = 2;

    /// A sink that writes into `folder`.
    ///
    /// # Errors
    /// [`Error::Output`] if the system gives it no thread.
    pub fn new(folder: OutputFolder, options: FileOptions) -> Result<Self> {
        let shared = Arc::new(Shared::default());
        let (encoded, jobs) = channel();
        let for_writer = Arc::clone(&shared);
        let writer = std::thread::Builder::new()
            .name("buzz-writer".into())
            .spawn(move || write_all(&jobs, &for_writer))
            .map_err(|e| super::write::explain(folder.path(), &e))?;
        Ok(Self { folder, options: Arc::new(options), shared, encoded: Some(encoded), writer: Some(writer) })
    }

    /// The folder that is written to.
    pub fn folder(&self) -> &OutputFolder {
        &self.folder
    }

    /// Frames in which values were not finite or did not fit their channel, and how many; known after `finish`.
    pub fn repaired(&self) -> Vec<(FrameId, u64)> {
        let mut repaired = self.shared.lock().repaired.clone();
        repaired.sort_unstable();
        repaired
    }

    /// Waits until `ready`. A caller inside the pool works on the pool's tasks meanwhile: with one thread, nobody else
    /// would.
    fn wait(&self, ready: impl Fn(&State) -> bool) -> MutexGuard<'_, State> {
        let Shared { changed, .. } = &*self.shared;
        let mut state = self.shared.lock();
        if rayon::current_thread_index().is_none() {
            return changed.wait_while(state, |s| !ready(s)).unwrap_or_else(PoisonError::into_inner);
        }
        while !ready(&state) {
            drop(state);
            let has_worked = rayon::yield_now() == Some(rayon::Yield::Executed);
            state = self.shared.lock();
            if !has_worked {
                // Not for long: a task may come, of which nothing is said here.
                let waited = changed.wait_timeout_while(state, Duration::from_millis(1), |s| !ready(s));
                (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
            }
        }
        state
    }
}

impl Shared {
    /// The state is changed in single steps, so it is sound even if a thread died while holding it.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends a frame's flight.
    fn land(&self, update: impl FnOnce(&mut State)) {
        let mut state = self.lock();
        state.in_flight -= 1;
        update(&mut state);
        self.changed.notify_all();
    }
}

impl State {
    /// Keeps the first error; the later ones follow from it.
    fn fail(&mut self, error: Error) {
        self.failed = true;
        self.error.get_or_insert(error);
    }

    fn take_error(&mut self, folder: &Path) -> Result<()> {
        match self.error.take() {
            Some(error) => Err(error),
            // The error has been reported before; this only stops whoever goes on regardless.
            None if self.failed => Err(Error::output(folder, "an earlier frame could not be written")),
            None => Ok(()),
        }
    }
}

impl FrameSink for ExrSink {
    fn blank(&mut self) -> Option<Frame> {
        self.shared.lock().free.pop()
    }

    fn put(&mut self, frame: Frame) -> Result<()> {
        let mut state = self.wait(|s| s.in_flight < Self::IN_FLIGHT || s.failed);
        state.take_error(self.folder.path())?;
        state.in_flight += 1;
        drop(state);
        let Some(encoded) = self.encoded.clone() else { return Ok(()) };
        let (shared, options) = (Arc::clone(&self.shared), Arc::clone(&self.options));
        let path = self.folder.file_of(frame.id());
        rayon::spawn(move || {
            let start = Instant::now();
            let id = frame.id();
            let result = encode(&frame, &options);
            let seconds = start.elapsed().as_secs_f64();
            shared.lock().free.push(frame);
            match result {
                Ok(file) => {
                    // The writer lives as long as the sink, and the sink waits for every frame in flight.
                    if encoded.send(Job { id, path, file, seconds }).is_err() {
                        shared.land(|s| {
                            s.fail(Error::Frame {
                                frame: id.number,
                                message: "the writer has stopped".into(),
                            })
                        });
                    }
                }
                Err(error) => shared.land(|s| s.fail(error)),
            }
        });
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<(FrameId, StageSeconds)>> {
        let mut state = self.wait(|s| s.in_flight == 0);
        state.take_error(self.folder.path())?;
        let mut seconds = std::mem::take(&mut state.seconds);
        seconds.sort_by_key(|(id, _)| *id);
        Ok(seconds)
    }
}

impl Drop for ExrSink {
    fn drop(&mut self) {
        drop(self.wait(|s| s.in_flight == 0));
        self.encoded = None;
        if let Some(writer) = self.writer.take() {
            // It cannot be helped here if it panicked.
            let _ = writer.join();
        }
    }
}

/// The writer's thread: one file after the other; none after the first that fails.
fn write_all(jobs: &Receiver<Job>, shared: &Shared) {
    for Job { id, path, file, seconds } in jobs {
        if shared.lock().failed {
            shared.land(|_| ());
            continue;
        }
        let start = Instant::now();
        let result = write_whole(&path, file.parts.iter().map(Vec::as_slice));
        let write = seconds + start.elapsed().as_secs_f64();
        shared.land(|state| match result {
            Ok(()) => {
                state.seconds.push((id, StageSeconds { write, ..StageSeconds::default() }));
                if file.repaired > 0 {
                    state.repaired.push((id, file.repaired));
                }
            }
            Err(error) => state.fail(error),
        });
    }
}
