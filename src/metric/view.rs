//! What the pages of `compare` and `evaluate` share: `view.css` and `view.js` (pictures that zoom and move together, values below the
//! pointer, keys, the choice in the address), and how data get into a page.

use crate::{Error, Result};
use serde::Serialize;

/// The page of `template`, without outside resources, with `data` in it.
pub fn page(template: &str, data: &impl Serialize) -> Result<String> {
    let data = serde_json::to_string(data).map_err(|e| Error::Request(format!("report: {e}")))?;
    // "</script>" in a name must not end the script; JSON allows this escape.
    let data = data.replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029");
    let template = template.replace("/* view.css */", include_str!("view.css")).replace("// view.js", include_str!("view.js"));
    Ok(template.replace("{\"data\": \"goes here\"}", &data))
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
