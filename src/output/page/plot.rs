//! Plots of points and lines, as SVG.

use super::escaped;
use std::ops::RangeInclusive;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 360.0;
/// Room for the numbers and titles of the axes, and for names at the right.
const LEFT: f64 = 64.0;
const RIGHT: f64 = 110.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 48.0;

/// Colours of series; with the shapes of their marks and their dashes they can be told apart without them too.
const COLORS: [&str; 4] = ["var(--a)", "var(--b)", "var(--c)", "var(--d)"];
const DASHES: [&str; 4] = ["", "6 3", "2 3", "8 3 2 3"];

/// Points in order, under a name.
pub(super) struct Series {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

/// A plot of series over two axes.
pub(super) struct Plot<'a> {
    /// What it shows, for those who cannot see it.
    pub title: &'a str,
    /// Title of the horizontal axis.
    pub x: &'a str,
    /// Title of the vertical axis.
    pub y: &'a str,
    pub series: Vec<Series>,
    /// Whether points of a series are joined by a line.
    pub lines: bool,
    /// Places on the horizontal axis with a name; with any, the axis begins at 0.
    pub marked: Vec<(f64, String)>,
}

impl Plot<'_> {
    /// The plot; nothing without points.
    pub fn svg(&self) -> String {
        let all = || self.series.iter().flat_map(|s| &s.points);
        let marked = self.marked.iter().flat_map(|(place, _)| [0.0, *place]);
        let (x, y) = (Axis::over(all().map(|p| p.0).chain(marked)), Axis::over(all().map(|p| p.1)));
        let (Some(x), Some(y), Some(_)) = (x, y, all().next()) else { return String::new() };
        let at = |&(px, py): &(f64, f64)| {
            let right = LEFT + x.share(px) * (WIDTH - LEFT - RIGHT);
            (right, HEIGHT - BOTTOM - y.share(py) * (HEIGHT - TOP - BOTTOM))
        };
        let mut marks = String::new();
        let mut names = Vec::new();
        for (i, series) in self.series.iter().enumerate() {
            let (color, dash) = (COLORS[i % COLORS.len()], DASHES[i % DASHES.len()]);
            let points: Vec<(f64, f64)> = series.points.iter().map(at).collect();
            if self.lines {
                let path: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
                marks += &format!(
                    "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\"/>",
                    path.join(" ")
                );
            }
            for ((px, py), (vx, vy)) in points.iter().zip(&series.points) {
                let text = format!("{}: {vx:.4} {}, {vy:.2} {}", series.name, self.x, self.y);
                marks += &mark(i, *px, *py, color, &escaped(&text));
            }
            if let Some((px, py)) = points.last() {
                names.push(((px + 10.0, py + 4.0), color, &series.name));
            }
        }
        set_apart(names.iter_mut().map(|name| &mut name.0).collect());
        for ((px, py), color, name) in names {
            let name = escaped(name);
            marks += &format!("<text x=\"{px:.1}\" y=\"{py:.1}\" style=\"fill:{color}\">{name}</text>");
        }
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        for (place, name) in &self.marked {
            let px = at(&(*place, y.low)).0;
            marks += &format!(
                "<line x1=\"{px:.1}\" y1=\"{TOP}\" x2=\"{px:.1}\" y2=\"{bottom}\" stroke=\"var(--text)\" stroke-dasharray=\"4 4\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                px - 6.0,
                TOP + 14.0,
                escaped(name)
            );
        }
        let down: String = x
            .ticks()
            .map(|v| {
                let px = at(&(v, y.low)).0;
                format!(
                    "<line class=\"grid\" x1=\"{px:.1}\" y1=\"{TOP}\" x2=\"{px:.1}\" y2=\"{bottom}\"/>\
                     <text x=\"{px:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                    bottom + 18.0,
                    x.label(v)
                )
            })
            .collect();
        let across: String = y
            .ticks()
            .map(|v| {
                let py = at(&(x.low, v)).1;
                format!(
                    "<line class=\"grid\" x1=\"{LEFT}\" y1=\"{py:.1}\" x2=\"{right}\" y2=\"{py:.1}\"/>\
                     <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                    LEFT - 8.0,
                    py + 4.0,
                    y.label(v)
                )
            })
            .collect();
        format!(
            "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">{down}{across}{marks}\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text transform=\"translate(16 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text></svg>\n",
            escaped(self.title),
            (LEFT + right) / 2.0,
            HEIGHT - 8.0,
            escaped(self.x),
            (TOP + bottom) / 2.0,
            escaped(self.y)
        )
    }
}

