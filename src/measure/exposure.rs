//! From scene light to what a screen shows.

/// The factor that exposes a sequence: 0.8 / p99, where p99 is the 99th percentile of max(R,G,B) over all its pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Multiplies linear colours before they are clamped and encoded.
    pub scale: f32,
}

impl Exposure {
    /// From the 99th percentile; a black sequence counts as if that were 1.
    pub fn from_p99(p99: f32) -> Self {
        Self { scale: 0.8 / if p99 > 0.0 { p99 } else { 1.0 } }
    }

    /// From a sequence's pixels.
    pub fn of<'a>(pictures: impl IntoIterator<Item = &'a [[f32; 4]]>) -> Self {
        let mut percentile = Percentile::default();
        pictures.into_iter().for_each(|pixels| percentile.add(pixels));
        Self::from_p99(percentile.get(0.99))
    }

    /// The colour as it is shown: scaled, clamped to 0–1, sRGB-encoded. NaN is shown black.
    pub fn encode(self, [r, g, b, _]: [f32; 4]) -> [f32; 3] {
        [r, g, b].map(|v| srgb(v * self.scale))
    }

    /// The linear value that is shown as each byte.
    pub fn linear_from_byte(self) -> [f32; 256] {
        std::array::from_fn(|byte| {
            let v = byte as f32 / 255.0;
            let linear = if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
            linear / self.scale
        })
    }

    /// [`Exposure::encode`] of a picture.
    pub fn encode_all(self, pixels: &[[f32; 4]]) -> Vec<[f32; 3]> {
        pixels.iter().map(|&pixel| self.encode(pixel)).collect()
    }
}

/// IEC 61966-2-1, clamped.
fn srgb(linear: f32) -> f32 {
    // NaN first: `clamp` would let it through.
    let v = linear.max(0.0).clamp(0.0, 1.0);
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Percentiles of max(R,G,B) over any number of pixels in 512 KiB: values are counted at half precision, which is what
/// the files hold.
#[derive(Debug, Clone)]
pub struct Percentile {
    counts: Vec<u64>,
    total: u64,
}

impl Default for Percentile {
    fn default() -> Self {
        Self { counts: vec![0; 1 << 15], total: 0 }
    }
}

impl Percentile {
    /// Counts pixels. Values below 0 and NaN count as 0.
    pub fn add(&mut self, pixels: &[[f32; 4]]) {
        for [r, g, b, _] in pixels {
            let brightest = r.max(*g).max(*b).max(0.0);
            // Halves that are not negative sort as their bits do.
            self.counts[usize::from(half::f16::from_f32(brightest).to_bits() & 0x7fff)] += 1;
        }
        self.total += pixels.len() as u64;
    }

    /// Adds another's counts.
    pub fn merge(&mut self, other: &Self) {
        self.counts.iter_mut().zip(&other.counts).for_each(|(a, b)| *a += b);
        self.total += other.total;
    }

    /// The least value that is not exceeded by `share` of all pixels (nearest rank); 0 without pixels.
    pub fn get(&self, share: f64) -> f32 {
        let rank = (share * self.total as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        let bits = self.counts.iter().position(|count| {
            seen += count;
            seen >= rank
        });
        bits.map_or(0.0, |bits| half::f16::from_bits(bits as u16).to_f32().min(half::f16::MAX.to_f32()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_percentile_is_the_nearest_rank_of_the_brightest_channel() {
        let pixels: Vec<[f32; 4]> = (1..=100).map(|i| [0.0, i as f32, -1.0, 1000.0]).collect();
        let mut percentile = Percentile::default();
        percentile.add(&pixels[..50]);
        let mut rest = Percentile::default();
        rest.add(&pixels[50..]);
        percentile.merge(&rest);
        assert_eq!(percentile.get(0.99), 99.0);
        assert_eq!(percentile.get(0.0), 1.0);
        assert_eq!(percentile.get(1.0), 100.0);
        assert_eq!(Percentile::default().get(0.99), 0.0);
    }

    #[test]
    fn a_black_sequence_is_not_divided_by_zero() {
        assert_eq!(Exposure::of([[[0.0; 4]; 3].as_slice()]).scale, 0.8);
        assert_eq!(Exposure::of([[[2.0; 4]; 3].as_slice()]).scale, 0.4);
    }

    #[test]
    fn encoding_clamps_and_follows_the_standard() {
        let exposure = Exposure { scale: 1.0 };
        let [r, g, b] = exposure.encode([-1.0, f32::NAN, f32::INFINITY, 1.0]);
        assert!(r == 0.0 && g == 0.0 && (b - 1.0).abs() < 1e-6);
        let [r, g, b] = exposure.encode([0.5, 0.002, 0.214_041_14, 1.0]);
        assert!((r - 0.735_357).abs() < 1e-5 && (g - 0.025_84).abs() < 1e-6 && (b - 0.5).abs() < 1e-5);
    }
}
