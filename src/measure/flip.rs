//! FLIP: how different two pictures look to someone who flips between them.
//!
//! Source: P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild, *FLIP: A Difference
//! Evaluator for Alternating Images*, HPG 2020 (LDR-FLIP); all filters are separated, which the authors show to be exact.
//! Written here because the crate that wraps the authors' program needs a C++ compiler; it is tested against that
//! program's results.

use rayon::prelude::*;
use std::f32::consts::PI;

/// Pixels in a degree of the view: the authors' default, a 0.7 m wide screen of 3840 pixels seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f32 = 67.0;

/// Exponent of colour differences.
const COLOR_EXPONENT: f32 = 0.7;
/// Where the mapping of colour differences to `[0, 1]` bends: this share of the largest maps to the value after it.
const BEND: (f32, f32) = (0.4, 0.95);
/// Width of an edge, degrees.
const EDGE_DEGREES: f32 = 0.082;
/// Exponent of feature differences.
const FEATURE_EXPONENT: f32 = 0.5;
/// Contrast sensitivity of the achromatic, red-green and blue-yellow channels: amplitude and spread of Gaussians.
const CSF_Y: (f32, f32) = (1.0, 0.0047);
const CSF_X: (f32, f32) = (1.0, 0.0053);
const CSF_Z: [(f32, f32); 2] = [(34.1, 0.04), (13.5, 0.025)];
/// D65, as the sum of the rows of [`XYZ_FROM_RGB`].
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];

/// The mean of [`flip_map`]: 0 (identical) to 1. 0 for empty pictures.
pub fn flip_mean(picture: &[[f32; 3]], reference: &[[f32; 3]], width: usize) -> f64 {
    let map = flip_map(picture, reference, width, PIXELS_PER_DEGREE);
    // Adding 0 makes a negative zero, which no error comes out as, a positive one.
    map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len().max(1) as f64 + 0.0
}

/// The visible difference at each pixel, 0 to 1, of two sRGB-encoded pictures of `width` columns; empty if they are, or
/// if they differ in size.
pub fn flip_map(
    picture: &[[f32; 3]],
    reference: &[[f32; 3]],
    width: usize,
    pixels_per_degree: f32,
) -> Vec<f32> {
    if width == 0 || picture.len() != reference.len() || !picture.len().is_multiple_of(width) {
        return Vec::new();
    }
    let (a, b) = (Opponent::of(picture, width), Opponent::of(reference, width));
    let (color_a, color_b) = (a.perceived(pixels_per_degree), b.perceived(pixels_per_degree));
    let (features_a, features_b) = (a.features(pixels_per_degree), b.features(pixels_per_degree));
    let largest = largest_color_difference();
    (0..a.planes[0].len())
        .into_par_iter()
        .map(|i| {
            let color = hyab(color_a[i], color_b[i]).powf(COLOR_EXPONENT);
            let edge = (features_a[i][0] - features_b[i][0]).abs();
            let point = (features_a[i][1] - features_b[i][1]).abs();
            let feature = (edge.max(point) / 2f32.sqrt()).powf(FEATURE_EXPONENT);
            mapped_color_difference(color, largest).powf(1.0 - feature)
        })
        .collect()
}

/// A picture in linearised CIELAB (YCxCz), plane by plane.
struct Opponent {
    width: usize,
    planes: [Vec<f32>; 3],
}

impl Opponent {
    fn of(picture: &[[f32; 3]], width: usize) -> Self {
        let pixels: Vec<[f32; 3]> =
            picture.par_iter().map(|&p| opponent_from_xyz(xyz_from_rgb(p.map(linear)))).collect();
        let plane = |i: usize| pixels.iter().map(|p| p[i]).collect();
        Self { width, planes: [plane(0), plane(1), plane(2)] }
    }

