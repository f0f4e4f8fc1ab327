//! URIs of buffers and images: data, or a file in the document's own folder.

use super::document::Document;
use super::folder::{Source, refuse_scheme};
use crate::Result;
use base64::{
    Engine,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::percent_decode_str;

/// Exporters leave out the padding, or leave stray bits in the last digit.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

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
    let source = refuse_scheme(uri).and_then(|()| document.folder.below(&path));
    source.map_err(|why| document.error(place, why))
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
