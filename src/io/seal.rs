//! A checksum within the file it is of, so that nobody takes a file that was damaged for a result.
//!
//! An EXR file has it at the start of its attribute `provenance`: blake3 of all bytes, with its own digits taken for zeros. A JSON
//! file has it in front of its other members: blake3 of their compact text, so that it may be indented anew.

use crate::{Error, Result};
use serde_json::{Map, Value};
use std::path::Path;

/// The member's name.
const NAME: &str = "checksum";
/// Digits before there is a checksum.
const BLANK: [u8; 64] = [b'0'; 64];
/// What stands before the digits in an EXR file.
const BEFORE: &[u8] = br#"{"checksum":""#;
/// What follows the digits there: the first member of a provenance.
const AFTER: &[u8] = br#"","version":"#;
/// Bytes of a file within which its head ends.
pub const HEAD: usize = 1 << 16;

/// Opens a JSON object with blank digits; its other members follow.
pub fn blank(members: &str) -> String {
    let digits = String::from_utf8_lossy(&BLANK);
    format!(r#"{{"{NAME}":"{digits}",{}"#, members.trim_start_matches('{'))
}

/// Fills in the digits of an EXR file.
pub fn seal(bytes: &mut [u8]) {
    if let Some(at) = place(bytes) {
        let sum = sum(bytes, at);
        bytes[at..at + BLANK.len()].copy_from_slice(sum.as_bytes());
    }
}

/// Whether an EXR file is as it was written; `None` where it has no checksum.
pub fn holds(bytes: &[u8]) -> Option<bool> {
    match place(bytes) {
        Some(at) => Some(bytes[at..at + BLANK.len()] == *sum(bytes, at).as_bytes()),
        None => is_misnamed(bytes).then_some(false),
    }
}

/// Whether a checksum stands in an EXR file's head whose name has changed: digits, and after them what follows ours.
fn is_misnamed(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD)];
    let before = |at: usize| Some(&head[at.checked_sub(BLANK.len())?..at]);
    find(head, AFTER).and_then(before).is_some_and(|digits| digits.iter().all(u8::is_ascii_hexdigit))
}

/// An error where an EXR file has changed since it was written. One without a checksum may be anybody's.
pub fn check(path: &Path, bytes: &[u8]) -> Result<()> {
    if holds(bytes) == Some(false) { Err(changed(path)) } else { Ok(()) }
}

/// Whether the head of a file has a checksum, of whatever it is.
pub fn is_sealed(head: &[u8]) -> bool {
    let digits = |word: &[u8]| head.get(find(head, word)? + word.len()..)?.first_chunk::<{ BLANK.len() }>();
    let is_sum = |word: &[u8]| digits(word).is_some_and(|digits| digits.iter().all(u8::is_ascii_hexdigit));
    is_sum(&BEFORE[1..]) || is_sum(br#""checksum": ""#)
}

/// Where the digits stand.
fn place(bytes: &[u8]) -> Option<usize> {
    let at = find(&bytes[..bytes.len().min(HEAD)], BEFORE)? + BEFORE.len();
    (at + BLANK.len() <= bytes.len()).then_some(at)
}

fn find(bytes: &[u8], word: &[u8]) -> Option<usize> {
    bytes.windows(word.len()).position(|w| w == word)
}

fn sum(bytes: &[u8], at: usize) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes[..at]).update(&BLANK).update(&bytes[at + BLANK.len()..]);
    hasher.finalize().to_hex().to_string()
}

fn changed(path: &Path) -> Error {
    Error::input(path, "has changed since it was written: its checksum is of something else; make it again")
}

/// The object with its checksum in front.
pub fn sealed(members: Map<String, Value>) -> Map<String, Value> {
    let sum = sum_of(&members);
    std::iter::once((NAME.to_owned(), sum.into())).chain(members).collect()
}

/// An error where an object has changed since it was [`sealed`].
pub fn check_object(path: &Path, mut object: Map<String, Value>) -> Result<()> {
    // The first member of an object that was sealed, by whatever name a change has left it.
    let is_sum =
        |value: &Value| value.as_str().is_some_and(|s| s.len() == BLANK.len() && s.bytes().all(|b| b.is_ascii_hexdigit()));
    let is_misnamed = object.values().next().is_some_and(is_sum);
    match object.shift_remove(NAME) {
        Some(found) if found != sum_of(&object) => Err(changed(path)),
        None if is_misnamed => Err(changed(path)),
        _ => Ok(()),
    }
}

fn sum_of(members: &Map<String, Value>) -> String {
    let text = serde_json::to_string(members).unwrap_or_default();
    blake3::hash(text.as_bytes()).to_hex().to_string()
}
