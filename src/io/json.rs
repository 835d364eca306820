//! JSON files with a checksum.

use super::{atomic, seal};
use crate::{Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;

/// Writes an object in one step: indented, with its checksum first and a newline at its end.
pub fn write(path: &Path, value: &impl Serialize) -> Result<()> {
    let fail = |e: serde_json::Error| Error::input(path, e.to_string());
    // By way of its text, in which a float has no more digits than it needs.
    let members = serde_json::from_str(&serde_json::to_string(value).map_err(fail)?).map_err(fail)?;
    let mut text = serde_json::to_string_pretty(&seal::sealed(members)).map_err(fail)?;
    text.push('\n');
    atomic::write(path, text.as_bytes())
}

/// What the text of a file says.
///
/// # Errors
/// It is no such object, or not the one that was written.
pub fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    let fail = |e: serde_json::Error| Error::at_line(path, e.line() as u32, e.to_string());
    if let Value::Object(object) = serde_json::from_str(text).map_err(fail)? {
        seal::check_object(path, object)?;
    }
    serde_json::from_str(text).map_err(fail)
}

/// What a file says that people write, without a checksum.
///
/// # Errors
/// It is no JSON, or not of the type, with the line.
pub fn written_by_hand<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    serde_json::from_str(text).map_err(|e| {
        // Without serde_json's own " at line L column C", as the error says the line itself.
        let message = e.to_string();
        let message = message.split(" at line ").next().unwrap_or_default().to_owned();
        Error::at_line(path, e.line() as u32, message)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_changed_value_is_found_and_another_layout_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        write(&path, &json!({"a": [0.1f32, 1e-30, 7], "b": {"c": "text"}})).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let value: Value = parse(&path, &text).unwrap();
        assert_eq!(value["a"][2], 7);
        assert_eq!(parse::<Value>(&path, &value.to_string()).unwrap(), value);
        for (from, to) in [
            ("7", "6"),
            ("text", "test"),
            ("\"c\"", "\"d\""),
            ("\"checksum\": \"", "\"checksum\": \"f"),
            ("checksum", "chucksum"),
        ] {
            let message = parse::<Value>(&path, &text.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(message.contains("has changed since it was written"), "{from}: {message}");
        }
        // What others write has none.
        parse::<Value>(&path, r#"{"a": 1}"#).unwrap();
    }

    #[test]
    fn floats_have_the_digits_they_need() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        #[derive(Serialize)]
        struct One {
            x: f32,
        }
        write(&path, &One { x: 0.1 }).unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().contains("\"x\": 0.1\n"));
    }
}
