//! Decoder of `EXT_meshopt_compression` and `KHR_meshopt_compression` (vertex codec 0 and 1, triangles, index
//! sequences, filters).
//!
//! Written after the bitstream descriptions in the two extensions' specifications. The `meshopt` crate builds C++, which a
//! machine with Rust alone cannot, and the pure Rust port (`meshopt-rs`) is not kept and asserts on broken data.
//! Here every read is checked: a broken stream gives a [`Broken`], never a panic.

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

/// Vertices decode in groups of so many.
const GROUP: usize = 16;
/// Bytes of decoded vertices in a block, at most.
const BLOCK_BYTES: usize = 8192;
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

// ---- attributes ------------------------------------------------------------------------------------------------

fn vertices(data: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Broken> {
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

// ---- indices ---------------------------------------------------------------------------------------------------

/// The last sixteen things seen.
struct Fifo<T> {
    ring: [T; 16],
    next: usize,
}

impl<T: Copy> Fifo<T> {
    fn push(&mut self, item: T) {
        self.ring[self.next] = item;
        self.next = (self.next + 1) & 15;
    }

    /// The item that was pushed `back` + 1 pushes ago.
    fn recent(&self, back: usize) -> T {
        self.ring[self.next.wrapping_sub(1 + back) & 15]
    }
}

/// The next vertex that no triangle has used yet.
fn fresh(next: &mut u32) -> u32 {
    let vertex = *next;
    *next = next.wrapping_add(1);
    vertex
}

fn triangles(data: &[u8], count: usize) -> Result<Vec<u32>, Broken> {
    if !count.is_multiple_of(3) {
        return Err(Broken("the count of triangle indices must be a multiple of 3"));
    }
    let version = match data.first() {
        Some(0xe0) => 0,
        Some(0xe1) => 1,
        _ => return Err(Broken("not a triangle stream of version 0 or 1")),
    };
    let mut bytes = Bytes(&data[1..]);
    let codes = bytes.take(count / 3)?;
    let (free, table) = bytes.0.split_last_chunk::<16>().ok_or(TRUNCATED)?;
    let mut free = Bytes(free);
    let (mut next, mut last) = (0_u32, 0_u32);
    let mut edges = Fifo { ring: [(u32::MAX, u32::MAX); 16], next: 0 };
    let mut seen = Fifo { ring: [u32::MAX; 16], next: 0 };
    let mut out = Vec::with_capacity(count);
    for &code in codes {
        let (high, low) = (usize::from(code >> 4), usize::from(code & 15));
        let (a, b, c);
        if high < 15 {
            // The triangle shares an edge with a recent one.
            (a, b) = edges.recent(high);
            match low {
                0 => c = fresh(&mut next),
                13 | 14 if version == 1 => {
                    last = if low == 13 { last.wrapping_sub(1) } else { last.wrapping_add(1) };
                    c = last;
                }
                15 => {
                    last = free.index(last)?;
                    c = last;
                }
                _ => c = seen.recent(low),
            }
            if low == 0 || low == 15 || (version == 1 && low >= 13) {
                seen.push(c);
            }
        } else {
            let listed = low < 14;
            let code = if listed { table[low] } else { free.byte()? };
            let (second, third) = (usize::from(code >> 4), usize::from(code & 15));
            if !listed && code == 0 {
                next = 0;
            }
            // Vertices count up in order a, b, c before free indices are read, also in that order.
            let fresh_a = low != 15;
            let fa = if fresh_a { fresh(&mut next) } else { 0 };
            // `seen` does not hold a yet, so a reference counts from one less.
            let fb = if second == 0 { fresh(&mut next) } else { seen.recent(second - 1) };
            let fc = if third == 0 { fresh(&mut next) } else { seen.recent(third - 1) };
            let mut free_index = |wanted: bool, otherwise: u32| -> Result<u32, Broken> {
                if wanted {
                    last = free.index(last)?;
                    Ok(last)
                } else {
                    Ok(otherwise)
                }
            };
            a = free_index(!fresh_a, fa)?;
            b = free_index(!listed && second == 15, fb)?;
            c = free_index(!listed && third == 15, fc)?;
            seen.push(a);
            for (vertex, how) in [(b, second), (c, third)] {
                if how == 0 || (!listed && how == 15) {
                    seen.push(vertex);
                }
            }
            edges.push((b, a));
        }
        edges.push((c, b));
        edges.push((a, c));
        out.extend([a, b, c]);
    }
    if free.0.is_empty() { Ok(out) } else { Err(TOO_LONG) }
}

fn sequence(data: &[u8], count: usize) -> Result<Vec<u32>, Broken> {
    if !matches!(data.first(), Some(0xd0 | 0xd1)) {
        return Err(Broken("not an index stream of version 0 or 1"));
    }
    let body = data[1..].split_last_chunk::<4>().ok_or(TRUNCATED)?.0;
    if body.len() < count {
        return Err(TRUNCATED);
    }
    let mut bytes = Bytes(body);
    let mut last = [0_u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let v = bytes.varint()?;
        let baseline = &mut last[(v & 1) as usize];
        *baseline = baseline.wrapping_add(unzigzag(v >> 1));
        out.push(*baseline);
    }
    if bytes.0.is_empty() { Ok(out) } else { Err(TOO_LONG) }
}

// ---- filters ---------------------------------------------------------------------------------------------------

fn apply(filter: Filter, data: &mut [u8], stride: usize) -> Result<(), Broken> {
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => each(data, |v: [i8; 4]| octahedral(v.map(f32::from), 127.0, v[3])),
        (Filter::Octahedral, 8) => each(data, |v: [i16; 4]| octahedral(v.map(f32::from), 32767.0, v[3])),
        (Filter::Quaternion, 8) => each(data, quaternion),
        (Filter::Exponential, _) => each(data, |[v]: [i32; 1]| {
            let power = f32::from_bits((((v >> 24) + 127).max(0) as u32) << 23);
            [((v << 8 >> 8) as f32 * power).to_bits() as i32]
        }),
        (Filter::Color, 4) => each(data, |v: [i8; 4]| {
            color([i32::from(v[0] as u8), i32::from(v[1]), i32::from(v[2]), i32::from(v[3] as u8)], 255.0)
                .map(|c| c as u8 as i8)
        }),
        (Filter::Color, 8) => each(data, |v: [i16; 4]| {
            color([i32::from(v[0] as u16), i32::from(v[1]), i32::from(v[2]), i32::from(v[3] as u16)], 65535.0)
                .map(|c| c as u16 as i16)
        }),
        _ => return Err(Broken("the filter does not fit the byte stride")),
    }
    Ok(())
}

/// A little-endian integer in a byte array.
trait Little: Copy {
    const SIZE: usize;
    fn read(bytes: &[u8]) -> Self;
    fn write(self, bytes: &mut [u8]);
}

macro_rules! little {
    ($($t:ty),*) => {$(impl Little for $t {
        const SIZE: usize = size_of::<$t>();
        fn read(bytes: &[u8]) -> Self {
            let mut array = [0; size_of::<$t>()];
            array.copy_from_slice(bytes);
            Self::from_le_bytes(array)
        }
        fn write(self, bytes: &mut [u8]) {
            bytes.copy_from_slice(&self.to_le_bytes());
        }
    })*};
}
little!(i8, i16, i32);

fn each<T: Little, const N: usize>(data: &mut [u8], change: impl Fn([T; N]) -> [T; N]) {
    for element in data.chunks_exact_mut(N * T::SIZE) {
        let changed = change(std::array::from_fn(|i| T::read(&element[i * T::SIZE..][..T::SIZE])));
        for (part, value) in element.chunks_exact_mut(T::SIZE).zip(changed) {
            value.write(part);
        }
    }
}

/// Rounds halves away from zero, as the specification's integers come out.
fn octahedral<T>([x, y, one, _]: [f32; 4], max: f32, w: T) -> [T; 4]
where
    T: Copy + FromF32,
{
    let z = one - x.abs() - y.abs();
    let fold = z.min(0.0);
    let (x, y) = (x + if x >= 0.0 { fold } else { -fold }, y + if y >= 0.0 { fold } else { -fold });
    let scale = max / (x * x + y * y + z * z).sqrt();
    [T::from_f32((x * scale).round()), T::from_f32((y * scale).round()), T::from_f32((z * scale).round()), w]
}

/// Saturating conversion from a rounded float.
trait FromF32 {
    fn from_f32(v: f32) -> Self;
}
impl FromF32 for i8 {
    fn from_f32(v: f32) -> Self {
        v as i8
    }
}
impl FromF32 for i16 {
    fn from_f32(v: f32) -> Self {
        v as i16
    }
}

fn quaternion(v: [i16; 4]) -> [i16; 4] {
    let one = f32::from(v[3] | 3);
    let [x, y, z] = [v[0], v[1], v[2]].map(f32::from);
    let w = (one * one * 2.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let scale = 32767.0 / std::f32::consts::SQRT_2 / one;
    let largest = (v[3] & 3) as usize;
    let mut out = [0; 4];
    for (i, part) in [w, x, y, z].into_iter().enumerate() {
        out[(largest + i) & 3] = i16::from_f32((part * scale).round());
    }
    out
}

fn color([y, co, cg, alpha]: [i32; 4], max: f32) -> [i32; 4] {
    // The highest bit of alpha says how many bits the components have.
    let mut mask = alpha;
    for shift in [1, 2, 4, 8] {
        mask |= mask >> shift;
    }
    let alpha = (alpha << 1 & mask) | (alpha & 1);
    let scale = max / mask as f32;
    [y + co - cg, y + cg, y - co - cg, alpha].map(|c| (c as f32 * scale + 0.5) as i32)
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

    #[test]
    fn filtered_vectors_and_quaternions_have_unit_length() {
        let mut data: Vec<u8> = [127_i8, 0, 127, 0, -64, 30, 127, 1].iter().map(|v| *v as u8).collect();
        apply(Filter::Octahedral, &mut data, 4).unwrap();
        for v in data.chunks(4) {
            let squares: f32 = v[..3].iter().map(|&c| (f32::from(c as i8) / 127.0).powi(2)).sum();
            assert!((squares - 1.0).abs() < 0.03, "{v:?}");
        }
        let quat = quaternion([100, -2000, 5, 0x7ffc | 2]);
        let squares: f32 = quat.iter().map(|&c| (f32::from(c) / 32767.0).powi(2)).sum();
        assert!((squares - 1.0).abs() < 1e-3, "{quat:?}");
        let mut data = (3_i32 | (-1 << 24)).to_le_bytes().to_vec();
        apply(Filter::Exponential, &mut data, 4).unwrap();
        assert_eq!(f32::from_le_bytes([data[0], data[1], data[2], data[3]]), 1.5);
    }

    #[test]
    fn full_alpha_and_grey_survive_the_colour_filter() {
        assert_eq!(color([255, 0, 0, 255], 255.0), [255, 255, 255, 255]);
        assert_eq!(color([0, 0, 0, 128], 255.0)[3], 0);
    }
}