/// Moves names down that would lie on another.
fn set_apart(mut places: Vec<&mut (f64, f64)>) {
    const ROOM: (f64, f64) = (90.0, 14.0);
    places.sort_by(|a, b| a.1.total_cmp(&b.1));
    for i in 1..places.len() {
        let (above, rest) = places.split_at_mut(i);
        let beside = above.iter().filter(|other| (other.0 - rest[0].0).abs() < ROOM.0);
        rest[0].1 = beside.map(|other| other.1 + ROOM.1).fold(rest[0].1, f64::max);
    }
}

/// A circle, square, triangle or diamond.
fn mark(kind: usize, x: f64, y: f64, color: &str, text: &str) -> String {
    let shape = match kind % 4 {
        0 => format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"{color}\">"),
        1 => format!("<path d=\"M{:.1} {:.1}h9v9h-9z\" fill=\"{color}\">", x - 4.5, y - 4.5),
        2 => format!("<path d=\"M{x:.1} {:.1}l5.5 10h-11z\" fill=\"{color}\">", y - 6.0),
        _ => format!("<path d=\"M{x:.1} {:.1}l6 6l-6 6l-6 -6z\" fill=\"{color}\">", y - 6.0),
    };
    let end = if kind.is_multiple_of(4) { "circle" } else { "path" };
    format!("{shape}<title>{text}</title></{end}>")
}

/// A range with a handful of round numbers in it.
struct Axis {
    low: f64,
    high: f64,
    step: f64,
}

impl Axis {
    /// Holds all finite `values`; `None` without one.
    fn over(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (low, high) = values
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        (low <= high).then(|| {
            // Small differences are not to look large.
            let range = (high - low).max(high.abs() * 0.05).max(1e-9);
            let power = 10f64.powf((range / 5.0).log10().floor());
            let step = [1.0, 2.0, 5.0, 10.0].map(|s| s * power).into_iter().find(|s| range / s <= 6.0);
            let step = step.unwrap_or(10.0 * power);
            Self { low: (low / step).floor() * step, high: ((high / step).floor() + 1.0) * step, step }
        })
    }

    fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    fn indices(&self) -> RangeInclusive<i64> {
        (self.low / self.step).round() as i64..=(self.high / self.step).round() as i64
    }

    fn ticks(&self) -> impl Iterator<Item = f64> {
        self.indices().map(|i| i as f64 * self.step)
    }

    fn label(&self, value: f64) -> String {
        let digits = (-self.step.log10().floor()).max(0.0) as usize;
        format!("{value:.digits$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_round_numbers_around_what_they_hold() {
        let axis = Axis::over([31.2, 47.9, f64::NAN].into_iter()).unwrap();
        let ticks: Vec<String> = axis.ticks().map(|v| axis.label(v)).collect();
        assert_eq!(ticks, ["30", "35", "40", "45", "50"]);
        let axis = Axis::over([0.25].into_iter()).unwrap();
        assert!(axis.low <= 0.25 && axis.high > 0.25 && axis.ticks().count() < 10);
        assert!(Axis::over(std::iter::empty()).is_none());
        assert!(Axis::over([0.0].into_iter()).unwrap().high > 0.0);
    }

    #[test]
    fn no_name_lies_on_another() {
        let mut places = [(10.0, 52.0), (300.0, 51.0), (20.0, 50.0), (12.0, 40.0), (15.0, 51.0)];
        set_apart(places.iter_mut().collect());
        assert_eq!(places, [(10.0, 82.0), (300.0, 51.0), (20.0, 54.0), (12.0, 40.0), (15.0, 68.0)]);
    }

    #[test]
    fn every_point_is_drawn_and_named() {
        let series = |name: &str, n: i32| Series {
            name: name.into(),
            points: (0..n).map(|i| (f64::from(i), f64::from(i * i))).collect(),
        };
        let marked = vec![(9.0, "all".to_string())];
        let series = vec![series("a<", 3), series("b", 2)];
        let plot = Plot { title: "t", x: "frames", y: "dB", series, lines: true, marked };
        let svg = plot.svg();
        assert!(svg.contains(">all</text>") && svg.contains(">10</text>"), "the axis holds what is marked");
        assert_eq!(svg.matches("<title>").count(), 5);
        assert_eq!(svg.matches("<polyline").count(), 2);
        assert!(svg.contains("a&lt;") && !svg.contains("NaN"));
        assert_eq!(Plot { series: Vec::new(), ..plot }.svg(), "");
    }
}
