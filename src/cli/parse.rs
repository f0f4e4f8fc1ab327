//! The small languages of option values: frame ranges, sizes, rates.

use buzz::error::{Error, Result};
use buzz::frame::{Aov, AovSet, Window};
use buzz::scene::{Rational, Stereo};
use std::collections::BTreeSet;

/// More frames than anyone renders in one run; a typo in a range must not fill the memory.
const MOST_FRAMES: i64 = 1_000_000;

fn usage(option: &str, text: &str, wanted: &str) -> Error {
    Error::Usage(format!("{option} {text}: expected {wanted}"))
}

/// What `is_frame_number` accepts, in words.
pub const FRAME_NUMBERS: &str = "a frame number from -1000000000 to 1000000000";

/// EXR files keep frame numbers in 32 bits.
pub fn is_frame_number(number: i64) -> bool {
    (-1_000_000_000..=1_000_000_000).contains(&number)
}

/// `1-100`, `1-100x2`, `1-7:2`, `1-10,20-30`, `7-7`, `7`, `-3--1`; `1-20&10-30` are the frames in both, of which there
/// may be none.
pub fn frames(text: &str) -> Result<BTreeSet<i64>> {
    let mut lists = text.split('&').map(|list| frame_list(text, list));
    let first = lists.next().unwrap_or_else(|| Ok(BTreeSet::new()))?;
    lists.try_fold(first, |both, list| Ok(&both & &list?))
}

fn frame_list(text: &str, list: &str) -> Result<BTreeSet<i64>> {
    let error = || usage("--frames", text, "ranges like 1-100, 1-100x2 or 1-10,20-30, first to last");
    let mut found = BTreeSet::new();
    for part in list.split(',') {
        let (range, step) = match part.split_once(['x', ':']) {
            Some((range, step)) => (range, Some(step.trim())),
            None => (part, None),
        };
        let range = range.trim();
        // The dash that divides is the first one after a digit; any other is a sign.
        let dash = range
            .char_indices()
            .skip(1)
            .find(|&(i, c)| c == '-' && range[..i].ends_with(|c: char| c.is_ascii_digit()));
        let (first, last) = match (dash, step) {
            (Some((i, _)), _) => (&range[..i], &range[i + 1..]),
            (None, None) => (range, range),
            (None, Some(step)) => {
                let bounds = range.parse::<i64>().ok().zip(step.parse().ok());
                let meant = match bounds {
                    Some((first, last)) if first < last => format!("; was {first}-{last} meant?"),
                    _ => String::new(),
                };
                let wanted = format!("a range before the step, like 1-100x2{meant}");
                return Err(usage("--frames", text, &wanted));
            }
        };
        let is_step = |&step: &i64| step > 0;
        let step = step.map_or(Ok(1), |s| s.parse().ok().filter(is_step).ok_or_else(error))?;
        let number = |s: &str| s.trim().parse::<i64>().ok().filter(|&n| is_frame_number(n)).ok_or_else(error);
        let (first, last) = (number(first)?, number(last)?);
        if last < first {
            return Err(error());
        }
        let length = last - first;
        if found.len() as i64 + length / step >= MOST_FRAMES {
            return Err(usage("--frames", text, &format!("at most {MOST_FRAMES} frames")));
        }
        found.extend((0..=length / step).map(|i| first + i * step));
    }
    Ok(found)
}

/// `24`, `23.976`, `24000/1001`. The decimal names of NTSC rates mean the exact ratios.
pub fn fps(text: &str) -> Result<Rational> {
    let error = || usage("--fps", text, "a rate like 24, 23.976 or 24000/1001");
    if let Some((numerator, denominator)) = text.split_once('/') {
        let part = |s: &str| s.trim().parse::<u32>().ok().filter(|&n| n > 0).ok_or_else(error);
        return Ok(Rational { numerator: part(numerator)?, denominator: part(denominator)? });
    }
    let rate: f64 = text.trim().parse().map_err(|_| error())?;
    if !(rate > 0.0 && rate <= 100_000.0) {
        return Err(error());
    }
    let ntsc = Rational { numerator: (rate.round() * 1000.0) as u32, denominator: 1001 };
    if rate.fract() != 0.0 && ntsc.numerator > 0 && (ntsc.value() - rate).abs() < 0.005 {
        return Ok(ntsc);
    }
    let scale = if rate.fract() == 0.0 { 1 } else { 1000 };
    let numerator = (rate * f64::from(scale)).round() as u32;
    if numerator > 0 { Ok(Rational { numerator, denominator: scale }) } else { Err(error()) }
}

