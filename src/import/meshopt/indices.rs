//! Indices: triangles by their shared edges, and sequences by their differences.

use super::{Broken, Bytes, TOO_LONG, TRUNCATED, unzigzag};

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

/// `count` indices of a triangle list.
pub(super) fn triangles(data: &[u8], count: usize) -> Result<Vec<u32>, Broken> {
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

/// `count` indices of any other kind.
pub(super) fn sequence(data: &[u8], count: usize) -> Result<Vec<u32>, Broken> {
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
