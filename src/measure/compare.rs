//! One sequence against another, frame by frame.

use super::sequences::{Sequences, sequences_in};
use super::{
    Exposure, ImageError, Percentile, Place, ReadFrame, compare_pictures, picture, read_frame, worst_place,
};
use crate::frame::FrameKind;
use crate::output::is_anothers;
use crate::{Error, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// How far a sequence is from its reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// All frames that both sequences have, in order.
    pub frames: Vec<FrameError>,
    /// The one with the lowest PSNR; if all are identical, the first.
    pub worst: FrameError,
    /// Over the frames that are not identical.
    pub mean: MeanError,
    /// The same over inferred frames only (as their files' headers say).
    pub inferred_mean: MeanError,
    /// Factor of the exposure that all frames were compared at.
    pub exposure: f32,
    /// Files of the sequence without a counterpart, and of the reference.
    pub unmatched: Unmatched,
}

/// Files that only one side has.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Unmatched {
    /// Names in the folder that was compared.
    pub sequence: Vec<String>,
    /// Names in the reference's folder.
    pub reference: Vec<String>,
}

/// One frame's error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameError {
    /// Frame number.
    pub frame: i64,
    /// Name of its file in the folder that was compared: of a stereo pair, two have one number.
    pub file: String,
    /// The error.
    #[serde(flatten)]
    pub error: ImageError,
    /// Where it is worst, in pixels of the full image; none in identical frames.
    pub worst_place: Option<Place>,
}

/// Means over frames that are not identical to their reference.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MeanError {
    /// Frames that the means are over.
    pub frames: usize,
    /// Mean of the decibels; `None` if there is no frame.
    pub psnr_db: Option<f64>,
    /// Mean of the means.
    pub flip_mean: f64,
    /// Mean of the largest differences.
    pub max_abs: f64,
    /// Mean of the shares.
    pub over_5_percent: f64,
}

/// Factor on differences in pictures of them, so that small ones can be seen.
pub const ENHANCED: f32 = 4.0;

/// Compares the EXR files of folder `sequence` with those of folder `reference`, paired by the frame numbers in their names,
/// which ours state too (and, if a folder holds several sequences, by the rest of the names). If a folder for `pictures` is given, a PNG a frame is
/// written there: the frame, its reference, and the absolute difference times [`ENHANCED`], side by side.
///
/// # Errors
/// [`Error::Input`] if a folder or file cannot be read, if no frame has a counterpart, or if a pair's data windows differ;
/// [`Error::Output`] if a picture cannot be written, or would replace one that is not of this program.
pub fn compare(sequence: &Path, reference: &Path, pictures: Option<&Path>) -> Result<Comparison> {
    let [own, others] = sequences_in([sequence, reference])?;
    let names = [&own, &others].map(|of| of.keys().take(4).cloned().collect::<Vec<_>>().join(", "));
    let (pairs, references, unmatched) = pair_up(own, others);
    if pairs.is_empty() {
        let [own, others] = names.map(|names| if names.is_empty() { "no EXR frames".into() } else { names });
        let message = format!(
            "it holds {own}, and {} holds {others}: no frame of one has the name and number of one of the other",
            reference.display()
        );
        return Err(Error::input(sequence, "folder", message));
    }
    if let Some(folder) = pictures {
        for file in pairs.iter().map(|pair| pair.picture_in(folder)) {
            if is_anothers(&file, picture::MARK) {
                let message = "is there already, and no picture of this program; choose another folder";
                return Err(Error::output(file, message));
            }
        }
        std::fs::create_dir_all(folder).map_err(|e| Error::output(folder, e.to_string()))?;
    }
    let percentile = references
        .par_iter()
        .map(|reference| {
            let mut percentile = Percentile::default();
            percentile.add(&read_frame(reference)?.color);
            Ok(percentile)
        })
        .try_reduce(Percentile::default, |mut a, b| {
            a.merge(&b);
            Ok(a)
        })?;
    let exposure = Exposure::from_p99(percentile.get(0.99));
    let errors: Result<Vec<_>> = pairs.par_iter().map(|pair| pair.compare(exposure, pictures)).collect();
    let (frames, inferred): (Vec<_>, Vec<_>) = errors?.into_iter().unzip();

    let decibels = |f: &FrameError| f.error.psnr_db.unwrap_or(f64::INFINITY);
    let Some(worst) = frames.iter().min_by(|a, b| decibels(a).total_cmp(&decibels(b))).cloned() else {
        return Err(Error::input(sequence, "folder", "it holds no frames"));
    };
    let of_inferred = frames.iter().zip(&inferred).filter(|(_, inferred)| **inferred).map(|(frame, _)| frame);
    Ok(Comparison {
        worst,
        mean: MeanError::of(frames.iter().map(|f| f.error)),
        inferred_mean: MeanError::of(of_inferred.map(|f| f.error)),
        exposure: exposure.scale,
        unmatched,
        frames,
    })
}

