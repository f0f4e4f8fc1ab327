//! Decoder of `EXT_meshopt_compression` and `KHR_meshopt_compression` (vertex codec 0 and 1, triangles, index
//! sequences, filters).
//!
//! Written after the bitstream descriptions in the two extensions' specifications. The `meshopt` crate builds C++, which a
//! machine with Rust alone cannot, and the pure Rust port (`meshopt-rs`) is not kept and asserts on broken data.
//! Here every read is checked: a broken stream gives a [`Broken`], never a panic.

mod attributes;
mod filter;
mod indices;

use attributes::vertices;
use filter::apply;
use indices::{sequence, triangles};

/// Why a stream cannot be decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Broken(pub &'static str);

/// What the bytes encode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Vertices of `stride` bytes.
    Attributes,
    /// Triangle lists.
    Triangles,
    /// Any other indices.
    Indices,
}

/// What is done to decoded attributes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Filter {
    /// Nothing.
    None,
    /// Unit vectors, folded onto an octahedron.
    Octahedral,
    /// Unit quaternions, the largest component left out.
    Quaternion,
    /// Floats with a shared exponent each.
    Exponential,
    /// YCoCg colours (`KHR_meshopt_compression`).
    Color,
}

/// Vertices in a block, at most.
const BLOCK_MAX: usize = 256;
const TRUNCATED: Broken = Broken("the compressed data ends early");
const TOO_LONG: Broken = Broken("bytes are left over after the compressed data");

/// The most bytes that `length` compressed bytes can become; more in a file is a lie.
///
/// The densest streams: version 1 attributes spend a control byte for every four bytes of a block of 256 vertices;
/// triangles spend a byte each, and become 12.
pub(super) fn most_bytes(length: usize) -> usize {
    length.saturating_mul(4 * BLOCK_MAX)
}

/// Decodes `count` elements of `stride` bytes.
pub(super) fn decode(
    data: &[u8],
    count: usize,
    stride: usize,
    mode: Mode,
    filter: Filter,
) -> Result<Vec<u8>, Broken> {
    match mode {
        Mode::Attributes => {
            let mut out = vertices(data, count, stride)?;
            apply(filter, &mut out, stride)?;
            Ok(out)
        }
        Mode::Triangles | Mode::Indices if !matches!(stride, 2 | 4) => {
            Err(Broken("indices must have 2 or 4 bytes"))
        }
        Mode::Triangles => pack(&triangles(data, count)?, stride),
        Mode::Indices => pack(&sequence(data, count)?, stride),
    }
}

fn pack(indices: &[u32], stride: usize) -> Result<Vec<u8>, Broken> {
    let mut out = Vec::with_capacity(indices.len() * stride);
    for index in indices {
        out.extend_from_slice(&index.to_le_bytes()[..stride]);
    }
    Ok(out)
}

/// Takes bytes off the front, or finds that there are too few.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Broken> {
        let (head, tail) = self.0.split_at_checked(count).ok_or(TRUNCATED)?;
        self.0 = tail;
        Ok(head)
    }

    fn byte(&mut self) -> Result<u8, Broken> {
        Ok(self.take(1)?[0])
    }

    /// A base-128 number, least significant digits first, of at most 5 bytes.
    fn varint(&mut self) -> Result<u32, Broken> {
        let mut value = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 127) << shift;
            if byte < 128 {
                break;
            }
        }
        Ok(value)
    }

    /// A zigzag difference from `last`.
    fn index(&mut self, last: u32) -> Result<u32, Broken> {
        Ok(last.wrapping_add(unzigzag(self.varint()?)))
    }
}

