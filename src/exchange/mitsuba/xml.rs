//! Mitsuba XML, from 0.5's camelCase to 3's snake_case, into the plugin tree.
//!
//! Parameters (`default`, `$name`), `include`, `path` and `alias` are resolved here; references stay for later.

use super::document::{self, Element};
use super::spectrum;
use super::transform::Steps;
use super::tree::{Folders, Kind, Location, MAX_DEPTH, Node, Param, Parsed, Value, snake_case};
use crate::io::read_named;
use crate::{Error, Result};
use glam::DVec3;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Deepest chain of `include`s.
const MAX_INCLUDES: usize = 16;
/// Most files of a scene: includes that include twice would multiply without end.
const MAX_FILES: usize = 1000;
/// Most bytes that parameters stand for in all: those of parameters of parameters would multiply without end.
const MAX_STOOD_FOR: usize = 100_000_000;
/// Most parameters that aliases copy.
const MAX_COPIED: usize = 1_000_000;

/// Parses the bytes of a file, and all files that it includes.
pub fn parse(path: &Path, bytes: &[u8], defines: &[(String, String)]) -> Result<Parsed> {
    let mut reader = Reader {
        values: defines.to_vec(),
        used: RefCell::default(),
        folders: Folders::of(path),
        open: Vec::new(),
        files: 0,
        aliases: Vec::new(),
        stood_for: Cell::new(0),
        parsed: Parsed::default(),
    };
    reader.file(path, bytes)?;
    reader.add_aliases()?;
    let used = reader.used.into_inner();
    if let Some((name, value)) = defines.iter().find(|(name, _)| !used.contains(name)) {
        let known: Vec<&str> = used.iter().map(String::as_str).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        let message = format!("--define {name}={value}: the scene has no parameter \"{name}\", expected one of its own: {known}");
        return Err(Error::input(path, message));
    }
    Ok(reader.parsed)
}

struct Reader {
    /// `$name` and what it stands for; the first entry of a name counts.
    values: Vec<(String, String)>,
    /// The names that were asked for, or have a `default`.
    used: RefCell<BTreeSet<String>>,
    folders: Folders,
    /// Files being read, outermost first: to see an include that goes in circles.
    open: Vec<PathBuf>,
    /// Files read so far.
    files: usize,
    /// (id, its second name, where).
    aliases: Vec<(String, String, Location)>,
    /// Bytes that parameters have stood for so far.
    stood_for: Cell<usize>,
    parsed: Parsed,
}

/// The file that an element stands in.
struct Source(Arc<Path>);

impl Source {
    fn at(&self, element: &Element) -> Location {
        Location { file: self.0.clone(), line: element.line }
    }
}

impl Reader {
    fn file(&mut self, path: &Path, bytes: &[u8]) -> Result<()> {
        let (root, odd) = document::parse(path, bytes)?;
        self.parsed.warnings.extend(odd);
        let source = Source(path.into());
        self.open.push(whole(path));
        self.folders.add_of(path);
        match root.tag.as_str() {
            "scene" => {
                for child in &root.children {
                    self.top_level(&source, child)?;
                }
            }
            _ if self.open.len() > 1 => self.top_level(&source, &root)?,
            tag => return Err(source.at(&root).error(format!("found <{tag}>, expected <scene>"))),
        }
        self.open.pop();
        Ok(())
    }

    fn top_level(&mut self, source: &Source, element: &Element) -> Result<()> {
        let at = source.at(element);
        match element.tag.as_str() {
            "default" => {
                let name = self.attribute(&at, element, "name")?;
                let value = self.attribute(&at, element, "value")?;
                self.used.borrow_mut().insert(name.clone());
                if !self.values.iter().any(|(n, _)| *n == name) {
                    self.values.push((name, value));
                }
            }
            "alias" => {
                let (id, second) = (self.attribute(&at, element, "id")?, self.attribute(&at, element, "as")?);
                self.aliases.push((id, second, at));
            }
            "path" => {
                let folder = self.attribute(&at, element, "value")?;
                self.folders.add(&folder, &at)?;
            }
            "include" => {
                let name = self.attribute(&at, element, "filename")?;
                let file = self.folders.find(&name, &at)?;
                if self.open.contains(&whole(&file)) {
                    return Err(at.error(format!("\"{name}\" includes itself")));
                }
                if self.open.len() >= MAX_INCLUDES {
                    return Err(at.error(format!("includes are nested more than {MAX_INCLUDES} deep")));
                }
                self.files += 1;
                if self.files > MAX_FILES {
                    return Err(at.error(format!("more than {MAX_FILES} files are included")));
                }
                self.file(&file, &read_named(&file)?)?;
            }
            _ => {
                let child = self.param(source, element, None, 0)?;
                self.parsed.children.push(child);
            }
        }
        Ok(())
    }

