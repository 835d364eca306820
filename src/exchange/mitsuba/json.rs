//! Mitsuba 3's dictionary form as JSON, into the plugin tree.
//!
//! A dictionary with a `type` is a plugin; keys name properties and children, and a child directly under the scene goes by
//! its key as id. `{"type": "rgb", "value": [r, g, b]}`, `{"type": "spectrum", ...}` and `{"type": "ref", "id": ...}` are
//! values. Ours: a transform is a 4x4 matrix (rows), for `to_uv` also 3x3, or a list of steps such as
//! `[{"scale": 2}, {"rotate": {"axis": [0, 1, 0], "angle": 90}}, {"translate": [1, 0, 0]},
//! {"look_at": {"origin": [..], "target": [..], "up": [..]}}, {"matrix": [[..]..]}]`.

use super::spectrum;
use super::transform::Steps;
use super::tree::{Folders, Kind, Lines, Location, MAX_DEPTH, Node, Param, Parsed, Value, snake_case};
use crate::{Error, Result};
use glam::{DMat4, DVec3};
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;
use std::path::Path;
use std::sync::Arc;

/// Parses the text of a file.
pub fn parse(path: &Path, text: &str, defines: &[(String, String)]) -> Result<Parsed> {
    // Some editors begin a file with a byte order mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let root: &RawValue =
        serde_json::from_str(text).map_err(|e| Error::at_line(path, e.line() as u32, format!("not well-formed JSON: {e}")))?;
    let reader = Reader { text, lines: Lines::new(text), file: path.into(), folders: Folders::of(path) };
    let at = reader.at(root);
    match reader.value("", root, None, 0)? {
        Value::Plugin(node) if node.plugin == "scene" => {
            let ignored = |(name, value): &(String, String)| {
                format!("{}: --define {name}={value} is ignored: JSON scenes have no parameters", path.display())
            };
            Ok(Parsed { children: node.params, warnings: defines.iter().map(ignored).collect() })
        }
        other => Err(at.error(format!("found {}, expected {{\"type\": \"scene\", ...}}", other.describe()))),
    }
}

struct Reader<'a> {
    text: &'a str,
    lines: Lines,
    file: Arc<Path>,
    folders: Folders,
}

/// A dictionary in file order.
struct Dictionary<'a>(Vec<(String, &'a RawValue)>);

impl<'de> Deserialize<'de> for Dictionary<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = Dictionary<'de>;
            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("a dictionary")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> std::result::Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Dictionary(entries))
            }
        }
        deserializer.deserialize_map(Entries)
    }
}

impl<'a> Reader<'a> {
    /// A raw value is a slice of the text, so its place in memory tells its place in the file.
    fn at(&self, raw: &RawValue) -> Location {
        let offset = (raw.get().as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        Location { file: self.file.clone(), line: self.lines.at(offset) }
    }

    fn read<T: Deserialize<'a>>(&self, raw: &'a RawValue, expected: &str) -> Result<T> {
        let found: String = raw.get().chars().take(40).collect();
        serde_json::from_str(raw.get()).map_err(|_| self.at(raw).error(format!("found {found}, expected {expected}")))
    }

    fn value(&self, key: &str, raw: &'a RawValue, parent: Option<Kind>, depth: usize) -> Result<Value> {
        let at = self.at(raw);
        if depth > MAX_DEPTH {
            return Err(at.error(format!("dictionaries are nested more than {MAX_DEPTH} deep")));
        }
        match raw.get().as_bytes().first() {
            Some(b'{') => self.dictionary(key, raw, depth),
            Some(b'[') => self.list(key, raw),
            Some(b'"') => {
                let text: String = self.read(raw, "a string")?;
                let names_a_file = key == "filename" && matches!(parent, Some(Kind::Shape | Kind::Texture | Kind::Emitter));
                Ok(if names_a_file { Value::File(self.folders.find(&text, &at)?) } else { Value::Text(text) })
            }
            Some(b't' | b'f') => Ok(Value::Bool(self.read(raw, "true or false")?)),
            Some(b'n') => Err(at.error(format!("\"{key}\" is null: leave it out"))),
            _ => match serde_json::from_str::<i64>(raw.get()) {
                Ok(i) => Ok(Value::Integer(i)),
                Err(_) => Ok(Value::Float(self.number(raw)?)),
            },
        }
    }

