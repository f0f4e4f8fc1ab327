//! A [`Frame`] as an EXR file: one part, scan lines, the channels of `docs/aovs.md`.
//!
//! The same frame gives the same bytes, whatever the number of threads, and no clock or name of a machine is in them. The
//! container (magic number, header, offset table, blocks) is written here, attributes by the `exr` crate's encoder.

mod channels;
mod chunk;
mod counts;
mod cryptomatte;
mod header;

pub use chunk::Compression;
pub(crate) use counts::from_text as counts_from_text;
pub(crate) use header::{
    CHECKSUM, COUNTS, FRAME, FRAME_KIND, INFERRED_FROM, MAGIC, NO_CHECKSUM, SETTINGS_HASH, VIEW,
};

use super::SettingsHash;
use crate::frame::Frame;
use crate::scene::Rational;
use crate::{Error, Result};
use channels::{Channel, Row};
use chunk::Scratch;
use cryptomatte::MatteLayer;
use exr::meta::BlockDescription;
use exr::meta::attribute::{IntegerBounds, LineOrder, Text};
use exr::meta::header::Header;
use rayon::prelude::*;

/// What all files of a run share.
#[derive(Debug, Clone, PartialEq)]
pub struct FileOptions {
    /// How pixels are packed.
    pub compression: Compression,
    /// Frames per second, for the header.
    pub fps: Rational,
    /// The quality's name, for the header.
    pub quality: String,
    /// Identifies everything that decides the pixels.
    pub settings_hash: SettingsHash,
}

/// A file's bytes, ready to be written one part after the other.
#[derive(Debug)]
pub struct EncodedFrame {
    /// Header and offset table, then the blocks.
    pub parts: Vec<Vec<u8>>,
    /// Values that were not finite or did not fit their channel, and were replaced.
    pub repaired: u64,
}

/// Encodes `frame`, its blocks in parallel on the pool in which it is called.
///
/// # Errors
/// [`Error::Frame`] if a layer's size is not that of the window, or if the window is not inside the image.
pub fn encode(frame: &Frame, options: &FileOptions) -> Result<EncodedFrame> {
    let fail = |message: String| Error::Frame { frame: frame.number, message };
    let window = frame.window;
    let inside =
        |at: u32, size: u32, whole: u32| size > 0 && at.checked_add(size).is_some_and(|end| end <= whole);
    if !inside(window.x, window.width, frame.view.width)
        || !inside(window.y, window.height, frame.view.height)
    {
        return Err(fail(format!("{window:?} is not inside the image")));
    }
    let mattes = MatteLayer::of(frame);
    let channels = Channel::of(frame, &mattes);
    if let Some(channel) = channels.iter().find(|c| c.len() != window.pixels()) {
        let (have, want) = (channel.len(), window.pixels());
        return Err(fail(format!("channel {} has {have} values for {want} pixels", channel.name)));
    }

    let (width, height) = (window.width as usize, window.height as usize);
    let rows = options.compression.rows();
    let row_bytes = width * channels.iter().map(Channel::sample_bytes).sum::<usize>();
    let crate_header = crate_header(frame, options, &channels);
    let block = |scratch: &mut (Row, Scratch), first: usize| -> Result<(Vec<u8>, u64)> {
        let last = height.min(first + rows);
        let mut raw = Vec::with_capacity(row_bytes * (last - first));
        let mut repaired = 0;
        for y in first..last {
            for channel in &channels {
                repaired += channel.append_row(y * width..(y + 1) * width, &mut scratch.0, &mut raw);
            }
        }
        let y = window.y as usize + first;
        let bounds = IntegerBounds::new((window.x as i32, y as i32), (width, last - first));
        let packed = chunk::pack(options.compression, &crate_header, bounds, raw, &mut scratch.1)
            .map_err(|e| fail(format!("its pixels cannot be packed: {e}")))?;
        let mut block = Vec::with_capacity(packed.len() + 8);
        block.extend((y as i32).to_le_bytes());
        block.extend((packed.len() as i32).to_le_bytes());
        block.extend(packed);
        Ok((block, repaired))
    };
    let firsts: Vec<usize> = (0..height).step_by(rows).collect();
    let blocks: Result<Vec<_>> = firsts.into_par_iter().map_init(Default::default, block).collect();
    let (blocks, repaired): (Vec<_>, Vec<_>) = blocks?.into_iter().unzip();

    let mut head =
        header::bytes(frame, options, &channels, &mattes).map_err(|e| fail(format!("header: {e}")))?;
    let mut offset = (head.len() + 8 * blocks.len()) as u64;
    for block in &blocks {
        head.extend(offset.to_le_bytes());
        offset += block.len() as u64;
    }
    let mut parts = vec![head];
    parts.extend(blocks);
    seal(&mut parts);
    Ok(EncodedFrame { parts, repaired: repaired.iter().sum() })
}

/// Writes the checksum of the whole file into its header, where zeros stand for it.
fn seal(parts: &mut [Vec<u8>]) {
    let checksum = parts.iter().fold(0, |crc, part| zlib_rs::crc32::crc32(crc, part));
    let mut pattern = CHECKSUM.as_bytes().to_vec();
    pattern.extend(b"\0string\0\x08\0\0\0");
    pattern.extend(NO_CHECKSUM);
    if let Some(head) = parts.first_mut()
        && let Some(at) = head.windows(pattern.len()).rposition(|w| w == pattern)
    {
        head[at + pattern.len() - 8..at + pattern.len()]
            .copy_from_slice(format!("{checksum:08x}").as_bytes());
    }
}

/// What the `exr` crate's compression wants to know about the file.
fn crate_header(frame: &Frame, options: &FileOptions, channels: &[Channel]) -> Header {
    let window = header::data_window(frame);
    let list = channels.iter().map(Channel::description).collect();
    Header::new(Text::default(), window.size, list).with_position(window.position).with_encoding(
        options.compression.in_crate(),
        BlockDescription::ScanLines,
        LineOrder::Increasing,
    )
}
