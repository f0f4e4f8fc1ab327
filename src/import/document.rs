//! A glTF document as JSON, read element by element with the JSON pointer at hand.
//!
//! The `gltf` crate is not used to parse. It rejects what is met in the wild (animation pointers fail the whole
//! parse, textures without a `source`, required `KHR_materials_volume`), keeps node matrices in single
//! precision, and panics or underflows on broken files (POSITION as VEC2, a count of 0, a GLB length under 12).
//! Working round it needs a validator as long as this reader, and would still not give the element's pointer.

use super::folder::Folder;
use crate::{Error, Result, error::reason};
use serde_json::{Map, Value};
use std::{
    fs, io,
    path::{Path, PathBuf},
    rc::Rc,
};

/// A parsed file.
pub(super) struct Document {
    /// As the user named it; for messages.
    pub file: PathBuf,
    /// The folder that holds it.
    pub folder: Folder,
    /// The whole tree.
    root: Value,
    /// The GLB's binary chunk.
    pub binary: Option<Rc<Vec<u8>>>,
    /// Size of the file.
    pub bytes: usize,
}

/// A value of the document and where it stands.
#[derive(Clone)]
pub(super) struct Element<'a> {
    /// The file it is in.
    pub document: &'a Document,
    /// The JSON itself.
    pub value: &'a Value,
    /// JSON pointer.
    pub place: String,
}

impl Document {
    /// Reads a `.gltf` or `.glb`; which one it is follows from the first bytes.
    pub fn read(file: &Path) -> Result<Self> {
        let bytes = read_file(file)?;
        let folder = Folder::of(file)?;
        let size = bytes.len();
        let (json, binary) =
            if bytes.starts_with(b"glTF") { split_glb(file, &bytes)? } else { (bytes.as_slice(), None) };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
        let root: Value = serde_json::from_slice(json).map_err(|e| match other_kind(file, json) {
            Some(message) => Error::input(file, "file", message),
            None => Error::json(file, &e, "not valid JSON: is this a glTF file? Copy or export it again"),
        })?;
        let binary = binary.map(|bytes| Rc::new(bytes.to_vec()));
        let document = Self { file: file.to_owned(), folder, root, binary, bytes: size };
        document.check_version()?;
        Ok(document)
    }

    /// The document's own element.
    pub fn root(&self) -> Element<'_> {
        Element { document: self, value: &self.root, place: String::new() }
    }

    /// An error in this file.
    pub fn error(&self, place: impl Into<String>, message: impl Into<String>) -> Error {
        let place = place.into();
        Error::input(&self.file, if place.is_empty() { "/".to_owned() } else { place }, message)
    }

    /// Reads a file that the element at `place` names.
    pub fn read_named(&self, path: &Path, place: &str) -> Result<Vec<u8>> {
        read_regular(path).map_err(|why| self.error(place, format!("{} {why}", path.display())))
    }

    /// Number of elements in a top-level array; 0 where there is none.
    pub fn count(&self, array: &str) -> usize {
        self.root.get(array).and_then(Value::as_array).map_or(0, Vec::len)
    }

    /// Element `index` of a top-level array, asked for by what stands at `user`.
    pub fn element(&self, array: &str, index: usize, user: &str) -> Result<Element<'_>> {
        match self.root.get(array).and_then(|a| a.get(index)) {
            Some(value) => Ok(Element { document: self, value, place: format!("/{array}/{index}") }),
            None => Err(self.error(
                user,
                format!(
                    "refers to /{array}/{index}, but there are {}; export the file again",
                    self.count(array)
                ),
            )),
        }
    }

    /// All elements of a top-level array.
    pub fn elements(&self, array: &str) -> Result<Vec<Element<'_>>> {
        self.root().items(array)
    }

    fn check_version(&self) -> Result<()> {
        if !self.root.is_object() {
            return Err(self.error("/", "not a JSON object; is this a glTF file?"));
        }
        let asset = self.root().get("asset").ok_or_else(|| {
            self.error("/asset", "missing; is this a glTF 2.0 file? Export it again as glTF 2.0")
        })?;
        let wanted = match asset.text("minVersion")? {
            Some(version) => version,
            None => asset.text("version")?.unwrap_or("2.0"),
        };
        let mut parts = wanted.split('.').map(str::parse::<u32>);
        match (parts.next(), parts.next(), asset.get("minVersion").is_some()) {
            (Some(Ok(2)), _, false) | (Some(Ok(2)), None | Some(Ok(0)), true) => Ok(()),
            _ => Err(self.error("/asset", format!("asks for glTF {wanted}; export the file as glTF 2.0"))),
        }
    }
}

