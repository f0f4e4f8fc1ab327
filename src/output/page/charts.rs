//! A report's charts: one bar a frame, so that they stand below each other.

use super::{escaped, grouped, percent};
use crate::frame::{PixelClass, RayCounts, StereoEye};
use crate::output::report::{FrameReport, KeyFrame, Report};
use serde_json::{Map, Value};
use std::collections::HashSet;

/// Width of all charts, in units of their own.
const WIDTH: f64 = 1000.0;
/// Height of the charts of counts.
const HEIGHT: f64 = 160.0;

/// From the bottom of the chart: what was reused, then what was traced and why.
pub(super) const STACK: [PixelClass; PixelClass::COUNT] = [
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

/// Colours of the classes: as in [`crate::measure::picture::CLASS_COLORS`], but that creeping is darker and reused pixels are
/// lighter on a dark page, where they would not be seen.
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
    /// All charts.
    pub(super) fn charts(&self) -> String {
        [self.timeline(), self.classes(), self.rays(), self.milliseconds()].concat()
    }

    /// One bar a frame: key frames tall, inferred ones low, skipped ones pale; a line at each cut.
    fn timeline(&self) -> String {
        let bar = |i: usize, frame: &FrameReport| {
            let (y, class) = if frame.from.is_none() { (0.0, "key") } else { (20.0, "inferred") };
            let skipped = if frame.skipped { " opacity=\".4\"" } else { "" };
            let cut =
                if self.plan.cuts.contains(&frame.frame) { " data-cut stroke=\"var(--text)\"" } else { "" };
            self.bar(i, y, 40.0 - y, &format!("class=\"{class}\"{skipped}{cut}"), &self.describe(frame))
        };
        let bars: String = self.frames.iter().enumerate().map(|(i, frame)| bar(i, frame)).collect();
        let note = format!(
            "Key frames are tall, inferred ones low, frames that were there already pale, the first after a cut framed. {}",
            self.reasons()
        );
        self.chart("Timeline", &note, 40.0, &bars)
    }

    /// Why there are key frames among the frames of the run: how many for each reason.
    fn reasons(&self) -> String {
        let explained = [
            ("first", "for the first segment"),
            ("cut", "after a cut"),
            ("cost", "where inferring would have cost more than tracing"),
            ("length", "where samples had been carried on far enough"),
            ("only", "the only frame"),
        ];
        let traced: HashSet<i64> = self.frames.iter().filter(|f| f.from.is_none()).map(|f| f.frame).collect();
        let here = |k: &&KeyFrame| traced.contains(&k.frame);
        let count = |name: &str| self.plan.keyframes.iter().filter(here).filter(|k| k.reason == name).count();
        let found = explained.iter().filter(|(name, _)| count(name) > 0);
        let reasons: Vec<String> =
            found.map(|(name, why)| format!("{} {why} ({name})", count(name))).collect();
        if reasons.is_empty() { String::new() } else { format!("Key frames: {}.", reasons.join(", ")) }
    }

    /// What a frame is, in words.
    pub(super) fn describe(&self, frame: &FrameReport) -> String {
        let made = match frame.from {
            Some(_) if frame.eye == Some(StereoEye::Right) => "inferred from left".into(),
            Some(from) => format!("inferred from {from}"),
            None => match self.plan.keyframes.binary_search_by_key(&frame.frame, |key| key.frame) {
                Ok(at) => format!("key frame ({})", self.plan.keyframes[at].reason),
                Err(_) => "traced".into(),
            },
        };
        let share = match (frame.from, frame.predicted_traced) {
            (Some(_), Some(predicted)) => {
                format!(
                    ", {:.0} % of pixels traced, {:.0} % predicted",
                    100.0 * frame.traced,
                    100.0 * predicted
                )
            }
            _ => String::new(),
        };
        format!(
            "Frame {}: {made}{share}{}",
            frame.id(),
            if frame.skipped { ", was there already" } else { "" }
        )
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
                    let text = format!("Frame {}: {} {}", frame.id(), class.name(), percent(pixels, total));
                    bars += &self.bar(i, y, height, &format!("fill=\"{}\"", COLORS[class as usize]), &text);
                }
            }
        }
        let seen = STACK.iter().filter(|&&class| count(&self.totals.pixels, class) > 0);
        let entry = |&class: &PixelClass| {
            let color = COLORS[class as usize];
            format!("<span><i style=\"background:{color}\"></i>{}</span>", class.name())
        };
        let legend: String = seen.map(entry).collect();
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
        let frame = self.frames.get(index).map_or(0, |f| f.frame);
        format!(
            "<rect data-frame=\"{frame}\" x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" {style}>\
             <title>{text}</title></rect>"
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
}

/// Pixels of a class.
pub(super) fn count(pixels: &Map<String, Value>, class: PixelClass) -> u64 {
    pixels.get(class.name()).and_then(Value::as_u64).unwrap_or(0)
}

/// Rays by kind, in words.
pub(super) fn ray_text(rays: &RayCounts) -> String {
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
