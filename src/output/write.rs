//! Files that are whole or not there: written beside their place under another name, forced to disk, then renamed.

use super::temporary::Temporary;
use crate::{Error, Result, error::reason};
use std::collections::HashSet;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::Path;

/// Writes `parts` one after the other as the file `path`.
///
/// # Errors
/// [`Error::Output`]; then nothing is left behind, and what was at `path` before is still there.
pub(super) fn write_whole<'a>(path: &Path, parts: impl IntoIterator<Item = &'a [u8]>) -> Result<()> {
    write_and_rename(path, parts).map_err(|error| explain(path, &error))
}

/// Writes a file whole or not at all: makes its folder if need be, and removes what a killed run left.
///
/// # Errors
/// [`Error::Output`].
pub fn write_alone(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = folder_of(path);
    fs::create_dir_all(folder).map_err(|e| explain(folder, &e))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    remove_leftovers(folder, &HashSet::from([name]))?;
    write_whole(path, [bytes])
}

/// True if a file of this name in `folder` could not have the longer name that it has while it is written. Makes nothing.
pub fn is_too_long(folder: &Path, name: &str) -> bool {
    let temporary = folder.join(format!("{}xxxxxx{SUFFIX}", prefix(name)));
    fs::symlink_metadata(temporary).is_err_and(|e| e.kind() == io::ErrorKind::InvalidFilename)
}

/// True if `file` is anything but empty or a file that has our `mark` in it, whatever else that is.
pub fn is_anothers(file: &Path, mark: &str) -> bool {
    let Ok(found) = fs::metadata(file) else { return false };
    // To open a pipe would wait for whoever writes to it.
    let bytes = if found.is_file() { fs::read(file).ok() } else { None };
    let has_mark = |bytes: &[u8]| bytes.windows(mark.len()).any(|part| part == mark.as_bytes());
    bytes.is_none_or(|bytes| !bytes.is_empty() && !has_mark(&bytes))
}

fn write_and_rename<'a>(path: &Path, parts: impl IntoIterator<Item = &'a [u8]>) -> io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut temporary = Temporary::new(folder_of(path), &prefix(&name), SUFFIX)?;
    let file = temporary.file();
    // So that no other run takes it for what a killed one left; where there are no locks, it has to do without.
    let _ = file.try_lock();
    for part in parts {
        file.write_all(part)?;
    }
    // A rename may reach the disk before the contents do: without this, a power cut leaves an empty frame.
    file.sync_all()?;
    temporary.rename(path)
}

/// What the temporary name of a file begins with; letters drawn by chance follow.
fn prefix(name: &str) -> String {
    format!(".{name}.")
}

/// What temporary names end with.
const SUFFIX: &str = ".tmp";

/// The folder that a file is in.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Removes what killed runs left of the files `names` in `folder`, but for what a live one is writing.
pub(super) fn remove_leftovers(folder: &Path, names: &HashSet<String>) -> Result<()> {
    let entries = fs::read_dir(folder).map_err(|e| explain(folder, &e))?;
    for entry in entries {
        let entry = entry.map_err(|e| explain(folder, &e))?;
        let ours = entry.file_name().to_str().and_then(temporary_of).is_some_and(|name| names.contains(name));
        if ours && !is_being_written(&entry.path()) {
            fs::remove_file(entry.path()).map_err(|e| explain(&entry.path(), &e))?;
        }
    }
    Ok(())
}

/// True if a live run holds the file's lock.
fn is_being_written(path: &Path) -> bool {
    open_to_lock(path).is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

/// Opens another run's file. Network file systems lock only what is open for writing; another user's may not be.
pub(super) fn open_to_lock(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).open(path).or_else(|_| File::open(path))
}

/// The file for which `name` is a temporary name.
fn temporary_of(name: &str) -> Option<&str> {
    let (name, letters) = name.strip_prefix('.')?.strip_suffix(SUFFIX)?.rsplit_once('.')?;
    (!letters.is_empty() && letters.bytes().all(|b| b.is_ascii_alphanumeric())).then_some(name)
}

/// An error of the file system, with what the user can do about it.
pub(super) fn explain(path: &Path, error: &io::Error) -> Error {
    let advice = match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            ": free some space, then run again (what is whole stays with --skip-existing)"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            ": choose a folder that may be written to"
        }
        io::ErrorKind::NotFound if path.parent().is_some_and(Path::is_dir) => {
            return Error::output(path, "it cannot be made there; choose another folder");
        }
        io::ErrorKind::NotFound => ": see whether its folder is there",
        io::ErrorKind::FileTooLarge => ": raise the limit on file sizes, then run again",
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => ": it must be a folder",
        io::ErrorKind::IsADirectory => ": it must be a file; move the folder away",
        io::ErrorKind::StaleNetworkFileHandle | io::ErrorKind::TimedOut => {
            ": see whether the folder is still connected, then run again"
        }
        _ => "",
    };
    Error::output(path, format!("{}{advice}", reason(error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listing(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_whole_and_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.0001.exr");
        write_whole(&path, [b"one".as_slice(), b"two"]).unwrap();
        write_whole(&path, [b"three".as_slice()]).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"three");
        assert_eq!(listing(folder.path()), ["a.0001.exr"]);
    }

    #[test]
    fn a_failed_write_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.0001.exr");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("kept"), "").unwrap();
        let error = write_whole(&path, [b"one".as_slice()]).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert_eq!(listing(folder.path()), ["a.0001.exr"]);
    }

    #[test]
    fn what_a_live_run_writes_is_no_leftover() {
        let folder = tempfile::tempdir().unwrap();
        let mut live = Temporary::new(folder.path(), ".a.0001.exr.", ".tmp").unwrap();
        live.file().try_lock().unwrap();
        let names = HashSet::from(["a.0001.exr".to_string()]);
        remove_leftovers(folder.path(), &names).unwrap();
        assert_eq!(listing(folder.path()).len(), 1);
        live.file().unlock().unwrap();
        remove_leftovers(folder.path(), &names).unwrap();
        assert!(listing(folder.path()).is_empty());
    }

    #[test]
    fn only_our_own_leftovers_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let kept = [
            ".a.0002.exr.12.tmp",
            ".a.0001.exr.x-y.tmp",
            ".a.0001.exr.tmp",
            "a.0001.exr.12.tmp",
            "a.0001.exr",
        ];
        for name in kept.iter().chain(&[".a.0001.exr.12.tmp", ".a.0001.exr.x3Yz.tmp"]) {
            fs::write(folder.path().join(name), "").unwrap();
        }
        remove_leftovers(folder.path(), &HashSet::from(["a.0001.exr".to_string()])).unwrap();
        let mut kept = kept.map(String::from).to_vec();
        kept.sort();
        assert_eq!(listing(folder.path()), kept);
    }
}
