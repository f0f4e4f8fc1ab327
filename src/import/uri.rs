//! URIs of buffers and images: data, or a file in the document's own folder.

use super::document::Document;
use crate::{Error, Result};
use base64::{
    Engine,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::percent_decode_str;
use std::{
    cell::RefCell,
    collections::BTreeSet,
    fs,
    path::{Component, Path, PathBuf},
};

/// Exporters leave out the padding, or leave stray bits in the last digit.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

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

impl Source {
    /// The bytes; a missing file is an error.
    pub fn read(self, document: &Document, place: &str) -> Result<Vec<u8>> {
        match self {
            Self::Data(bytes) => Ok(bytes),
            Self::File(path) => document.read_named(&path, place),
            Self::Missing(path) => {
                let message = format!("{} is missing; put it beside the file", path.display());
                Err(document.error(place, message))
            }
        }
    }
}

/// Whether a URI holds its data itself.
pub(super) fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// Resolves a URI found at `place`, or refuses it.
pub(super) fn resolve(document: &Document, uri: &str, place: &str) -> Result<Source> {
    if is_data(uri) {
        return data(document, &uri[5..], place).map(Source::Data);
    }
    if uri.is_empty() {
        return Err(document.error(place, "the URI is empty; export the file again"));
    }
    let path = percent_decode_str(uri)
        .decode_utf8()
        .map_err(|_| document.error(place, "the URI is not UTF-8 after percent-decoding"))?;
    // A colon that is encoded is part of a name.
    let source = if has_scheme(uri) { Err(refusal(uri, SCHEME)) } else { below(&document.folder, &path) };
    source.map_err(|why| document.error(place, why))
}

/// The file `path` in `folder` or below, or why it will not be read.
pub(super) fn in_folder(folder: &Folder, path: &str) -> Result<Source, String> {
    if has_scheme(path) { Err(refusal(path, SCHEME)) } else { below(folder, path) }
}

/// What is wrong with a name that [`has_scheme`].
const SCHEME: &str = "has a scheme";

/// Says why `path` will not be read.
fn refusal(path: &str, why: &str) -> String {
    format!("`{path}` {why}; only files in the scene's own folder are read")
}

/// Whether a text begins as a URI does that is not relative, or as a path does that names a drive.
fn has_scheme(text: &str) -> bool {
    let scheme = text.split_once(':').map_or("", |(scheme, _)| scheme);
    !scheme.is_empty() && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
}

/// [`in_folder`] for a path that may have colons.
fn below(folder: &Folder, path: &str) -> Result<Source, String> {
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
    let full = folder.path.join(&path);
    let Ok(real) = fs::canonicalize(&full) else { return Ok(Source::Missing(full)) };
    if !real.starts_with(&folder.path) {
        return refuse("is a link that leaves the folder");
    }
    folder.files.borrow_mut().insert(real.clone());
    Ok(Source::File(real))
}

/// The bytes of `[<type>][;base64],<data>`.
fn data(document: &Document, rest: &str, place: &str) -> Result<Vec<u8>> {
    let (head, body) = rest
        .split_once(',')
        .ok_or_else(|| document.error(place, "a data URI without a comma; export the file again"))?;
    if !head.to_ascii_lowercase().ends_with(";base64") {
        return Ok(percent_decode_str(body).collect());
    }
    let digits: Vec<u8> = percent_decode_str(body).filter(|b| !b.is_ascii_whitespace()).collect();
    BASE64
        .decode(digits)
        .map_err(|e| document.error(place, format!("invalid base64 ({e}); export the file again")))
}
