//! Mitsuba XML, from 0.5's camelCase to 3's snake_case, into the plugin tree.
//!
//! Parameters (`default`, `$name`), `include`, `path` and `alias` are resolved here; references stay for later.

use super::spectrum;
use super::transform::Steps;
use super::tree::{Folders, Kind, Lines, Location, MAX_DEPTH, Node, Param, Value, snake_case};
use crate::io::read_text;
use crate::{Error, Result};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Deepest chain of `include`s.
const MAX_INCLUDES: usize = 16;
/// Most files of a scene: includes that include twice would multiply without end.
const MAX_FILES: usize = 1000;
/// Most elements and attributes in one file.
const MAX_NODES: u32 = 20_000_000;

/// Parses a file and all that it includes; the result is the scene's children in order.
pub fn parse(path: &Path, defines: &[(String, String)]) -> Result<Vec<Param>> {
    let mut reader = Reader {
        values: defines.to_vec(),
        folders: Folders::of(path),
        open: Vec::new(),
        files: 0,
        aliases: Vec::new(),
        children: Vec::new(),
    };
    reader.file(path)?;
    reader.add_aliases()?;
    Ok(reader.children)
}

type Element<'a, 'input> = roxmltree::Node<'a, 'input>;

struct Reader {
    /// `$name` and what it stands for; the first entry of a name counts.
    values: Vec<(String, String)>,
    folders: Folders,
    /// Files being read, outermost first: to see an include that goes in circles.
    open: Vec<PathBuf>,
    /// Files read so far.
    files: usize,
    /// (id, its second name, where).
    aliases: Vec<(String, String, Location)>,
    children: Vec<Param>,
}

/// The file that an element stands in.
struct Source {
    file: Arc<Path>,
    lines: Lines,
}

impl Source {
    fn at(&self, element: Element) -> Location {
        Location { file: self.file.clone(), line: self.lines.at(element.range().start) }
    }
}

impl Reader {
    fn file(&mut self, path: &Path) -> Result<()> {
        let text = read_text(path)?;
        let options = roxmltree::ParsingOptions { nodes_limit: MAX_NODES, ..Default::default() };
        let document = roxmltree::Document::parse_with_options(&text, options)
            .map_err(|e| Error::at_line(path, e.pos().row, format!("not well-formed XML: {e}")))?;
        let source = Source { file: path.into(), lines: Lines::new(&text) };
        self.open.push(path.canonicalize().map_err(|e| Error::io(path, e))?);
        self.folders.add_of(path);
        let root = document.root_element();
        match root.tag_name().name() {
            "scene" => {
                for child in root.children().filter(|c| c.is_element()) {
                    self.top_level(&source, child)?;
                }
            }
            _ if self.open.len() > 1 => self.top_level(&source, root)?,
            tag => return Err(source.at(root).error(format!("found <{tag}>, expected <scene>"))),
        }
        self.open.pop();
        Ok(())
    }

    fn top_level(&mut self, source: &Source, element: Element) -> Result<()> {
        let at = source.at(element);
        match element.tag_name().name() {
            "default" => {
                let name = self.attribute(&at, element, "name")?;
                let value = self.attribute(&at, element, "value")?;
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
                let full = file.canonicalize().map_err(|e| Error::io(&file, e))?;
                if self.open.contains(&full) {
                    return Err(at.error(format!("\"{name}\" includes itself")));
                }
                if self.open.len() >= MAX_INCLUDES {
                    return Err(at.error(format!("includes are nested more than {MAX_INCLUDES} deep")));
                }
                self.files += 1;
                if self.files > MAX_FILES {
                    return Err(at.error(format!("more than {MAX_FILES} files are included")));
                }
                self.file(&file)?;
            }
            _ => {
                let child = self.param(source, element, None, 0)?;
                self.children.push(child);
            }
        }
        Ok(())
    }

