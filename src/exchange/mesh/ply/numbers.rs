//! The numbers of a PLY file, one after another.

use super::header::{Encoding, Property, Scalar};
use crate::{Error, Result};
use std::path::Path;

/// Numbers still to be read.
pub struct Numbers<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
}

impl<'a> Numbers<'a> {
    /// Those from byte `at` on.
    pub fn new(path: &'a Path, bytes: &'a [u8], at: usize, encoding: Encoding) -> Self {
        Self { path, bytes, at, encoding }
    }

    /// The next number. In text, it stands between any white space; the rest of a line after `comment` or `#` is passed over.
    pub fn next(&mut self, kind: Scalar) -> Result<f64> {
        match self.encoding {
            Encoding::Ascii => self.word(),
            Encoding::Little | Encoding::Big => self.binary(kind),
        }
    }

    /// The next numbers of a property: one, or a list's.
    pub fn of(&mut self, property: &Property, out: &mut Vec<f64>) -> Result<()> {
        out.clear();
        let Some(length) = property.list else {
            out.push(self.next(property.kind)?);
            return Ok(());
        };
        let count = self.next(length)?;
        let left = self.bytes.len() - self.at.min(self.bytes.len());
        if count < 0.0 || count.fract() != 0.0 || count > left as f64 {
            return Err(self.error(format!("a list \"{}\" of {count} numbers where {left} bytes are left", property.name)));
        }
        for _ in 0..count as usize {
            out.push(self.next(property.kind)?);
        }
        Ok(())
    }

    /// An error at the place that was read last.
    pub fn error(&self, message: impl Into<String>) -> Error {
        match self.encoding {
            Encoding::Ascii => {
                let read = &self.bytes[..self.at.min(self.bytes.len())];
                Error::at_line(self.path, read.iter().filter(|b| **b == b'\n').count() as u32 + 1, message)
            }
            _ => Error::input(self.path, message),
        }
    }

    fn word(&mut self) -> Result<f64> {
        loop {
            let rest = &self.bytes[self.at..];
            self.at += rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
            let rest = &self.bytes[self.at..];
            let word = &rest[..rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len())];
            if word.is_empty() {
                return Err(self.error("the PLY file ends before all its elements are there"));
            }
            if word[0] == b'#' || word == b"comment" {
                self.at += rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
                continue;
            }
            let text = String::from_utf8_lossy(word);
            match text.parse::<f64>() {
                Ok(x) if x.is_finite() => {
                    self.at += word.len();
                    return Ok(x);
                }
                _ => return Err(self.error(format!("found \"{text}\", expected a finite number"))),
            }
        }
    }

    fn binary(&mut self, kind: Scalar) -> Result<f64> {
        let mut raw = [0; 8];
        let size = kind.size();
        let Some(found) = self.bytes.get(self.at..self.at + size) else {
            return Err(self.error("the PLY file ends before all its elements are there"));
        };
        self.at += size;
        raw[..size].copy_from_slice(found);
        if self.encoding == Encoding::Big {
            raw[..size].reverse();
        }
        let four = [raw[0], raw[1], raw[2], raw[3]];
        Ok(match kind {
            Scalar::I8 => f64::from(raw[0] as i8),
            Scalar::U8 => f64::from(raw[0]),
            Scalar::I16 => f64::from(i16::from_le_bytes([raw[0], raw[1]])),
            Scalar::U16 => f64::from(u16::from_le_bytes([raw[0], raw[1]])),
            Scalar::I32 => f64::from(i32::from_le_bytes(four)),
            Scalar::U32 => f64::from(u32::from_le_bytes(four)),
            Scalar::F32 => f64::from(f32::from_le_bytes(four)),
            Scalar::F64 => f64::from_le_bytes(raw),
        })
    }
}