/// `2GiB`, `512MiB`, `1.5GB`, or a number of bytes.
pub fn memory(text: &str) -> Result<u64> {
    let error = || usage("--memory", text, "a size like 2GiB or 512MiB");
    let unit = text.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    let scale = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        "kib" | "k" => 1024.0,
        "mib" | "m" => 1024f64.powi(2),
        "gib" | "g" => 1024f64.powi(3),
        "tib" | "t" => 1024f64.powi(4),
        _ => return Err(error()),
    };
    let number: f64 = text[..text.len() - unit.len()].parse().map_err(|_| error())?;
    let bytes = number * scale;
    if bytes >= 1.0 && bytes < u64::MAX as f64 { Ok(bytes as u64) } else { Err(error()) }
}

/// Longest side that is accepted.
const MOST_PIXELS_A_SIDE: u32 = 65_536;

/// `1920x1080`, or `50%` of `own`.
pub fn resolution(text: &str, own: (u32, u32)) -> Result<(u32, u32)> {
    let error =
        || usage("--resolution", text, "a size like 1920x1080, sides up to 65536, or a share like 50%");
    let size = if let Some(percent) = text.strip_suffix('%') {
        let share = percent.trim().parse::<f64>().map_err(|_| error())? / 100.0;
        let side = |s: u32| (f64::from(s) * share).round() as u32;
        (side(own.0), side(own.1))
    } else {
        let (width, height) = text.split_once(['x', 'X']).ok_or_else(error)?;
        let side = |s: &str| s.trim().parse::<u32>().map_err(|_| error());
        (side(width)?, side(height)?)
    };
    let fits = |s: u32| (1..=MOST_PIXELS_A_SIDE).contains(&s);
    if fits(size.0) && fits(size.1) { Ok(size) } else { Err(error()) }
}

/// `x,y,width,height` inside `full`.
pub fn crop(text: &str, full: (u32, u32)) -> Result<Window> {
    let error = || usage("--crop", text, &format!("x,y,width,height in pixels of {}x{}", full.0, full.1));
    let numbers =
        text.split(',').map(|s| s.trim().parse::<u32>().map_err(|_| error())).collect::<Result<Vec<_>>>()?;
    let &[x, y, width, height] = numbers.as_slice() else { return Err(error()) };
    if width == 0 || height == 0 {
        return Err(error());
    }
    let over = |at: u32, size: u32, full: u32| (u64::from(at) + u64::from(size)).saturating_sub(full.into());
    let sides = [(over(x, width, full.0), "right edge"), (over(y, height, full.1), "lower edge")];
    let beyond: Vec<String> = sides
        .iter()
        .filter(|(pixels, _)| *pixels > 0)
        .map(|(pixels, side)| format!("{pixels} pixels beyond the {side}"))
        .collect();
    if beyond.is_empty() {
        return Ok(Window { x, y, width, height });
    }
    let reaches = beyond.join(" and ");
    Err(Error::Usage(format!("--crop {text}: reaches {reaches} of the {}x{} frame", full.0, full.1)))
}

/// A distance as typed.
pub fn metres(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| "expected a number of metres, without a unit".into())
}

/// An exposure as typed.
pub fn stops(text: &str) -> Result<f32, String> {
    text.trim().parse().map_err(|_| "expected a number of stops, without a unit".into())
}

/// The distances of a stereo pair.
pub fn stereo(interocular: f64, convergence: Option<f64>) -> Result<Stereo> {
    let distance = |option: &str, value: f64| {
        let usable = value > 0.0 && value.is_finite();
        usable.then_some(value).ok_or_else(|| usage(option, &value.to_string(), "metres, more than 0"))
    };
    let interocular = distance("--stereo", interocular)?;
    let convergence = convergence.map_or(Ok(f64::INFINITY), |c| distance("--convergence", c))?;
    Ok(Stereo { interocular, convergence })
}

/// A comma list of layers.
pub fn aovs(text: &str) -> Result<AovSet> {
    const NAMES: [(&str, Aov); 11] = [
        ("depth", Aov::Depth),
        ("class", Aov::Class),
        ("normal", Aov::Normal),
        ("position", Aov::Position),
        ("motion", Aov::Motion),
        ("object", Aov::Object),
        ("diffuse", Aov::Diffuse),
        ("specular", Aov::Specular),
        ("emission", Aov::Emission),
        ("lights", Aov::Lights),
        ("crypto", Aov::Crypto),
    ];
    let mut set = AovSet::default();
    for name in text.split(',').map(str::trim) {
        match (name, NAMES.iter().find(|(n, _)| *n == name)) {
            (_, Some((_, aov))) => set = set.with(*aov),
            ("all", _) => set = Aov::ALL.into_iter().collect(),
            ("beauty", _) => set = set.with(Aov::Depth).with(Aov::Class),
            ("", _) if text.contains(',') => {
                return Err(Error::Usage(format!("--aov {text}: there is a comma too many")));
            }
            _ => {
                let names: Vec<&str> = NAMES.iter().map(|(n, _)| *n).collect();
                return Err(usage("--aov", name, &format!("one of {}, all, beauty", names.join(", "))));
            }
        }
    }
    Ok(set)
}