    /// A second name for a plugin is a copy of it under that name.
    fn add_aliases(&mut self) -> Result<()> {
        for (id, second, at) in std::mem::take(&mut self.aliases) {
            let node = self.children.iter().find_map(|c| match &c.value {
                Value::Plugin(n) if n.id.as_ref() == Some(&id) => Some(n.clone()),
                _ => None,
            });
            let mut node = node.ok_or_else(|| at.error(format!("alias: nothing has the id \"{id}\"")))?;
            node.id = Some(second);
            self.children.push(Param { name: String::new(), at, value: Value::Plugin(node) });
        }
        Ok(())
    }

    fn param(&self, source: &Source, element: Element, parent: Option<Kind>, depth: usize) -> Result<Param> {
        let at = source.at(element);
        if depth > MAX_DEPTH {
            return Err(at.error(format!("elements are nested more than {MAX_DEPTH} deep")));
        }
        let name = snake_case(&self.optional(&at, element, "name")?.unwrap_or_default());
        let tag = element.tag_name().name();
        if let Some(kind) = Kind::from_tag(tag) {
            let node = self.plugin(source, element, kind, depth)?;
            return Ok(Param { name, at, value: Value::Plugin(node) });
        }
        let text = || self.attribute(&at, element, "value");
        let value = match tag {
            "ref" => Value::Reference(self.attribute(&at, element, "id")?),
            "boolean" => match text()?.trim() {
                "true" => Value::Bool(true),
                "false" => Value::Bool(false),
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
        if let Some(child) = element.children().find(|c| c.is_element()).filter(|_| tag != "transform") {
            return Err(source.at(child).error(format!("<{tag}> holds no <{}>", child.tag_name().name())));
        }
        Ok(Param { name, at, value })
    }

    fn plugin(&self, source: &Source, element: Element, kind: Kind, depth: usize) -> Result<Node> {
        let at = source.at(element);
        let plugin = self.attribute(&at, element, "type")?;
        let id = self.optional(&at, element, "id")?;
        let children = element.children().filter(|c| c.is_element());
        let params = children.map(|c| self.param(source, c, Some(kind), depth + 1)).collect::<Result<_>>()?;
        Ok(Node { kind, plugin, id, at, params })
    }

    fn transform(&self, source: &Source, element: Element) -> Result<glam::DMat4> {
        let mut steps = Steps::default();
        for step in element.children().filter(|c| c.is_element()) {
            let at = source.at(step);
            let done = match step.tag_name().name() {
                "translate" => steps.translate(self.vector(&at, step, "value", Some(0.0))?),
                "scale" => steps.scale(self.vector(&at, step, "value", Some(1.0))?),
                "rotate" => {
                    let axis = self.vector(&at, step, "value", Some(0.0))?;
                    // In a texture's transform the axis goes without saying.
                    let axis = if axis == DVec3::ZERO { DVec3::Z } else { axis };
                    steps.rotate(axis, number(&at, &self.attribute(&at, step, "angle")?)?)
                }
                "lookat" | "lookAt" | "look_at" => {
                    let up = step.has_attribute("up").then(|| self.vector(&at, step, "up", None)).transpose()?;
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
    fn vector(&self, at: &Location, element: Element, name: &str, default: Option<f64>) -> Result<DVec3> {
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

    fn attribute(&self, at: &Location, element: Element, name: &str) -> Result<String> {
        self.optional(at, element, name)?
            .ok_or_else(|| at.error(format!("<{}> has no attribute \"{name}\"", element.tag_name().name())))
    }

    fn optional(&self, at: &Location, element: Element, name: &str) -> Result<Option<String>> {
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
            out.push_str(value);
            rest = &rest[name.len()..];
        }
        out.push_str(rest);
        Ok(out)
    }
}

fn number(at: &Location, text: &str) -> Result<f64> {
    spectrum::number(text).map_err(|m| at.error(m))
}

fn numbers(at: &Location, text: &str) -> Result<Vec<f64>> {
    spectrum::numbers(text).map_err(|m| at.error(m))
}
