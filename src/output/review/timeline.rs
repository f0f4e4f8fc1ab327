//! An OpenTimelineIO file: one track, a clip for each shot, a marker at each key frame.

use super::Review;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::{Value, json};

/// All but letters, digits, what needs no encoding anywhere, and what divides a path.
const NOT_IN_URLS: AsciiSet =
    NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~').remove(b'/');

impl Review<'_> {
    /// The timeline, with the frames in folder `base`.
    pub(super) fn timeline(&self, base: &str) -> String {
        let rate = self.fps.value();
        let mut children = Vec::new();
        let mut end = None;
        for run in self.runs() {
            if let Some(end) = end.filter(|&end| end < run[0]) {
                children.push(json!({
                    "OTIO_SCHEMA": "Gap.1", "name": "", "metadata": {}, "enabled": true, "effects": [], "markers": [],
                    "source_range": range(0, run[0] - end, rate),
                }));
            }
            end = Some(run[1] + 1);
            children.push(self.clip(base, run, rate));
        }
        let first = self.frames.first().copied().unwrap_or(0);
        let timeline = json!({
            "OTIO_SCHEMA": "Timeline.1", "name": self.title(), "metadata": {}, "global_start_time": time(first, rate),
            "tracks": {
                "OTIO_SCHEMA": "Stack.1", "name": "tracks", "metadata": {}, "enabled": true, "effects": [], "markers": [],
                "source_range": null,
                "children": [{
                    "OTIO_SCHEMA": "Track.1", "name": "Video", "kind": "Video", "metadata": {}, "enabled": true,
                    "effects": [], "markers": [], "source_range": null, "children": children,
                }],
            },
        });
        format!("{timeline:#}\n")
    }

    /// First and last frames of what is shown without a hole or a cut, and without numbers of both signs where these are
    /// filled up with zeros: a clip has one padding, and theirs differ.
    fn runs(&self) -> Vec<[i64; 2]> {
        let is_padded = self.names.parts().2 > 1;
        let begins = |frame: i64| self.cuts.contains(&frame) || (frame == 0 && is_padded);
        let mut runs: Vec<[i64; 2]> = Vec::new();
        for &frame in self.frames {
            match runs.last_mut() {
                Some([_, last]) if *last + 1 == frame && !begins(frame) => *last = frame,
                _ => runs.push([frame, frame]),
            }
        }
        runs
    }

    fn clip(&self, base: &str, [first, last]: [i64; 2], rate: f64) -> Value {
        let (prefix, suffix, width) = self.names.parts();
        // A minus sign is one of our characters, but none of OpenTimelineIO's digits.
        let padding = if first < 0 { width.saturating_sub(1) } else { width };
        let inside = self.keyframes.iter().filter(|k| (first..=last).contains(&k.frame));
        let markers: Vec<Value> = inside
            .map(|key| {
                json!({
                    "OTIO_SCHEMA": "Marker.2", "name": format!("key frame ({})", key.reason), "metadata": {}, "comment": "",
                    "color": "RED", "marked_range": range(key.frame, 1, rate),
                })
            })
            .collect();
        let shown = range(first, last - first + 1, rate);
        // Joined, the three are a URL.
        let [base, prefix, suffix] =
            [base, prefix, suffix].map(|part| utf8_percent_encode(part, &NOT_IN_URLS).to_string());
        json!({
            "OTIO_SCHEMA": "Clip.2", "name": format!("{} {first}-{last}", self.title()), "metadata": {}, "enabled": true,
            "effects": [], "markers": markers, "source_range": shown, "active_media_reference_key": "DEFAULT_MEDIA",
            "media_references": {"DEFAULT_MEDIA": {
                "OTIO_SCHEMA": "ImageSequenceReference.1", "name": "", "metadata": {}, "available_range": shown,
                "available_image_bounds": null, "target_url_base": base, "name_prefix": prefix, "name_suffix": suffix,
                "start_frame": first, "frame_step": 1, "rate": rate, "frame_zero_padding": padding,
                "missing_frame_policy": "hold",
            }},
        })
    }
}

fn time(frames: i64, rate: f64) -> Value {
    json!({"OTIO_SCHEMA": "RationalTime.1", "value": frames as f64, "rate": rate})
}

fn range(first: i64, frames: i64, rate: f64) -> Value {
    json!({"OTIO_SCHEMA": "TimeRange.1", "start_time": time(first, rate), "duration": time(frames, rate)})
}
