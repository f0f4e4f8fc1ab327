//! Two runs must not write the same files: each run holds a lock on the names that it may write.
//!
//! The lock is the operating system's on a small file (`.buzz-<letters>.lock`) in the output folder that lists the
//! names. It ends with its process, however that dies; the file that is left then is removed by the next run. Runs that
//! share a folder but no frames do not disturb each other.

use super::temporary::Temporary;
use super::write::{explain, open_to_lock};
use crate::{Error, Result};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A run's claim on file names in a folder; given up when dropped.
#[derive(Debug)]
pub struct FrameLock {
    /// Holds the system's lock until it is removed. `None` where the file system has no locks.
    file: Option<Temporary>,
}

/// How long another run may take to register before something must be wrong.
const PATIENCE: Duration = Duration::from_secs(10);
/// What locks' names begin and end with.
const PREFIX: &str = ".buzz-";
const SUFFIX: &str = ".lock";
/// Taken for moments only, while a run looks for others and registers itself.
const REGISTER: &str = ".buzz.lock";
/// Between names in a list: the one character beside the folders' that no name has.
const SEPARATOR: &str = "\0";
/// Largest list of names that is read from another run's lock.
const LONGEST_LIST: u64 = 64 << 20;

impl FrameLock {
    /// Claims `names` in `folder`.
    ///
    /// On a file system without locks there is nothing to hold, and [`FrameLock::is_held`] is false.
    ///
    /// # Errors
    /// [`Error::Output`] if another run holds one of the names, or the folder cannot be written.
    pub fn acquire(folder: &Path, names: &[String]) -> Result<Self> {
        let Some(register) = Register::enter(folder)? else {
            return Ok(Self { file: None });
        };
        refuse_if_claimed(folder, names)?;
        let mut file = Temporary::new(folder, PREFIX, SUFFIX).map_err(|e| explain(folder, &e))?;
        let claim = |file: &mut File| {
            file.try_lock()?;
            let _ = open_to_all(file);
            file.write_all(names.join(SEPARATOR).as_bytes())?;
            // Other machines see what has reached the server.
            file.sync_all()
        };
        claim(file.file()).map_err(|e| explain(folder, &e))?;
        drop(register);
        Ok(Self { file: Some(file) })
    }

    /// False where the file system cannot lock: then nothing keeps a second run away.
    pub fn is_held(&self) -> bool {
        self.file.is_some()
    }
}

/// Looks at the other runs' locks: an error if a live one claims one of `names`; dead ones are removed.
fn refuse_if_claimed(folder: &Path, names: &[String]) -> Result<()> {
    let wanted: std::collections::HashSet<&str> = names.iter().map(String::as_str).collect();
    for entry in fs::read_dir(folder).map_err(|e| explain(folder, &e))? {
        let path = entry.map_err(|e| explain(folder, &e))?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        if !(name.starts_with(PREFIX) && name.ends_with(SUFFIX)) {
            continue;
        }
        if fs::metadata(&path).is_ok_and(|found| !found.is_file()) {
            continue;
        }
        let file = match open_to_lock(&path) {
            // It may vanish while we look: its run has just ended.
            Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
            file => file.map_err(|e| explain_lock(&path, &e))?,
        };
        // There are locks here, so what cannot be locked, whatever the reason, is taken to be held.
        if file.try_lock().is_ok() {
            let _ = fs::remove_file(&path);
            continue;
        }
        let mut list = String::new();
        file.take(LONGEST_LIST).read_to_string(&mut list).map_err(|e| explain(&path, &e))?;
        if let Some(claimed) = list.split(SEPARATOR).find(|n| wanted.contains(n)) {
            let message = format!(
                "another run ({name}) is writing it: wait for that run, or choose other --frames or another folder"
            );
            return Err(Error::output(folder.join(claimed), message));
        }
    }
    Ok(())
}

/// The right to look at and change the folder's locks, held for moments.
struct Register {
    _file: File,
    path: PathBuf,
}

impl Register {
    /// Waits for the right. `None` if the file system has no locks.
    fn enter(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(REGISTER);
        let start = Instant::now();
        if fs::metadata(&path).is_ok_and(|found| !found.is_file()) {
            return Err(Error::output(path, "is no file, and in the way of locking the folder; remove it"));
        }
        loop {
            let existed = path.exists();
            let file = Self::open(&path).map_err(|e| explain_lock(&path, &e))?;
            match file.try_lock() {
                // Whoever held it before has removed it: ours must be the file that is there now.
                Ok(()) if is_at(&file, &path) => return Ok(Some(Self { _file: file, path })),
                Ok(()) => {}
                Err(TryLockError::Error(_)) => {
                    if !existed {
                        let _ = fs::remove_file(&path);
                    }
                    return Ok(None);
                }
                Err(TryLockError::WouldBlock) => {
                    if start.elapsed() > PATIENCE {
                        let message = "another run has held it for 10 seconds: end that run, then try again";
                        return Err(Error::output(path, message));
                    }
                    std::thread::sleep(Duration::from_millis(2));
                }
            }
        }
    }

