//! Frames as pictures for screens and documentation.

use super::Exposure;
use crate::output::write_alone;
use crate::{Error, Result};
use image::imageops::{self, FilterType};
use image::{ImageFormat, Rgb, RgbImage};
use std::io::Cursor;
use std::path::Path;

/// Colours of the pixel classes by number: traced ones are warm or bright, reused ones dark and cool.
pub const CLASS_COLORS: [[u8; 3]; crate::frame::PixelClass::COUNT] = [
    [150, 150, 150], // traced
    [24, 48, 84],    // good
    [0, 130, 140],   // overlapped
    [235, 64, 52],   // missed
    [255, 170, 0],   // bad
    [255, 235, 80],  // creeping
    [190, 80, 220],  // entering
    [120, 220, 100], // edge
    [255, 120, 190], // moved
    [70, 110, 190],  // filled
];

/// The beauty as it is shown at `exposure`; `None` if `pixels` are not rows of `width`.
pub fn beauty(pixels: &[[f32; 4]], width: u32, exposure: Exposure) -> Option<RgbImage> {
    draw(pixels, width, |&pixel| exposure.encode(pixel).map(to_byte))
}

/// A picture that was made at one exposure, as it is shown at another.
pub fn exposed(picture: &RgbImage, from: Exposure, to: Exposure) -> RgbImage {
    let linear = from.linear_from_byte();
    let shown = linear.map(|v| to_byte(to.encode([v; 4])[0]));
    let mut picture = picture.clone();
    picture.iter_mut().for_each(|byte| *byte = shown[usize::from(*byte)]);
    picture
}

/// Pixel classes in [`CLASS_COLORS`].
pub fn classes(class: &[u8], width: u32) -> Option<RgbImage> {
    draw(class, width, |&class| CLASS_COLORS.get(usize::from(class)).copied().unwrap_or([0; 3]))
}

/// The absolute difference of the shown colours, times `factor`: black where they agree.
pub fn difference(
    pixels: &[[f32; 4]],
    reference: &[[f32; 4]],
    width: u32,
    exposure: Exposure,
    factor: f32,
) -> Option<RgbImage> {
    let pairs: Vec<_> = pixels.iter().zip(reference).collect();
    draw(&pairs, width, |&(&a, &b)| {
        let (a, b) = (exposure.encode(a), exposure.encode(b));
        [0, 1, 2].map(|i| to_byte((a[i] - b[i]).abs() * factor))
    })
}

/// Depth, near white to far dark on a scale of equal ratios; the background black.
pub fn depth(depth: &[f32], width: u32) -> Option<RgbImage> {
    let is_surface = |z: f32| z > 0.0 && z < crate::frame::Frame::FAR_DEPTH;
    let surface = || depth.iter().copied().filter(|z| is_surface(*z));
    let near = surface().fold(f32::INFINITY, f32::min);
    let far = surface().fold(0.0, f32::max);
    let range = (far / near).ln().max(1e-6);
    draw(depth, width, |&z| {
        let far_share = (z / near).ln() / range;
        [if is_surface(z) { to_byte(1.0 - 0.9 * far_share) } else { 0 }; 3]
    })
}

/// Pictures side by side in rows of `columns`, each scaled to `width` pixels across, on dark grey.
pub fn contact_sheet(pictures: &[RgbImage], columns: usize, width: u32) -> RgbImage {
    const GAP: u32 = 4;
    let columns = columns.max(1).min(pictures.len().max(1));
    let scaled: Vec<RgbImage> = pictures.iter().map(|picture| scale(picture, width.max(1))).collect();
    let heights: Vec<u32> =
        scaled.chunks(columns).map(|row| row.iter().map(RgbImage::height).max().unwrap_or(0)).collect();
    let size = (
        columns as u32 * (width.max(1) + GAP) + GAP,
        heights.iter().map(|height| height + GAP).sum::<u32>() + GAP,
    );
    let mut sheet = RgbImage::from_pixel(size.0, size.1, Rgb([28, 28, 28]));
    let mut y = GAP;
    for (row, height) in scaled.chunks(columns).zip(heights) {
        for (column, picture) in row.iter().enumerate() {
            let x = GAP + column as u32 * (width.max(1) + GAP);
            imageops::replace(&mut sheet, picture, x.into(), y.into());
        }
        y += height + GAP;
    }
    sheet
}

