//! What others need to look at a sequence: a contact sheet, a timeline for review players, and scripts that load it into Nuke
//! and Blender with the class of each pixel laid over it.
//!
//! They stand in a folder beside the report, `report.review`, and refer to the frames by a relative path: the output folder can
//! be moved as a whole.

mod blender;
mod nuke;
mod timeline;

use super::{KeyFrame, NamePattern, Thumbnails, write_alone};
use crate::frame::Window;
use crate::measure::picture::{contact_sheet, png};
use crate::scene::Rational;
use crate::{Error, Result};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A sequence to be looked at.
#[derive(Debug)]
pub struct Review<'a> {
    /// Where the frames are.
    pub folder: &'a Path,
    /// What they are called.
    pub names: &'a NamePattern,
    /// Which there are.
    pub frames: &'a BTreeSet<i64>,
    /// First frames after a cut.
    pub cuts: &'a [i64],
    /// Frames traced in full, and why.
    pub keyframes: &'a [KeyFrame],
    /// Frames per second.
    pub fps: Rational,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Width of a pixel over its height.
    pub pixel_aspect: f64,
    /// The part of the image that the files hold.
    pub window: Window,
    /// Whether the files hold the class of each pixel.
    pub has_class: bool,
}

/// Pictures of a contact sheet, and how many stand side by side.
const SHEET: (usize, usize) = (24, 6);

