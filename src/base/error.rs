//! The library's one error type: every message names the file (and line or channel), what was found and what was expected.

use std::path::{Path, PathBuf};

/// What went wrong with an input, an output or a request.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be read or written.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's word.
        cause: std::io::Error,
    },
    /// A file's content is not what it should be; `line` is 1-based, 0 where there is none.
    #[error("{}{}: {message}", path.display(), if *line > 0 { format!(":{line}") } else { String::new() })]
    Input {
        /// The file.
        path: PathBuf,
        /// Its line, 1-based; 0 where the format has no lines.
        line: u32,
        /// What was found and what was expected.
        message: String,
    },
    /// A parameter is out of its range, or inputs do not fit together.
    #[error("{0}")]
    Request(String),
}

/// The library's result.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An [`Error::Input`] without a line.
    pub fn input(path: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Self::Input { path: path.as_ref().into(), line: 0, message: message.into() }
    }

    /// An [`Error::Input`] at a line (1-based).
    pub fn at_line(path: impl AsRef<Path>, line: u32, message: impl Into<String>) -> Self {
        Self::Input { path: path.as_ref().into(), line, message: message.into() }
    }

    /// An [`Error::Io`].
    pub fn io(path: impl AsRef<Path>, cause: std::io::Error) -> Self {
        Self::Io { path: path.as_ref().into(), cause }
    }
}