/// Two files of one frame.
#[derive(Debug)]
struct Pair {
    frame: i64,
    sequence: PathBuf,
    reference: PathBuf,
}

impl Pair {
    /// The error, and whether the frame was inferred.
    fn compare(&self, exposure: Exposure, pictures: Option<&Path>) -> Result<(FrameError, bool)> {
        let a: ReadFrame = read_frame(&self.sequence)?;
        let b = read_frame(&self.reference)?;
        for (path, frame) in [(&self.sequence, &a), (&self.reference, &b)] {
            refuse_no_number(path, frame)?;
        }
        let window = |f: &ReadFrame| (f.origin, f.width, f.height);
        if window(&a) != window(&b) {
            let size = |f: &ReadFrame| format!("{}x{} from {},{}", f.width, f.height, f.origin.0, f.origin.1);
            let message = format!("it is {}, but {} is {}", size(&a), self.reference.display(), size(&b));
            return Err(Error::input(&self.sequence, "dataWindow", message));
        }
        let (error, map) = compare_pictures(&a.color, &b.color, a.width, exposure);
        if let Some(folder) = pictures {
            self.draw(&a, &b, exposure, folder)?;
        }
        let file = file_name(&self.sequence);
        let worst_place = worst_place(&map, a.width).map(|place| place.in_image(a.origin));
        let error = FrameError { frame: self.frame, file, error, worst_place };
        Ok((error, matches!(a.kind, Some(FrameKind::Inferred { .. }))))
    }

    /// Writes the frame, its reference and their difference as a picture of the frame's name.
    fn draw(&self, a: &ReadFrame, b: &ReadFrame, exposure: Exposure, folder: &Path) -> Result<()> {
        let width = a.width as u32;
        let parts = [
            picture::beauty(&a.color, width, exposure),
            picture::beauty(&b.color, width, exposure),
            picture::difference(&a.color, &b.color, width, exposure, ENHANCED),
        ];
        let parts: Vec<_> = parts.into_iter().flatten().collect();
        picture::write_png(&picture::contact_sheet(&parts, 3, width), &self.picture_in(folder))
    }

    fn picture_in(&self, folder: &Path) -> PathBuf {
        folder.join(file_name(&self.sequence)).with_extension("png")
    }
}

/// What is no brightness cannot be told from another: taken for black, it would be the same as black.
fn refuse_no_number(path: &Path, frame: &ReadFrame) -> Result<()> {
    let is_none = |pixel: &[f32; 4]| pixel[..3].iter().any(|v| v.is_nan() || *v == f32::NEG_INFINITY);
    let Some(first) = frame.color.iter().position(is_none) else { return Ok(()) };
    let (count, width) = (frame.color.iter().filter(|pixel| is_none(pixel)).count(), frame.width);
    let in_image = |within: usize, origin: i32| within as i64 + i64::from(origin);
    let (x, y) = (in_image(first % width, frame.origin.0), in_image(first / width, frame.origin.1));
    let place = format!("pixel {x},{y}");
    let message = format!(
        "it is no number (of the frame's pixels: {count}), and cannot be compared; render the frame again"
    );
    Err(Error::input(path, place, message))
}

