//! One entry of the lists of lights, materials or objects: its attributes, and what its keyframes say of them.

use crate::scene::animation::track::Track;
use crate::scene::spline::Spline;
use glam::DVec3;
use serde_json::{Map, Value};

/// What is wrong, and where in the file.
pub type Result<T> = std::result::Result<T, String>;

/// Most keyframes of an entry.
const MAX_KEYS: usize = 10_000;
/// Least time between keyframes, and latest time of one, seconds.
const TIMES: [f64; 2] = [1e-6, 1e6];
/// No number is larger: what a spline and a unit scale make of it is still finite.
const LARGEST: f64 = 1e12;

/// How many numbers an attribute has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// A number.
    One,
    /// A list of two.
    Two,
    /// A list of three.
    Three,
}

/// An attribute: its name, how many numbers it has, and what each of them may be.
#[derive(Debug, Clone, Copy)]
pub struct Attribute {
    pub name: &'static str,
    pub width: Width,
    low: f64,
    high: f64,
}

impl Attribute {
    const fn new(name: &'static str, width: Width, low: f64, high: f64) -> Self {
        Self { name, width, low, high }
    }

    /// A position, or another three numbers of any size.
    pub const fn vector(name: &'static str) -> Self {
        Self::new(name, Width::Three, -LARGEST, LARGEST)
    }

    /// What light has: three numbers from 0.
    pub const fn light(name: &'static str) -> Self {
        Self::new(name, Width::Three, 0.0, LARGEST)
    }

    /// Three numbers from 0 to 1.
    pub const fn albedo(name: &'static str) -> Self {
        Self::new(name, Width::Three, 0.0, 1.0)
    }

    /// A number from 0 to `high`.
    pub const fn number(name: &'static str, high: f64) -> Self {
        Self::new(name, Width::One, 0.0, high)
    }

    /// Lengths.
    pub const fn lengths(name: &'static str, width: Width) -> Self {
        Self::new(name, width, f64::MIN_POSITIVE, LARGEST)
    }

    fn expected(&self) -> String {
        let numbers = match self.width {
            Width::One => "a number",
            Width::Two => "a list of two numbers",
            Width::Three => "a list of three numbers",
        };
        match (self.low, self.high) {
            (low, LARGEST) if low < 0.0 => format!("{numbers} of at most {LARGEST:e}"),
            (0.0, LARGEST) => format!("{numbers} of 0 or more"),
            (_, LARGEST) => format!("{numbers} of more than 0"),
            (low, high) => format!("{numbers} from {low} to {high}"),
        }
    }

    /// The value at `place`; a single number is all three.
    fn read(&self, value: &Value, place: &str) -> Result<DVec3> {
        let wrong = || format!("{place}: {} = {value}: expected {}", self.name, self.expected());
        let number = |v: &Value| v.as_f64().filter(|x| (self.low..=self.high).contains(x)).ok_or_else(wrong);
        match (self.width, value.as_array().map(Vec::as_slice)) {
            (Width::One, None) => number(value).map(DVec3::splat),
            (Width::Two, Some([x, y])) => Ok(DVec3::new(number(x)?, number(y)?, 0.0)),
            (Width::Three, Some([x, y, z])) => Ok(DVec3::new(number(x)?, number(y)?, number(z)?)),
            _ => Err(wrong()),
        }
    }
}

/// An entry, its names checked.
#[derive(Debug)]
pub struct Entry<'a> {
    /// Like `lights[2]`.
    pub place: String,
    object: &'a Map<String, Value>,
    keys: Vec<&'a Map<String, Value>>,
    spline: Option<Spline>,
}

impl<'a> Entry<'a> {
    /// An entry with attributes that may change in `moving`, and others in `fixed`.
    pub fn new(value: &'a Value, place: String, moving: &[Attribute], fixed: &[&str]) -> Result<Self> {
        let object = object(value, &place)?;
        let moving: Vec<&str> = moving.iter().map(|a| a.name).collect();
        check_names(object, &place, &[fixed, &moving, &["keyframes"]].concat())?;
        let mut keys = Vec::new();
        let mut times = Vec::new();
        if let Some(list) = object.get("keyframes") {
            let count = |n: usize| (1..=MAX_KEYS).contains(&n);
            let list = list.as_array().filter(|l| count(l.len()));
            let list = list.ok_or_else(|| format!("{place}: keyframes: expected a list of 1 to {MAX_KEYS}"))?;
            for (i, key) in list.iter().enumerate() {
                let place = format!("{place}.keyframes[{i}]");
                let key = self::object(key, &place)?;
                check_names(key, &place, &[&["time"], moving.as_slice()].concat())?;
                times.push(time(key, &place)?);
                keys.push(key);
            }
            if let Some(i) = times.windows(2).position(|t| t[1] > t[0] && t[1] - t[0] < TIMES[0]) {
                let (a, b, least) = (times[i], times[i + 1], TIMES[0]);
                return Err(format!("{place}.keyframes[{}]: time {b} follows {a}: expected {least} or more between them", i + 1));
            }
            if moving.iter().all(|name| keys.iter().all(|k| !k.contains_key(*name))) {
                return Err(format!("{place}: keyframes: found times alone, expected {}", moving.join(", ")));
            }
        }
        let spline = match times.is_empty() {
            true => None,
            false => Some(Spline::new(times).map_err(|e| format!("{place}.{e}"))?),
        };
        Ok(Self { place, object, keys, spline })
    }

