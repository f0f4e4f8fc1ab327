//! `trade.html`: what each quality costs and gets wrong, as a page.

use super::plot::{Plot, Series};
use super::{document, escaped, file_name, table};
use crate::measure::picture::png;
use crate::measure::trade::{ChainStep, Measured, TITLES, Trade, WorstPlace, notes, row};
use base64::Engine;
use image::RgbImage;

impl Trade {
    /// The page.
    pub fn html(&self) -> String {
        let rows: Vec<Vec<String>> = self.qualities.iter().map(|m| row(m, self.full_seconds())).collect();
        let said: String = notes(self).iter().map(|note| format!("<p>{}</p>", escaped(note))).collect();
        let body = format!(
            "<h2>In numbers</h2>{}\n{said}{}{}{}",
            table(&TITLES.map(String::from), &rows),
            self.pareto(),
            self.chains(),
            self.worst()
        );
        document(
            &format!("{} – what each quality costs", file_name(&self.input)),
            &format!("What each quality costs: {}", file_name(&self.input)),
            &body,
        )
    }

    /// The qualities that have an error.
    fn inferred(&self) -> impl Iterator<Item = &Measured> {
        self.qualities.iter().filter(|m| m.summary.error.psnr_db.is_some())
    }

    fn pareto(&self) -> String {
        let point =
            |m: &Measured| (m.summary.seconds.mean * 1e3, m.summary.error.psnr_db.unwrap_or_default());
        let series = self.inferred().map(|m| Series { name: m.quality.into(), points: vec![point(m)] });
        let exact = self.qualities.iter().filter(|m| m.summary.error.psnr_db.is_none());
        let plot = Plot {
            title: "Error against time",
            x: "ms a frame, key frames included",
            y: "PSNR, dB",
            series: series.collect(),
            lines: false,
            marked: exact
                .map(|m| (m.summary.seconds.mean * 1e3, format!("{}: no error", m.quality)))
                .collect(),
        };
        format!("<h2>Error against time</h2><p>Up and to the left is better.</p>{}", plot.svg())
    }

    fn chains(&self) -> String {
        let point = |s: &ChainStep| Some((s.distance as f64, s.error.psnr_db?));
        let series = self
            .inferred()
            .map(|m| Series { name: m.quality.into(), points: m.chain.iter().filter_map(point).collect() });
        let plot = Plot {
            title: "Error along the chain",
            x: "frames from the key frame",
            y: "PSNR, dB",
            series: series.collect(),
            lines: true,
            marked: Vec::new(),
        };
        format!(
            "<h2>Error along the chain</h2><p>The mean over all frames that are as far from their key frame.</p>{}",
            plot.svg()
        )
    }

    fn worst(&self) -> String {
        let mut text = String::new();
        for measured in self.inferred() {
            let places: String = measured.worst.iter().map(|w| place(measured.quality, w)).collect();
            text += &format!("<h2>Worst places: {}</h2>{places}", measured.quality);
        }
        text
    }
}

/// What is right, what is shown, and the difference.
fn place(quality: &str, worst: &WorstPlace) -> String {
    let WorstPlace { frame, place, .. } = worst;
    let said = format!("frame {frame} at {},{}", place.x, place.y);
    let figures: String = [("truth", &worst.truth), (quality, &worst.shown), ("difference, times 4", &worst.difference)]
        .into_iter()
        .filter_map(|(name, picture)| {
            let source = data_uri(picture)?;
            Some(format!(
                "<figure class=\"pixels\"><img src=\"{source}\" alt=\"{name}, {said}\"><figcaption>{name}</figcaption></figure>"
            ))
        })
        .collect();
    format!(
        "<p>Frame {frame}, {}x{} pixels at {},{}: FLIP {:.3}</p><div class=\"pictures\">{figures}</div>",
        place.side, place.side, place.x, place.y, place.flip
    )
}

fn data_uri(picture: &RgbImage) -> Option<String> {
    let bytes = png(picture).ok()?;
    Some(format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes)))
}
