//! File names of frames: `--name` patterns, and the frame number in a name.

use crate::frame::{FrameId, StereoEye};
use crate::{Error, Result};

/// A pattern for the names of a sequence's files, such as `walk.%04d.exr` or `walk.####.exr`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamePattern {
    prefix: String,
    suffix: String,
    /// Least number of characters, the minus sign included, as in C's `%04d`.
    width: usize,
}

impl NamePattern {
    /// What `--name` is when it is not given.
    pub const DEFAULT: &str = "<stem>.%04d.exr";

    /// Reads a pattern; `<stem>` in it stands for the input's name without its ending.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no frame number in it or more than one, if it names a folder, or if it does not
    /// end in `.exr`.
    pub fn parse(pattern: &str, stem: &str) -> Result<Self> {
        let fail = |what: &str| {
            Err(Error::Usage(format!("--name {pattern}: {what}; write it like {}", Self::DEFAULT)))
        };
        let mut parsed: Option<Self> = None;
        let mut text = String::new();
        let mut rest = pattern;
        while let Some(c) = rest.chars().next() {
            let number = match c {
                '#' => {
                    let width = rest.len() - rest.trim_start_matches('#').len();
                    Some((width, &rest[width..]))
                }
                '%' => percent(rest),
                _ => None,
            };
            if let Some((width, after)) = number {
                if parsed.is_some() {
                    return fail("there is more than one frame number in it");
                }
                if width > 20 {
                    return fail("its frame number has more than 20 digits");
                }
                parsed = Some(Self { prefix: std::mem::take(&mut text), suffix: String::new(), width });
                rest = after;
            } else if let Some(after) = rest.strip_prefix("<stem>") {
                text += stem;
                rest = after;
            } else if c == '%' {
                let Some(after) = rest.strip_prefix("%%") else {
                    return fail("only %d, %04d and the like, or %% for a percent sign, may follow a %");
                };
                text.push('%');
                rest = after;
            } else {
                text.push(c);
                rest = &rest[c.len_utf8()..];
            }
        }
        let Some(mut name) = parsed else {
            return fail("there is no frame number in it");
        };
        name.suffix = text;
        let whole = name.file_name(0);
        if whole.contains(['/', '\\', '\0']) {
            return fail("it must be a file name, without a folder");
        }
        if !whole.ends_with(".exr") {
            return fail("it must end in .exr");
        }
        Ok(name)
    }

    /// What stands before the frame number, what stands after it, and the least number of its characters.
    pub fn parts(&self) -> (&str, &str, usize) {
        (&self.prefix, &self.suffix, self.width)
    }

    /// The name of the file of a frame and eye.
    pub fn file_of(&self, frame: FrameId) -> String {
        frame.eye.map_or_else(|| self.file_name(frame.number), |eye| self.of_eye(eye).file_name(frame.number))
    }

    /// The pattern of one eye's files: its name stands before the frame number, as in `walk.left.%04d.exr`.
    #[must_use]
    pub fn of_eye(&self, eye: StereoEye) -> Self {
        let separator = self.prefix.chars().next_back().filter(|c| ['.', '_', '-'].contains(c));
        let stem = separator.map_or(self.prefix.as_str(), |c| self.prefix.trim_end_matches(c));
        let joint = if stem.is_empty() { String::new() } else { separator.unwrap_or('.').to_string() };
        let prefix = format!("{stem}{joint}{}{}", eye.name(), separator.unwrap_or('.'));
        Self { prefix, ..self.clone() }
    }

    /// The name of `frame`'s file. Negative numbers are written as C's `%04d` does: `-001`.
    pub fn file_name(&self, frame: i64) -> String {
        format!("{}{frame:0width$}{}", self.prefix, self.suffix, width = self.width)
    }
}

/// `%d`, `%4d` or `%04d` at the start of `text`: its width and what follows. `%4d` is padded with zeros too: a space in
/// a file name would split it on command lines.
fn percent(text: &str) -> Option<(usize, &str)> {
    let digits = text.strip_prefix('%')?;
    let after = digits.trim_start_matches(|c: char| c.is_ascii_digit());
    let width = &digits[..digits.len() - after.len()];
    let width = if width.is_empty() { 1 } else { width.parse().ok()? };
    Some((width, after.strip_prefix('d')?))
}

/// A number in a file's name, between what stands before it and after it.
pub type NumberInName<'a> = (&'a str, i64, &'a str);

/// The frame number in a file's name: the last run of digits before its ending; a hyphen before it is a minus sign unless it
/// joins the number to a word (`walk-001.exr` is 1, `walk.-001.exr` is -1).
pub fn number_in_name(name: &str) -> Option<NumberInName<'_>> {
    let numbers = numbers_in_name(name);
    let &(before, number, after) = numbers.first()?;
    let negative =
        numbers.get(1).filter(|second| second.2 == after && !second.0.ends_with(char::is_alphanumeric));
    Some(negative.copied().unwrap_or((before, number, after)))
}