    /// A second name for a plugin is a copy of it under that name.
    fn add_aliases(&mut self) -> Result<()> {
        let mut places = BTreeMap::new();
        for (i, child) in self.parsed.children.iter().enumerate() {
            if let Value::Plugin(Node { id: Some(id), .. }) = &child.value {
                places.entry(id.clone()).or_insert(i);
            }
        }
        let mut copied = 0;
        for (id, second, at) in std::mem::take(&mut self.aliases) {
            let Some(Value::Plugin(node)) = places.get(&id).map(|&i| &self.parsed.children[i].value) else {
                return Err(at.error(format!("alias: nothing has the id \"{id}\"")));
            };
            copied += node.size();
            if copied > MAX_COPIED {
                return Err(at.error(format!("alias: more than {MAX_COPIED} parameters are copied")));
            }
            let node = Node { id: Some(second.clone()), ..node.clone() };
            places.entry(second).or_insert(self.parsed.children.len());
            self.parsed.children.push(Param { name: String::new(), at, value: Value::Plugin(node) });
        }
        Ok(())
    }

    fn param(&self, source: &Source, element: &Element, parent: Option<Kind>, depth: usize) -> Result<Param> {
        let at = source.at(element);
        if depth > MAX_DEPTH {
            return Err(at.error(format!("elements are nested more than {MAX_DEPTH} deep")));
        }
        let name = snake_case(&self.optional(&at, element, "name")?.unwrap_or_default());
        let tag = element.tag.as_str();
        // A spectrum with a type is a plugin, else a value.
        let spectrum = (tag == "spectrum" && element.attribute("type").is_some()).then_some(Kind::Texture);
        if let Some(kind) = Kind::from_tag(tag).or(spectrum) {
            let node = self.plugin(source, element, kind, depth)?;
            return Ok(Param { name, at, value: Value::Plugin(node) });
        }
        let text = || self.attribute(&at, element, "value");
        let value = match tag {
            "ref" => Value::Reference(self.attribute(&at, element, "id")?),
            "boolean" => match text()?.trim() {
                yes if yes.eq_ignore_ascii_case("true") => Value::Bool(true),
                no if no.eq_ignore_ascii_case("false") => Value::Bool(false),
                other => return Err(at.error(format!("found \"{other}\", expected true or false"))),
            },
            "integer" => {
                let text = text()?;
                let bad = |_| at.error(format!("found \"{text}\", expected an integer"));
                Value::Integer(text.trim().parse().map_err(bad)?)
            }
            "float" => Value::Float(number(&at, &text()?)?),
            "string" => {
                let text = text()?;
                let names_a_file = name == "filename" && matches!(parent, Some(Kind::Shape | Kind::Texture | Kind::Emitter));
                if names_a_file { Value::File(self.folders.find(&text, &at)?) } else { Value::Text(text) }
            }
            "rgb" => Value::Color(spectrum::rgb(&text()?).map_err(|m| at.error(m))?),
            "srgb" => Value::Color(spectrum::srgb(&text()?).map_err(|m| at.error(m))?),
            "spectrum" => match self.optional(&at, element, "filename")? {
                Some(file) => spectrum::parse_file(&self.folders.find(&file, &at)?)?,
                None => spectrum::parse(&text()?).map_err(|m| at.error(m))?,
            },
            "point" | "vector" => Value::Vector(self.vector(&at, element, "value", None)?),
            "transform" => Value::Transform(self.transform(source, element)?),
            "default" | "include" | "path" | "alias" => {
                return Err(at.error(format!("<{tag}> belongs directly under <scene>")));
            }
            _ => return Err(at.error(format!("unknown element <{tag}>"))),
        };
        if let Some(child) = element.children.first().filter(|_| tag != "transform") {
            return Err(source.at(child).error(format!("<{tag}> holds no <{}>", child.tag)));
        }
        Ok(Param { name, at, value })
    }

    fn plugin(&self, source: &Source, element: &Element, kind: Kind, depth: usize) -> Result<Node> {
        let at = source.at(element);
        let plugin = self.attribute(&at, element, "type")?;
        let id = self.optional(&at, element, "id")?;
        let params = element.children.iter().map(|c| self.param(source, c, Some(kind), depth + 1)).collect::<Result<_>>()?;
        Ok(Node { kind, plugin, id, at, params })
    }

