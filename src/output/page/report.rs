//! `report.html`: the report as a page.

use super::charts::{STACK, count, ray_text};
use super::{document, escaped, file_name, grouped, percent, table};
use crate::Result;
use crate::frame::PixelClass;
use crate::output::report::Report;
use crate::output::thumbnails::Thumbnail;
use crate::output::write::write_alone;
use std::path::Path;

impl Report {
    /// Writes `report.html`, whole or not at all.
    ///
    /// # Errors
    /// [`crate::Error::Output`].
    pub fn write_html(&self, path: &Path, thumbnails: &[Thumbnail]) -> Result<()> {
        write_alone(path, self.html(thumbnails).as_bytes())
    }

    /// The page.
    pub fn html(&self, thumbnails: &[Thumbnail]) -> String {
        let body = [
            self.summary(),
            self.warned(),
            self.scrubber(thumbnails),
            self.charts(),
            self.key_frames(),
            self.all_frames(),
        ];
        let name = file_name(&self.input);
        document(&format!("{name} – Buzz report"), &format!("Buzz report: {name}"), &body.concat())
    }

    fn summary(&self) -> String {
        let Self { settings, scene, totals, .. } = self;
        let pixels: u64 = PixelClass::ALL.iter().map(|&class| count(&totals.pixels, class)).sum();
        let reused: u64 =
            PixelClass::ALL.iter().filter(|c| c.is_reused()).map(|&class| count(&totals.pixels, class)).sum();
        let [numerator, denominator] = settings.fps;
        let fps = f64::from(numerator) / f64::from(denominator.max(1));
        let fps = if denominator == 1 { numerator.to_string() } else { format!("{fps:.3}") };
        let mut rows = vec![
            ("Input", escaped(&self.input)),
            (
                "Frames",
                format!(
                    "{}: {} key, {} inferred",
                    totals.frames, totals.traced_frames, totals.inferred_frames
                ),
            ),
            (
                "Pixels reused",
                format!("{} of {} ({})", grouped(reused), grouped(pixels), percent(reused, pixels)),
            ),
            ("Rays", ray_text(&totals.rays)),
            ("Time", format!("{:.2} s{}; {}", totals.seconds.wall, self.of_runs(), self.stages())),
            (
                "Settings",
                format!(
                    "quality {}, {}×{}, {fps} frames/s, {}, anti-aliasing {}",
                    escaped(&settings.quality),
                    settings.width,
                    settings.height,
                    if settings.threads == 1 {
                        "1 thread".into()
                    } else {
                        format!("{} threads", settings.threads)
                    },
                    settings.aa
                ),
            ),
            (
                "Scene",
                format!(
                    "{} triangles, {} shapes, {} instances, {} lights; needs {}",
                    grouped(scene.triangles as u64),
                    scene.shapes,
                    scene.instances,
                    scene.lights,
                    if scene.requires.is_empty() {
                        "nothing special".into()
                    } else {
                        escaped(&scene.requires.join(", "))
                    }
                ),
            ),
            (
                "Memory",
                format!(
                    "{:.1} MiB at most, {} bytes a pixel kept",
                    totals.peak_bytes as f64 / 1048576.0,
                    scene.bytes_per_pixel
                ),
            ),
        ];
        let subpixels = totals.subpixels;
        if !subpixels.is_empty() {
            rows.push((
                "Sub-pixels",
                format!(
                    "{} beside the centres, {} of them reused ({}); {} landed for nothing",
                    grouped(subpixels.sampled),
                    grouped(subpixels.reused),
                    percent(subpixels.reused, subpixels.sampled),
                    grouped(subpixels.wasted)
                ),
            ));
        }
        if let Some(hidden) = totals.hidden {
            rows.push(("Hidden samples", {
                let reused = reused + subpixels.reused;
                format!("{} of {} reused ({})", grouped(hidden), grouped(reused), percent(hidden, reused))
            }));
        }
        let rows: String =
            rows.iter().map(|(name, value)| format!("<dt>{name}</dt><dd>{value}</dd>")).collect();
        format!("<dl>{rows}</dl>\n")
    }

    /// Whose time it is, where several runs made the frames.
    fn of_runs(&self) -> String {
        match self.runs.len() {
            0 | 1 => String::new(),
            runs => format!(", {runs} runs added up"),
        }
    }

    /// Where the time went.
    fn stages(&self) -> String {
        let s = &self.totals.seconds;
        let all = [
            ("reading", s.import),
            ("trees", s.accel),
            ("plan", s.plan),
            ("frames on the way", s.on_the_way),
            ("infer", s.infer),
            ("trace", s.trace),
            ("enhance", s.enhance),
            ("write (beside)", s.write),
        ];
        let shown = all.iter().filter(|(name, seconds)| *seconds > 0.0 || *name != "frames on the way");
        shown.map(|(name, seconds)| format!("{name} {seconds:.2}")).collect::<Vec<_>>().join(" · ")
    }

