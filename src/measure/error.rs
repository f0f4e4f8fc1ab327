//! Numbers for the difference of two pictures.

use super::{Exposure, PIXELS_PER_DEGREE, flip_map};
use serde::{Deserialize, Serialize};

/// The difference of two pictures, both encoded by the same [`Exposure`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ImageError {
    /// Peak signal-to-noise ratio, decibels; `None` (infinite) for identical pictures.
    pub psnr_db: Option<f64>,
    /// Mean of the FLIP map, 0 to 1: see [`super::flip_map`].
    pub flip_mean: f64,
    /// Largest difference of an encoded channel, 0 to 1.
    pub max_abs: f64,
    /// Share of the pixels in which an encoded channel is off by more than 0.05.
    pub over_5_percent: f64,
}

/// Peak signal-to-noise ratio of two pictures of linear colours, decibels: over R, G and B of all pixels, encoded by
/// `exposure`; `None` if they are identical then.
pub fn psnr(picture: &[[f32; 4]], reference: &[[f32; 4]], exposure: Exposure) -> Option<f64> {
    psnr_where(picture, reference, exposure, |_| true)
}

/// [`psnr`] of the pixels whose number `keep` accepts, such as those of one class; `None` also if there are none.
pub fn psnr_where(
    picture: &[[f32; 4]],
    reference: &[[f32; 4]],
    exposure: Exposure,
    keep: impl Fn(usize) -> bool,
) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    let pairs = picture.iter().zip(reference).enumerate().filter(|(i, _)| keep(*i));
    for (_, (&a, &b)) in pairs {
        sum += squared(exposure.encode(a), exposure.encode(b));
        count += 3;
    }
    decibels(sum, count)
}

/// All measures of two pictures of `width` columns.
pub fn image_error(
    picture: &[[f32; 4]],
    reference: &[[f32; 4]],
    width: usize,
    exposure: Exposure,
) -> ImageError {
    compare_pictures(picture, reference, width, exposure).0
}

/// [`image_error`], and the FLIP map that it is the mean of; no map for identical pictures.
pub fn compare_pictures(
    picture: &[[f32; 4]],
    reference: &[[f32; 4]],
    width: usize,
    exposure: Exposure,
) -> (ImageError, Vec<f32>) {
    let (a, b) = (exposure.encode_all(picture), exposure.encode_all(reference));
    let (mut sum, mut largest, mut over) = (0.0, 0.0f32, 0u64);
    for (&a, &b) in a.iter().zip(&b) {
        sum += squared(a, b);
        let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        largest = largest.max(worst);
        over += u64::from(worst > 0.05);
    }
    let pixels = a.len().max(1) as f64;
    let map = if sum == 0.0 { Vec::new() } else { flip_map(&a, &b, width, PIXELS_PER_DEGREE) };
    let error = ImageError {
        psnr_db: decibels(sum, 3 * a.len() as u64),
        flip_mean: map.iter().fold(0.0, |sum, &v| sum + f64::from(v)) / pixels,
        max_abs: largest.into(),
        over_5_percent: over as f64 / pixels,
    };
    (error, map)
}

fn squared(a: [f32; 3], b: [f32; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum()
}

fn decibels(sum: f64, count: u64) -> Option<f64> {
    (sum > 0.0).then(|| -10.0 * (sum / count as f64).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Exposure = Exposure { scale: 1.0 };

    #[test]
    fn identical_pictures_have_no_error() {
        let picture = [[0.2, 0.4, 0.6, 1.0]; 12];
        let same = ImageError { psnr_db: None, flip_mean: 0.0, max_abs: 0.0, over_5_percent: 0.0 };
        let error = image_error(&picture, &picture, 4, PLAIN);
        assert_eq!(error, same);
        assert!(error.flip_mean.is_sign_positive(), "it is printed");
        // Both are white on the screen.
        assert_eq!(psnr(&[[2.0; 4]], &[[3.0; 4]], PLAIN), None);
    }

    #[test]
    fn black_against_white_is_zero_decibels() {
        assert!(psnr(&[[0.0; 4]; 5], &[[1.0; 4]; 5], PLAIN).unwrap().abs() < 1e-5);
        let error = image_error(&[[0.0; 4]; 4], &[[1.0; 4]; 4], 2, PLAIN);
        assert!((error.max_abs - 1.0).abs() < 1e-6 && error.over_5_percent == 1.0);
        assert!(error.flip_mean > 0.9);
    }

    #[test]
    fn one_channel_of_one_pixel_counts_for_its_share() {
        let reference = [[0.0; 4]; 100];
        let mut picture = reference;
        picture[7][1] = 1.0;
        let db = psnr(&picture, &reference, PLAIN).unwrap();
        assert!((db - 10.0 * 300f64.log10()).abs() < 1e-5);
        assert_eq!(psnr_where(&picture, &reference, PLAIN, |i| i != 7), None);
        assert!(
            (psnr_where(&picture, &reference, PLAIN, |i| i == 7).unwrap() - 10.0 * 3f64.log10()).abs() < 1e-5
        );
        assert_eq!(image_error(&picture, &reference, 10, PLAIN).over_5_percent, 0.01);
    }

    #[test]
    fn alpha_does_not_count() {
        assert_eq!(psnr(&[[0.5, 0.5, 0.5, 0.0]], &[[0.5, 0.5, 0.5, 1.0]], PLAIN), None);
    }
}
