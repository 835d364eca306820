//! Parameters by name: any field of a parameter struct, by its dotted name, and the range that it may have.

use crate::{Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::fmt::Display;
use std::ops::RangeInclusive;

/// A struct of parameters that knows what it may hold.
pub trait Parameters: Serialize + DeserializeOwned {
    /// An error where a parameter is out of its range.
    fn validate(&self) -> Result<()>;
}

/// The words for an enumeration's values, both ways.
macro_rules! words {
    ($type:ident { $($value:ident $word:literal),+ }) => {
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str(match self { $(Self::$value => $word),+ })
            }
        }

        impl std::str::FromStr for $type {
            type Err = String;

            fn from_str(text: &str) -> std::result::Result<Self, String> {
                match text {
                    $($word => Ok(Self::$value),)+
                    _ => Err(format!("expected one of {}", [$($word),+].join(", "))),
                }
            }
        }
    };
}
pub(crate) use words;

/// An error where `value` is not in `range`; no range holds a NaN.
pub fn within<T: PartialOrd + Display>(name: &str, value: T, range: RangeInclusive<T>) -> Result<()> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Error::Request(format!("{name}={value}: expected {} to {}", range.start(), range.end())))
}

/// `params` with the fields that `sets` (NAME=VALUE) names replaced, all within their ranges. Values are JSON; a bare word is a string.
pub fn apply<T: Parameters>(params: &T, sets: &[String]) -> Result<T> {
    let mut tree = tree(params)?;
    for set in sets {
        let (name, text) = set.split_once('=').ok_or_else(|| Error::Request(format!("--set {set}: expected NAME=VALUE")))?;
        let value = value(text);
        let slot = find(&mut tree, name)
            .ok_or_else(|| Error::Request(format!("--set {set}: no such parameter; there are\n{}", list(params))))?;
        *slot = value;
        read::<T>(&tree).map_err(|e| Error::Request(format!("--set {set}: {e}")))?.validate().map_err(|e| match sets.len() {
            1 => e,
            _ => Error::Request(format!("--set {set}: {e}")),
        })?;
    }
    let params: T = read(&tree).map_err(|e| Error::Request(e.to_string()))?;
    params.validate()?;
    Ok(params)
}

/// What a text says: JSON, a number as people write it (.5), or itself.
fn value(text: &str) -> Value {
    let number = || text.parse().ok().and_then(serde_json::Number::from_f64).map(Value::Number);
    serde_json::from_str(text).ok().or_else(number).unwrap_or_else(|| Value::String(text.into()))
}

/// Parameters as JSON.
pub fn tree(params: &impl Serialize) -> Result<Value> {
    serde_json::to_value(params).map_err(|e| Error::Request(e.to_string()))
}

fn read<T: DeserializeOwned>(tree: &Value) -> serde_json::Result<T> {
    serde_json::from_value(tree.clone())
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
    use serde::Deserialize;

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Level {
        radius: u32,
        step: f32,
    }

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Example {
        falloff: f32,
        search: Vec<Level>,
        filter: Option<Level>,
    }

    impl Parameters for Example {
        fn validate(&self) -> Result<()> {
            within("falloff", self.falloff, 0.0..=1e6)?;
            within("search: levels", self.search.len(), 1..=8)
        }
    }

    fn example() -> Example {
        Example { falloff: 128.0, search: vec![Level { radius: 3, step: 4.0 }], filter: Some(Level { radius: 1, step: 1.0 }) }
    }

    #[test]
    fn lists_are_split_outside_of_brackets() {
        let search = r#"search=[{"radius":1,"step":4},{"radius":1,"step":2}]"#;
        let parts = split(&format!("falloff=1,{search}"));
        assert_eq!(parts, ["falloff=1", search]);
        assert_eq!(apply(&example(), &parts).unwrap().search.len(), 2);
        assert!(split("").is_empty());
    }

    #[test]
    fn fields_are_set_by_name_and_wrong_names_list_the_right_ones() {
        let set = |s: &str| apply(&example(), &[s.to_owned()]);
        assert_eq!(set("falloff=4").unwrap().falloff, 4.0);
        assert_eq!(set("falloff=.5").unwrap().falloff, 0.5);
        assert_eq!(set("search.0.radius=1").unwrap().search[0].radius, 1);
        assert!(set("filter=null").unwrap().filter.is_none());
        let message = set("fallof=4").unwrap_err().to_string();
        assert!(message.contains("falloff=128") && message.contains("search.0.step=4"), "{message}");
        assert!(set("falloff=many").is_err());
        assert!(set("falloff").is_err());
        assert_eq!(apply(&example(), &[]).unwrap(), example());
    }

    #[test]
    fn what_is_out_of_range_is_refused_and_so_is_what_is_no_number() {
        for (set, expected) in
            [("falloff=-1", "falloff=-1: expected 0 to 1000000"), ("search=[]", "search: levels=0: expected 1 to 8")]
        {
            assert_eq!(apply(&example(), &[set.to_owned()]).unwrap_err().to_string(), expected);
        }
        assert!(within("x", f32::NAN, f32::MIN..=f32::MAX).is_err());
    }
}
