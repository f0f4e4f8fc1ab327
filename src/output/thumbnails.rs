//! Small pictures of a run's frames, for the report and the contact sheet.
//!
//! They are taken as frames pass to the sink ([`WithThumbnails`]), and read from their files for frames that were there
//! already. Their number, their size and what they take in a page are bounded, however long the sequence is.

use crate::frame::{Frame, FrameId, StageSeconds, StereoEye};
use crate::measure::{Exposure, Percentile, picture, read_frame};
use crate::sequence::FrameSink;
use crate::{Error, Result};
use base64::Engine;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageFormat, RgbImage};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Frames of which there are pictures at most.
pub const MOST_FRAMES: usize = 200;
/// Longer side of a picture, pixels, at most.
pub const SIDE: usize = 256;
/// Bytes that all pictures take in a page, at most.
pub const MOST_BYTES: usize = 8 << 20;

/// JPEG quality of what is shown, and of what is exposed anew before it is.
const SHOWN: u8 = 82;
const KEPT: u8 = 92;

/// A frame's pictures as data URIs; none for layers that the frame does not have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Thumbnail {
    /// Frame number.
    pub frame: i64,
    /// The beauty, under the whole sequence's exposure.
    pub beauty: String,
    /// The class of each pixel, in colour.
    pub class: Option<String>,
    /// Depth, near to far.
    pub depth: Option<String>,
}

/// The small pictures of a run. They are kept encoded, or a long run would hold a hundred megabytes of them; the beauty
/// under its frame's own exposure, until all frames are known and with them the sequence's.
#[derive(Debug)]
pub struct Thumbnails {
    chosen: BTreeSet<i64>,
    small: BTreeMap<i64, Small>,
    percentile: Percentile,
    /// Width of a frame's pixel over its height; those of pictures are square.
    pixel_aspect: f64,
}

/// A frame made small: JPEG and WebP files.
#[derive(Debug)]
struct Small {
    beauty: Vec<u8>,
    exposure: Exposure,
    depth: Option<Vec<u8>>,
    class: Option<Vec<u8>>,
}

impl Thumbnails {
    /// For the run of `frames`: of all, or of 200 that are spread evenly. Pictures have the shape of what is shown, whatever
    /// the aspect of the frames' pixels.
    pub fn of(frames: &BTreeSet<i64>, pixel_aspect: f64) -> Self {
        let step = frames.len().div_ceil(MOST_FRAMES).max(1);
        let chosen = frames.iter().copied().step_by(step).collect();
        Self { chosen, small: BTreeMap::new(), percentile: Percentile::default(), pixel_aspect }
    }

    /// Takes frames' pictures from their files; a file that cannot be read leaves its frame without.
    ///
    /// # Errors
    /// [`Error::Interrupted`] as soon as `stop` names a signal.
    pub fn read(&mut self, files: &[(i64, PathBuf)], stop: impl Fn() -> Option<i32> + Sync) -> Result<()> {
        let chosen = files.par_iter().filter(|(number, _)| self.chosen.contains(number));
        let read = |(number, file): &(i64, PathBuf)| {
            if let Some(signal) = stop() {
                return Err(Error::Interrupted { signal });
            }
            let Ok(frame) = read_frame(file) else { return Ok(None) };
            let small = self.small(frame.width, &frame.color, &frame.depth, &frame.class);
            Ok(small.map(|small| (*number, small)))
        };
        let read: Vec<_> = chosen.map(read).collect::<Result<_>>()?;
        read.into_iter().flatten().for_each(|(number, small)| self.keep(number, small));
        Ok(())
    }

    fn exposure(&self) -> Exposure {
        Exposure::from_p99(self.percentile.get(0.99))
    }

    fn add(&mut self, number: i64, width: usize, color: &[[f32; 4]], depth: &[f32], class: &[u8]) {
        if self.chosen.contains(&number)
            && let Some(small) = self.small(width, color, depth, class)
        {
            self.keep(number, small);
        }
    }

