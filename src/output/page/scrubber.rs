//! The pictures of a report, frame after frame under a slider.

use super::escaped;
use crate::frame::StereoEye;
use crate::output::report::Report;
use crate::output::thumbnails::{MOST_BYTES, MOST_FRAMES, SIDE, Thumbnail};
use serde_json::json;

const SCRIPT: &str = include_str!("scrubber.js");

impl Report {
    /// The slider and the first frame's pictures; the script shows the others. Nothing without pictures.
    pub(super) fn scrubber(&self, thumbnails: &[Thumbnail]) -> String {
        let Some(first) = thumbnails.first() else { return String::new() };
        let text = |number: i64| {
            let frame = self.frames.iter().find(|f| f.frame == number);
            frame.map_or_else(|| format!("Frame {number}"), |f| self.describe(f))
        };
        let layers = [
            (
                "beauty",
                "Beauty, exposed so that the brightest percent of the sequence is nearly white",
                Some(&first.beauty),
            ),
            (
                "class",
                "Class of each pixel: blue is reused; red missed, green an edge, purple entering, yellow creeping, orange bad, pink moved, grey traced",
                first.class.as_ref(),
            ),
            ("depth", "Depth of each frame, near is light", first.depth.as_ref()),
        ];
        let figure = |(layer, caption, source): (&str, &str, Option<&String>)| {
            let Some(source) = source else { return String::new() };
            format!(
                "<figure{}><img data-layer=\"{layer}\" src=\"{source}\" alt=\"{layer} of frame {}\">\
                 <figcaption>{caption}</figcaption></figure>",
                if layer == "class" { " class=\"pixels\"" } else { "" },
                first.frame
            )
        };
        let figures: String = layers.into_iter().map(figure).collect();
        let data: Vec<_> = thumbnails
            .iter()
            .map(|t| json!({"frame": t.frame, "text": text(t.frame), "beauty": t.beauty, "class": t.class, "depth": t.depth}))
            .collect();
        // A name with `</script>` in it must not end the script.
        let data = json!(data).to_string().replace('<', "\\u003c");
        let [numerator, denominator] = self.settings.fps;
        let rate = f64::from(numerator.max(1)) / f64::from(denominator.max(1));
        let step = self.pictured_frames() as f64 / thumbnails.len() as f64;
        format!(
            "<h2>Frames</h2><p id=\"caption\" aria-live=\"polite\">{}</p><div class=\"pictures\">{figures}</div>\
             <div class=\"controls\"><label for=\"frame\">Frame</label>\
             <input type=\"range\" id=\"frame\" min=\"0\" max=\"{}\" value=\"0\">\
             <button type=\"button\" id=\"play\" data-rate=\"{:.3}\">Play</button></div>\
             <p>{} Arrow keys, Home and End go through them; a click on a chart shows that frame.</p>\
             <script type=\"application/json\" id=\"frames\">{data}</script><script>{SCRIPT}</script>\n",
            escaped(&text(first.frame)),
            thumbnails.len() - 1,
            (rate / step).max(0.1),
            self.coverage(thumbnails.len()),
        )
    }

    /// Frames of which there may be pictures: of a pair, the left eye's.
    fn pictured_frames(&self) -> usize {
        self.frames.iter().filter(|frame| frame.eye != Some(StereoEye::Right)).count()
    }

    /// Of how many frames there are pictures, and why not of more.
    fn coverage(&self, pictures: usize) -> String {
        let frames = self.pictured_frames();
        if pictures == frames {
            return format!("Pictures of all {frames} frames.");
        }
        format!(
            "Pictures of {pictures} of {frames} frames: at most {MOST_FRAMES}, {SIDE} pixels wide, in {} MiB; \
             frames whose files could not be read have none.",
            MOST_BYTES >> 20
        )
    }
}