impl<'a> Element<'a> {
    /// An error at this element.
    pub fn error(&self, message: impl Into<String>) -> Error {
        self.document.error(self.place.clone(), message)
    }

    /// The pointer of a member.
    pub fn place_of(&self, key: &str) -> String {
        format!("{}/{}", self.place, key.replace('~', "~0").replace('/', "~1"))
    }

    /// A member; null counts as absent.
    pub fn get(&self, key: &str) -> Option<Element<'a>> {
        let value = self.value.get(key).filter(|v| !v.is_null())?;
        Some(Element { document: self.document, value, place: self.place_of(key) })
    }

    /// An extension's object.
    pub fn extension(&self, name: &str) -> Option<Element<'a>> {
        self.get("extensions")?.get(name)
    }

    /// The members of an object; none for anything else.
    pub fn members(&self) -> impl Iterator<Item = (&'a str, Element<'a>)> + use<'a> {
        let object: Option<&'a Map<String, Value>> = self.value.as_object();
        let this = self.clone();
        object.into_iter().flatten().map(move |(key, value)| {
            (key.as_str(), Element { document: this.document, value, place: this.place_of(key) })
        })
    }

    /// The elements of the array that is member `key`; none if it is absent.
    pub fn items(&self, key: &str) -> Result<Vec<Element<'a>>> {
        let Some(member) = self.get(key) else { return Ok(Vec::new()) };
        let array = member.value.as_array().ok_or_else(|| member.error("must be an array"))?;
        let item =
            |(i, value)| Element { document: self.document, value, place: format!("{}/{i}", member.place) };
        Ok(array.iter().enumerate().map(item).collect())
    }

    /// Element `index` of the array that is member `key`, where there is one.
    pub fn item(&self, key: &str, index: usize) -> Result<Option<Element<'a>>> {
        let Some(member) = self.get(key) else { return Ok(None) };
        let array = member.value.as_array().ok_or_else(|| member.error("must be an array"))?;
        let place = || format!("{}/{index}", member.place);
        Ok(array.get(index).map(|value| Element { document: self.document, value, place: place() }))
    }

    /// This element as a number.
    pub fn as_number(&self) -> Result<f64> {
        self.value.as_f64().filter(|v| v.is_finite()).ok_or_else(|| self.error("must be a number"))
    }

    /// This element as an index or count. Whole numbers written as `3.0` are met in the wild.
    pub fn as_index(&self) -> Result<usize> {
        let whole = |v: f64| (v >= 0.0 && v.fract() == 0.0 && v <= 9e15).then_some(v as u64);
        let number = self.value.as_u64().or_else(|| self.value.as_f64().and_then(whole));
        number
            .and_then(|n| usize::try_from(n).ok())
            .ok_or_else(|| self.error("must be a whole number that is not negative"))
    }

    /// A number.
    pub fn number(&self, key: &str) -> Result<Option<f64>> {
        self.get(key).map(|e| e.as_number()).transpose()
    }

    /// A number in single precision, or a default; values beyond single precision are errors.
    pub fn f32(&self, key: &str, default: f32) -> Result<f32> {
        let Some(member) = self.get(key) else { return Ok(default) };
        let value = member.as_number()? as f32;
        if value.is_finite() { Ok(value) } else { Err(member.error("is out of range")) }
    }

    /// An index or count.
    pub fn index(&self, key: &str) -> Result<Option<usize>> {
        self.get(key).map(|e| e.as_index()).transpose()
    }

    /// An index or count that must be there.
    pub fn required_index(&self, key: &str) -> Result<usize> {
        self.index(key)?.ok_or_else(|| self.error(format!("`{key}` is missing; export the file again")))
    }

    /// A truth value.
    pub fn flag(&self, key: &str) -> Result<Option<bool>> {
        let Some(member) = self.get(key) else { return Ok(None) };
        member.value.as_bool().map(Some).ok_or_else(|| member.error("must be true or false"))
    }

    /// A string.
    pub fn text(&self, key: &str) -> Result<Option<&'a str>> {
        let Some(member) = self.get(key) else { return Ok(None) };
        member.value.as_str().map(Some).ok_or_else(|| member.error("must be a string"))
    }

    /// The name for messages; empty if there is none.
    pub fn name(&self) -> String {
        self.value.get("name").and_then(Value::as_str).unwrap_or_default().to_owned()
    }

    /// Exactly `N` numbers.
    pub fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>> {
        let Some(member) = self.get(key) else { return Ok(None) };
        let items = self.items(key)?;
        if items.len() != N {
            return Err(member.error(format!("must have {N} numbers, not {}", items.len())));
        }
        let mut out = [0.0; N];
        for (slot, item) in out.iter_mut().zip(&items) {
            *slot = item.as_number()?;
        }
        Ok(Some(out))
    }

    /// Exactly `N` numbers in single precision, or a default.
    pub fn f32s<const N: usize>(&self, key: &str, default: [f32; N]) -> Result<[f32; N]> {
        let Some(values) = self.numbers::<N>(key)? else { return Ok(default) };
        let values = values.map(|v| v as f32);
        if values.iter().all(|v| v.is_finite()) {
            Ok(values)
        } else {
            Err(self.document.error(self.place_of(key), "is out of range"))
        }
    }
}