    fn keep(&mut self, number: i64, (small, percentile): (Small, Percentile)) {
        self.percentile.merge(&percentile);
        self.small.insert(number, small);
    }

    /// A frame made small, and how bright it is.
    fn small(
        &self,
        width: usize,
        color: &[[f32; 4]],
        depth: &[f32],
        class: &[u8],
    ) -> Option<(Small, Percentile)> {
        if width == 0 || color.is_empty() {
            return None;
        }
        let grid = Grid::new(width, color.len() / width, self.pixel_aspect);
        let (columns, color) = (grid.columns as u32, grid.means(color));
        let mut percentile = Percentile::default();
        percentile.add(&color);
        let exposure = Exposure::from_p99(percentile.get(0.99));
        let beauty = picture::beauty(&color, columns, exposure).and_then(|p| jpeg(&p, KEPT))?;
        let (depth, class) = (grid.centers(depth), grid.centers(class));
        let depth = picture::depth(&depth, columns).filter(|_| !depth.is_empty());
        let class = picture::classes(&class, columns).filter(|_| !class.is_empty());
        let depth = depth.and_then(|p| jpeg(&p, SHOWN));
        let class = class.and_then(|p| webp(&p));
        Some((Small { beauty, exposure, depth, class }, percentile))
    }

    /// The beauty of every frame, or of at most so many that are spread evenly, under one exposure.
    pub fn beauties(&self, most: usize) -> BTreeMap<i64, RgbImage> {
        let exposure = self.exposure();
        let step = self.small.len().div_ceil(most.max(1)).max(1);
        let chosen = self.small.iter().step_by(step);
        chosen.filter_map(|(&frame, small)| Some((frame, small.beauty(exposure)?))).collect()
    }

    /// All pictures, encoded for a page. If they take more than 8 MiB, every second frame is left out until they do
    /// not.
    pub fn encoded(&self) -> Vec<Thumbnail> {
        let exposure = self.exposure();
        let encode = |(&frame, small): (&i64, &Small)| {
            Some(Thumbnail {
                frame,
                beauty: uri("jpeg", &jpeg(&small.beauty(exposure)?, SHOWN)?),
                class: small.class.as_ref().map(|class| uri("webp", class)),
                depth: small.depth.as_ref().map(|depth| uri("jpeg", depth)),
            })
        };
        let mut all: Vec<Thumbnail> = self.small.par_iter().filter_map(encode).collect();
        while all.len() > 1 && all.iter().map(Thumbnail::bytes).sum::<usize>() > MOST_BYTES {
            all = all.into_iter().step_by(2).collect();
        }
        all
    }
}

impl Small {
    fn beauty(&self, exposure: Exposure) -> Option<RgbImage> {
        let own = image::load_from_memory_with_format(&self.beauty, ImageFormat::Jpeg).ok()?;
        Some(picture::exposed(&own.into_rgb8(), self.exposure, exposure))
    }
}

impl Thumbnail {
    fn bytes(&self) -> usize {
        let of = |layer: &Option<String>| layer.as_ref().map_or(0, String::len);
        self.beauty.len() + of(&self.class) + of(&self.depth)
    }
}

/// Pixels of a large picture for each of a small one.
struct Grid {
    size: (usize, usize),
    columns: usize,
    rows: usize,
}

impl Grid {
    /// Small pixels are square: the side along which large ones are longer is stretched, so that none is lost.
    fn new(width: usize, height: usize, pixel_aspect: f64) -> Self {
        let wide = (width as f64 * pixel_aspect.max(1.0)).round() as usize;
        let high = (height as f64 * pixel_aspect.recip().max(1.0)).round() as usize;
        let shrink = |side: usize| (side * SIDE / wide.max(high).max(SIDE)).max(1);
        Self { size: (width, height), columns: shrink(wide), rows: shrink(high) }
    }