/// All that may be a number in a file's name, before its ending: the last run of digits first, and each twice if a hyphen
/// stands before it, which may be a minus sign.
pub fn numbers_in_name(name: &str) -> Vec<NumberInName<'_>> {
    let mut found = Vec::new();
    let mut rest = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    while let Some(last) = rest.rfind(|c: char| c.is_ascii_digit()) {
        let (digits, after) = (&rest[..=last], &name[last + 1..]);
        rest = digits.trim_end_matches(|c: char| c.is_ascii_digit());
        if let Ok(number) = digits[rest.len()..].parse::<i64>() {
            found.push((rest, number, after));
            found.extend(rest.strip_suffix('-').map(|before| (before, -number, after)));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(name: &str) -> Option<i64> {
        number_in_name(name).map(|(_, number, _)| number)
    }

    #[test]
    fn what_is_not_the_number_is_the_sequences_name() {
        assert_eq!(number_in_name("s010_v2.-0101.left.exr"), Some(("s010_v2.", -101, ".left.exr")));
        assert_eq!(number_in_name("walk-0001.exr"), Some(("walk-", 1, ".exr")));
    }

    fn name(pattern: &str, frame: i64) -> String {
        NamePattern::parse(pattern, "walk").unwrap().file_name(frame)
    }

    #[test]
    fn patterns_are_filled_in() {
        assert_eq!(name(NamePattern::DEFAULT, 7), "walk.0007.exr");
        assert_eq!(name("a_####.exr", 7), "a_0007.exr");
        assert_eq!(name("a.%d.exr", 12345), "a.12345.exr");
        assert_eq!(name("a.%3d.exr", 7), "a.007.exr");
        assert_eq!(name("100%%.%02d.exr", 123), "100%.123.exr");
        assert_eq!(name("é<stem>#.exr", 1), "éwalk1.exr");
    }

    #[test]
    fn eyes_stand_before_the_number() {
        let of = |pattern: &str| {
            let frame = FrameId { number: 7, eye: Some(StereoEye::Right) };
            NamePattern::parse(pattern, "walk").unwrap().file_of(frame)
        };
        assert_eq!(of(NamePattern::DEFAULT), "walk.right.0007.exr");
        assert_eq!(of("a_####.beauty.exr"), "a_right_0007.beauty.exr");
        assert_eq!(of("shot%04d.exr"), "shot.right.0007.exr");
        assert_eq!(of("%04d.exr"), "right.0007.exr");
        for pattern in [NamePattern::DEFAULT, "%04d.exr"] {
            assert_eq!(number(&of(pattern)), Some(7));
        }
    }

    #[test]
    fn negative_frames_have_their_own_names() {
        assert_eq!(name("<stem>.%04d.exr", -1), "walk.-001.exr");
        assert_eq!(name("<stem>.####.exr", -12345), "walk.-12345.exr");
    }

    #[test]
    fn a_pattern_that_would_not_work_is_a_usage_error() {
        for bad in [
            "a.exr",
            "%04d.%04d.exr",
            "#.#.exr",
            "%04d",
            "%04d.png",
            "d/%04d.exr",
            "%x.exr",
            "%.exr",
            "%99d.exr",
        ] {
            let error = NamePattern::parse(bad, "walk").unwrap_err();
            assert_eq!(error.exit_code(), 2, "{bad}");
            assert!(error.to_string().contains(bad));
        }
    }

    #[test]
    fn other_renderers_names_are_read_too() {
        assert_eq!(number("shot010_v2.0101.exr"), Some(101));
        assert_eq!(number("0001.exr"), Some(1));
        assert_eq!(number("-0001.exr"), Some(-1));
        assert_eq!(number("walk-0001.exr"), Some(1));
        assert_eq!(number("walk.-0001.exr"), Some(-1));
        assert_eq!(number("walk0012.left.exr"), Some(12));
        assert_eq!(number("walk.exr"), None);
        assert_eq!(number("99999999999999999999.exr"), None);
        assert_eq!(number(""), None);
    }

    proptest! {
        #[test]
        fn the_number_written_is_read_back(frame in -100_000i64..100_000, width in 1usize..9) {
            let pattern = NamePattern::parse(&format!("<stem>.%0{width}d.exr"), "a b-2").unwrap();
            prop_assert_eq!(number(&pattern.file_name(frame)), Some(frame));
        }

        #[test]
        fn no_name_panics(name in ".*") {
            number_in_name(&name);
            let _ = NamePattern::parse(&name, "s");
        }
    }
}