    fn transform(&self, source: &Source, element: &Element) -> Result<glam::DMat4> {
        let mut steps = Steps::default();
        for step in &element.children {
            let at = source.at(step);
            let done = match step.tag.as_str() {
                "translate" => steps.translate(self.vector(&at, step, "value", Some(0.0))?),
                "scale" => steps.scale(self.vector(&at, step, "value", Some(1.0))?),
                "rotate" => {
                    let axis = self.vector(&at, step, "value", Some(0.0))?;
                    // In a texture's transform the axis goes without saying.
                    let axis = if axis == DVec3::ZERO { DVec3::Z } else { axis };
                    steps.rotate(axis, number(&at, &self.attribute(&at, step, "angle")?)?)
                }
                "lookat" | "lookAt" | "look_at" => {
                    let up = step.attribute("up").map(|_| self.vector(&at, step, "up", None)).transpose()?;
                    let (origin, target) = (self.vector(&at, step, "origin", None)?, self.vector(&at, step, "target", None)?);
                    steps.look_at(origin, target, up)
                }
                "matrix" => steps.matrix(&numbers(&at, &self.attribute(&at, step, "value")?)?),
                tag => return Err(at.error(format!("found <{tag}>, expected translate, scale, rotate, lookat or matrix"))),
            };
            done.map_err(|m| at.error(m))?;
        }
        steps.finish().map_err(|m| source.at(element).error(m))
    }

    /// Three numbers from one attribute, or from `x`, `y` and `z` where it is missing. With a `default`, a single number
    /// stands for all three, and missing coordinates are allowed.
    fn vector(&self, at: &Location, element: &Element, name: &str, default: Option<f64>) -> Result<DVec3> {
        if let Some(text) = self.optional(at, element, name)? {
            return match (numbers(at, &text)?.as_slice(), default) {
                (&[x, y, z], _) => Ok(DVec3::new(x, y, z)),
                (&[x], Some(_)) => Ok(DVec3::splat(x)),
                (found, _) => Err(at.error(format!("{name}: found {} numbers, expected 3", found.len()))),
            };
        }
        let mut v = DVec3::ZERO;
        for (i, axis) in ["x", "y", "z"].into_iter().enumerate() {
            v[i] = match (self.optional(at, element, axis)?, default) {
                (Some(text), _) => number(at, &text)?,
                (None, Some(d)) => d,
                (None, None) => return Err(at.error(format!("attribute \"{axis}\" (or \"{name}\") is missing"))),
            };
        }
        Ok(v)
    }

    fn attribute(&self, at: &Location, element: &Element, name: &str) -> Result<String> {
        self.optional(at, element, name)?
            .ok_or_else(|| at.error(format!("<{}> has no attribute \"{name}\"", element.tag.as_str())))
    }

    fn optional(&self, at: &Location, element: &Element, name: &str) -> Result<Option<String>> {
        element.attribute(name).map(|text| self.substitute(at, text)).transpose()
    }

    /// Replaces each `$name`, of the names that fit the longest.
    fn substitute(&self, at: &Location, text: &str) -> Result<String> {
        let mut out = String::new();
        let mut rest = text;
        while let Some(dollar) = rest.find('$') {
            out.push_str(&rest[..dollar]);
            rest = &rest[dollar + 1..];
            let fitting = self.values.iter().filter(|(n, _)| !n.is_empty() && rest.starts_with(n.as_str()));
            // The first of equally long ones: `--define` goes before the file's own default.
            let Some((name, value)) = fitting.reduce(|a, b| if b.0.len() > a.0.len() { b } else { a }) else {
                let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                return Err(at.error(format!("the parameter \"${name}\" has no value: no <default>, no --define")));
            };
            self.used.borrow_mut().insert(name.clone());
            self.stood_for.set(self.stood_for.get() + value.len());
            if self.stood_for.get() > MAX_STOOD_FOR {
                return Err(at.error(format!("the parameters stand for more than {MAX_STOOD_FOR} bytes in all")));
            }
            out.push_str(value);
            rest = &rest[name.len()..];
        }
        out.push_str(rest);
        Ok(out)
    }
}

/// A file's one name, by which an include that goes in circles is known; as it is where there is no such file.
fn whole(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

fn number(at: &Location, text: &str) -> Result<f64> {
    spectrum::number(text).map_err(|m| at.error(m))
}

fn numbers(at: &Location, text: &str) -> Result<Vec<f64>> {
    spectrum::numbers(text).map_err(|m| at.error(m))
}
