//! XML text as a tree of elements, as leniently as Mitsuba's parser takes it.
//!
//! A document type declaration, comments with `--` in them, processing instructions and what stands before the XML declaration are
//! passed over; of an attribute that is given twice the first counts; an entity that XML itself does not define stays as it is written.
//! So no entity grows, whatever a declaration says.

use super::tree::{Lines, Location};
use crate::{Error, Result};
use encoding_rs::Encoding;
use quick_xml::Reader;
use quick_xml::escape::resolve_xml_entity;
use quick_xml::events::{BytesStart, Event};
use std::path::Path;
use std::sync::Arc;

/// Most elements and attributes in one file.
const MAX_NODES: usize = 20_000_000;
/// Deepest nesting of elements; what a scene may have is less.
const MAX_NESTED: usize = 500;

/// An element with its attributes and children; text between elements is left out.
#[derive(Debug, Default)]
pub struct Element {
    /// Its name.
    pub tag: String,
    /// Names and values, in file order.
    attributes: Vec<(String, String)>,
    /// Where it begins, 1-based.
    pub line: u32,
    /// The elements within.
    pub children: Vec<Element>,
}

impl Element {
    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| n == name).map(|(_, v)| v.as_str())
    }
}

/// Parses the bytes of a file; `path` is for messages. The second result is what was odd about it.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<(Element, Option<String>)> {
    let (text, odd) = decode(path, bytes)?;
    let file: Arc<Path> = path.into();
    let lines = Lines::new(&text);
    let at = |offset: usize| Location { file: file.clone(), line: lines.at(offset) };
    let mut reader = Reader::from_str(&text);
    let mut open: Vec<Element> = Vec::new();
    let mut root = None;
    let mut nodes = 0;
    loop {
        let begin = reader.buffer_position() as usize;
        let malformed = |offset: u64, e: String| at(offset as usize).error(format!("not well-formed XML: {e}"));
        let event = reader.read_event().map_err(|e| malformed(reader.error_position(), e.to_string()))?;
        let closed = match event {
            Event::Start(tag) => {
                if open.len() >= MAX_NESTED {
                    return Err(at(begin).error(format!("elements are nested more than {MAX_NESTED} deep")));
                }
                open.push(element(&tag, &at(begin), &mut nodes)?);
                continue;
            }
            Event::Empty(tag) => element(&tag, &at(begin), &mut nodes)?,
            Event::End(_) => open.pop().ok_or_else(|| malformed(begin as u64, "an end tag without its start".into()))?,
            Event::Eof => break,
            _ => continue,
        };
        match open.last_mut() {
            Some(parent) => parent.children.push(closed),
            None if root.is_none() => root = Some(closed),
            None => return Err(at(begin).error(format!("found <{}> after the end of the scene", closed.tag))),
        }
    }
    if let Some(unclosed) = open.last() {
        return Err(Error::at_line(path, unclosed.line, format!("not well-formed XML: <{}> is not closed", unclosed.tag)));
    }
    let root = root.ok_or_else(|| Error::at_line(path, 1, "not well-formed XML: no element found"))?;
    Ok((root, odd))
}

fn element(start: &BytesStart, at: &Location, nodes: &mut usize) -> Result<Element> {
    let tag = start.name().as_ref().to_owned();
    let mut attributes = Vec::new();
    // No look for attributes given twice: it would compare each with all.
    for attribute in start.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| at.error(format!("not well-formed XML: attributes of <{tag}>: {e}")))?;
        attributes.push((attribute.key.as_ref().to_owned(), unescape(&attribute.value)));
    }
    *nodes += 1 + attributes.len();
    if *nodes > MAX_NODES {
        return Err(at.error(format!("the file has more than {MAX_NODES} elements and attributes")));
    }
    Ok(Element { tag, attributes, line: at.line, children: Vec::new() })
}

/// Replaces XML's own entities and character codes; an `&` that begins neither stands for itself.
fn unescape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(and) = rest.find('&') {
        out.push_str(&rest[..and]);
        rest = &rest[and..];
        let known = rest.find(';').filter(|&end| end <= 12).and_then(|end| {
            let name = &rest[1..end];
            let code = name.strip_prefix('#').and_then(|digits| match digits.strip_prefix(['x', 'X']) {
                Some(hex) => u32::from_str_radix(hex, 16).ok(),
                None => digits.parse().ok(),
            });
            let code = code.and_then(char::from_u32).map(String::from);
            code.or_else(|| resolve_xml_entity(name).map(str::to_owned)).map(|meant| (meant, end + 1))
        });
        match known {
            Some((meant, length)) => {
                out.push_str(&meant);
                rest = &rest[length..];
            }
            None => {
                out.push('&');
                rest = &rest[1..];
            }
        }
    }
    out.push_str(rest);
    // Line ends and tabs in an attribute are spaces.
    out.replace(['\n', '\r', '\t'], " ")
}

/// The text of a file: by its byte order mark, by how its first bytes look, by what it declares, else UTF-8. What claims to be UTF-8
/// and is not is taken for Windows' Latin-1, with a word of it.
fn decode(path: &Path, bytes: &[u8]) -> Result<(String, Option<String>)> {
    let (encoding, bytes) = match Encoding::for_bom(bytes) {
        Some((encoding, length)) => (encoding, &bytes[length..]),
        None => (guess(bytes), bytes),
    };
    if encoding == encoding_rs::UTF_8 {
        return Ok(match std::str::from_utf8(bytes) {
            Ok(text) => (text.to_owned(), None),
            Err(e) => {
                let line = bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() + 1;
                let odd = format!("{}:{line}: not UTF-8 text, and no other encoding declared: taken for Latin-1", path.display());
                (encoding_rs::WINDOWS_1252.decode_without_bom_handling(bytes).0.into_owned(), Some(odd))
            }
        });
    }
    let (text, bad) = encoding.decode_without_bom_handling(bytes);
    if bad {
        return Err(Error::input(path, format!("the text is not {} as it says", encoding.name())));
    }
    Ok((text.into_owned(), None))
}