    /// The mean of the pixels that fall on each small one; what is not finite counts as black.
    fn means(&self, pixels: &[[f32; 4]]) -> Vec<[f32; 4]> {
        let (width, height) = self.size;
        let range = |i: usize, count: usize, size: usize| {
            i * size / count..((i + 1) * size / count).max(i * size / count + 1)
        };
        let mean = |column: usize, row: usize| {
            let (mut sum, mut count) = ([0.0; 4], 0.0);
            for y in range(row, self.rows, height) {
                for pixel in &pixels[y * width..][range(column, self.columns, width)] {
                    sum.iter_mut().zip(pixel).for_each(|(s, v)| *s += if v.is_finite() { *v } else { 0.0 });
                    count += 1.0;
                }
            }
            sum.map(|s| s / count)
        };
        let row = |row: usize| (0..self.columns).map(move |column| mean(column, row));
        (0..self.rows).into_par_iter().flat_map_iter(row).collect()
    }

    /// The pixel under the middle of each small one: numbers are not blended.
    fn centers<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let (width, height) = self.size;
        let middle = |i: usize, count: usize, size: usize| (2 * i + 1) * size / (2 * count);
        let row = |row: usize| middle(row, self.rows, height) * width;
        let places = (0..self.rows)
            .flat_map(|y| (0..self.columns).map(move |x| row(y) + middle(x, self.columns, width)));
        places.filter_map(|i| values.get(i).copied()).collect()
    }
}

/// Photographs: small, and nobody measures them.
fn jpeg(picture: &RgbImage, quality: u8) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(picture).ok()?;
    bytes.shrink_to_fit();
    Some(bytes)
}

/// Pictures of few colours: exact, and half of what PNG takes.
fn webp(picture: &RgbImage) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let (width, height) = picture.dimensions();
    let encoder = WebPEncoder::new_lossless(&mut bytes);
    encoder.write_image(picture, width, height, ExtendedColorType::Rgb8).ok()?;
    bytes.shrink_to_fit();
    Some(bytes)
}