/// What to do about a file that is of another kind than glTF; none if it looks like one that is broken.
fn other_kind(file: &Path, bytes: &[u8]) -> Option<&'static str> {
    let extension = file.extension().unwrap_or_default().to_ascii_lowercase();
    if extension == "blend" || bytes.starts_with(b"BLENDER") {
        Some("is a Blender file; export it as glTF first (docs/pipeline.md)")
    } else if ["usd", "usda", "usdc", "usdz"].iter().any(|usd| extension == *usd) {
        Some("is a USD file; export it as glTF first (docs/pipeline.md)")
    } else {
        bytes.contains(&0).then_some("is no glTF file; give a .gltf, .glb or .obj")
    }
}

/// Reads a regular file; a pipe or device could be endless.
pub(super) fn read_file(file: &Path) -> Result<Vec<u8>> {
    let failed = |why| Error::input(file, "file", format!("{why}; give the path of a file that may be read"));
    read_regular(file).map_err(failed)
}

/// The bytes of a regular file, or what is wrong with it.
fn read_regular(file: &Path) -> Result<Vec<u8>, String> {
    let failed = |e: io::Error| match e.kind() {
        io::ErrorKind::NotFound => reason(&e),
        _ => format!("cannot be read ({})", reason(&e)),
    };
    if !fs::metadata(file).map_err(failed)?.is_file() {
        return Err("is not a regular file".into());
    }
    fs::read(file).map_err(failed)
}

/// The JSON chunk and, if there is one, the binary chunk of a GLB.
fn split_glb<'a>(file: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let error = |at: usize, message: String| Error::input(file, format!("byte {at}"), message);
    let word = |at: usize| -> Result<usize> {
        let word = bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
        word.map(|w| w as usize).ok_or_else(|| error(at, "the file ends here; copy it again".into()))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(error(4, format!("this is binary glTF version {version}; export it as glTF 2.0")));
    }
    let (mut at, mut json, mut binary) = (12, None, None);
    word(8)?;
    // note: the length in the header is not trusted; exporters have written it wrong, and the chunks say it all.
    while bytes.len() >= at + 8 && binary.is_none() {
        let (length, kind) = (word(at)?, &bytes[at + 4..at + 8]);
        let body = bytes.get(at + 8..at + 8 + length).ok_or_else(|| {
            let rest = bytes.len() - at - 8;
            error(
                at,
                format!("a chunk of {length} bytes, but only {rest} follow: truncated; copy the file again"),
            )
        })?;
        match kind {
            b"JSON" if json.is_none() => json = Some(body),
            b"BIN\0" if json.is_some() => binary = Some(body),
            _ => {}
        }
        at += 8 + length.next_multiple_of(4);
    }
    let json = json.ok_or_else(|| error(12, "no JSON chunk; export the file again".into()))?;
    Ok((json, binary))
}
