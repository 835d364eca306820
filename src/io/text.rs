//! Files as bytes, and as text.

use crate::{Error, Result};
use std::path::Path;

/// Reads a file. A device is an error: it may never end.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let fail = |e| Error::io(path, e);
    let kind = std::fs::metadata(path).map_err(fail)?.file_type();
    if kind.is_dir() || is_device(kind) {
        let found = if kind.is_dir() { "a folder" } else { "a device" };
        return Err(Error::input(path, format!("is {found}, expected a file")));
    }
    std::fs::read(path).map_err(fail)
}

/// Reads a file that another one names, which must be a regular one: nobody may be there to fill a pipe.
pub fn read_named(path: &Path) -> Result<Vec<u8>> {
    match std::fs::metadata(path).map_err(|e| Error::io(path, e))?.is_file() {
        true => read(path),
        false => Err(Error::input(path, "is no regular file")),
    }
}

#[cfg(unix)]
fn is_device(kind: std::fs::FileType) -> bool {
    use std::os::unix::fs::FileTypeExt;
    kind.is_char_device() || kind.is_block_device()
}

#[cfg(not(unix))]
fn is_device(_: std::fs::FileType) -> bool {
    false
}

/// Reads a text file; one that is not UTF-8 is an error that says where.
pub fn read_text(path: &Path) -> Result<String> {
    text(path, read(path)?)
}

/// The bytes of a file as text; `path` is for messages.
pub fn text(path: &Path, bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|e| {
        let line = e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count() as u32 + 1;
        Error::at_line(path, line, "not UTF-8 text")
    })
}
