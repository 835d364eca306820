//! A plugin's parameters as its loader takes them: typed, with defaults; what nobody takes becomes a warning.

use super::spectrum::{EQUAL_ENERGY_WHITE, reduce};
use super::spectrum_plugin;
use super::tree::{Kind, Location, Node, Param, Value};
use crate::Result;
use crate::base::math::Rgb;
use glam::{DMat4, Vec3};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The plugins that references mean.
pub type Ids<'a> = BTreeMap<&'a str, &'a Node>;

/// The parameters of one plugin.
pub struct Params<'a> {
    /// The plugin.
    pub node: &'a Node,
    ids: &'a Ids<'a>,
    taken: Vec<bool>,
    /// What was odd, but is taken.
    odd: Vec<String>,
}

impl<'a> Params<'a> {
    /// None taken yet.
    pub fn new(node: &'a Node, ids: &'a Ids<'a>) -> Self {
        Self { node, ids, taken: vec![false; node.params.len()], odd: Vec::new() }
    }

    /// The parameter of that name. Where a file gives it twice, the last counts.
    pub fn get(&mut self, name: &str) -> Option<&'a Param> {
        let mut found = None;
        for (i, p) in self.node.params.iter().enumerate() {
            if p.name == name {
                self.taken[i] = true;
                found = Some(p);
            }
        }
        found
    }

    /// Whether the file gives it. Does not take it.
    pub fn has(&self, name: &str) -> bool {
        self.node.params.iter().any(|p| p.name == name)
    }

    /// Takes parameters that change nothing here, so that nobody warns of them.
    pub fn accept(&mut self, names: &[&str]) {
        for name in names {
            self.get(name);
        }
    }

    /// Takes all that is left.
    pub fn accept_all(&mut self) {
        self.taken.fill(true);
    }

    /// A number.
    pub fn f32(&mut self, name: &str, default: f32) -> Result<f32> {
        match self.get(name) {
            None => Ok(default),
            Some(p) => number_of(p, self.node)?.ok_or_else(|| wrong(p, self.node, "a number")),
        }
    }

    /// A number above zero.
    pub fn positive(&mut self, name: &str, default: f32) -> Result<f32> {
        let x = self.f32(name, default)?;
        if x > 0.0 { Ok(x) } else { Err(self.at(name).error(format!("{name} = {x}: expected more than 0"))) }
    }

    /// A whole number from `least` to `most`.
    pub fn integer(&mut self, name: &str, default: i64, least: i64, most: i64) -> Result<i64> {
        let Some(p) = self.get(name) else { return Ok(default) };
        match p.value {
            Value::Integer(i) if (least..=most).contains(&i) => Ok(i),
            Value::Integer(i) => Err(p.at.error(format!("{name} = {i}: expected {least} to {most}"))),
            _ => Err(wrong(p, self.node, "an integer")),
        }
    }

    /// True or false.
    pub fn bool(&mut self, name: &str, default: bool) -> Result<bool> {
        match self.get(name) {
            None => Ok(default),
            Some(Param { value: Value::Bool(b), .. }) => Ok(*b),
            Some(p) => Err(wrong(p, self.node, "a boolean")),
        }
    }

    /// One of several words.
    pub fn choice<T: Copy>(&mut self, name: &str, default: T, words: &[(&str, T)]) -> Result<T> {
        self.choice_where(name, default, words, |word, text| word == text)
    }

    /// One of several words, where Mitsuba does not ask how they are capitalised.
    pub fn choice_of_any_case<T: Copy>(&mut self, name: &str, default: T, words: &[(&str, T)]) -> Result<T> {
        self.choice_where(name, default, words, str::eq_ignore_ascii_case)
    }

    fn choice_where<T: Copy>(
        &mut self,
        name: &str,
        default: T,
        words: &[(&str, T)],
        is: impl Fn(&str, &str) -> bool,
    ) -> Result<T> {
        let Some(text) = self.text(name)? else { return Ok(default) };
        words.iter().find(|(w, _)| is(w, text)).map(|(_, t)| *t).ok_or_else(|| {
            let known: Vec<_> = words.iter().map(|(w, _)| *w).collect();
            self.at(name).error(format!("{name} = \"{text}\": expected one of {}", known.join(", ")))
        })
    }

    /// Text.
    pub fn text(&mut self, name: &str) -> Result<Option<&'a str>> {
        match self.get(name) {
            None => Ok(None),
            Some(Param { value: Value::Text(t), .. }) => Ok(Some(t)),
            Some(p) => Err(wrong(p, self.node, "a string")),
        }
    }

    /// A file that exists.
    pub fn file(&mut self) -> Result<&'a Path> {
        match self.get("filename") {
            None => Err(self.node.at.error(format!("{} has no \"filename\"", self.node.plugin))),
            Some(Param { value: Value::File(f), .. }) => Ok(f),
            Some(p) => Err(wrong(p, self.node, "a string")),
        }
    }

    /// A point or vector.
    pub fn vector(&mut self, name: &str) -> Result<Option<Vec3>> {
        match self.get(name) {
            None => Ok(None),
            Some(Param { value: Value::Vector(v), .. }) => Ok(Some(v.as_vec3())),
            Some(p) => Err(wrong(p, self.node, "a point or vector")),
        }
    }

    /// `to_world` or `to_uv`.
    pub fn transform(&mut self, name: &str) -> Result<DMat4> {
        match self.get(name) {
            None => Ok(DMat4::IDENTITY),
            Some(Param { value: Value::Transform(m), .. }) => Ok(*m),
            Some(p) => Err(wrong(p, self.node, "a transform")),
        }
    }

    /// A colour that does not vary.
    pub fn color(&mut self, name: &str, default: Rgb) -> Result<Rgb> {
        match self.get(name) {
            None => Ok(default),
            Some(p) => self.color_of(p)?.ok_or_else(|| wrong(p, self.node, "a colour")),
        }
    }

    /// The colour of a surface, whatever plugin it is a parameter of.
    pub fn reflectance(&mut self, name: &str, default: Rgb) -> Result<Rgb> {
        let Some(p) = self.get(name) else { return Ok(default) };
        let color = self.color_seen(p, false)?.ok_or_else(|| wrong(p, self.node, "a colour"))?;
        match color.min_element() >= 0.0 && color.max_element() <= 1.0 {
            true => Ok(color),
            false => Err(p.at.error(format!("{name} = {color}: expected 0 to 1"))),
        }
    }

    /// A parameter as a colour, where it is one. An emitter's spectra keep their white, a surface's are seen under D65.
    ///
    /// Numbers below 0 are Mitsuba's choice: a reflectance given as RGB may not be; a metal's eta and k may, and count by their size;
    /// anything else is taken for 0 (ours: Mitsuba goes on with it).
    pub fn color_of(&mut self, p: &'a Param) -> Result<Option<Rgb>> {
        self.color_seen(p, self.node.kind == Kind::Emitter)
    }

    /// A parameter as a colour, an emitter's or a surface's.
    fn color_seen(&mut self, p: &'a Param, emitter: bool) -> Result<Option<Rgb>> {
        let color = match &p.value {
            Value::Integer(_) | Value::Float(_) => number_of(p, self.node)?.map(Rgb::splat),
            Value::Uniform(x) => Some(if emitter { EQUAL_ENERGY_WHITE } else { Rgb::ONE } * *x as f32),
            Value::Color(c) => Some(*c),
            Value::Vector(v) => Some(v.as_vec3()),
            // A surface does not reflect more than there is.
            Value::Spectrum(pairs) if !emitter && !matches!(p.name.as_str(), "eta" | "k") => {
                Some(reduce(pairs, emitter).min(Rgb::ONE))
            }
            Value::Spectrum(pairs) => Some(reduce(pairs, emitter)),
            _ => match self.plugin_of(p)? {
                Some(plugin) if plugin.kind == Kind::Texture => spectrum_plugin::color(plugin, self, emitter)?,
                _ => None,
            },
        };
        let Some(c) = color else { return Ok(None) };
        let (plugin, name) = (&self.node.plugin, &p.name);
        if !c.is_finite() {
            return Err(p.at.error(format!("{plugin}: {name} = {c}: expected finite numbers")));
        }
        if c.min_element() >= 0.0 {
            return Ok(color);
        }
        let (taken, why) = match (self.node.kind, &p.value) {
            (Kind::Bsdf, _) if matches!(name.as_str(), "eta" | "k") => (c.abs(), "its size is taken, as only squares count"),
            (Kind::Bsdf | Kind::Texture, Value::Color(_) | Value::Vector(_)) => {
                return Err(p.at.error(format!("{plugin}: {name} = {c}: expected finite numbers of at least 0")));
            }
            _ => (c.max(Rgb::ZERO), "0 is taken for what is below"),
        };
        self.odd.push(p.at.warning(format!("{plugin}: {name} = {c}: {why}")));
        Ok(Some(taken))
    }

    /// Keeps a warning for [`Params::finish`].
    pub fn warn(&mut self, warning: String) {
        self.odd.push(warning);
    }

    /// The parameters of another plugin of the same scene.
    pub fn of(&self, node: &'a Node) -> Self {
        Self::new(node, self.ids)
    }

    /// Children of a kind, references followed, in file order.
    pub fn children(&mut self, kind: Kind) -> Result<Vec<&'a Node>> {
        let mut found = Vec::new();
        for (i, p) in self.node.params.iter().enumerate() {
            if let Some(node) = self.plugin_of(p)?
                && node.kind == kind
            {
                self.taken[i] = true;
                found.push(node);
            }
        }
        Ok(found)
    }

    /// The plugin that a parameter holds or refers to.
    pub fn plugin_of(&self, p: &'a Param) -> Result<Option<&'a Node>> {
        match &p.value {
            Value::Plugin(node) => Ok(Some(node)),
            Value::Reference(id) => match self.ids.get(id.as_str()) {
                Some(node) => Ok(Some(node)),
                None => Err(p.at.error(format!("nothing has the id \"{id}\""))),
            },
            _ => Ok(None),
        }
    }

    /// Where a parameter stands; the plugin's own place without it.
    pub fn at(&self, name: &str) -> &'a Location {
        self.node.params.iter().rfind(|p| p.name == name).map_or(&self.node.at, |p| &p.at)
    }

    /// Warns of what was not taken.
    pub fn finish(self, warnings: &mut Vec<String>) {
        warnings.extend(self.odd);
        let mut seen = BTreeSet::new();
        for p in &self.node.params {
            if !seen.insert(&p.name) && !p.name.is_empty() {
                warnings.push(p.at.warning(format!("{}: {} is given again: the last one counts", self.node.plugin, p.name)));
            }
        }
        for (p, _) in self.node.params.iter().zip(&self.taken).filter(|(_, taken)| !**taken) {
            // What is not supported at all is told elsewhere.
            if matches!(&p.value, Value::Plugin(n) if n.kind == Kind::Unsupported) {
                continue;
            }
            let what = match &p.value {
                Value::Plugin(n) if p.name.is_empty() => format!("child \"{}\"", n.plugin),
                Value::Reference(id) if p.name.is_empty() => format!("reference to \"{id}\""),
                _ => format!("property \"{}\"", p.name),
            };
            warnings.push(p.at.warning(format!("unknown {what} of {} is ignored", self.node.plugin)));
        }
    }
}

/// "roughplastic: alpha is a string, expected a number".
pub fn wrong(p: &Param, node: &Node, expected: &str) -> crate::Error {
    let found = match &p.value {
        Value::Plugin(child) => format!("the plugin \"{}\"", child.plugin),
        value => value.describe().to_owned(),
    };
    p.at.error(format!("{}: {} is {found}, expected {expected}", node.plugin, p.name))
}

/// A parameter as a number, where it is one.
pub fn number_of(p: &Param, node: &Node) -> Result<Option<f32>> {
    let x = match p.value {
        Value::Integer(i) => i as f32,
        Value::Float(x) | Value::Uniform(x) => x as f32,
        _ => return Ok(None),
    };
    if x.is_finite() { Ok(Some(x)) } else { Err(p.at.error(format!("{}: {} = {x}", node.plugin, p.name))) }
}
