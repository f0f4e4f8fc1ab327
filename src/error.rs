//! What can go wrong, sorted by what the user can do about it.
//!
//! Every message is one line that names the file and the element and says what to do. The exit code of the
//! program follows from the variant (see [`Error::exit_code`]).

use std::io;
use std::path::PathBuf;

/// Result of everything in this crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error that a user can act on.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A frame could not be made.
    #[error("frame {frame}: {message}")]
    Frame {
        /// The frame's number.
        frame: i64,
        /// What went wrong and what to do.
        message: String,
    },
    /// The options contradict each other or the scene.
    #[error("{0}")]
    Usage(String),
    /// The input is missing, broken, or asks for something that is not supported.
    #[error("{}: {location}: {message}", .file.display())]
    Input {
        /// The file as the user named it.
        file: PathBuf,
        /// The element in it: a JSON pointer (`/meshes/3/primitives/0`), a byte offset or a line; never empty.
        location: String,
        /// What is wrong and what to do.
        message: String,
    },
    /// The output cannot be written.
    #[error("{}: {message}", .file.display())]
    Output {
        /// The file or folder.
        file: PathBuf,
        /// What is wrong and what to do.
        message: String,
    },
    /// The user asked to stop.
    #[error("interrupted by {}", if *.signal == 15 { "SIGTERM" } else { "Ctrl-C" })]
    Interrupted {
        /// 2 for SIGINT, 15 for SIGTERM.
        signal: i32,
    },
}

impl Error {
    /// An [`Error::Input`].
    pub fn input(file: impl Into<PathBuf>, location: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Input { file: file.into(), location: location.into(), message: message.into() }
    }

    /// An [`Error::Output`].
    pub fn output(file: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self::Output { file: file.into(), message: message.into() }
    }

    /// An [`Error::Input`] where the JSON in `file` cannot be read.
    pub fn json(file: impl Into<PathBuf>, error: &serde_json::Error, advice: &str) -> Self {
        let place = format!("line {} column {}", error.line(), error.column());
        // The place stands before the message already.
        let said = error.to_string();
        let why = said.strip_suffix(&format!(" at {place}")).unwrap_or(&said);
        Self::input(file, place, format!("{why}; {advice}"))
    }

    /// The program's exit code: 1 a frame failed, 2 usage, 3 input, 4 output, 130 and 143 interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Frame { .. } => 1,
            Self::Usage(_) => 2,
            Self::Input { .. } => 3,
            Self::Output { .. } => 4,
            Self::Interrupted { signal } => (128 + signal) as u8,
        }
    }
}

/// What went wrong, without the system's number for it.
pub fn reason(error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound {
        return "there is no such file".into();
    }
    let said = error.to_string();
    said.split(" (os error ").next().unwrap_or_default().to_owned()
}
