//! Buffers and buffer views, decompressed where they are compressed.

use super::{
    budget::Budget,
    document::{Document, Element},
    folder::Source,
    meshopt, uri,
};
use crate::Result;
use std::{cell::OnceCell, collections::HashMap, path::PathBuf, rc::Rc};

/// The binary data of a document.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    /// Bytes and how many of them count. None: the fallback of compressed views, which need not be there.
    data: Vec<Option<(Rc<Vec<u8>>, usize)>>,
    decompressed: Vec<OnceCell<Vec<u8>>>,
    /// What the views and arrays made of the data may take.
    pub budget: Budget,
}

/// A checked range of a buffer.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    /// The bytes.
    pub bytes: &'a [u8],
    /// Bytes from one element to the next; packed where none.
    pub stride: Option<usize>,
}

impl<'a> Buffers<'a> {
    /// Loads all buffers.
    pub fn load(document: &'a Document) -> Result<Self> {
        let mut data = Vec::new();
        let mut total = document.bytes;
        // A file is read once, however many buffers name it.
        let mut files: HashMap<PathBuf, Rc<Vec<u8>>> = HashMap::new();
        for (i, buffer) in document.elements("buffers")?.iter().enumerate() {
            data.push(load(document, buffer, i, &mut files)?);
        }
        for bytes in files.values() {
            total = total.saturating_add(bytes.len());
        }
        let decompressed = (0..document.count("bufferViews")).map(|_| OnceCell::new()).collect();
        Ok(Self { document, data, decompressed, budget: Budget::new(total) })
    }

    /// View `index`, wanted by what stands at `user`.
    pub fn view(&self, index: usize, user: &str) -> Result<View<'_>> {
        let element = self.document.element("bufferViews", index, user)?;
        let stride = element.index("byteStride")?;
        if let Some(stride) = stride.filter(|s| *s == 0 || *s > 65536) {
            return Err(
                element.error(format!("a byteStride of {stride} is out of range; export the file again"))
            );
        }
        let compression = ["EXT_meshopt_compression", "KHR_meshopt_compression"]
            .iter()
            .find_map(|name| element.extension(name));
        let Some(compression) = compression else {
            return Ok(View { bytes: self.range(&element)?, stride });
        };
        let cell = &self.decompressed[index];
        if cell.get().is_none() {
            let bytes = self.decompress(&compression)?;
            return Ok(View { bytes: cell.get_or_init(|| bytes), stride });
        }
        Ok(View { bytes: cell.get().map_or(&[], Vec::as_slice), stride })
    }

    /// The bytes that `buffer`, `byteOffset` and `byteLength` of `element` name.
    fn range(&self, element: &Element) -> Result<&[u8]> {
        let buffer = element.required_index("buffer")?;
        let offset = element.index("byteOffset")?.unwrap_or(0);
        let length = element.required_index("byteLength")?;
        let data = self.data.get(buffer).ok_or_else(|| {
            let count = self.data.len();
            element
                .error(format!("refers to /buffers/{buffer}, but there are {count}; export the file again"))
        })?;
        let (data, counting) =
            data.as_ref().ok_or_else(|| element.error(format!("/buffers/{buffer} has no data")))?;
        let data = &data[..*counting];
        offset.checked_add(length).and_then(|end| data.get(offset..end)).ok_or_else(|| {
            element.error(format!(
                "bytes {offset} to {offset}+{length} are outside /buffers/{buffer} of {} bytes; export the file again",
                data.len()
            ))
        })
    }

    fn decompress(&self, element: &Element) -> Result<Vec<u8>> {
        let bytes = self.range(element)?;
        let (count, stride) = (element.required_index("count")?, element.required_index("byteStride")?);
        let mode = match element.text("mode")? {
            Some("ATTRIBUTES") => meshopt::Mode::Attributes,
            Some("TRIANGLES") => meshopt::Mode::Triangles,
            Some("INDICES") => meshopt::Mode::Indices,
            other => return Err(element.error(format!("unknown mode {other:?}; export without compression"))),
        };
        let filter = match element.text("filter")? {
            None | Some("NONE") => meshopt::Filter::None,
            Some("OCTAHEDRAL") => meshopt::Filter::Octahedral,
            Some("QUATERNION") => meshopt::Filter::Quaternion,
            Some("EXPONENTIAL") => meshopt::Filter::Exponential,
            Some("COLOR") => meshopt::Filter::Color,
            Some(other) => {
                return Err(element.error(format!("unknown filter {other}; export without compression")));
            }
        };
        if count.checked_mul(stride).is_none_or(|size| size > meshopt::most_bytes(bytes.len())) {
            let message =
                format!("{} bytes cannot hold {count} elements; export the file again", bytes.len());
            return Err(element.error(message));
        }
        self.budget.take(count, stride, |message| element.error(message))?;
        meshopt::decode(bytes, count, stride, mode, filter)
            .map_err(|broken| element.error(format!("{}; export the file again", broken.0)))
    }
}

fn load(
    document: &Document,
    buffer: &Element,
    index: usize,
    files: &mut HashMap<PathBuf, Rc<Vec<u8>>>,
) -> Result<Option<(Rc<Vec<u8>>, usize)>> {
    let length = buffer.required_index("byteLength")?;
    let bytes = match (buffer.text("uri")?, &document.binary) {
        (Some(text), _) => match uri::resolve(document, text, &buffer.place)? {
            Source::File(path) => match files.get(&path) {
                Some(bytes) => bytes.clone(),
                None => {
                    let bytes = Rc::new(document.read_named(&path, &buffer.place)?);
                    files.insert(path, bytes.clone());
                    bytes
                }
            },
            other => Rc::new(other.read(document, &buffer.place)?),
        },
        (None, Some(binary)) if index == 0 => binary.clone(),
        // note: not only with the extension's `fallback: true`; validators allow a buffer without data, and it
        // is an error only once something reads it.
        (None, _) => return Ok(None),
    };
    if bytes.len() < length {
        let found = bytes.len();
        return Err(buffer
            .error(format!("{length} bytes are wanted, but there are {found}; copy or export it again")));
    }
    Ok(Some((bytes, length)))
}
