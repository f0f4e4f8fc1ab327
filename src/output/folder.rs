//! The output folder of a run: made, locked for the run's frames, and cleared of what a killed run left.

use super::write::{explain, is_too_long, remove_leftovers};
use super::{FrameFile, FrameLock, NamePattern, SettingsHash};
use crate::frame::FrameId;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// A folder in which this run alone may write its frames, until this is dropped.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    names: NamePattern,
    lock: FrameLock,
    // Dropped last: the lock's file is in it.
    _made: Made,
}

/// The folders that had to be made, the deepest first. Those in which nothing was written are removed again.
#[derive(Debug)]
struct Made(Vec<PathBuf>);

impl Made {
    fn make(path: &Path) -> Result<Self> {
        let missing = path.ancestors().take_while(|p| !p.as_os_str().is_empty() && !p.exists());
        let made = Self(missing.map(Path::to_path_buf).collect());
        std::fs::create_dir_all(path).map_err(|e| explain(path, &e))?;
        Ok(made)
    }
}

impl Drop for Made {
    fn drop(&mut self) {
        // What is not empty cannot be removed, and is to stay.
        let _ = self.0.iter().try_for_each(std::fs::remove_dir);
    }
}

impl OutputFolder {
    /// Makes the folder if need be, claims the files of `frames` in it, and removes temporary files that a killed run left
    /// of them.
    ///
    /// # Errors
    /// [`Error::Output`] if the folder cannot be made or written, if a name is too long, or if another run is writing one of the
    /// frames.
    pub fn open(path: &Path, names: NamePattern, frames: impl IntoIterator<Item = FrameId>) -> Result<Self> {
        let made = Made::make(path)?;
        let files: Vec<String> = frames.into_iter().map(|id| names.file_of(id)).collect();
        let longest = files.iter().max_by_key(|name| name.len());
        if let Some(long) = longest.filter(|name| is_too_long(path, name)) {
            let message = "its name is too long for this file system; give a shorter --name";
            return Err(Error::output(path.join(long), message));
        }
        let lock = FrameLock::acquire(path, &files)?;
        remove_leftovers(path, &files.into_iter().collect())?;
        Ok(Self { path: path.to_path_buf(), names, lock, _made: made })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where `frame` is written.
    pub fn file_of(&self, frame: FrameId) -> PathBuf {
        self.path.join(self.names.file_of(frame))
    }

    /// What the frames are called.
    pub fn names(&self) -> &NamePattern {
        &self.names
    }

    /// What stands there now.
    pub fn check(&self, frame: FrameId, settings_hash: &SettingsHash) -> FrameFile {
        FrameFile::check(&self.file_of(frame), frame, settings_hash)
    }

    /// False where the file system cannot lock: then nothing keeps a second run away.
    pub fn is_locked(&self) -> bool {
        self.lock.is_held()
    }
}
