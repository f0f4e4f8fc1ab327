//! The text of OBJ and MTL files, statement by statement.

use std::{borrow::Cow, iter};

/// The text of a file. What is not UTF-8 counts as Latin-1: older tools write names and comments in it.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().copied().map(char::from).collect()),
    }
}

/// The statements of a file, each with the number of its first line. A `\` at a line's end continues it on the next.
pub(super) fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = text.lines().map(str::trim).zip(1..);
    iter::from_fn(move || {
        let (first, number) = lines.next()?;
        // Comments end in folders of Windows.
        if first.starts_with('#') || !first.ends_with('\\') {
            return Some((number, Cow::Borrowed(first)));
        }
        let (mut whole, mut line) = (String::new(), first);
        while let Some(start) = line.strip_suffix('\\') {
            whole.push_str(start);
            whole.push(' ');
            line = lines.next().map_or("", |(line, _)| line);
        }
        whole.push_str(line);
        Some((number, Cow::Owned(whole)))
    })
}

/// A statement's first word, and what follows it.
pub(super) fn split(statement: &str) -> (&str, &str) {
    let (key, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
    (key, rest.trim_start())
}

/// A statement as messages show it.
pub(super) fn shown(statement: &str) -> String {
    const MOST: usize = 60;
    let more = if statement.chars().nth(MOST).is_some() { "…" } else { "" };
    format!("`{}{more}`", statement.chars().take(MOST).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statements_go_on_after_a_backslash_and_keep_their_lines() {
        let text = decode(b"\xef\xbb\xbfv 1 \\\r\n2 \\\n3\r\n# c:\\\n  f 1\t2 \nv \\");
        let all: Vec<(usize, Cow<str>)> = statements(&text).collect();
        let expected = [(1, "v 1  2  3"), (4, "# c:\\"), (5, "f 1\t2"), (6, "v  ")];
        assert_eq!(all, expected.map(|(line, text)| (line, Cow::Borrowed(text))));
        assert_eq!(split("f 1\t2"), ("f", "1\t2"));
    }

    #[test]
    fn what_is_not_utf_8_is_latin_1() {
        assert_eq!(decode(b"caf\xe9"), "café");
        assert_eq!(decode("café".as_bytes()), "café");
    }
}
