//! Filters: what is done to attributes once they are decoded.

use super::{Broken, Filter};

/// Applies `filter` to elements of `stride` bytes.
pub(super) fn apply(filter: Filter, data: &mut [u8], stride: usize) -> Result<(), Broken> {
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
