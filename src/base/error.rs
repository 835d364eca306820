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
    /// A file asks for something that this program does not have.
    #[error("{}{}: {message}", path.display(), if *line > 0 { format!(":{line}") } else { String::new() })]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Its line, 1-based; 0 where the format has no lines.
        line: u32,
        /// What was found, and what there is.
        message: String,
    },
    /// Several things at once, each different from the others.
    #[error("{} problems:\n{}", .0.len(), list(.0))]
    Many(Vec<Error>),
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

    /// All results, or all that went wrong: one error as it is, several as [`Error::Many`], the same one once.
    pub fn gather<T>(results: impl IntoIterator<Item = Result<T>>) -> Result<Vec<T>> {
        let (mut values, mut errors) = (Vec::new(), Vec::<Self>::new());
        let mut told = std::collections::BTreeSet::new();
        for result in results {
            match result {
                Ok(value) => values.push(value),
                Err(Self::Many(several)) => errors.extend(several.into_iter().filter(|e| told.insert(e.to_string()))),
                Err(e) => errors.extend(told.insert(e.to_string()).then_some(e)),
            }
        }
        match errors.pop() {
            None => Ok(values),
            Some(only) if errors.is_empty() => Err(only),
            Some(last) => {
                errors.push(last);
                Err(Self::Many(errors))
            }
        }
    }

    /// Both results, or all that went wrong.
    pub fn both<A, B>(a: Result<A>, b: Result<B>) -> Result<(A, B)> {
        match (a, b) {
            (Ok(a), Ok(b)) => Ok((a, b)),
            (Err(a), Err(b)) => Self::gather::<()>([Err(a), Err(b)]).and(Err(Self::Many(Vec::new()))),
            (Err(e), _) | (_, Err(e)) => Err(e),
        }
    }

    /// Whether it is only about what this program does not have.
    pub fn is_unsupported(&self) -> bool {
        match self {
            Self::Unsupported { .. } => true,
            Self::Many(several) => several.iter().all(Self::is_unsupported),
            _ => false,
        }
    }

    /// An [`Error::Io`].
    pub fn io(path: impl AsRef<Path>, cause: std::io::Error) -> Self {
        Self::Io { path: path.as_ref().into(), cause }
    }
}

fn list(errors: &[Error]) -> String {
    errors.iter().map(|e| format!("  {e}")).collect::<Vec<_>>().join("\n")
}
