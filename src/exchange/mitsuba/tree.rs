//! The plugin tree that XML and JSON both parse into: nodes with typed parameters, each with the line it came from.

use crate::base::math::Rgb;
use crate::{Error, Result};
use glam::{DMat4, DVec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Deepest nesting of plugins, and of references, that a scene may have.
pub const MAX_DEPTH: usize = 64;

/// A line of a scene file.
#[derive(Debug, Clone, PartialEq)]
pub struct Location {
    /// The file, as the user named it or as an `include` did.
    pub file: Arc<Path>,
    /// Its line, 1-based.
    pub line: u32,
}

impl Location {
    /// An error that names this line.
    pub fn error(&self, message: impl Into<String>) -> Error {
        Error::at_line(&self.file, self.line, message)
    }

    /// An error that names this line: what there is not, so that it can be left out.
    pub fn unsupported(&self, message: impl Into<String>) -> Error {
        Error::Unsupported { path: self.file.to_path_buf(), line: self.line, message: message.into() }
    }

    /// A warning that names this line.
    pub fn warning(&self, message: impl std::fmt::Display) -> String {
        format!("{}:{}: {message}", self.file.display(), self.line)
    }
}

/// What a plugin is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Triangles.
    Shape,
    /// A scattering model.
    Bsdf,
    /// A colour over a surface.
    Texture,
    /// A light source.
    Emitter,
    /// A camera.
    Sensor,
    /// Number of bounces.
    Integrator,
    /// Size of the image, within a sensor.
    Film,
    /// Anything that does not change what light does here: samplers, reconstruction filters.
    Other,
    /// What has no place here: participating media and their parts.
    Unsupported,
}

impl Kind {
    /// From an XML tag; `None` where it is no plugin's.
    pub fn from_tag(tag: &str) -> Option<Self> {
        Some(match tag {
            "shape" => Self::Shape,
            "bsdf" => Self::Bsdf,
            "texture" => Self::Texture,
            "emitter" | "luminaire" => Self::Emitter,
            "sensor" | "camera" => Self::Sensor,
            "integrator" => Self::Integrator,
            "film" => Self::Film,
            "sampler" | "rfilter" => Self::Other,
            "medium" | "phase" | "volume" | "subsurface" => Self::Unsupported,
            _ => return None,
        })
    }

    /// From a plugin's name, for the JSON form; `None` for one that is not known. `key` is where its parent holds it.
    pub fn from_plugin(plugin: &str, key: &str) -> Option<Self> {
        Some(match plugin {
            "obj" | "ply" | "serialized" | "rectangle" | "cube" | "sphere" | "disk" | "cylinder" => Self::Shape,
            "diffuse" | "plastic" | "roughplastic" | "conductor" | "roughconductor" | "dielectric" | "thindielectric"
            | "roughdielectric" | "twosided" | "mask" | "bumpmap" | "normalmap" | "blendbsdf" | "principled" => Self::Bsdf,
            "bitmap" | "checkerboard" => Self::Texture,
            "area" | "envmap" | "constant" | "point" | "spot" | "directional" | "projector" | "sky" | "sun" | "sunsky"
            | "timed_sunsky" => Self::Emitter,
            "perspective" | "thinlens" | "orthographic" => Self::Sensor,
            "hdrfilm" | "ldrfilm" | "mfilm" | "specfilm" => Self::Film,
            "path" | "direct" | "volpath" | "volpathmis" | "bdpt" | "aov" | "depth" | "ptracer" | "moment" => Self::Integrator,
            "independent" | "stratified" | "multijitter" | "orthogonal" | "ldsampler" | "sobol" | "halton" | "box" | "tent"
            | "gaussian" | "mitchell" | "catmullrom" | "lanczos" => Self::Other,
            "merge" | "shapegroup" | "instance" => Self::Shape,
            "null" => Self::Bsdf,
            "mesh_attribute" | "d65" | "regular" | "irregular" | "blackbody" | "srgb" | "rawconstant" => Self::Texture,
            _ => match key {
                "integrator" => Self::Integrator,
                "film" => Self::Film,
                "sampler" | "rfilter" => Self::Other,
                _ => return Self::of_foreign(plugin),
            },
        })
    }

    /// What a plugin of Mitsuba's that is not supported would be.
    fn of_foreign(plugin: &str) -> Option<Self> {
        Some(match plugin {
            "bsplinecurve" | "linearcurve" | "sdfgrid" | "ellipsoids" | "ellipsoidsmesh" | "heightfield" => Self::Shape,
            "hair" | "measured" | "measured_polarized" | "polarizer" | "retarder" | "circular" | "pplastic"
            | "principledthin" | "difftrans" | "phong" | "ward" | "hk" | "coating" | "roughcoating" | "irawan" => Self::Bsdf,
            "homogeneous" | "heterogeneous" | "isotropic" | "hg" | "rayleigh" | "sggx" | "tabphase" | "blendphase"
            | "gridvolume" | "constvolume" => Self::Unsupported,
            "volume" | "bitmap3d" => Self::Texture,
            "directionalarea" | "volumelight" | "collimated" | "tangent" => Self::Emitter,
            "batch" | "distant" | "irradiancemeter" | "radiancemeter" | "fluxmeter" | "mradiancemeter" | "mdistant" => {
                Self::Sensor
            }
            _ => return None,
        })
    }
}

/// A plugin with its parameters.
#[derive(Debug, Clone)]
pub struct Node {
    /// What it is for.
    pub kind: Kind,
    /// Its type, `roughplastic`, say.
    pub plugin: String,
    /// What references call it.
    pub id: Option<String>,
    /// Where it stands.
    pub at: Location,
    /// Its parameters and children in file order.
    pub params: Vec<Param>,
}

