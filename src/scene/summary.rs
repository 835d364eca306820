//! What a scene holds, in numbers.

use super::{Emitter, Scene};
use crate::material::bsdf::Bsdf;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// Counts and bounds of a [`Scene`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Shapes.
    pub shapes: usize,
    /// Triangles of all of them.
    pub triangles: usize,
    /// Shapes that rays meet as the spheres, cylinders and disks that they are.
    pub round_shapes: usize,
    /// Lower and upper corner of everything, metres; `None` where there is nothing.
    pub bounds: Option<[[f32; 3]; 2]>,
    /// How many materials follow each scattering model.
    pub materials: BTreeMap<String, usize>,
    /// How many of them are masked.
    pub masked: usize,
    /// How many lights there are of each kind.
    pub emitters: BTreeMap<&'static str, usize>,
    /// Pixels of the scene's own sensor, where it has one.
    pub sensor: Option<[u32; 2]>,
}

impl Summary {
    /// Counts.
    pub fn of(scene: &Scene) -> Self {
        let geometry = &scene.geometry;
        let (low, high) = geometry.bounds();
        let mut materials = BTreeMap::new();
        for material in &scene.materials {
            *materials.entry(model(&material.bsdf)).or_default() += 1;
        }
        let mut emitters = BTreeMap::new();
        for emitter in &scene.emitters {
            *emitters.entry(kind(emitter)).or_default() += 1;
        }
        Self {
            shapes: geometry.objects.len(),
            triangles: geometry.triangles.len(),
            round_shapes: geometry.rounds.len(),
            bounds: (!geometry.positions.is_empty()).then(|| [low.to_array(), high.to_array()]),
            masked: scene.materials.iter().filter(|m| m.opacity.is_some()).count(),
            materials,
            emitters,
            sensor: scene.sensor.as_ref().map(|camera| camera.size),
        }
    }
}

/// A scattering model's name as scene files have it, with those that it holds.
fn model(bsdf: &Bsdf) -> String {
    let of = |outer: &str, inner: &Bsdf| format!("{outer} {}", model(inner));
    match bsdf {
        Bsdf::Diffuse(_) => "diffuse".into(),
        Bsdf::Plastic(_) => "plastic".into(),
        Bsdf::RoughPlastic(_) => "roughplastic".into(),
        Bsdf::Conductor(_) => "conductor".into(),
        Bsdf::RoughConductor(_) => "roughconductor".into(),
        Bsdf::Dielectric(_) => "dielectric".into(),
        Bsdf::ThinDielectric(_) => "thindielectric".into(),
        Bsdf::RoughDielectric(_) => "roughdielectric".into(),
        Bsdf::Principled(_) => "principled".into(),
        Bsdf::TwoSided(t) => of("twosided", &t.front),
        Bsdf::BumpMap(b) => of("bumpmap", &b.nested),
        Bsdf::NormalMap(n) => of("normalmap", &n.nested),
        Bsdf::Blend(b) => format!("blendbsdf of {} and {}", model(&b.a), model(&b.b)),
    }
}

/// An emitter's name as scene files have it.
fn kind(emitter: &Emitter) -> &'static str {
    match emitter {
        Emitter::Area { .. } => "area",
        Emitter::Envmap { .. } => "envmap",
        Emitter::Constant { .. } => "constant",
        Emitter::Point { .. } => "point",
        Emitter::Spot { .. } => "spot",
        Emitter::Projector { .. } => "projector",
        Emitter::Directional { .. } => "directional",
        Emitter::Sun { .. } => "sun",
    }
}

/// `3 diffuse, 1 plastic`.
fn list<K: fmt::Display>(counts: &BTreeMap<K, usize>) -> String {
    let parts: Vec<String> = counts.iter().map(|(kind, count)| format!("{count} {kind}")).collect();
    if parts.is_empty() { "none".into() } else { parts.join(", ") }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} shapes, {} triangles", self.shapes, self.triangles)?;
        if self.round_shapes > 0 {
            write!(f, ", {} of the shapes traced as round ones", self.round_shapes)?;
        }
        if let Some([low, high]) = self.bounds {
            let [a, b] = [low, high].map(|p| p.map(|x| format!("{x:.3}")).join(" "));
            write!(f, "\nbounds: {a} to {b} m")?;
        }
        write!(f, "\nmaterials: {}", list(&self.materials))?;
        if self.masked > 0 {
            write!(f, "; {} masked", self.masked)?;
        }
        write!(f, "\nemitters: {}", list(&self.emitters))?;
        match self.sensor {
            Some([w, h]) => write!(f, "\nsensor: {w} x {h} pixels"),
            None => write!(f, "\nsensor: none"),
        }
    }
}