impl Review<'_> {
    /// The files of the folder that belongs to the report `report`: timeline, scripts for Nuke and Blender, contact sheet.
    pub fn files(report: &Path) -> [PathBuf; 4] {
        ["timeline.otio", "nuke.nk", "blender.py", "sheet.png"]
            .map(|name| report.with_extension("review").join(name))
    }

    /// Writes the folder that belongs to the report `report`.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write(&self, report: &Path, thumbnails: &Thumbnails) -> Result<()> {
        let (Some(&first), Some(&last)) = (self.frames.first(), self.frames.last()) else { return Ok(()) };
        let [timeline, nuke, blender, sheet] = Self::files(report);
        let base = self.base(report)?;
        write_alone(&timeline, self.timeline(&base).as_bytes())?;
        write_alone(&nuke, self.nuke_script(&base, first, last).as_bytes())?;
        write_alone(&blender, self.blender_script(&base, first, last).as_bytes())?;
        let pictures: Vec<_> = thumbnails.beauties(SHEET.0).into_values().collect();
        let Some(width) = pictures.first().map(image::RgbImage::width) else { return Ok(()) };
        let picture = png(&contact_sheet(&pictures, SHEET.1, width));
        write_alone(&sheet, &picture.map_err(|e| Error::output(&sheet, e.to_string()))?)
    }

    /// The frames' folder as seen from the review's, with a slash at its end: `../`, unless the report was sent elsewhere.
    fn base(&self, report: &Path) -> Result<String> {
        let whole = |path: &Path| path.canonicalize().map_err(|e| super::write::explain(path, &e));
        let frames = whole(self.folder)?;
        let beside = super::write::folder_of(report);
        Ok(if whole(beside)? == frames { "../".into() } else { format!("{}/", frames.display()) })
    }

    /// The sequence's name.
    fn title(&self) -> &str {
        let title = self.names.parts().0.trim_end_matches(['.', '_', '-']);
        if title.is_empty() { "sequence" } else { title }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of<'a>(folder: &'a Path, names: &'a NamePattern, frames: &'a BTreeSet<i64>) -> Review<'a> {
        Review {
            folder,
            names,
            frames,
            cuts: &[],
            keyframes: &[],
            fps: Rational { numerator: 24, denominator: 1 },
            width: 64,
            height: 36,
            pixel_aspect: 1.0,
            window: Window { x: 0, y: 0, width: 64, height: 36 },
            has_class: true,
        }
    }

    #[test]
    fn pixels_that_are_not_square_are_said_to_be() {
        let frames: BTreeSet<i64> = (1..=3).collect();
        let names = NamePattern::parse("<stem>.####.exr", "shot").unwrap();
        for (pixel_aspect, nuke, blender) in [(2.0, "2", [2.0, 1.0]), (0.5, "0.5", [1.0, 2.0])] {
            let review = Review { pixel_aspect, ..of(Path::new(""), &names, &frames) };
            let script = review.nuke_script("../", 1, 3);
            assert!(script.contains(&format!(" format \"64 36 0 0 64 36 {nuke} Buzz\"\n")), "{script}");
            let script: String = review.blender_script("../", 1, 3).split_whitespace().collect();
            let said = format!("\"pixel_aspect\":[{:?},{:?}]", blender[0], blender[1]);
            assert!(script.contains(&said), "{script}");
        }
    }

    #[test]
    fn clips_of_padded_numbers_end_before_0() {
        let frames: BTreeSet<i64> = (-2..=1).collect();
        let clips = |pattern: &str| {
            let names = NamePattern::parse(pattern, "shot").unwrap();
            let text = of(Path::new(""), &names, &frames).timeline("../");
            let timeline: serde_json::Value = serde_json::from_str(&text).unwrap();
            let children = timeline["tracks"]["children"][0]["children"].as_array().unwrap();
            let reference = |clip: &serde_json::Value| clip["media_references"]["DEFAULT_MEDIA"].clone();
            let said = |r: serde_json::Value| (r["start_frame"].as_i64(), r["frame_zero_padding"].as_i64());
            children.iter().map(|clip| said(reference(clip))).collect::<Vec<_>>()
        };
        assert_eq!(clips("<stem>.####.exr"), [(Some(-2), Some(3)), (Some(0), Some(4))]);
        assert_eq!(clips("<stem>.%d.exr"), [(Some(-2), Some(0))]);
    }

    #[test]
    fn names_are_encoded_where_urls_are_asked_for() {
        let frames: BTreeSet<i64> = (1..=3).collect();
        let names = NamePattern::parse("<stem>.####_%%.exr", "sh#1 50%41é").unwrap();
        let text = of(Path::new(""), &names, &frames).timeline("/a b/c?/");
        let timeline: serde_json::Value = serde_json::from_str(&text).unwrap();
        let clip = &timeline["tracks"]["children"][0]["children"][0];
        let reference = &clip["media_references"]["DEFAULT_MEDIA"];
        assert_eq!(reference["target_url_base"], "/a%20b/c%3F/");
        assert_eq!(reference["name_prefix"], "sh%231%2050%2541%C3%A9.");
        assert_eq!(reference["name_suffix"], "_%25.exr");
        assert_eq!(timeline["name"], "sh#1 50%41é");
    }

    #[test]
    fn that_nuke_cannot_read_a_name_is_said_in_the_script() {
        let frames: BTreeSet<i64> = (1..=3).collect();
        let said = |stem: &str, base: &str| {
            let names = NamePattern::parse("<stem>.####.exr", stem).unwrap();
            of(Path::new(""), &names, &frames).nuke_script(base, 1, 3).contains("label \"Nuke takes #")
        };
        assert_eq!(
            (said("shot", "../"), said("sh#1", "../"), said("shot", "/shots/#1/")),
            (false, true, true)
        );
    }

    #[test]
    fn everything_is_written_beside_the_report_and_refers_to_the_frames() {
        let folder = tempfile::tempdir().unwrap();
        let frames: BTreeSet<i64> = (1..=3).collect();
        let names = NamePattern::parse("<stem>.####.exr", "shot").unwrap();
        let review = of(folder.path(), &names, &frames);
        review.write(&folder.path().join("report.json"), &Thumbnails::of(&frames, 1.0)).unwrap();
        let read =
            |name: &str| std::fs::read_to_string(folder.path().join("report.review").join(name)).unwrap();
        assert!(read("nuke.nk").contains("/../shot.%04d.exr"));
        assert!(read("blender.py").contains("\"../\"") && read("timeline.otio").contains("\"../\""));
        let elsewhere = folder.path().join("reports/r.json");
        std::fs::create_dir_all(elsewhere.parent().unwrap()).unwrap();
        review.write(&elsewhere, &Thumbnails::of(&frames, 1.0)).unwrap();
        let text = std::fs::read_to_string(folder.path().join("reports/r.review/timeline.otio")).unwrap();
        assert!(text.contains(folder.path().canonicalize().unwrap().to_str().unwrap()));
        let none = BTreeSet::new();
        let empty = Review { frames: &none, ..review };
        empty.write(&folder.path().join("none.json"), &Thumbnails::of(&none, 1.0)).unwrap();
        assert!(!folder.path().join("none.review").exists());
    }
}
