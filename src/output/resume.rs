//! Is a frame that is already there the one that this run would write?

use super::SettingsHash;
use super::exr::{
    CHECKSUM, COUNTS, FRAME, FRAME_KIND, INFERRED_FROM, MAGIC, NO_CHECKSUM, SETTINGS_HASH, VIEW,
    counts_from_text,
};
use crate::frame::{FrameId, FrameKind, FrameStats, StereoEye};
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// What stands under a frame's name.
#[derive(Debug, Clone, PartialEq)]
pub enum FrameFile {
    /// Nothing.
    Missing,
    /// The frame, whole, made from the same input with the same settings: its counts (times are 0) and how it was made.
    Complete(FrameStats, FrameKind),
    /// Something else, and why: it must be rendered again.
    Stale(String),
}

impl FrameFile {
    /// Looks at the file `path`, where `frame` should be. Nothing in it is trusted: damage of any kind makes it stale, and no size that it states
    /// is allocated before the file has been seen to be that large.
    pub fn check(path: &Path, frame: FrameId, settings_hash: &SettingsHash) -> Self {
        let file = match fs::metadata(path) {
            // To open a pipe would wait for whoever writes to it.
            Ok(metadata) if !metadata.is_file() => return Self::Stale("it is not a file".into()),
            Ok(_) => File::open(path),
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Self::Missing,
            Err(error) => Err(error),
        };
        let file = match file {
            Ok(file) => file,
            Err(error) => return Self::Stale(error.to_string()),
        };
        match inspect(file, frame, settings_hash) {
            Ok(Ok((stats, kind))) => Self::Complete(stats, kind),
            Ok(Err(reason)) => Self::Stale(reason.to_string()),
            Err(error) => Self::Stale(error.to_string()),
        }
    }
}

/// Headers are a few kilobytes, but a matte's lists the names of all objects.
const LONGEST_HEADER: u64 = 16 << 20;

type Verdict = Result<(FrameStats, FrameKind), &'static str>;

fn inspect(mut file: File, frame: FrameId, settings_hash: &SettingsHash) -> io::Result<Verdict> {
    let length = file.metadata()?.len();
    let mut head = Vec::new();
    (&mut file).take(LONGEST_HEADER).read_to_end(&mut head)?;
    let Some(header) = Header::parse(&head) else {
        return Ok(Err("its header is not whole"));
    };
    let Some(hash) = header.text(SETTINGS_HASH) else {
        return Ok(Err("it was not written by this program"));
    };
    if hash != settings_hash.as_str() {
        return Ok(Err("it was made from another input or with other settings"));
    }
    let eye = header.text(VIEW);
    if header.i32(FRAME).map(i64::from) != Some(frame.number) || eye != frame.eye.map(StereoEye::name) {
        return Ok(Err("it is another frame"));
    }
    let found = (|| {
        let stats = counts_from_text(header.text(COUNTS)?)?;
        let kind = match header.text(FRAME_KIND)? {
            "traced" => FrameKind::Traced,
            "inferred" => FrameKind::Inferred { from: header.i32(INFERRED_FROM)?.into() },
            _ => return None,
        };
        Some((stats, kind))
    })();
    let Some(found) = found else {
        return Ok(Err("its counts are missing"));
    };
    let Some(blocks) = header.blocks() else {
        return Ok(Err("its header is not whole"));
    };
    if !offsets_are_whole(&mut file, header.end as u64, blocks, length)? {
        return Ok(Err("its pixels are not whole"));
    }
    if !checksum_agrees(&mut file, &header)? {
        return Ok(Err("it is damaged"));
    }
    Ok(Ok(found))
}

/// A header as far as it matters here.
struct Header<'a> {
    /// Name to type and value.
    attributes: HashMap<&'a [u8], (&'a [u8], Range<'a>)>,
    /// Where the offset table starts.
    end: usize,
}

/// Bytes, and where they are in the file.
#[derive(Clone, Copy)]
struct Range<'a> {
    at: usize,
    bytes: &'a [u8],
}

