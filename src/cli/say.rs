//! What is printed: results on standard output, everything else on standard error.
//!
//! The macros of the standard library panic when nobody reads any more (`| head`, a closed terminal); a run of hours
//! must not end by that.

use buzz::error::{Error, Result};
use std::fmt::Display;
use std::io::{ErrorKind, Write, stderr, stdout};

/// Prints a result. A reader that went away has seen what it wanted.
pub fn result(text: &str) -> Result<()> {
    let mut out = stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Error::output("standard output", error.to_string()))
        }
        _ => Ok(()),
    }
}

/// A line on standard error; if it cannot be written, there is nobody to tell. Names in it may hold anything; it stays one line.
pub fn line(text: impl Display) {
    let _ = writeln!(stderr(), "{}", escaped(text));
}

/// The text with its control characters spelled out, which could end the line or change the terminal.
pub fn escaped(text: impl Display) -> String {
    let mut line = String::new();
    for c in text.to_string().chars() {
        if c.is_control() { line.extend(c.escape_default()) } else { line.push(c) }
    }
    line
}

/// An error or a warning.
pub fn complain(text: impl Display) {
    line(format_args!("buzz-convert: {text}"));
}

/// So many of what `one` is called.
pub fn count(number: usize, one: &str) -> String {
    format!("{number} {one}{}", if number == 1 { "" } else { "s" })
}