    /// What the eye makes of it at this distance: blurred by contrast sensitivity, then Hunt-adjusted CIELAB.
    fn perceived(&self, pixels_per_degree: f32) -> Vec<[f32; 3]> {
        let spread = CSF_Z[0].1;
        let radius = (3.0 * (spread / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        let taps = |(a, b): (f32, f32)| -> Vec<f32> {
            let tap = |i| {
                let x = i as f32 / pixels_per_degree;
                (a * (PI / b).sqrt()).sqrt() * (-PI * PI * x * x / b).exp()
            };
            (-radius..=radius).map(tap).collect()
        };
        let normalised = |taps: Vec<f32>, sum: f32| taps.into_iter().map(|t| t / sum).collect::<Vec<_>>();
        let blurred = |plane: usize, taps: &[f32]| self.down(&self.across(&self.planes[plane], taps), taps);

        let single = |csf| {
            let taps = taps(csf);
            let sum = taps.iter().sum();
            normalised(taps, sum)
        };
        let y = blurred(0, &single(CSF_Y));
        let cx = blurred(1, &single(CSF_X));
        // The blue-yellow filter is a sum of two separable ones; only their sum is normalised.
        let [first, second] = CSF_Z.map(taps);
        let squares = first.iter().sum::<f32>().powi(2) + second.iter().sum::<f32>().powi(2);
        let cz_first = blurred(2, &normalised(first, squares.sqrt()));
        let cz_second = blurred(2, &normalised(second, squares.sqrt()));

        let pixel = |i: usize| {
            let xyz = xyz_from_opponent([y[i], cx[i], cz_first[i] + cz_second[i]]);
            hunt(lab_from_xyz(xyz_from_rgb(rgb_from_xyz(xyz).map(|v| v.clamp(0.0, 1.0)))))
        };
        (0..y.len()).into_par_iter().map(pixel).collect()
    }

    /// Strength of the edge and of the point at each pixel.
    fn features(&self, pixels_per_degree: f32) -> Vec<[f32; 2]> {
        let deviation = 0.5 * EDGE_DEGREES * pixels_per_degree;
        let radius = (3.0 * deviation).ceil() as i32;
        let taps = |weight: &dyn Fn(f32) -> f32| -> Vec<f32> {
            let tap = |i: i32| {
                let x = i as f32;
                weight(x) * (-x * x / (2.0 * deviation * deviation)).exp()
            };
            balanced((-radius..=radius).map(tap).collect())
        };
        let blur = taps(&|_| 1.0);
        let slope = taps(&|x| -x);
        let bend = taps(&|x| x * x / (deviation * deviation) - 1.0);

        let gray: Vec<f32> = self.planes[0].iter().map(|y| (y + 16.0) / 116.0).collect();
        let blurred = self.across(&gray, &blur);
        let edge_x = self.down(&self.across(&gray, &slope), &blur);
        let edge_y = self.down(&blurred, &slope);
        let point_x = self.down(&self.across(&gray, &bend), &blur);
        let point_y = self.down(&blurred, &bend);
        (0..gray.len())
            .into_par_iter()
            .map(|i| [edge_x[i].hypot(edge_y[i]), point_x[i].hypot(point_y[i])])
            .collect()
    }

    /// Convolution along rows; the border is repeated.
    fn across(&self, plane: &[f32], taps: &[f32]) -> Vec<f32> {
        let radius = taps.len() / 2;
        let mut result = vec![0.0; plane.len()];
        result.par_chunks_mut(self.width).zip(plane.par_chunks(self.width)).for_each(|(result, row)| {
            let (first, last) = (row[0], row[row.len() - 1]);
            let mut padded = vec![first; radius];
            padded.extend_from_slice(row);
            padded.resize(row.len() + 2 * radius, last);
            for (i, &tap) in taps.iter().enumerate() {
                add_scaled(result, &padded[i..], tap);
            }
        });
        result
    }

    /// Convolution along columns; the border is repeated.
    fn down(&self, plane: &[f32], taps: &[f32]) -> Vec<f32> {
        let (width, height, radius) = (self.width, plane.len() / self.width, taps.len() / 2);
        let mut result = vec![0.0; plane.len()];
        result.par_chunks_mut(width).enumerate().for_each(|(y, result)| {
            for (i, &tap) in taps.iter().enumerate() {
                let row = (y + i).saturating_sub(radius).min(height - 1);
                add_scaled(result, &plane[row * width..], tap);
            }
        });
        result
    }
}

fn add_scaled(sum: &mut [f32], values: &[f32], factor: f32) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
}

/// Positive weights sum to 1, negative ones to -1.
fn balanced(mut taps: Vec<f32>) -> Vec<f32> {
    let positive: f32 = taps.iter().filter(|t| **t > 0.0).sum();
    let negative: f32 = -taps.iter().filter(|t| **t < 0.0).sum::<f32>();
    taps.iter_mut().for_each(|t| *t /= if *t > 0.0 { positive } else { negative.max(f32::MIN_POSITIVE) });
    taps
}

/// Colour difference to `[0, 1]`: nearly all of the range for the differences that occur.
fn mapped_color_difference(difference: f32, largest: f32) -> f32 {
    let bend = BEND.0 * largest;
    if difference < bend {
        difference * BEND.1 / bend
    } else {
        BEND.1 + (difference - bend) / (largest - bend) * (1.0 - BEND.1)
    }
}

/// Between green and blue, the largest that RGB has.
fn largest_color_difference() -> f32 {
    let perceived = |rgb| hunt(lab_from_xyz(xyz_from_rgb(rgb)));
    hyab(perceived([0.0, 1.0, 0.0]), perceived([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT)
}

/// City-block distance of lightness plus Euclidean distance of chroma.
fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Colours look less colourful in the dark.
fn hunt([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

fn linear(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

const XYZ_FROM_RGB: [[f32; 3]; 3] = [
    [0.412_386_56, 0.357_591_5, 0.180_450_5],
    [0.212_636_82, 0.715_183, 0.072_180_21],
    [0.019_330_62, 0.119_197_16, 0.950_372_6],
];

const RGB_FROM_XYZ: [[f32; 3]; 3] = [
    [3.241_003_3, -1.537_398_9, -0.498_615_86],
    [-0.969_224_33, 1.875_930_1, 0.041_554_224],
    [0.055_639_423, -0.204_011_2, 1.057_148_9],
];

fn multiply(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn xyz_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    multiply(&XYZ_FROM_RGB, rgb)
}

fn rgb_from_xyz(xyz: [f32; 3]) -> [f32; 3] {
    multiply(&RGB_FROM_XYZ, xyz)
}

fn lab_from_xyz(xyz: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |i: usize| {
        let v = xyz[i] / WHITE[i];
        if v > DELTA.powi(3) { v.cbrt() } else { v / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let (x, y, z) = (f(0), f(1), f(2));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn opponent_from_xyz(xyz: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = [xyz[0] / WHITE[0], xyz[1] / WHITE[1], xyz[2] / WHITE[2]];
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn xyz_from_opponent([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (y + 16.0) / 116.0;
    [(y + cx / 500.0) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (48, 32);

    /// Pictures of 8 bits that the authors' program was given too.
    fn picture(kind: usize) -> Vec<[f32; 3]> {
        let (width, height) = SIZE;
        let pixel = |i: usize| {
            let (x, y) = (i % width, i / width);
            let base = [x * 255 / (width - 1), y * 255 / (height - 1), (x * 7 + y * 13) % 256];
            let inverted = (x / 4 + y / 4) % 2 == 1;
            let value = match kind {
                1 => base.map(|v| (v + 20).min(255)),
                2 if inverted => base.map(|v| 255 - v),
                3 if (x, y) == (20, 10) => [255; 3],
                4 => [base[2], base[0], base[1]],
                _ => base,
            };
            value.map(|v| v as f32 / 255.0)
        };
        (0..width * height).map(pixel).collect()
    }

    /// Results of the authors' C++ program (by way of the crate `nv-flip` 0.1.2): the mean, and the map at (20,10), (0,0),
    /// (47,31) and (21,12).
    #[test]
    fn the_map_is_that_of_the_authors_program() {
        let expected = [
            (0, 0.0, [0.0; 4]),
            (1, 0.346_752_990_260_332_2, [0.293_750_4, 0.267_212_87, 0.344_740_18, 0.332_992_02]),
            (2, 0.785_773_599_937_480_5, [0.614_116_1, 0.361_978_68, 0.463_335_78, 0.517_802_54]),
            (3, 0.004_313_369_637_804_598, [0.462_501_05, 0.0, 0.0, 0.130_912_04]),
            (4, 0.848_163_485_745_317_3, [0.691_541_97, 0.054_300_31, 0.630_891_4, 0.395_475_1]),
        ];
        for (kind, mean, at) in expected {
            let map = flip_map(&picture(kind), &picture(0), SIZE.0, PIXELS_PER_DEGREE);
            let have = flip_mean(&picture(kind), &picture(0), SIZE.0);
            assert!((have - mean).abs() < 1e-4, "picture {kind}: mean {have}, not {mean}");
            for ((x, y), want) in [(20, 10), (0, 0), (47, 31), (21, 12)].into_iter().zip(at) {
                let have: f32 = map[y * SIZE.0 + x];
                assert!((have - want).abs() < 1e-3, "picture {kind} at ({x},{y}): {have}, not {want}");
            }
        }
    }

    #[test]
    fn pictures_that_do_not_fit_have_no_map() {
        assert!(flip_map(&picture(0), &picture(0)[1..], SIZE.0, 67.0).is_empty());
        assert!(flip_map(&picture(0), &picture(0), 0, 67.0).is_empty());
        assert_eq!(flip_mean(&[], &[], 4), 0.0);
        assert!(flip_map(&[[0.0; 3]], &[[1.0; 3]], 1, 67.0)[0] > 0.9, "one pixel is a picture");
    }
}