/// More than any machine has; a typo must not start a thread for each of its digits.
const MOST_THREADS: usize = 1024;

/// A number of threads; 0, for as many as there are processors, if none is asked for.
pub fn threads(asked: Option<usize>) -> Result<usize> {
    match asked.filter(|n| !(1..=MOST_THREADS).contains(n)) {
        Some(number) => Err(usage("--threads", &number.to_string(), &format!("1 to {MOST_THREADS}"))),
        None => Ok(asked.unwrap_or(0)),
    }
}

/// `auto` or a number of frames.
pub fn segment(text: &str) -> Result<u32> {
    match text {
        "auto" => Ok(buzz::plan::LONGEST_SEGMENT),
        _ => text
            .parse()
            .ok()
            .filter(|&n| n > 0)
            .ok_or_else(|| usage("--segment", text, "auto or a number of frames")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_ranges_as_farms_write_them() {
        let list = |text| frames(text).unwrap().into_iter().collect::<Vec<_>>();
        assert_eq!(list("1-4"), [1, 2, 3, 4]);
        assert_eq!(list("1-7x2"), [1, 3, 5, 7]);
        assert_eq!(list("1-7:3"), [1, 4, 7]);
        assert_eq!(list("-3--1"), [-3, -2, -1]);
        assert_eq!(list("-1-1"), [-1, 0, 1]);
        assert_eq!(list("7-7"), [7]);
        assert_eq!(list("4,5,20"), [4, 5, 20]);
        assert_eq!(list("1-2,10-11"), [1, 2, 10, 11]);
        assert_eq!(list("1-4&3-9"), [3, 4]);
        assert_eq!(list("1-20x2&1,4-7&-9-6"), [1, 5]);
        assert_eq!(list("1-4&5-9"), [0; 0]);
        assert_eq!(frames("0-499999,500000-999999&0-999999").unwrap().len(), 1_000_000);
        assert!(frames("0-499999,500000-1000000").unwrap_err().to_string().contains("at most"));
        let said = frames("1:5").unwrap_err().to_string();
        assert!(said.contains("a range before the step") && said.contains("was 1-5 meant?"), "{said}");
        for bad in ["7x1", "1-4&", "&1", "", "a", "5-1", "1-5x0", "1--", "1-99999999999", "--", "1-5x"] {
            assert!(frames(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn decimal_ntsc_rates_are_exact() {
        for (text, n, d) in [
            ("24", 24, 1),
            ("23.976", 24000, 1001),
            ("29.97", 30000, 1001),
            ("24000/1001", 24000, 1001),
            ("12.5", 12500, 1000),
        ] {
            assert_eq!(fps(text).unwrap(), Rational { numerator: n, denominator: d });
        }
        for bad in ["0", "-1", "24/0", "x", "nan", "inf", "0.0001"] {
            assert!(fps(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn sizes_of_memory_have_units() {
        for (text, bytes) in [
            ("2GiB", 2 << 30),
            ("512MiB", 512 << 20),
            ("1.5GB", 1_500_000_000),
            ("64k", 65_536),
            ("7", 7),
            ("8 mib", 8 << 20),
        ] {
            assert_eq!(memory(text).unwrap(), bytes, "{text}");
        }
        for bad in ["", "GiB", "-1GiB", "2 gigs", "0", "1e9", "nan", "99999999TiB"] {
            assert!(memory(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn sizes_and_windows_must_fit() {
        assert_eq!(resolution("50%", (1280, 720)).unwrap(), (640, 360));
        assert_eq!(resolution("16384x16", (1, 1)).unwrap(), (16384, 16));
        for bad in ["0x5", "5", "x", "0%", "-5%", "99999999x1", "65537x1", "nan%"] {
            assert!(resolution(bad, (1280, 720)).is_err(), "{bad}");
        }
        assert!(crop("0,0,1280,720", (1280, 720)).is_ok());
        let said = crop("0,0,1300,721", (1280, 720)).unwrap_err().to_string();
        assert!(
            said.contains("20 pixels beyond the right edge and 1 pixels beyond the lower edge"),
            "{said}"
        );
        for bad in ["0,0,1281,720", "1,0,1280,1", "0,0,0,1", "0,0,1", "4294967295,0,1,1"] {
            assert!(crop(bad, (1280, 720)).is_err(), "{bad}");
        }
    }
}
