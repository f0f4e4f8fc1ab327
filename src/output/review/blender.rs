//! A Blender script: the sequence in the compositor, and over it the class of each pixel in colour.

use super::Review;
use crate::measure::picture::CLASS_COLORS;
use serde_json::json;

const SCRIPT: &str = include_str!("blender.py");

impl Review<'_> {
    /// The script, with the frames in folder `base`.
    pub(super) fn blender_script(&self, base: &str, first: i64, last: i64) -> String {
        let (prefix, suffix, digits) = self.names.parts();
        let sequence = json!({
            "folder": base,
            "name": [prefix, digits, suffix],
            "first": first,
            "last": last,
            "size": [self.width, self.height],
            "window": [self.window.x, self.window.y, self.window.width, self.window.height],
            // Blender takes none below 1.
            "pixel_aspect": [self.pixel_aspect.max(1.0), self.pixel_aspect.recip().max(1.0)],
            "fps": [self.fps.numerator, self.fps.denominator],
            "title": self.title(),
            "class_colors": CLASS_COLORS,
        });
        // JSON without true, false and null is Python too.
        SCRIPT.replace("SEQUENCE = {}", &format!("SEQUENCE = {sequence:#}"))
    }
}
