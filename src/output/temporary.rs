//! Files that must not outlive their run: each has a name that no other file had, and goes with whoever holds it.
//!
//! Names are drawn by chance, not made of the process's number: in containers, and on machines that share a folder, two
//! runs may have the same one. A run that is ended at once removes its own on the way out ([`remove_temporary_files`]).

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::{Builder, NamedTempFile};

/// Those of this process that are there now.
static THERE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// A new file; removed when dropped, unless it was given its place.
#[derive(Debug)]
pub(super) struct Temporary(NamedTempFile);

impl Temporary {
    /// In `folder`, named `prefix`, letters and digits, `suffix`; open for reading and writing.
    pub fn new(folder: &Path, prefix: &str, suffix: &str) -> io::Result<Self> {
        let mut there = there();
        // With the permissions of any other file, as others on the folder must be able to read a lock.
        let open = |path: &Path| OpenOptions::new().read(true).write(true).create_new(true).open(path);
        let file = Builder::new().prefix(prefix).suffix(suffix).make_in(folder, open)?;
        there.insert(file.path().to_path_buf());
        Ok(Self(file))
    }

    /// The open file.
    pub fn file(&mut self) -> &mut File {
        self.0.as_file_mut()
    }

    /// Becomes the file `path` in the same folder: a rename across file systems would not be atomic.
    pub fn rename(mut self, path: &Path) -> io::Result<()> {
        let own = self.0.path().to_path_buf();
        let renamed = std::fs::rename(&own, path);
        self.0.disable_cleanup(renamed.is_ok());
        renamed
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        there().remove(self.0.path());
    }
}

/// Removes all of this process that are there, and makes none from then on: only for a process that is about to end.
pub fn remove_temporary_files() {
    let there = there();
    for path in there.iter() {
        // Nothing can be done about a failure here; the next run tidies up.
        let _ = std::fs::remove_file(path);
    }
    std::mem::forget(there);
}

fn there() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    THERE.lock().unwrap_or_else(PoisonError::into_inner)
}
