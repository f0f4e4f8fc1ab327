//! Mip levels: where they are among an image's texels, and how each is made from the one before.

use super::ColorSpace;
use glam::Vec3;
use std::sync::LazyLock;

/// Where a mip level is among an image's texels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    pub width: u32,
    pub height: u32,
    pub first: usize,
}

/// All levels of an image, each half the one before, down to 1x1.
pub(super) fn levels_of(width: u32, height: u32) -> Vec<Level> {
    let mut levels = vec![Level { width, height, first: 0 }];
    let mut level = levels[0];
    while level.width > 1 || level.height > 1 {
        let first = level.first + level.width as usize * level.height as usize;
        level = Level { width: (level.width / 2).max(1), height: (level.height / 2).max(1), first };
        levels.push(level);
    }
    levels
}

/// The texels of all levels.
pub(super) fn texels_of(levels: &[Level]) -> usize {
    levels.iter().map(|level| level.width as usize * level.height as usize).sum()
}

/// Appends level `to`, each texel the average of those of `from` that it covers: two a side, or up to three where
/// the size is odd.
pub(super) fn halve<T: Copy>(from: Level, to: Level, texels: &mut Vec<T>, average: impl Fn(&[T]) -> T) {
    let span = |i: u32, from: u32, to: u32| {
        let first = u64::from(i) * u64::from(from) / u64::from(to);
        let last = (u64::from(i + 1) * u64::from(from)).div_ceil(u64::from(to));
        first as usize..last as usize
    };
    let mut block = Vec::with_capacity(9);
    for y in 0..to.height {
        for x in 0..to.width {
            block.clear();
            for row in span(y, from.height, to.height) {
                let columns = span(x, from.width, to.width);
                let row = from.first + row * from.width as usize;
                block.extend_from_slice(&texels[row + columns.start..row + columns.end]);
            }
            texels.push(average(&block));
        }
    }
}

/// The average of 8-bit texels in linear light; colours weighed by alpha where it cuts out.
pub(super) fn average_bytes(block: &[[u8; 4]], space: ColorSpace) -> [u8; 4] {
    let (mut color, mut weighed, mut alpha) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    let table = linear_from_code(space);
    for &[r, g, b, a] in block {
        let rgb = Vec3::from([r, g, b].map(|c| table[usize::from(c)]));
        color += rgb;
        weighed += rgb * LINEAR_FROM_BYTE[usize::from(a)];
        alpha += LINEAR_FROM_BYTE[usize::from(a)];
    }
    let n = block.len() as f32;
    let rgb = if space == ColorSpace::SrgbCutOut && alpha > 0.0 { weighed / alpha } else { color / n };
    let encode = |x: f32| match space {
        ColorSpace::Srgb | ColorSpace::SrgbCutOut => SRGB_FROM_LINEAR[(x * SRGB_STEPS as f32 + 0.5) as usize],
        ColorSpace::Linear => (x * 255.0 + 0.5) as u8,
    };
    let [r, g, b] = rgb.to_array().map(encode);
    [r, g, b, (alpha / n * 255.0 + 0.5) as u8]
}

/// Linear value of each 8-bit sRGB code.
pub(super) static LINEAR_FROM_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = i as f64 / 255.0;
        (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// Linear value of each 8-bit code that is linear itself.
pub(super) static LINEAR_FROM_BYTE: [f32; 256] = {
    let mut table = [0.0; 256];
    let mut i = 0;
    while i < 256 {
        table[i] = i as f32 / 255.0;
        i += 1;
    }
    table
};

/// The table for a colour space.
fn linear_from_code(space: ColorSpace) -> &'static [f32; 256] {
    match space {
        ColorSpace::Srgb | ColorSpace::SrgbCutOut => &LINEAR_FROM_SRGB,
        ColorSpace::Linear => &LINEAR_FROM_BYTE,
    }
}

/// Steps of the table below: fine enough that no code is off by more than half near black, where sRGB is steep.
const SRGB_STEPS: usize = 1 << 14;

/// 8-bit sRGB code of a linear value in [0, 1], in steps of 1 / [`SRGB_STEPS`].
static SRGB_FROM_LINEAR: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let encode = |i: usize| {
        let x = i as f64 / SRGB_STEPS as f64;
        let x = if x <= 0.003_130_8 { x * 12.92 } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (x * 255.0 + 0.5) as u8
    };
    (0..=SRGB_STEPS).map(encode).collect()
});