    fn number(&self, raw: &'a RawValue) -> Result<f64> {
        spectrum::number(raw.get()).map_err(|m| self.at(raw).error(m))
    }

    fn dictionary(&self, key: &str, raw: &'a RawValue, depth: usize) -> Result<Value> {
        let at = self.at(raw);
        let Dictionary(entries) = self.read(raw, "a dictionary")?;
        let mut seen = std::collections::BTreeSet::new();
        for (name, value) in &entries {
            if !seen.insert(name.as_str()) {
                return Err(self.at(value).error(format!("the key \"{name}\" is here twice")));
            }
        }
        let get = |name: &str| entries.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
        let need = |name: &str| get(name).ok_or_else(|| at.error(format!("\"{key}\" has no \"{name}\"")));
        let plugin: String = self.read(need("type")?, "a string, the plugin's type")?;
        match plugin.as_str() {
            "ref" => return Ok(Value::Reference(self.read(need("id")?, "a string, an id")?)),
            "rgb" => return self.rgb(need("value")?),
            "uniform" => return Ok(Value::Float(self.number(need("value")?)?)),
            "spectrum" => {
                return match get("filename") {
                    Some(name) => spectrum::parse_file(&self.folders.find(&self.read::<String>(name, "a string")?, &at)?),
                    None => self.spectrum(need("value")?),
                };
            }
            _ => {}
        }
        let is_scene = plugin == "scene" && depth == 0;
        let kind = match is_scene {
            true => Kind::Other,
            false => Kind::from_plugin(&plugin, key).unwrap_or(Kind::Unsupported),
        };
        let mut id = get("id").map(|v| self.read(v, "a string, an id")).transpose()?;
        if depth == 1 && id.is_none() {
            id = Some(key.to_owned());
        }
        let mut params = Vec::new();
        for (name, value) in &entries {
            if !matches!(name.as_str(), "type" | "id") {
                let parent = (!is_scene).then_some(kind);
                // Directly under the scene a key is an id.
                let name = if is_scene { name.clone() } else { snake_case(name) };
                let parsed = self.value(&name, value, parent, depth + 1)?;
                params.push(Param { name, at: self.at(value), value: parsed });
            }
        }
        Ok(Value::Plugin(Node { kind, plugin, id, at, params }))
    }

    fn rgb(&self, raw: &'a RawValue) -> Result<Value> {
        let color = match raw.get().as_bytes().first() {
            Some(b'[') => self.vector(raw)?.as_vec3(),
            Some(b'"') => spectrum::rgb(&self.read::<String>(raw, "a colour")?).map_err(|m| self.at(raw).error(m))?,
            _ => glam::Vec3::splat(self.number(raw)? as f32),
        };
        Ok(Value::Color(color))
    }

    fn spectrum(&self, raw: &'a RawValue) -> Result<Value> {
        let at = self.at(raw);
        match raw.get().as_bytes().first() {
            Some(b'[') => {
                let pairs: Vec<[&RawValue; 2]> = self.read(raw, "a list of [wavelength, value]")?;
                let pairs = pairs.into_iter().map(|[w, v]| Ok((self.number(w)?, self.number(v)?)));
                spectrum::ascending(pairs.collect::<Result<_>>()?).map_err(|m| at.error(m))
            }
            Some(b'"') => spectrum::parse(&self.read::<String>(raw, "a spectrum")?).map_err(|m| at.error(m)),
            _ => Ok(Value::Uniform(self.number(raw)?)),
        }
    }

