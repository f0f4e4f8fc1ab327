//! Attributes: blocks of vertices, byte plane by byte plane.

use super::{BLOCK_MAX, Broken, Bytes, TOO_LONG, TRUNCATED};

/// Vertices decode in groups of so many.
const GROUP: usize = 16;
/// Bytes of decoded vertices in a block, at most.
const BLOCK_BYTES: usize = 8192;

/// `count` vertices of `stride` bytes.
pub(super) fn vertices(data: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Broken> {
    if stride == 0 || stride > 256 || !stride.is_multiple_of(4) {
        return Err(Broken("the byte stride must be a multiple of 4, at most 256"));
    }
    let version = match data.first() {
        Some(0xa0) => 0,
        Some(0xa1) => 1,
        _ => return Err(Broken("not a vertex stream of version 0 or 1")),
    };
    // The tail holds the vertex that the first differs from and, since version 1, how each four bytes are coded.
    let tail = stride + if version == 0 { 0 } else { stride / 4 };
    let padded = tail.max(if version == 0 { 32 } else { 24 });
    if data.len() < 1 + padded {
        return Err(TRUNCATED);
    }
    let (last, channels) = data[data.len() - tail..].split_at(stride);
    let mut last = last.to_vec();
    let mut bytes = Bytes(&data[1..data.len() - padded]);
    let block = (BLOCK_BYTES / stride / GROUP * GROUP).min(BLOCK_MAX);
    let mut out = vec![0; count.checked_mul(stride).ok_or(TRUNCATED)?];
    for vertices in out.chunks_mut(block * stride) {
        decode_block(&mut bytes, vertices, stride, &last, channels)?;
        last.copy_from_slice(&vertices[vertices.len() - stride..]);
    }
    if bytes.0.is_empty() { Ok(out) } else { Err(TOO_LONG) }
}

/// Decodes one block; `channels` is empty in version 0.
fn decode_block(
    bytes: &mut Bytes,
    out: &mut [u8],
    stride: usize,
    last: &[u8],
    channels: &[u8],
) -> Result<(), Broken> {
    let count = out.len() / stride;
    let control = bytes.take(channels.len())?;
    let mut planes = [[0_u8; BLOCK_MAX]; 4];
    for k in (0..stride).step_by(4) {
        for (j, plane) in planes.iter_mut().enumerate() {
            match control.get(k / 4).map(|c| (c >> (2 * j)) & 3) {
                None => decode_plane(bytes, plane, count, &[0, 2, 4, 8])?,
                Some(0) => decode_plane(bytes, plane, count, &[0, 1, 2, 4])?,
                Some(1) => decode_plane(bytes, plane, count, &[1, 2, 4, 8])?,
                Some(2) => plane[..count].fill(0),
                _ => plane[..count].copy_from_slice(bytes.take(count)?),
            }
        }
        let channel = channels.get(k / 4).copied().unwrap_or(0);
        let mut value = [last[k], last[k + 1], last[k + 2], last[k + 3]];
        for (i, vertex) in out.chunks_exact_mut(stride).enumerate() {
            let delta = [planes[0][i], planes[1][i], planes[2][i], planes[3][i]];
            value = match channel & 3 {
                0 => std::array::from_fn(|j| {
                    value[j].wrapping_add((delta[j] >> 1) ^ (delta[j] & 1).wrapping_neg())
                }),
                1 => {
                    let half = |j: usize| {
                        let d = u16::from_le_bytes([delta[j], delta[j + 1]]);
                        let d = (d >> 1) ^ (d & 1).wrapping_neg();
                        u16::from_le_bytes([value[j], value[j + 1]]).wrapping_add(d).to_le_bytes()
                    };
                    let (a, b) = (half(0), half(2));
                    [a[0], a[1], b[0], b[1]]
                }
                2 => {
                    let turned = u32::from_le_bytes(delta).rotate_right(u32::from(channel >> 4));
                    (turned ^ u32::from_le_bytes(value)).to_le_bytes()
                }
                _ => return Err(Broken("an unknown channel coding")),
            };
            vertex[k..k + 4].copy_from_slice(&value);
        }
    }
    Ok(())
}

/// Decodes one byte of each of `count` vertices: two header bits for each group choose among four bit widths.
fn decode_plane(
    bytes: &mut Bytes,
    plane: &mut [u8; BLOCK_MAX],
    count: usize,
    widths: &[u32; 4],
) -> Result<(), Broken> {
    let groups = count.div_ceil(GROUP);
    let header = bytes.take(groups.div_ceil(4))?;
    for (g, group) in plane.chunks_exact_mut(GROUP).take(groups).enumerate() {
        match widths[usize::from(header[g / 4] >> (g % 4 * 2) & 3)] {
            0 => group.fill(0),
            8 => group.copy_from_slice(bytes.take(GROUP)?),
            width => {
                let packed = bytes.take(GROUP * width as usize / 8)?;
                let (escape, each) = (((1_u32 << width) - 1) as u8, 8 / width as usize);
                for (i, slot) in group.iter_mut().enumerate() {
                    let at = (i % each) as u32 * width;
                    // Single bits start at the least significant end, pairs and nibbles at the other.
                    let shift = if width == 1 { at } else { 8 - width - at };
                    let value = packed[i / each] >> shift & escape;
                    *slot = if value == escape { bytes.byte()? } else { value };
                }
            }
        }
    }
    Ok(())
}
