//! The measurements as a table for people and as rows for spreadsheets.

use super::{Measured, Spread, Trade};
use crate::frame::RayCounts;
use std::fmt;

/// Titles of [`row`].
pub(crate) const TITLES: [&str; 12] = [
    "quality",
    "frames",
    "traced",
    "ms a frame",
    "inferred, ms",
    "10-90 %",
    "times as fast",
    "rays a pixel",
    "PSNR dB",
    "worst dB",
    "FLIP",
    "over 5 %",
];

/// A quality's row of the table; `full` is the mean seconds of a frame of the truth.
pub(crate) fn row(measured: &Measured, full: f64) -> Vec<String> {
    let s = &measured.summary;
    let spread = s.inferred_seconds;
    let decibels = |db: Option<f64>| db.map_or("-".into(), |db| format!("{db:.2}"));
    let share = |share: f64| format!("{:.2} %", 100.0 * share);
    vec![
        measured.quality.into(),
        s.frames.to_string(),
        s.traced_frames.to_string(),
        milliseconds(s.seconds.mean),
        spread.map_or("-".into(), |s| milliseconds(s.median)),
        spread.map_or("-".into(), |Spread { p10, p90, .. }| {
            format!("{}-{}", milliseconds(p10), milliseconds(p90))
        }),
        format!("{:.2}", full / s.seconds.mean.max(f64::MIN_POSITIVE)),
        format!("{:.2}", s.rays_per_pixel),
        decibels(s.error.psnr_db),
        decibels(s.worst_db),
        format!("{:.4}", s.error.flip_mean),
        share(s.error.over_5_percent),
    ]
}

fn milliseconds(seconds: f64) -> String {
    let ms = seconds * 1e3;
    if ms < 10.0 { format!("{ms:.2}") } else { format!("{ms:.0}") }
}

/// What stands under the table.
pub(crate) fn notes(trade: &Trade) -> Vec<String> {
    let mut notes: Vec<String> = trade.qualities.iter().map(rays).collect();
    let spans: Vec<String> = trade.spans.iter().map(|[first, last]| format!("{first}-{last}")).collect();
    let noise = trade.qualities.iter().map(|m| m.summary.noise).fold(0.0, f64::max);
    notes.push(format!(
        "segments measured: {}; {}x{}, {} threads",
        spans.join(", "),
        trade.width,
        trade.height,
        trade.threads
    ));
    notes.push(format!(
        "the faster of {} rounds counts; the slower took {:.1} % longer (median). Writing is left out, the audit is not timed",
        trade.rounds,
        100.0 * noise
    ));
    notes
}

/// A quality's rays by kind, and what of its samples should not be seen.
fn rays(measured: &Measured) -> String {
    let s = &measured.summary;
    let RayCounts { primary, shadow, ambient, reflection, refraction, visibility } = s.rays;
    let share = s.rays_per_pixel / s.rays.total().max(1) as f64;
    let kinds = [
        (primary, "primary"),
        (visibility, "visibility"),
        (shadow, "shadow"),
        (ambient, "ambient"),
        (reflection, "reflection"),
        (refraction, "refraction"),
    ];
    let cast = kinds.into_iter().filter(|(count, _)| *count > 0);
    let cast: Vec<String> = cast.map(|(count, kind)| format!("{:.3} {kind}", count as f64 * share)).collect();
    let hidden =
        s.hidden.map(|h| format!("; {:.3} % of reused samples are hidden", 100.0 * h)).unwrap_or_default();
    format!("{}: rays a pixel: {}{hidden}", measured.quality, cast.join(", "))
}

impl Trade {
    /// Mean seconds of a frame of the truth.
    pub(crate) fn full_seconds(&self) -> f64 {
        self.qualities.first().map_or(0.0, |full| full.summary.seconds.mean)
    }

    /// One row a frame and quality, titles first.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "quality,frame,from,distance,seconds,infer,trace,enhance,primary,shadow,ambient,reflection,refraction,\
             visibility,reused,hidden,psnr_db,flip_mean,max_abs,over_5_percent\n",
        );
        let optional = |value: Option<String>| value.unwrap_or_default();
        for measured in &self.qualities {
            for frame in &measured.frames {
                let (s, r, e) = (&frame.seconds, &frame.rays, frame.error);
                let cells = [
                    measured.quality.to_string(),
                    frame.frame.to_string(),
                    optional(frame.from.map(|n| n.to_string())),
                    frame.distance.to_string(),
                    format!("{:.6}", frame.total_seconds()),
                    format!("{:.6},{:.6},{:.6}", s.infer, s.trace, s.enhance),
                    format!(
                        "{},{},{},{},{},{}",
                        r.primary, r.shadow, r.ambient, r.reflection, r.refraction, r.visibility
                    ),
                    frame.reused.to_string(),
                    optional(frame.hidden.map(|n| n.to_string())),
                    optional(e.and_then(|e| e.psnr_db).map(|db| format!("{db:.4}"))),
                    e.map_or(",,".into(), |e| {
                        format!("{:.6},{:.6},{:.6}", e.flip_mean, e.max_abs, e.over_5_percent)
                    }),
                ];
                text += &cells.join(",");
                text.push('\n');
            }
        }
        text
    }
}

/// The table that is printed.
impl fmt::Display for Trade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rows = vec![TITLES.map(String::from).to_vec()];
        rows.extend(self.qualities.iter().map(|m| row(m, self.full_seconds())));
        let widths: Vec<usize> = (0..TITLES.len())
            .map(|i| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0))
            .collect();
        for row in rows {
            let (name, cells) = (format!("{:<1$}", row[0], widths[0]), row[1..].iter().zip(&widths[1..]));
            let cells: String = cells.map(|(cell, width)| format!("  {cell:>width$}")).collect();
            writeln!(f, "{name}{cells}")?;
        }
        notes(self).iter().try_for_each(|note| writeln!(f, "{note}"))
    }
}
