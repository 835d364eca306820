//! The header of a PLY file.

use crate::{Error, Result};
use std::path::Path;

/// Most elements, and most properties of one: each is compared with all.
const MAX_PARTS: usize = 1000;

/// How numbers are written after the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    Ascii,
    Little,
    Big,
}

/// A type of number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of a number.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The largest number of an integer type.
    pub fn largest(self) -> Option<f64> {
        Some(match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32_767.0,
            Self::U16 => 65_535.0,
            // Colours are of 8 bits in wider integers too.
            Self::I32 | Self::U32 => 255.0,
            Self::F32 | Self::F64 => return None,
        })
    }
}

/// A number, or a list of them, that each item of an element has.
#[derive(Debug)]
pub struct Property {
    pub name: String,
    pub kind: Scalar,
    /// The type of a list's length.
    pub list: Option<Scalar>,
}

/// Items of one form.
#[derive(Debug)]
pub struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

impl Element {
    /// Where among the properties a number of that name is.
    pub fn number(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name == name && p.list.is_none())
    }

    /// Where among the properties a list of one of these names is.
    pub fn list(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|p| names.contains(&p.name.as_str()) && p.list.is_some())
    }
}

/// What a file says of itself.
#[derive(Debug)]
pub struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// Where the numbers begin, bytes.
    pub end: usize,
}

/// Reads the header: lines that end in any way, blank ones among them.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Header> {
    let (mut encoding, mut elements, mut at) = (None, Vec::<Element>::new(), 0);
    let mut number = 0;
    loop {
        let Some(length) = bytes[at..].iter().position(|b| matches!(b, b'\n' | b'\r')) else {
            let message =
                if number == 0 { "not a PLY file: it does not begin with \"ply\"" } else { "the PLY header has no end_header" };
            return Err(Error::at_line(path, number + 1, message));
        };
        let line = String::from_utf8_lossy(&bytes[at..at + length]).into_owned();
        at += length + if bytes[at + length..].starts_with(b"\r\n") { 2 } else { 1 };
        number += 1;
        let bad = |expected: &str| Error::at_line(path, number, format!("found \"{}\", expected {expected}", line.trim()));
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            _ if number == 1 => match words.as_slice() {
                ["ply"] => {}
                _ => return Err(Error::at_line(path, 1, "not a PLY file: it does not begin with \"ply\"")),
            },
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, ..] => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(bad("ascii, binary_little_endian or binary_big_endian")),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| bad("a number of items"))?;
                // Each item takes a byte at least; more of them than bytes is a broken header, and could fill the memory.
                if count > bytes.len() {
                    let message = format!("declares {count} elements \"{name}\", but the file has only {} bytes", bytes.len());
                    return Err(Error::at_line(path, number, message));
                }
                if elements.iter().any(|e| e.name == *name) || elements.len() == MAX_PARTS {
                    return Err(bad("each element once, and few of them"));
                }
                elements.push(Element { name: (*name).into(), count, properties: Vec::new() });
            }
            ["property", rest @ ..] => {
                let property = property(rest).map_err(bad)?;
                let of = elements.last_mut().ok_or_else(|| bad("an element before its properties"))?;
                of.properties.push(property);
                if of.properties.len() > MAX_PARTS {
                    return Err(bad("fewer properties"));
                }
            }
            ["end_header"] => break,
            _ => return Err(bad("format, comment, element, property or end_header")),
        }
    }
    let encoding = encoding.ok_or_else(|| Error::input(path, "the PLY header has no format"))?;
    Ok(Header { encoding, elements, end: at })
}

/// What a line says after `property`, or what was expected.
fn property(words: &[&str]) -> std::result::Result<Property, &'static str> {
    let scalar = |name: &str| Scalar::named(name).ok_or("a type such as float or uchar");
    Ok(match words {
        ["list", length, kind, name] => Property { name: (*name).into(), kind: scalar(kind)?, list: Some(scalar(length)?) },
        [kind, name] => Property { name: (*name).into(), kind: scalar(kind)?, list: None },
        _ => return Err("property TYPE NAME or property list TYPE TYPE NAME"),
    })
}