    fn warned(&self) -> String {
        let ignored =
            self.scene.ignored.iter().map(|i| format!("{} at {}: {}", i.feature, i.place, i.effect));
        let items: String = self
            .warnings
            .iter()
            .cloned()
            .chain(ignored)
            .map(|warning| format!("<li>{}</li>", escaped(&warning)))
            .collect();
        if items.is_empty() {
            items
        } else {
            format!("<h2>Warnings</h2><ul class=\"warnings\">{items}</ul>\n")
        }
    }

    fn key_frames(&self) -> String {
        let rows: Vec<Vec<String>> = self
            .plan
            .keyframes
            .iter()
            .map(|key| {
                let segment = self.plan.segments.iter().find(|s| s.key == key.frame);
                let frames = segment.map_or(String::new(), |s| format!("{}–{}", s.first, s.last));
                vec![key.frame.to_string(), escaped(&key.reason), frames]
            })
            .collect();
        let titles = ["Frame", "Reason", "Serves frames"].map(String::from);
        format!("<details><summary>Key frames</summary>{}</details>\n", table(&titles, &rows))
    }

    fn all_frames(&self) -> String {
        let mut titles = vec!["Frame".to_string(), "From".into()];
        titles.extend(STACK.iter().map(|class| class.name().to_string()));
        titles.extend(["Rays".into(), "ms".into()]);
        let rows: Vec<Vec<String>> = self
            .frames
            .iter()
            .map(|frame| {
                let ms = (frame.seconds.infer + frame.seconds.trace + frame.seconds.enhance) * 1e3;
                let mut row =
                    vec![frame.id().to_string(), frame.from.map_or("key".into(), |from| from.to_string())];
                row.extend(STACK.iter().map(|&class| grouped(count(&frame.pixels, class))));
                // Of the run that made a frame which was there already there may be no report.
                let ms = if frame.skipped && ms == 0.0 { "–".into() } else { format!("{ms:.1}") };
                row.extend([grouped(frame.rays.total()), ms]);
                row
            })
            .collect();
        format!("<details><summary>All frames</summary>{}</details>\n", table(&titles, &rows))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{FrameId, FrameKind, FrameStats, StereoEye};
    use crate::output::{FrameRecord, KeyFrame, ReportInput};

    #[test]
    fn the_page_stands_alone_and_escapes_names() {
        let record = |number: i64, kind| {
            let mut stats = FrameStats::default();
            stats.pixels[1] = 750;
            stats.pixels[3] = 250;
            FrameRecord { id: number.into(), kind, stats, skipped: number == 2 }
        };
        let mut input = ReportInput { input: "<a & \"b\">.gltf".into(), ..ReportInput::default() };
        input.frames = vec![record(1, FrameKind::Traced), record(2, FrameKind::Inferred { from: 1 })];
        input.plan.keyframes = vec![KeyFrame { frame: 1, reason: "first".into() }];
        input.warnings = vec!["clearcoat <ignored>".into()];
        let picture =
            Thumbnail { frame: 2, beauty: "data:image/png;base64,AAAA".into(), class: None, depth: None };
        let page = Report::new(input).html(&[picture]);
        assert!(page.contains("&lt;a &amp; &quot;b&quot;&gt;.gltf"));
        assert!(page.contains("clearcoat &lt;ignored&gt;"));
        assert!(page.contains("Frame 1: key frame (first)") && page.contains("Frame 2: inferred from 1"));
        assert!(page.contains("Key frames: 1 for the first segment (first)."));
        assert!(page.contains("missed 25.00 %"));
        for absent in ["http:", "https:", "src=\"/", "NaN", "inf\""] {
            assert!(!page.contains(absent), "{absent}");
        }
        let open = |tag: &str| page.matches(&format!("<{tag}")).count();
        let closed = |tag: &str| page.matches(&format!("</{tag}>")).count();
        for tag in ["rect", "svg", "table", "details", "main", "dl", "ul", "script", "figure"] {
            assert_eq!(open(tag), closed(tag), "{tag}");
        }
    }

    #[test]
    fn a_pair_is_one_frame_under_the_slider() {
        let mut input = ReportInput::default();
        input.settings.fps = [24, 1];
        for number in 1..=2 {
            for eye in [StereoEye::Left, StereoEye::Right] {
                let id = FrameId { number, eye: Some(eye) };
                let stats = FrameStats::default();
                input.frames.push(FrameRecord { id, kind: FrameKind::Traced, stats, skipped: false });
            }
        }
        let picture = |frame| Thumbnail { frame, beauty: String::new(), class: None, depth: None };
        let page = Report::new(input).html(&[picture(1), picture(2)]);
        assert!(page.contains("data-rate=\"24.000\"") && page.contains("Pictures of all 2 frames."));
    }

    #[test]
    fn an_empty_report_has_a_page_too() {
        let page = Report::new(ReportInput::default()).html(&[]);
        assert!(!page.contains("NaN") && !page.contains("<script"));
    }
}