/// The picture `width` pixels across. Enlarged ones keep their pixels visible.
pub fn scale(picture: &RgbImage, width: u32) -> RgbImage {
    let height =
        (u64::from(picture.height()) * u64::from(width) / u64::from(picture.width().max(1))).max(1) as u32;
    let filter = if width > picture.width() { FilterType::Nearest } else { FilterType::Triangle };
    imageops::resize(picture, width, height, filter)
}

/// What all our PNG files have in them: the keyword and text of a `tEXt` chunk.
pub const MARK: &str = "Software\0Buzz";

/// The picture as the bytes of a PNG file that says who made it.
///
/// # Errors
/// If the picture is empty or too large for the format.
pub fn png(picture: &RgbImage) -> image::ImageResult<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png)?;
    let mut bytes = bytes.into_inner();
    let content = ["tEXt", MARK].concat().into_bytes();
    let checksum = zlib_rs::crc32::crc32(0, &content).to_be_bytes();
    let chunk = [&(MARK.len() as u32).to_be_bytes()[..], &content, &checksum].concat();
    bytes.splice(BEHIND_HEADER..BEHIND_HEADER, chunk);
    Ok(bytes)
}

/// Where the second chunk of a PNG file begins: signature and header have a fixed length.
const BEHIND_HEADER: usize = 8 + 25;

/// Writes the picture as a PNG file, whole or not at all.
///
/// # Errors
/// [`Error::Output`] if the file cannot be written or the picture is empty.
pub fn write_png(picture: &RgbImage, path: &Path) -> Result<()> {
    let bytes = png(picture).map_err(|e| Error::output(path, e.to_string()))?;
    write_alone(path, &bytes)
}

fn draw<T>(values: &[T], width: u32, color: impl Fn(&T) -> [u8; 3]) -> Option<RgbImage> {
    let height = u32::try_from(values.len()).ok()?.checked_div(width)?;
    RgbImage::from_raw(width, height, values.iter().flat_map(color).collect())
        .filter(|_| width as usize * height as usize == values.len())
}

fn to_byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::is_anothers;

    #[test]
    fn a_picture_exposed_anew_is_as_if_it_had_been_made_so() {
        let pixels: Vec<[f32; 4]> = (0..256).map(|i| [i as f32 / 256.0; 4]).collect();
        let (dark, bright) = (Exposure { scale: 0.5 }, Exposure { scale: 1.0 });
        let made = |exposure| beauty(&pixels, 256, exposure).unwrap();
        assert_eq!(exposed(&made(bright), bright, bright), made(bright));
        let darkened = exposed(&made(bright), bright, dark);
        assert!(darkened.iter().zip(made(dark).iter()).all(|(a, b)| a.abs_diff(*b) <= 1));
    }

    #[test]
    fn layers_become_pictures() {
        let exposure = Exposure { scale: 1.0 };
        let white = beauty(&[[1.0; 4]; 6], 3, exposure).unwrap();
        assert_eq!((white.dimensions(), white.get_pixel(2, 1).0), ((3, 2), [255; 3]));
        assert!(beauty(&[[1.0; 4]; 6], 4, exposure).is_none());
        assert!(beauty(&[[1.0; 4]; 6], 0, exposure).is_none());
        assert_eq!(classes(&[3, 200], 2).unwrap().into_raw(), [235, 64, 52, 0, 0, 0]);
        let black = difference(&[[0.5; 4]; 2], &[[0.5; 4]; 2], 2, exposure, 10.0).unwrap();
        assert!(black.into_raw().iter().all(|&v| v == 0));
        let depth = depth(&[1.0, 10.0, 100.0, 1e10], 4).unwrap();
        assert_eq!(depth.pixels().map(|p| p.0[0]).collect::<Vec<_>>(), [255, 140, 26, 0]);
    }

    #[test]
    fn a_contact_sheet_holds_every_picture() {
        let pictures = vec![RgbImage::from_pixel(8, 4, Rgb([255; 3])); 3];
        let sheet = contact_sheet(&pictures, 2, 16);
        assert_eq!(sheet.dimensions(), (2 * 20 + 4, 2 * 12 + 4));
        assert_eq!(sheet.pixels().filter(|p| p.0 == [255; 3]).count(), 3 * 16 * 8);
        assert_eq!(contact_sheet(&[], 3, 16).dimensions(), (24, 4));
    }

    #[test]
    fn a_png_is_written_and_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.png");
        let picture = RgbImage::from_fn(5, 3, |x, y| Rgb([x as u8, y as u8, 7]));
        write_png(&picture, &path).unwrap();
        assert_eq!(image::open(&path).unwrap().into_rgb8(), picture);
        assert!(!is_anothers(&path, MARK));
    }
}