    /// Time of the last keyframe, seconds; `None` where there is none.
    pub fn last(&self) -> Option<f64> {
        self.spline.as_ref().and_then(|s| s.times().last().copied())
    }

    /// An attribute over time, if it is given. That of keyframes goes before that of the entry.
    pub fn track(&self, attribute: Attribute) -> Result<Option<Track>> {
        let Attribute { name, low, high, .. } = attribute;
        let still = self.object.get(name).map(|v| attribute.read(v, &self.place)).transpose()?;
        let Some(spline) = self.spline.as_ref().filter(|_| self.keys.iter().any(|k| k.contains_key(name))) else {
            return Ok(still.map(Track::still));
        };
        let value = |(i, key): (usize, &&Map<String, Value>)| {
            let place = format!("{}.keyframes[{i}]", self.place);
            let value = key.get(name).ok_or_else(|| format!("{place}: found no \"{name}\", which other keyframes give"))?;
            attribute.read(value, &place)
        };
        let values = self.keys.iter().enumerate().map(value).collect::<Result<Vec<_>>>()?;
        Ok(Some(Track::new(spline.clone(), values, low..=high)))
    }

    /// An attribute over time that must be given.
    pub fn required(&self, attribute: Attribute) -> Result<Track> {
        self.track(attribute)?.ok_or_else(|| format!("{}: found no \"{}\"", self.place, attribute.name))
    }

    /// An attribute that does not change, if it is given.
    pub fn value(&self, attribute: Attribute) -> Result<Option<DVec3>> {
        self.object.get(attribute.name).map(|v| attribute.read(v, &self.place)).transpose()
    }

    /// The same that must be given.
    pub fn required_value(&self, attribute: Attribute) -> Result<DVec3> {
        self.value(attribute)?.ok_or_else(|| format!("{}: found no \"{}\"", self.place, attribute.name))
    }

    /// A word.
    pub fn text(&self, name: &str) -> Result<&'a str> {
        text(self.object, &self.place, name)
    }
}

/// The type of an entry, one of `known`.
pub fn kind<'a>(value: &'a Value, place: &str, known: &[&str]) -> Result<&'a str> {
    let kind = text(object(value, place)?, place, "type")?;
    match known.contains(&kind) {
        true => Ok(kind),
        false => Err(format!("{place}: type = \"{kind}\": expected one of {}", known.join(", "))),
    }
}

fn object<'a>(value: &'a Value, place: &str) -> Result<&'a Map<String, Value>> {
    value.as_object().ok_or_else(|| format!("{place}: found {value}, expected an object {{...}}"))
}

fn text<'a>(object: &'a Map<String, Value>, place: &str, name: &str) -> Result<&'a str> {
    match object.get(name) {
        Some(Value::String(text)) => Ok(text),
        Some(other) => Err(format!("{place}: {name} = {other}: expected a text")),
        None => Err(format!("{place}: found no \"{name}\"")),
    }
}

fn time(key: &Map<String, Value>, place: &str) -> Result<f64> {
    match key.get("time") {
        Some(value) => {
            let time = value.as_f64().filter(|t| t.abs() <= TIMES[1]);
            time.ok_or_else(|| format!("{place}: time = {value}: expected seconds, at most {:e}", TIMES[1]))
        }
        None => Err(format!("{place}: found no \"time\"")),
    }
}

fn check_names(object: &Map<String, Value>, place: &str, known: &[&str]) -> Result<()> {
    match object.keys().find(|name| !known.contains(&name.as_str())) {
        Some(name) => Err(format!("{place}: unknown \"{name}\", expected one of {}", known.join(", "))),
        None => Ok(()),
    }
}