impl MeanError {
    pub(super) fn of(errors: impl Iterator<Item = ImageError>) -> Self {
        let mut sum = Self::default();
        for error in errors {
            if let Some(db) = error.psnr_db {
                sum.frames += 1;
                *sum.psnr_db.get_or_insert(0.0) += db;
                sum.flip_mean += error.flip_mean;
                sum.max_abs += error.max_abs;
                sum.over_5_percent += error.over_5_percent;
            }
        }
        let count = sum.frames.max(1) as f64;
        Self {
            frames: sum.frames,
            psnr_db: sum.psnr_db.map(|db| db / count),
            flip_mean: sum.flip_mean / count,
            max_abs: sum.max_abs / count,
            over_5_percent: sum.over_5_percent / count,
        }
    }
}

/// The name of a file in its folder.
fn file_name(path: impl AsRef<Path>) -> String {
    path.as_ref().file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Pairs frames; two folders with one sequence each are paired whatever the names. Also all files of the reference sequences of
/// which there is a pair: a frame's exposure must not hang on which others have been rendered.
fn pair_up(mut sequence: Sequences, mut reference: Sequences) -> (Vec<Pair>, Vec<PathBuf>, Unmatched) {
    if sequence.len() == 1 && reference.len() == 1 {
        sequence = sequence.into_values().map(|frames| (String::new(), frames)).collect();
        reference = reference.into_values().map(|frames| (String::new(), frames)).collect();
    }
    let (mut pairs, mut references) = (Vec::new(), Vec::new());
    let mut unmatched = Unmatched::default();
    for (key, frames) in sequence {
        let mut counterparts = reference.remove(&key).unwrap_or_default();
        if frames.keys().any(|frame| counterparts.contains_key(frame)) {
            references.extend(counterparts.values().cloned());
        }
        for (frame, path) in frames {
            match counterparts.remove(&frame) {
                Some(reference) => pairs.push(Pair { frame, sequence: path, reference }),
                None => unmatched.sequence.push(file_name(path)),
            }
        }
        unmatched.reference.extend(counterparts.into_values().map(file_name));
    }
    unmatched.reference.extend(reference.into_values().flat_map(BTreeMap::into_values).map(file_name));
    (pairs, references, unmatched)
}

/// The table of `--format text`.
impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let titles = ["PSNR dB", "FLIP", "max", "over 5 %"].map(|title| format!("  {title:>8}")).concat();
        let mut numbers: Vec<_> = self.frames.iter().map(|frame| frame.frame).collect();
        numbers.sort_unstable();
        let one_sequence = numbers.windows(2).all(|pair| pair[0] != pair[1]);
        let name = |of: &FrameError| if one_sequence { of.frame.to_string() } else { of.file.clone() };
        let worst = &self.worst;
        let worst_name = format!("worst ({})", name(worst));
        let names = self.frames.iter().map(name).chain([worst_name.clone()]);
        let width = names.map(|name| name.chars().count()).fold(15, usize::max);
        writeln!(f, "{:>width$}{titles}  worst place", "frame")?;
        let row = |f: &mut fmt::Formatter<'_>, name: String, e: ImageError, place: Option<Place>| {
            let db = e.psnr_db.map_or("same".to_string(), |db| format!("{db:.2}"));
            let share = 100.0 * e.over_5_percent;
            let place = place.map(|p| {
                format!("  mean FLIP {:.3} in the {1}x{1} block at {2},{3}", p.flip, p.side, p.x, p.y)
            });
            let place = place.unwrap_or_default();
            writeln!(
                f,
                "{name:>width$}  {db:>8}  {:>8.4}  {:>8.4}  {share:>6.2} %{place}",
                e.flip_mean, e.max_abs
            )
        };
        for frame in &self.frames {
            row(f, name(frame), frame.error, frame.worst_place)?;
        }
        row(f, worst_name, worst.error, worst.worst_place)?;
        for (name, mean) in [("mean", self.mean), ("inferred mean", self.inferred_mean)] {
            if mean.frames > 0 {
                let MeanError { psnr_db, flip_mean, max_abs, over_5_percent, .. } = mean;
                row(f, name.to_string(), ImageError { psnr_db, flip_mean, max_abs, over_5_percent }, None)?;
            }
        }
        for (side, names) in
            [("sequence", &self.unmatched.sequence), ("reference", &self.unmatched.reference)]
        {
            if let [first, rest @ ..] = names.as_slice() {
                let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
                writeln!(f, "only in the {side}: {first}{more}")?;
            }
        }
        Ok(())
    }
}
