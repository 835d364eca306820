//! What the pages of `compare` and `evaluate` share: `view.css` and `view.js` (pictures that zoom and move together, values below the
//! pointer, keys, the choice in the address), and how data get into a page.

use crate::io::{Provenance, read_text};
use crate::{Error, Result};
use serde::Serialize;
use serde_json::{Deserializer, Value};
use std::path::Path;

/// What stands before the data, in the page of `compare` and in that of `evaluate`.
const BEFORE: [&str; 2] = ["const data = {", "id=\"data\">{"];

/// The page of `template`, without outside resources, with `data` in it.
pub fn page(template: &str, data: &impl Serialize) -> Result<String> {
    let data = serde_json::to_string(data).map_err(|e| Error::Request(format!("report: {e}")))?;
    // "</script>" in a name must not end the script; JSON allows this escape.
    let data = data.replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029");
    let template = template.replace("/* view.css */", include_str!("view.css")).replace("// view.js", include_str!("view.js"));
    Ok(template.replace("{\"data\": \"goes here\"}", &data))
}

/// Where a page came from; `None` of one that is not ours, or does not say.
///
/// # Errors
/// The file cannot be read, or its data are damaged.
pub fn page_provenance(path: &Path) -> Result<Option<Provenance>> {
    let text = read_text(path)?;
    let Some(at) = BEFORE.iter().filter_map(|b| text.find(b).map(|at| at + b.len() - 1)).min() else { return Ok(None) };
    let fail = |e: serde_json::Error| Error::input(path, format!("the data of the page: {e}"));
    let data: Value = Deserializer::from_str(&text[at..]).into_iter().next().transpose().map_err(fail)?.unwrap_or_default();
    let found = [&data["provenance"], &data["evaluation"]["provenance"]].into_iter().find(|p| !p.is_null());
    found.map(|p| serde_json::from_value(p.clone()).map_err(fail)).transpose()
}

#[cfg(test)]
pub mod tests {
    /// What a page must have for phones, keyboards and readers of screens, as far as its text tells. `scripts/check_reports.mjs`
    /// tries the rest in a browser.
    pub fn is_usable_by_all(page: &str) {
        assert!(page.contains("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"));
        assert!(!page.contains("goes here") && !page.contains("http"), "self-contained");
        for script in ["/* view.css */", "// view.js\n"] {
            assert!(!page.contains(script), "{script} is filled in");
        }
        let body = page.split("<script").next().unwrap();
        let tags = |name: &str| -> Vec<String> {
            let tag = |rest: &str| rest.split_inclusive('>').take(2).collect();
            body.split(&format!("<{name} ")).skip(1).map(tag).collect()
        };
        for (name, least) in [("img", 3), ("canvas", 0), ("button", 3), ("select", 1), ("input", 1)] {
            let tags = tags(name);
            assert!(tags.len() >= least, "{name}: {tags:?}");
            for tag in tags {
                let named =
                    ["alt=\"", "aria-label=\""].iter().any(|a| tag.split(a).nth(1).is_some_and(|text| !text.starts_with('"')));
                // A button has its text, a list of choices may stand in its label.
                let text = tag.split('>').nth(1).is_some_and(|t| t.starts_with(|c: char| c.is_alphabetic()));
                assert!(
                    named || (text && name == "button") || body.contains(&format!(" <select id=\"{}", id(&tag))),
                    "{name} {tag}"
                );
            }
        }
        for rule in ["touch-action: pan-y", ":focus-visible", "overflow: auto"] {
            assert!(page.contains(rule), "{rule}");
        }
    }

    fn id(tag: &str) -> &str {
        tag.split("id=\"").nth(1).and_then(|t| t.split('"').next()).unwrap_or("?")
    }
}