fn guess(bytes: &[u8]) -> &'static Encoding {
    match bytes {
        [b'<', 0, ..] => return encoding_rs::UTF_16LE,
        [0, b'<', ..] => return encoding_rs::UTF_16BE,
        _ => {}
    }
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(400)]);
    let declared = head.trim_start().strip_prefix("<?xml").and_then(|rest| {
        let rest = rest.split_once("?>")?.0.split_once("encoding")?.1.trim_start().strip_prefix('=')?.trim_start();
        let quote = rest.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        rest[1..].split(quote).next()
    });
    // What can be read as bytes is not UTF-16, whatever it says: some programs declare that and write UTF-8.
    let known = declared.and_then(|label| Encoding::for_label(label.trim().as_bytes()));
    known.filter(|e| *e != encoding_rs::UTF_16LE && *e != encoding_rs::UTF_16BE).unwrap_or(encoding_rs::UTF_8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<(Element, Option<String>)> {
        parse(Path::new("s.xml"), bytes)
    }

    fn utf16(text: &str, big: bool, mark: bool) -> Vec<u8> {
        let units = mark.then_some(0xfeff).into_iter().chain(text.encode_utf16());
        units.flat_map(|u| if big { u.to_be_bytes() } else { u.to_le_bytes() }).collect()
    }

    #[test]
    fn encodings_are_those_of_the_mark_the_bytes_or_the_declaration() {
        let plain = |encoding: &str| format!("<?xml version='1.0' encoding='{encoding}'?>\n<a b='\u{e9}\u{df}'/>");
        let latin = |encoding: &str| encoding_rs::WINDOWS_1252.encode(&plain(encoding)).0.into_owned();
        let files = [
            plain("utf-8").into_bytes(),
            ["\u{feff}", &plain("utf-8")].concat().into_bytes(),
            plain("utf-16").into_bytes(),
            plain("nonsense").into_bytes(),
            latin("ISO-8859-1"),
            latin("windows-1252"),
            utf16(&plain("utf-16"), false, true),
            utf16(&plain("utf-16"), true, true),
            utf16(&plain("utf-16"), false, false),
            utf16(&plain("UTF-16"), true, false),
        ];
        for (i, bytes) in files.iter().enumerate() {
            let (root, odd) = read(bytes).unwrap_or_else(|e| panic!("file {i}: {e}"));
            assert_eq!((root.attribute("b"), root.line, odd), (Some("\u{e9}\u{df}"), 2, None), "file {i}");
        }
        let (root, odd) = read(&latin("utf-8")).unwrap();
        assert_eq!(root.attribute("b"), Some("\u{e9}\u{df}"));
        assert!(odd.unwrap().starts_with("s.xml:2: not UTF-8"));
        assert!(read(&utf16("<a/>", false, true)[..9]).is_err(), "half a character");
    }

    #[test]
    fn what_mitsuba_passes_over_is_passed_over() {
        let text =
            "\n\n<?xml version='1.0'?>\n<!DOCTYPE a [ <!ELEMENT a (b)> <!ENTITY big '&big;&big;'> ]>\n<!-- a -- b --->\n<?p q?>
            <a x='1 < 2 & 3' y='&lt;&#65;&#x42;&big;&' x='second'><![CDATA[<no/>]]>text &big;<b z='p\nq'/></a>\n";
        let (root, _) = read(text.as_bytes()).unwrap();
        assert_eq!((root.tag.as_str(), root.line), ("a", 7));
        assert_eq!((root.attribute("x"), root.attribute("y")), (Some("1 < 2 & 3"), Some("<AB&big;&")));
        assert_eq!((root.children.len(), root.children[0].attribute("z")), (1, Some("p q")));
    }

    #[test]
    fn broken_text_is_an_error_with_its_line() {
        for (text, expected) in [
            ("", "s.xml:1"),
            ("words", "s.xml:1"),
            ("<a>\n<b></a>", "s.xml:2"),
            ("<a>\n<b>", "s.xml:2: not well-formed XML: <b> is not closed"),
            ("\n<a", "s.xml:2"),
            ("\n<a b>", "s.xml:2"),
            ("\n<a b=c/>", "s.xml:2"),
            ("<a/>\n</a>", "s.xml:2"),
            ("<a/>\n<b/>", "s.xml:2: found <b> after the end"),
            ("<a>\n<!-- ", "s.xml:2"),
        ] {
            let message = read(text.as_bytes()).expect_err(text).to_string();
            assert!(message.starts_with(expected), "{text:?}: {message}");
        }
        assert!(read("<a>".repeat(100_000).as_bytes()).unwrap_err().to_string().contains("nested more than"));
    }

    #[test]
    fn many_attributes_take_linear_time() {
        let many: String = (0..200_000).map(|i| format!(" a{i}='{i}'")).collect();
        let start = std::time::Instant::now();
        let (root, _) = read(format!("<a{many}/>").as_bytes()).unwrap();
        assert_eq!(root.attribute("a199999"), Some("199999"));
        assert!(start.elapsed().as_secs() < 10, "{:?}", start.elapsed());
    }
}