impl Node {
    /// Its parameters and those of all plugins within, and itself.
    pub fn size(&self) -> usize {
        let of = |p: &Param| if let Value::Plugin(node) = &p.value { node.size() } else { 1 };
        1 + self.params.iter().map(of).sum::<usize>()
    }
}

/// A scene file as it was read.
#[derive(Debug, Default)]
pub struct Parsed {
    /// The scene's children in order.
    pub children: Vec<Param>,
    /// What was odd about the text but no error, one line each.
    pub warnings: Vec<String>,
}

/// A parameter, or a child.
#[derive(Debug, Clone)]
pub struct Param {
    /// snake_case; empty for a child without a name.
    pub name: String,
    /// Where it stands.
    pub at: Location,
    /// What it holds.
    pub value: Value,
}

/// What a parameter holds.
#[derive(Debug, Clone)]
pub enum Value {
    /// true or false.
    Bool(bool),
    /// An integer.
    Integer(i64),
    /// A finite number.
    Float(f64),
    /// Text.
    Text(String),
    /// An existing file.
    File(PathBuf),
    /// A point, a vector, or in JSON any three numbers.
    Vector(DVec3),
    /// Linear Rec.709.
    Color(Rgb),
    /// A spectrum given as one number: grey for a reflectance, equal-energy white for an emitter.
    Uniform(f64),
    /// A spectrum given as (wavelength in nm, value), wavelengths ascending.
    Spectrum(Vec<(f64, f64)>),
    /// An affine map.
    Transform(DMat4),
    /// A child.
    Plugin(Node),
    /// A child that stands elsewhere, by its id.
    Reference(String),
}

impl Value {
    /// What to call it in a message.
    pub fn describe(&self) -> &'static str {
        match self {
            Self::Bool(_) => "a boolean",
            Self::Integer(_) => "an integer",
            Self::Float(_) => "a number",
            Self::Text(_) => "a string",
            Self::File(_) => "a file",
            Self::Vector(_) => "a vector",
            Self::Color(_) => "a colour",
            Self::Uniform(_) | Self::Spectrum(_) => "a spectrum",
            Self::Transform(_) => "a transform",
            Self::Plugin(_) => "a plugin",
            Self::Reference(_) => "a reference",
        }
    }
}

/// `toWorld` becomes `to_world`, `intIOR` becomes `int_ior`; snake_case stays as it is.
pub fn snake_case(name: &str) -> String {
    let mut out = String::with_capacity(name.len() + 4);
    let mut after_lower = false;
    for c in name.chars() {
        if c.is_ascii_uppercase() && after_lower {
            out.push('_');
        }
        after_lower = c.is_ascii_lowercase() || c.is_ascii_digit();
        out.push(c.to_ascii_lowercase());
    }
    out
}

/// Folders in which a scene's files are looked for.
#[derive(Debug, Clone)]
pub struct Folders(Vec<PathBuf>);

impl Folders {
    /// The scene file's own folder.
    pub fn of(scene: &Path) -> Self {
        Self(vec![scene.parent().map(Path::to_owned).unwrap_or_default()])
    }

    /// Adds a folder (itself relative to the others), to be searched first.
    pub fn add(&mut self, folder: &str, at: &Location) -> Result<()> {
        let found = self.candidates(folder).find(|p| p.is_dir());
        self.0.insert(0, found.ok_or_else(|| at.error(format!("no folder \"{folder}\"")))?);
        Ok(())
    }

    /// Adds a file's own folder, to be searched last.
    pub fn add_of(&mut self, file: &Path) {
        let folder = file.parent().map(Path::to_owned).unwrap_or_default();
        if !self.0.contains(&folder) {
            self.0.push(folder);
        }
    }

    /// The file that `name` means here.
    pub fn find(&self, name: &str, at: &Location) -> Result<PathBuf> {
        self.candidates(name).find(|p| p.is_file()).ok_or_else(|| {
            let tried: Vec<_> = self.candidates(name).map(|p| p.display().to_string()).collect();
            at.error(format!("no file \"{name}\" (looked for {})", tried.join(", ")))
        })
    }

    fn candidates(&self, name: &str) -> impl Iterator<Item = PathBuf> {
        // Scenes written on Windows use backslashes.
        let forward = if cfg!(windows) { name.to_owned() } else { name.replace('\\', "/") };
        let beside = self.0.iter().map(|folder| folder.join(&forward)).collect::<Vec<_>>();
        let here = PathBuf::from(forward);
        // Last the working folder: programs that write scenes give files as they see them.
        let anew = (!beside.contains(&here)).then_some(here);
        beside.into_iter().chain(anew)
    }
}

/// Line numbers of byte offsets.
pub struct Lines(Vec<usize>);

impl Lines {
    /// Finds the line ends of a text.
    pub fn new(text: &str) -> Self {
        Self(text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i).collect())
    }

    /// The 1-based line of the byte at `offset`.
    pub fn at(&self, offset: usize) -> u32 {
        self.0.partition_point(|&end| end < offset) as u32 + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_dialects_name_a_property_the_same() {
        for (camel, snake) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("alphaU", "alpha_u"),
            ("diffuseReflectance", "diffuse_reflectance"),
            ("wrap_mode", "wrap_mode"),
            ("color0", "color0"),
            ("k", "k"),
        ] {
            assert_eq!(snake_case(camel), snake);
        }
    }

    #[test]
    fn a_line_starts_after_its_newline() {
        let lines = Lines::new("ab\ncd\n\ne");
        assert_eq!([0, 2, 3, 5, 6, 7].map(|i| lines.at(i)), [1, 1, 2, 2, 3, 4]);
    }
}
