//! Text files.

use crate::{Error, Result};
use std::path::Path;

/// Reads a text file; one that is not UTF-8 is an error that says where.
pub fn read_text(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    String::from_utf8(bytes).map_err(|e| {
        let line = e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count() as u32 + 1;
        Error::at_line(path, line, "not UTF-8 text")
    })
}