impl<'a> Header<'a> {
    /// Reads all attributes; `None` if anything is cut off or not as the format has it.
    fn parse(head: &'a [u8]) -> Option<Self> {
        let mut at = MAGIC.len();
        if !head.starts_with(&MAGIC) {
            return None;
        }
        let mut attributes = HashMap::new();
        loop {
            let name = until_nul(head, &mut at)?;
            if name.is_empty() {
                return Some(Self { attributes, end: at });
            }
            let kind = until_nul(head, &mut at)?;
            let size = usize::try_from(i32::from_le_bytes(take(head, &mut at, 4)?.try_into().ok()?)).ok()?;
            let start = at;
            attributes.insert(name, (kind, Range { at: start, bytes: take(head, &mut at, size)? }));
        }
    }

    fn value(&self, name: &str, kind: &str) -> Option<Range<'a>> {
        let (found, value) = self.attributes.get(name.as_bytes())?;
        (*found == kind.as_bytes()).then_some(*value)
    }

    fn text(&self, name: &str) -> Option<&'a str> {
        std::str::from_utf8(self.value(name, "string")?.bytes).ok()
    }

    fn i32(&self, name: &str) -> Option<i32> {
        Some(i32::from_le_bytes(self.value(name, "int")?.bytes.try_into().ok()?))
    }

    /// How many blocks of rows there must be.
    fn blocks(&self) -> Option<u64> {
        let window = self.value("dataWindow", "box2i")?.bytes;
        let side = |i: usize| Some(i64::from(i32::from_le_bytes(window.get(i..i + 4)?.try_into().ok()?)));
        let rows = u64::try_from(side(12)? - side(4)? + 1).ok().filter(|&rows| rows > 0)?;
        let rows_in_block = match self.value("compression", "compression")?.bytes {
            [0..=2] => 1,
            [3] => 16,
            [4] => 32,
            _ => return None,
        };
        Some(rows.div_ceil(rows_in_block))
    }
}

fn take<'a>(bytes: &'a [u8], at: &mut usize, size: usize) -> Option<&'a [u8]> {
    let taken = bytes.get(*at..at.checked_add(size)?)?;
    *at += size;
    Some(taken)
}

/// A name of at most 31 characters, without its NUL.
fn until_nul<'a>(bytes: &'a [u8], at: &mut usize) -> Option<&'a [u8]> {
    let rest = bytes.get(*at..)?;
    let length = rest.iter().take(32).position(|&b| b == 0)?;
    *at += length + 1;
    Some(&rest[..length])
}

/// True if the table of offsets is full and in order, and the last block ends where the file does.
fn offsets_are_whole(file: &mut File, table: u64, blocks: u64, length: u64) -> io::Result<bool> {
    // Also bounds the memory for the table by the file's size.
    if blocks.checked_mul(16).and_then(|bytes| bytes.checked_add(table)).is_none_or(|least| least > length) {
        return Ok(false);
    }
    let mut bytes = vec![0; blocks as usize * 8];
    file.seek(SeekFrom::Start(table))?;
    file.read_exact(&mut bytes)?;
    let mut least = table + blocks * 8;
    let mut last = 0;
    for offset in bytes.chunks_exact(8) {
        last = u64::from_le_bytes(offset.try_into().unwrap_or_default());
        if last < least || last > length - 8 {
            return Ok(false);
        }
        least = last + 8;
    }
    let mut block = [0; 8];
    file.seek(SeekFrom::Start(last))?;
    file.read_exact(&mut block)?;
    let size = i32::from_le_bytes([block[4], block[5], block[6], block[7]]);
    Ok(u64::try_from(size).is_ok_and(|size| last + 8 + size == length))
}

/// True if no bit of the file has changed since it was written.
fn checksum_agrees(file: &mut File, header: &Header) -> io::Result<bool> {
    let Some(stated) = header.value(CHECKSUM, "string").filter(|v| v.bytes.len() == NO_CHECKSUM.len()) else {
        return Ok(false);
    };
    let mut crc = 0;
    let mut add = |bytes: &[u8]| crc = zlib_rs::crc32::crc32(crc, bytes);
    let mut buffer = vec![0; stated.at];
    file.seek(SeekFrom::Start(0))?;
    file.read_exact(&mut buffer)?;
    add(&buffer);
    add(NO_CHECKSUM);
    file.seek(SeekFrom::Start((stated.at + NO_CHECKSUM.len()) as u64))?;
    buffer.resize(1 << 18, 0);
    loop {
        match file.read(&mut buffer)? {
            0 => break,
            read => add(&buffer[..read]),
        }
    }
    Ok(stated.bytes == format!("{crc:08x}").as_bytes())
}