fn unzigzag(v: u32) -> u32 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_and_short_streams_are_broken_not_a_panic() {
        for data in [&[][..], &[0xa0], &[0xe0], &[0xd0], &[0xa1, 0, 0], &[0xe1; 17], &[0xd1; 5]] {
            for mode in [Mode::Attributes, Mode::Triangles, Mode::Indices] {
                assert!(decode(data, 3, 4, mode, Filter::None).is_err(), "{data:?} {mode:?}");
            }
        }
    }

    // The streams below were made by the reference encoder, meshoptimizer 1.3.

    #[test]
    fn reference_vertex_streams_of_both_versions_decode() {
        let wanted: Vec<u8> = (0..20_u16)
            .flat_map(|i| [i * 7, i * i, 1000 - i * 3, if i.is_multiple_of(5) { 9 } else { 0 }])
            .flat_map(u16::to_le_bytes)
            .collect();
        let version_0 = [
            160, 10, 14, 238, 238, 238, 238, 238, 238, 238, 238, 238, 0, 0, 0, 0, 0, 0, 0, 7, 0, 2, 6, 10,
            14, 18, 22, 26, 30, 34, 38, 42, 46, 50, 54, 58, 255, 0, 0, 0, 62, 66, 70, 74, 4, 128, 0, 0, 0,
            10, 5, 85, 85, 85, 85, 85, 85, 85, 85, 85, 0, 0, 0, 0, 0, 0, 0, 5, 48, 60, 15, 3, 17, 18, 17, 18,
            17, 18, 192, 0, 0, 0, 17, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
            0, 0, 0, 0, 0, 232, 3, 9, 0,
        ];
        let version_1 = [
            161, 185, 153, 2, 14, 238, 238, 238, 238, 238, 238, 238, 15, 0, 14, 14, 14, 14, 0, 2, 6, 10, 14,
            18, 22, 26, 30, 34, 38, 42, 46, 50, 54, 58, 62, 66, 70, 74, 2, 5, 85, 85, 85, 85, 85, 85, 85, 15,
            0, 5, 5, 5, 5, 0, 98, 140, 17, 18, 17, 18, 17, 18, 1, 0, 17, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
            0, 0, 0, 0, 0, 0, 232, 3, 9, 0, 1, 0,
        ];
        for stream in [&version_0[..], &version_1] {
            assert_eq!(decode(stream, 20, 8, Mode::Attributes, Filter::None).as_ref(), Ok(&wanted));
            for end in 0..stream.len() {
                assert!(decode(&stream[..end], 20, 8, Mode::Attributes, Filter::None).is_err());
            }
        }
    }

    #[test]
    fn the_reference_triangle_stream_of_version_1_decodes() {
        let stream = [
            225, 240, 16, 254, 255, 47, 240, 12, 255, 2, 2, 2, 22, 0, 118, 135, 86, 103, 120, 169, 134, 101,
            137, 104, 152, 1, 105, 0, 0,
        ];
        let wanted = [0_u32, 1, 2, 2, 1, 3, 4, 6, 5, 7, 8, 9, 8, 7, 20];
        let wanted: Vec<u8> = wanted.iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(decode(&stream, 15, 4, Mode::Triangles, Filter::None), Ok(wanted));
    }

    #[test]
    fn the_reference_triangle_stream_decodes() {
        let stream = [
            0xe0, 0xf0, 0x10, 0xfe, 0xff, 0xf0, 0x0c, 0xff, 0x02, 0x02, 0x02, 0x00, 0x76, 0x87, 0x56, 0x67,
            0x78, 0xa9, 0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69, 0x00, 0x00,
        ];
        let wanted: Vec<u8> =
            [0_u32, 1, 2, 2, 1, 3, 4, 6, 5, 7, 8, 9].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(decode(&stream, 12, 4, Mode::Triangles, Filter::None), Ok(wanted));
    }

    #[test]
    fn the_reference_index_sequence_decodes() {
        let stream = [0xd1, 0x00, 0x04, 0xcd, 0x01, 0x04, 0x07, 0x98, 0x1f, 0x00, 0x00, 0x00, 0x00];
        let wanted: Vec<u8> = [0_u32, 1, 51, 2, 49, 1000].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(decode(&stream, 6, 4, Mode::Indices, Filter::None), Ok(wanted));
    }
}