    fn vector(&self, raw: &'a RawValue) -> Result<DVec3> {
        let [x, y, z]: [&RawValue; 3] = self.read(raw, "three numbers")?;
        Ok(DVec3::new(self.number(x)?, self.number(y)?, self.number(z)?))
    }

    fn list(&self, key: &str, raw: &'a RawValue) -> Result<Value> {
        let at = self.at(raw);
        let items: Vec<&RawValue> = self.read(raw, "a list")?;
        if key == "to_world" || key == "to_uv" {
            let is_steps = items.is_empty() || items[0].get().starts_with('{');
            let done = if is_steps { self.steps(&items)? } else { self.matrix(raw, &items)? };
            return Ok(Value::Transform(done));
        }
        if key == "values" || key == "wavelengths" {
            let numbers: Vec<String> = items.iter().map(|n| self.number(n).map(|x| x.to_string())).collect::<Result<_>>()?;
            return Ok(Value::Text(numbers.join(" ")));
        }
        match items.len() {
            3 => Ok(Value::Vector(self.vector(raw)?)),
            n => Err(at.error(format!("\"{key}\": found a list of {n}, expected three numbers"))),
        }
    }

    fn matrix(&self, raw: &'a RawValue, items: &[&'a RawValue]) -> Result<DMat4> {
        let at = self.at(raw);
        let mut rows = Vec::new();
        for item in items {
            match item.get().starts_with('[') {
                true => {
                    for cell in self.read::<Vec<&RawValue>>(item, "a row of the matrix")? {
                        rows.push(self.number(cell)?);
                    }
                }
                false => rows.push(self.number(item)?),
            }
        }
        if let &[a, b, tx, c, d, ty, 0.0, 0.0, 1.0] = rows.as_slice() {
            // 3x3 acts on homogeneous uv.
            rows = vec![a, b, 0.0, tx, c, d, 0.0, ty, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        }
        let mut steps = Steps::default();
        steps.matrix(&rows).and_then(|()| steps.finish()).map_err(|m| at.error(m))
    }

    fn steps(&self, items: &[&'a RawValue]) -> Result<DMat4> {
        let mut steps = Steps::default();
        for item in items {
            let at = self.at(item);
            let Dictionary(entries) = self.read(item, "a step of the transform")?;
            let [(name, raw)] = entries.as_slice() else {
                return Err(at.error("expected one of translate, scale, rotate, look_at, matrix"));
            };
            let done = match name.as_str() {
                "translate" => steps.translate(self.vector(raw)?),
                "scale" if raw.get().starts_with('[') => steps.scale(self.vector(raw)?),
                "scale" => steps.scale(DVec3::splat(self.number(raw)?)),
                "rotate" => {
                    let argument = self.arguments(raw, &["axis", "angle"])?;
                    steps.rotate(self.vector(argument[0])?, self.number(argument[1])?)
                }
                "look_at" => {
                    let argument = self.arguments(raw, &["origin", "target", "up"])?;
                    steps.look_at(self.vector(argument[0])?, self.vector(argument[1])?, Some(self.vector(argument[2])?))
                }
                "matrix" => {
                    let m = self.matrix(raw, &self.read::<Vec<&RawValue>>(raw, "a matrix")?)?;
                    steps.matrix(&m.transpose().to_cols_array())
                }
                other => {
                    return Err(at.error(format!("found \"{other}\", expected translate, scale, rotate, look_at or matrix")));
                }
            };
            done.map_err(|m| at.error(m))?;
        }
        let finished = steps.finish();
        finished.map_err(|m| items.first().map_or_else(|| Error::input(&self.file, m.clone()), |i| self.at(i).error(m.clone())))
    }

    fn arguments(&self, raw: &'a RawValue, names: &[&str]) -> Result<Vec<&'a RawValue>> {
        let Dictionary(entries) = self.read(raw, "a dictionary")?;
        let find = |name: &&str| {
            let found = entries.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
            found.ok_or_else(|| self.at(raw).error(format!("\"{name}\" is missing")))
        };
        names.iter().map(find).collect()
    }
}