fn uri(kind: &str, bytes: &[u8]) -> String {
    format!("data:image/{kind};base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// A sink that takes a small picture of each frame on its way to another.
pub struct WithThumbnails<'a> {
    /// Where frames go.
    pub sink: &'a mut dyn FrameSink,
    /// Where their pictures go.
    pub thumbnails: &'a mut Thumbnails,
}

impl FrameSink for WithThumbnails<'_> {
    fn blank(&mut self) -> Option<Frame> {
        self.sink.blank()
    }

    fn put(&mut self, frame: Frame) -> Result<()> {
        // Of a pair, the left eye's are enough to find one's way.
        if frame.eye != Some(StereoEye::Right) {
            let width = frame.window.width as usize;
            self.thumbnails.add(frame.number, width, &frame.color, &frame.depth, &frame.class);
        }
        self.sink.put(frame)
    }

    fn finish(&mut self) -> Result<Vec<(FrameId, StageSeconds)>> {
        self.sink.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_made_small_and_never_large() {
        let grid = Grid::new(1024, 512, 1.0);
        assert_eq!((grid.columns, grid.rows), (256, 128));
        let pixels: Vec<[f32; 4]> = (0..1024 * 512).map(|i| [(i % 1024 / 4) as f32; 4]).collect();
        let means = grid.means(&pixels);
        assert!(means.iter().enumerate().all(|(i, m)| m[0] == (i % 256) as f32));
        let classes: Vec<u8> = (0..1024 * 512).map(|i| (i % 4) as u8).collect();
        assert!(grid.centers(&classes).iter().all(|&c| c == 2));
        let grid = Grid::new(3, 2, 1.0);
        assert_eq!((grid.columns, grid.rows), (3, 2));
        assert_eq!(grid.centers(&[1, 2, 3, 4, 5, 6]), [1, 2, 3, 4, 5, 6]);
        assert_eq!(grid.centers::<u8>(&[]), [0; 0]);
        let grid = Grid::new(100_000, 10, 1.0);
        assert_eq!((grid.columns, grid.rows), (256, 1));
    }

    #[test]
    fn pictures_have_the_shape_of_what_is_shown() {
        let size = |width, height, pixel_aspect| {
            let grid = Grid::new(width, height, pixel_aspect);
            (grid.columns, grid.rows)
        };
        assert_eq!(size(160, 180, 2.0), (256, 144));
        assert_eq!(size(1440, 1080, 4.0 / 3.0), (256, 144));
        assert_eq!(size(64, 36, 0.5), (64, 72));
        let grid = Grid::new(3, 2, 2.0);
        assert_eq!(grid.centers(&[1, 2, 3, 4, 5, 6]), [1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6]);
        let means = grid.means(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(|v| [v; 4]));
        assert_eq!(means.iter().map(|m| m[0]).collect::<Vec<_>>()[..6], [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
    }

    #[test]
    fn frames_are_shown_under_one_exposure_wherever_they_began() {
        let frames: BTreeSet<i64> = (0..2).collect();
        let mut thumbnails = Thumbnails::of(&frames, 1.0);
        let gray = |value: f32| vec![[value, value, value, 1.0]; 64 * 64];
        thumbnails.add(0, 64, &gray(0.5), &[], &[]);
        thumbnails.add(1, 64, &gray(0.125), &[], &[]);
        let exposure = Exposure::from_p99(0.5);
        for (frame, value) in [(0, 0.5), (1, 0.125)] {
            let shown = 255.0 * exposure.encode([value; 4])[0];
            let [found, ..] = thumbnails.beauties(2)[&frame].get_pixel(32, 32).0;
            assert!((f32::from(found) - shown).abs() <= 2.0, "{found} for {shown}");
        }
    }

    #[test]
    fn files_are_read_until_there_is_a_signal() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        exr::prelude::write_rgb_file(&path, 4, 2, |_, _| (0.2, 0.3, 0.5)).unwrap();
        let files: Vec<_> = (0..4).map(|frame| (frame, path.clone())).collect();
        let mut thumbnails = Thumbnails::of(&(0..3).collect(), 1.0);
        let stopped = thumbnails.read(&files, || Some(15));
        assert!(matches!(stopped, Err(Error::Interrupted { signal: 15 })));
        assert!(thumbnails.encoded().is_empty());
        thumbnails.read(&files, || None).unwrap();
        assert_eq!(thumbnails.encoded().iter().map(|t| t.frame).collect::<Vec<_>>(), [0, 1, 2]);
    }

    #[test]
    fn the_number_of_frames_and_bytes_is_bounded() {
        let frames: BTreeSet<i64> = (-500..500).collect();
        let mut thumbnails = Thumbnails::of(&frames, 1.0);
        assert_eq!(thumbnails.chosen.len(), MOST_FRAMES);
        assert!(thumbnails.chosen.contains(&-500));
        // Noise is the worst that can be.
        let noise = |i: usize| ((i * 2_654_435_761) % 1009) as f32 / 1009.0;
        let color: Vec<[f32; 4]> =
            (0..256 * 256).map(|i| [noise(i), noise(i + 7), noise(i + 99), 1.0]).collect();
        let class: Vec<u8> = (0..256 * 256).map(|i| (noise(i) * 10.0) as u8).collect();
        for frame in &frames {
            thumbnails.add(*frame, 256, &color, &[], &class);
        }
        assert_eq!(thumbnails.beauties(MOST_FRAMES).len(), MOST_FRAMES);
        assert_eq!(thumbnails.beauties(24).len(), 23, "every ninth");
        let encoded = thumbnails.encoded();
        assert!(encoded.len() < MOST_FRAMES && encoded.len() > 20, "{}", encoded.len());
        assert!(encoded.iter().map(Thumbnail::bytes).sum::<usize>() <= MOST_BYTES);
        assert!(encoded[0].beauty.starts_with("data:image/jpeg") && encoded[0].depth.is_none());
        assert!(encoded[0].class.as_ref().is_some_and(|c| c.starts_with("data:image/webp")));
    }
}