    /// Opens the file, or makes it. In a folder for all, some systems let nobody but its user open a file to make it.
    fn open(path: &Path) -> io::Result<File> {
        let made = OpenOptions::new().write(true).create(true).truncate(false).open(path);
        match made {
            Ok(file) => {
                let _ = open_to_all(&file);
                Ok(file)
            }
            Err(denied) => open_to_lock(path).map_err(|_| denied),
        }
    }
}

impl Drop for Register {
    fn drop(&mut self) {
        // While still locked, so that nobody takes a lock on a file that is about to vanish without noticing.
        if cfg!(unix) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Lets other users lock the file, whatever the mask of this process. Of their own files this fails, and need not be done.
#[cfg(unix)]
fn open_to_all(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o666))
}

/// Elsewhere a file has the rights that its folder gives it.
#[cfg(not(unix))]
fn open_to_all(_: &File) -> io::Result<()> {
    Ok(())
}

/// Why a file that locks the folder cannot be opened.
fn explain_lock(path: &Path, error: &io::Error) -> Error {
    if error.kind() == io::ErrorKind::PermissionDenied && path.exists() {
        let message =
            format!("{error}: another user's run has locked the folder; if it has ended, remove the file");
        return Error::output(path, message);
    }
    explain(path, error)
}

/// True if the open `file` is the one named `path` now.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(a), Ok(b)) => a.ino() == b.ino() && a.dev() == b.dev(),
        _ => false,
    }
}

/// True if the open `file` is the one named `path` now: elsewhere it is never removed.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(range: std::ops::Range<u32>) -> Vec<String> {
        range.map(|n| format!("a.{n:04}.exr")).collect()
    }

    #[test]
    fn the_second_run_is_refused_only_for_the_same_frames() {
        let folder = tempfile::tempdir().unwrap();
        let first = FrameLock::acquire(folder.path(), &names(1..10)).unwrap();
        assert!(first.is_held());
        let error = FrameLock::acquire(folder.path(), &names(9..20)).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("a.0009.exr"), "{error}");
        let beside = FrameLock::acquire(folder.path(), &names(10..20)).unwrap();
        drop(first);
        let again = FrameLock::acquire(folder.path(), &names(1..10)).unwrap();
        drop((beside, again));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn names_of_several_lines_are_names() {
        let folder = tempfile::tempdir().unwrap();
        let name = ["two\nlines.0001.exr".to_owned()];
        let _held = FrameLock::acquire(folder.path(), &name).unwrap();
        FrameLock::acquire(folder.path(), &name).unwrap_err();
    }

    #[test]
    fn a_dead_runs_lock_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(".buzz-1-0.lock"), names(1..10).join(SEPARATOR)).unwrap();
        fs::write(folder.path().join(REGISTER), "").unwrap();
        let lock = FrameLock::acquire(folder.path(), &names(1..10)).unwrap();
        assert!(!folder.path().join(".buzz-1-0.lock").exists());
        drop(lock);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_live_lock_stays_whatever_the_process_is_called() {
        let folder = tempfile::tempdir().unwrap();
        let first = FrameLock::acquire(folder.path(), &names(1..10)).unwrap();
        let locks = || fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()).collect::<Vec<_>>();
        let before = locks();
        assert_eq!(before.len(), 1);
        // Not even runs with one process number, as in two containers, have a lock of the same name.
        let second = FrameLock::acquire(folder.path(), &names(10..20)).unwrap();
        drop(second);
        assert_eq!(locks(), before);
        FrameLock::acquire(folder.path(), &names(1..2)).unwrap_err();
        drop(first);
    }

    #[test]
    fn of_many_at_once_exactly_one_gets_the_frames() {
        let folder = tempfile::tempdir().unwrap();
        let results: Vec<_> = std::thread::scope(|scope| {
            let run = || FrameLock::acquire(folder.path(), &names(1..3));
            let threads: Vec<_> = (0..8).map(|_| scope.spawn(run)).collect();
            threads.into_iter().map(|t| t.join().unwrap()).collect()
        });
        assert_eq!(results.iter().filter(|r| r.is_ok()).count(), 1);
    }
}
