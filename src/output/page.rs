//! `report.html`: the report as one page that opens from disk, without network or scripts.

use super::Report;
use super::report::FrameReport;
use super::write::write_alone;
use crate::Result;
use crate::frame::{PixelClass, RayCounts};
use std::fmt::Write;
use std::path::Path;

/// Width of all charts, in units of their own.
const WIDTH: f64 = 1000.0;
/// Height of the charts of counts.
const HEIGHT: f64 = 160.0;

/// Colours of the classes: as in [`crate::measure::picture::CLASS_COLORS`], but that unchanged pixels are light or dark
/// with the page.
const COLORS: [&str; PixelClass::COUNT] = [
    "#969696",
    "var(--reused)",
    "#00828c",
    "#eb4034",
    "#ffaa00",
    "#e8cf30",
    "#be50dc",
    "#78dc64",
    "#ff78be",
    "#466ebe",
];

impl Report {
    /// Writes `report.html`, whole or not at all.
    ///
    /// # Errors
    /// [`crate::Error::Output`].
    pub fn write_html(&self, path: &Path) -> Result<()> {
        write_alone(path, self.html().as_bytes())
    }

    /// The page.
    pub fn html(&self) -> String {
        let mut page = String::new();
        let title = format!("{} – Buzz report", escaped(&self.input));
        // Writing to a string cannot fail.
        let _ = write!(
            page,
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width\"><title>{title}</title>\
             <style>{STYLE}</style></head><body><main>\n<h1>{}</h1>\n{}{}{}{}{}{}{}{}</main></body></html>\n",
            escaped(&self.input),
            self.summary(),
            self.warned(),
            self.timeline(),
            self.classes(),
            self.rays(),
            self.milliseconds(),
            self.key_frames(),
            self.table(),
        );
        page
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
            ("Time", format!("{:.2} s; {}", totals.seconds.wall, self.stages())),
            (
                "Settings",
                format!(
                    "quality {}, {}×{}, {fps} frames/s, {} threads, anti-aliasing {}",
                    escaped(&settings.quality),
                    settings.width,
                    settings.height,
                    settings.threads,
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
        if let Some(hidden) = totals.hidden {
            rows.push((
                "Hidden samples",
                format!("{} of {} reused ({})", grouped(hidden), grouped(reused), percent(hidden, reused)),
            ));
        }
        let rows: String =
            rows.iter().map(|(name, value)| format!("<dt>{name}</dt><dd>{value}</dd>")).collect();
        format!("<dl>{rows}</dl>\n")
    }

    /// Where the time went.
    fn stages(&self) -> String {
        let s = &self.totals.seconds;
        let all = [
            ("import", s.import),
            ("accel", s.accel),
            ("plan", s.plan),
            ("infer", s.infer),
            ("trace", s.trace),
            ("enhance", s.enhance),
            ("write (beside)", s.write),
        ];
        all.map(|(name, seconds)| format!("{name} {seconds:.2}")).join(" · ")
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

    /// One bar a frame: key frames tall, inferred ones low, skipped ones pale; a line at each cut.
    fn timeline(&self) -> String {
        let bar = |i: usize, frame: &FrameReport| {
            let (y, class) = if frame.from.is_none() { (0.0, "key") } else { (20.0, "inferred") };
            let skipped = if frame.skipped { " opacity=\".4\"" } else { "" };
            let cut =
                if self.plan.cuts.contains(&frame.frame) { " data-cut stroke=\"var(--text)\"" } else { "" };
            let text = self.describe(frame);
            self.bar(i, y, 40.0 - y, &format!("class=\"{class}\"{skipped}{cut}"), &text)
        };
        let bars: String = self.frames.iter().enumerate().map(|(i, frame)| bar(i, frame)).collect();
        self.chart(
            "Timeline",
            "Key frames are tall, inferred ones low, frames that were there already pale.",
            40.0,
            &bars,
        )
    }

    fn describe(&self, frame: &FrameReport) -> String {
        let made = match frame.from {
            Some(from) => format!("inferred from {from}"),
            None => match self.plan.keyframes.iter().find(|key| key.frame == frame.frame) {
                Some(key) => format!("key frame ({})", key.reason),
                None => "traced".into(),
            },
        };
        format!("Frame {}: {made}{}", frame.frame, if frame.skipped { ", was there already" } else { "" })
    }

    fn classes(&self) -> String {
        let mut bars = String::new();
        for (i, frame) in self.frames.iter().enumerate() {
            let total: u64 = PixelClass::ALL.iter().map(|&class| count(&frame.pixels, class)).sum();
            let mut y = HEIGHT;
            for class in STACK {
                let pixels = count(&frame.pixels, class);
                let height = HEIGHT * pixels as f64 / total.max(1) as f64;
                y -= height;
                if pixels > 0 {
                    let text = format!("Frame {}: {} {}", frame.frame, class.name(), percent(pixels, total));
                    bars += &self.bar(i, y, height, &format!("fill=\"{}\"", COLORS[class as usize]), &text);
                }
            }
        }
        let legend: String = STACK
            .iter()
            .filter(|&&class| count(&self.totals.pixels, class) > 0)
            .map(|&class| {
                format!(
                    "<span><i style=\"background:{}\"></i>{}</span>",
                    COLORS[class as usize],
                    class.name()
                )
            })
            .collect();
        self.chart("Pixels by class", &format!("<span class=\"legend\">{legend}</span>"), HEIGHT, &bars)
    }

    fn rays(&self) -> String {
        let values = self.frames.iter().map(|frame| (frame.rays.total() as f64, ray_text(&frame.rays)));
        self.graph("Rays", "rays", values.collect())
    }

    fn milliseconds(&self) -> String {
        let values = self.frames.iter().map(|frame| {
            let s = &frame.seconds;
            let text = format!(
                "infer {:.1}, trace {:.1}, enhance {:.1} ms",
                s.infer * 1e3,
                s.trace * 1e3,
                s.enhance * 1e3
            );
            ((s.infer + s.trace + s.enhance) * 1e3, text)
        });
        self.graph("Milliseconds", "ms (writing goes on beside it and is left out)", values.collect())
    }

    /// A bar a frame, scaled to the largest.
    fn graph(&self, title: &str, unit: &str, values: Vec<(f64, String)>) -> String {
        let largest = values.iter().map(|v| v.0).fold(0.0, f64::max);
        let mut bars = String::new();
        for (i, ((value, text), frame)) in values.iter().zip(&self.frames).enumerate() {
            let height = if largest > 0.0 { HEIGHT * value / largest } else { 0.0 };
            let class = if frame.from.is_none() { "class=\"key\"" } else { "class=\"inferred\"" };
            bars += &self.bar(i, HEIGHT - height, height, class, &format!("Frame {}: {text}", frame.frame));
        }
        let note = format!("The tallest bar is {} {unit}.", grouped(largest.round() as u64));
        self.chart(&format!("{title} a frame"), &note, HEIGHT, &bars)
    }

    fn bar(&self, index: usize, y: f64, height: f64, style: &str, text: &str) -> String {
        let step = WIDTH / self.frames.len().max(1) as f64;
        // Bars overlap a little, or their seams would show; with few frames there is a gap instead.
        let width = if step > 4.0 { step - 1.0 } else { step + 0.2 };
        let x = index as f64 * step;
        let text = escaped(text);
        format!(
            "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" {style}><title>{text}</title></rect>"
        )
    }

    fn chart(&self, title: &str, note: &str, height: f64, bars: &str) -> String {
        let range = match (self.frames.first(), self.frames.last()) {
            (Some(first), Some(last)) => {
                format!("<p class=\"range\"><span>{}</span><span>{}</span></p>", first.frame, last.frame)
            }
            _ => String::new(),
        };
        format!(
            "<h2>{title}</h2><p>{note}</p><svg viewBox=\"0 0 {WIDTH} {height}\" preserveAspectRatio=\"none\" \
             style=\"height:{height}px\" role=\"img\" aria-label=\"{title}\">{bars}</svg>{range}\n"
        )
    }

    fn key_frames(&self) -> String {
        let rows: String = self
            .plan
            .keyframes
            .iter()
            .map(|key| {
                let segment = self.plan.segments.iter().find(|s| s.key == key.frame);
                let frames = segment.map_or(String::new(), |s| format!("{}–{}", s.first, s.last));
                format!("<tr><td>{}</td><td>{}</td><td>{frames}</td></tr>", key.frame, escaped(&key.reason))
            })
            .collect();
        format!(
            "<details><summary>Key frames</summary><table><thead><tr><th>Frame</th><th>Reason</th>\
             <th>Serves frames</th></tr></thead><tbody>{rows}</tbody></table></details>\n"
        )
    }

    fn table(&self) -> String {
        let head: String = STACK.iter().map(|class| format!("<th>{}</th>", class.name())).collect();
        let mut rows = String::new();
        for frame in &self.frames {
            let cells: String = STACK
                .iter()
                .map(|&class| format!("<td>{}</td>", grouped(count(&frame.pixels, class))))
                .collect();
            let ms = (frame.seconds.infer + frame.seconds.trace + frame.seconds.enhance) * 1e3;
            let rays = grouped(frame.rays.total());
            let from = frame.from.map_or("key".into(), |from| from.to_string());
            let _ = write!(
                rows,
                "<tr><td>{}</td><td>{from}</td>{cells}<td>{rays}</td><td>{ms:.1}</td></tr>",
                frame.frame
            );
        }
        format!(
            "<details><summary>All frames</summary><div class=\"scroll\"><table><thead><tr><th>Frame</th><th>From</th>\
             {head}<th>Rays</th><th>ms</th></tr></thead><tbody>{rows}</tbody></table></div></details>\n"
        )
    }
}

/// From the bottom of the chart: what was reused, then what was traced and why.
const STACK: [PixelClass; PixelClass::COUNT] = [
    PixelClass::Good,
    PixelClass::Overlapped,
    PixelClass::Filled,
    PixelClass::Edge,
    PixelClass::Moved,
    PixelClass::Entering,
    PixelClass::Creeping,
    PixelClass::Bad,
    PixelClass::Missed,
    PixelClass::Traced,
];

fn count(pixels: &serde_json::Map<String, serde_json::Value>, class: PixelClass) -> u64 {
    pixels.get(class.name()).and_then(serde_json::Value::as_u64).unwrap_or(0)
}

fn ray_text(rays: &RayCounts) -> String {
    let RayCounts { primary, shadow, ambient, reflection, refraction, visibility } = *rays;
    let kinds = [
        ("primary", primary),
        ("shadow", shadow),
        ("ambient", ambient),
        ("reflection", reflection),
        ("refraction", refraction),
        ("visibility", visibility),
    ];
    let cast = kinds.iter().filter(|(_, count)| *count > 0);
    let cast: Vec<String> = cast.map(|(name, count)| format!("{} {name}", grouped(*count))).collect();
    if cast.is_empty() { "none".into() } else { cast.join(", ") }
}

fn percent(part: u64, whole: u64) -> String {
    format!("{:.2} %", 100.0 * part as f64 / whole.max(1) as f64)
}

/// 1234567 as `1,234,567`.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Names come from files: they must not become markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

const STYLE: &str = "\
:root{color-scheme:light dark;--text:#1c2330;--muted:#5a6473;--page:#fff;--line:#d5dae2;--key:#b3541e;--inferred:#3a6ea5;--reused:#c9d6e6}\
@media(prefers-color-scheme:dark){:root{--text:#e3e8f0;--muted:#9aa5b5;--page:#14181f;--line:#333c4a;--key:#e08a4f;--inferred:#6ba3dc;--reused:#24405f}}\
body{margin:0;background:var(--page);color:var(--text);font:15px/1.5 system-ui,sans-serif}\
main{max-width:1040px;margin:0 auto;padding:24px 20px 60px}\
h1{font-size:22px;overflow-wrap:anywhere}h2{font-size:16px;margin:28px 0 2px}p{margin:0 0 6px;color:var(--muted)}\
dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 18px}dt{color:var(--muted)}dd{margin:0}\
svg{width:100%;display:block;border-bottom:1px solid var(--line)}\
.key{fill:var(--key)}.inferred{fill:var(--inferred)}\
.range{display:flex;justify-content:space-between;font-size:13px}\
.legend span{margin-right:14px;white-space:nowrap}.legend i{display:inline-block;width:11px;height:11px;margin-right:5px}\
.warnings{color:var(--key);padding-left:20px}\
details{margin-top:24px}summary{cursor:pointer}.scroll{overflow-x:auto}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums}\
th,td{padding:2px 10px;text-align:right;border-bottom:1px solid var(--line)}\
@media print{details>*{display:block}}";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{FrameKind, FrameStats};
    use crate::output::{FrameRecord, KeyFrame, ReportInput};

    #[test]
    fn the_page_stands_alone_and_escapes_names() {
        let record = |number, kind| {
            let mut stats = FrameStats::default();
            stats.pixels[1] = 750;
            stats.pixels[3] = 250;
            FrameRecord { number, kind, stats, skipped: number == 2 }
        };
        let mut input = ReportInput { input: "<a & \"b\">.gltf".into(), ..ReportInput::default() };
        input.frames = vec![record(1, FrameKind::Traced), record(2, FrameKind::Inferred { from: 1 })];
        input.plan.keyframes = vec![KeyFrame { frame: 1, reason: "first".into() }];
        input.warnings = vec!["clearcoat <ignored>".into()];
        let page = Report::new(input).html();
        assert!(page.contains("&lt;a &amp; &quot;b&quot;&gt;.gltf"));
        assert!(page.contains("clearcoat &lt;ignored&gt;"));
        assert!(page.contains("Frame 1: key frame (first)") && page.contains("Frame 2: inferred from 1"));
        assert!(page.contains("missed 25.00 %"));
        for absent in ["http", "<script", "NaN", "inf\""] {
            assert!(!page.contains(absent), "{absent}");
        }
        let open = |tag: &str| page.matches(&format!("<{tag}")).count();
        let closed = |tag: &str| page.matches(&format!("</{tag}>")).count();
        for tag in ["rect", "svg", "table", "details", "main", "dl", "ul"] {
            assert_eq!(open(tag), closed(tag), "{tag}");
        }
    }

    #[test]
    fn an_empty_report_has_a_page_too() {
        assert!(!Report::new(ReportInput::default()).html().contains("NaN"));
        assert_eq!(["0", "999", "1,000", "12,345,678"], [0, 999, 1000, 12_345_678].map(grouped));
    }
}
