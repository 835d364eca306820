//! `--set NAME=VALUE`: any field of a parameter struct, by its dotted name.

use anyhow::{Context, anyhow, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// `params` with the fields that `sets` names replaced. Values are JSON; a bare word is a string.
pub fn apply<T: Serialize + DeserializeOwned>(params: &T, sets: &[String]) -> anyhow::Result<T> {
    let mut tree = serde_json::to_value(params)?;
    for set in sets {
        let (name, text) = set.split_once('=').with_context(|| format!("--set {set}: expected NAME=VALUE"))?;
        let value = serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.into()));
        let slot = find(&mut tree, name).ok_or_else(|| anyhow!("--set {set}: no such parameter; there are\n{}", list(params)))?;
        *slot = value;
        if let Err(e) = serde_json::from_value::<T>(tree.clone()) {
            bail!("--set {set}: {e}");
        }
    }
    Ok(serde_json::from_value(tree)?)
}

/// The parts of a list with commas between them; commas within brackets are JSON's.
pub fn split(text: &str) -> Vec<String> {
    let mut depth = 0usize;
    let parts = text.split(|c| {
        depth = match c {
            '[' | '{' => depth + 1,
            ']' | '}' => depth.saturating_sub(1),
            _ => depth,
        };
        c == ',' && depth == 0
    });
    parts.filter(|part| !part.is_empty()).map(str::to_owned).collect()
}

fn find<'a>(tree: &'a mut Value, name: &str) -> Option<&'a mut Value> {
    name.split('.').try_fold(tree, |node, key| match node {
        Value::Object(fields) => fields.get_mut(key),
        Value::Array(items) => items.get_mut(key.parse::<usize>().ok()?),
        _ => None,
    })
}

/// All parameters with their values, a line each.
pub fn list(params: &impl Serialize) -> String {
    let mut lines = Vec::new();
    walk("", &serde_json::to_value(params).unwrap_or_default(), &mut lines);
    lines.join("\n")
}

fn walk(prefix: &str, node: &Value, lines: &mut Vec<String>) {
    let name = |key: &str| if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") };
    match node {
        Value::Object(fields) => fields.iter().for_each(|(k, v)| walk(&name(k), v, lines)),
        Value::Array(items) if items.iter().any(Value::is_object) => {
            items.iter().enumerate().for_each(|(i, v)| walk(&name(&i.to_string()), v, lines));
        }
        leaf => lines.push(format!("  {prefix}={leaf}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use reprobe::method::glossy_probes::GlossyProbeParams;

    #[test]
    fn lists_are_split_outside_of_brackets() {
        let search = r#"gather.search=[{"radius":1,"step":4},{"radius":1,"step":2}]"#;
        let parts = split(&format!("gather.probes=1,{search}"));
        assert_eq!(parts, ["gather.probes=1", search]);
        assert_eq!(apply(&GlossyProbeParams::default(), &parts).unwrap().gather.search.len(), 2);
        assert!(split("").is_empty());
    }

    #[test]
    fn fields_are_set_by_name_and_wrong_names_list_the_right_ones() {
        let base = GlossyProbeParams::default();
        let set = |s: &str| apply(&base, &[s.to_owned()]);
        assert_eq!(set("gather.falloff=4").unwrap().gather.falloff, 4.0);
        assert_eq!(set("gather.search.0.radius=1").unwrap().gather.search[0].radius, 1);
        assert!(set("footprint=null").unwrap().footprint.is_none());
        let message = set("gather.fallof=4").unwrap_err().to_string();
        assert!(message.contains("gather.falloff=128"), "{message}");
        assert!(set("gather.falloff=many").is_err());
        assert!(set("gather.falloff").is_err());
        let paper = GlossyProbeParams::paper();
        assert_eq!(apply(&paper, &[]).unwrap(), paper, "a parameter that JSON cannot say");
    }
}
