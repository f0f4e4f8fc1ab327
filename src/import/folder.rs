//! The folder that a scene is read from, and what its names lead to.

use crate::{Error, Result};
use std::{
    cell::RefCell,
    collections::BTreeSet,
    fs,
    path::{Component, Path, PathBuf},
};

/// The folder that a file is in, canonical: nothing outside is ever read.
pub(super) struct Folder {
    path: PathBuf,
    /// The file, and all that were found.
    files: RefCell<BTreeSet<PathBuf>>,
}

impl Folder {
    /// The folder that holds `file`.
    pub fn of(file: &Path) -> Result<Self> {
        let parent = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let real = |path| fs::canonicalize(path);
        let failed = |e| Error::input(file, "folder", format!("cannot be read ({e})"));
        let (path, file) = (real(parent).map_err(failed)?, real(file).map_err(failed)?);
        Ok(Self { path, files: RefCell::new(BTreeSet::from([file])) })
    }

    /// What a scene is read from that is in it.
    pub fn into_files(self) -> BTreeSet<PathBuf> {
        self.files.into_inner()
    }

    /// The file `path` in the folder or below, or why it will not be read.
    pub fn find(&self, path: &str) -> Result<Source, String> {
        refuse_scheme(path)?;
        self.below(path)
    }

    /// [`Folder::find`] for a path that may have colons.
    pub fn below(&self, path: &str) -> Result<Source, String> {
        // Windows tools write back-slashes; on other systems they would be part of the name.
        let path = path.replace('\\', "/");
        let refuse = |why: &str| Err(refusal(&path, why));
        let mut depth = 0_i32;
        for component in Path::new(&path).components() {
            match component {
                Component::Normal(_) => depth += 1,
                Component::CurDir => {}
                Component::ParentDir => depth -= 1,
                Component::RootDir | Component::Prefix(_) => return refuse("is absolute"),
            }
            if depth < 0 {
                return refuse("leaves the folder");
            }
        }
        let full = self.path.join(&path);
        let Ok(real) = fs::canonicalize(&full) else { return Ok(Source::Missing(full)) };
        if !real.starts_with(&self.path) {
            return refuse("is a link that leaves the folder");
        }
        self.files.borrow_mut().insert(real.clone());
        Ok(Source::File(real))
    }
}

/// Where a URI leads.
pub(super) enum Source {
    /// The bytes stood in the URI.
    Data(Vec<u8>),
    /// A file in the document's folder or below; it exists.
    File(PathBuf),
    /// A file that is not there.
    Missing(PathBuf),
}

/// Refuses a text that begins as a URI does that is not relative, or as a path does that names a drive.
pub(super) fn refuse_scheme(text: &str) -> Result<(), String> {
    let scheme = text.split_once(':').map_or("", |(scheme, _)| scheme);
    let has_scheme =
        !scheme.is_empty() && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    if has_scheme { Err(refusal(text, "has a scheme")) } else { Ok(()) }
}

/// Says why `path` will not be read.
fn refusal(path: &str, why: &str) -> String {
    format!("`{path}` {why}; only files in the scene's own folder are read")
}
