//! Spectra given as plugins (`uniform`, `d65`, `regular`, `irregular`, `blackbody`, `srgb`, `rawconstant`), as colours.
//!
//! After Mitsuba's RGB variants: `uniform` is grey and `d65` white, on emitters too. Ours: those variants do not know the other
//! spectra; here they are reduced as [`super::spectrum::reduce`] reduces a list of wavelengths.

use super::params::{Params, wrong};
use super::spectrum::{numbers, reduce};
use super::tree::{Kind, Node, Value};
use crate::Result;
use crate::base::math::Rgb;

/// Plugins that mean one colour.
pub const NAMES: [&str; 7] = ["uniform", "d65", "regular", "irregular", "blackbody", "srgb", "rawconstant"];

/// The colour that a texture plugin means; `None` where it is no spectrum, or one that a texture colours. What is odd about it is added
/// to the warnings of `parent`, whose property it is.
pub fn color<'a>(node: &'a Node, parent: &mut Params<'a>, emitter: bool) -> Result<Option<Rgb>> {
    if !NAMES.contains(&node.plugin.as_str()) {
        return Ok(None);
    }
    let mut p = parent.of(node);
    let color = match node.plugin.as_str() {
        "uniform" => {
            p.accept(&["wavelength_min", "wavelength_max"]);
            Rgb::splat(p.f32("value", 1.0)?)
        }
        "d65" => {
            if !p.children(Kind::Texture)?.is_empty() && p.get("color").is_none() {
                return Ok(None);
            }
            p.color("color", Rgb::ONE)? * p.f32("scale", 1.0)?
        }
        "srgb" => p.color("color", Rgb::ONE)?,
        "rawconstant" => match p.get("value") {
            Some(value) => match value.value {
                Value::Vector(v) => v.as_vec3(),
                Value::Color(c) => c,
                _ => Rgb::splat(p.f32("value", 1.0)?),
            },
            None => return Err(node.at.error("rawconstant has no \"value\"")),
        },
        "blackbody" => {
            p.accept(&["wavelength_min", "wavelength_max"]);
            let temperature = p.positive("temperature", 5000.0)?;
            reduce(&black_body(f64::from(temperature)), emitter)
        }
        _ => reduce(&pairs(&mut p)?, emitter),
    };
    let mut warnings = Vec::new();
    p.finish(&mut warnings);
    warnings.into_iter().for_each(|w| parent.warn(w));
    Ok(Some(color))
}

/// The wavelengths and values of `regular` and `irregular`.
fn pairs(p: &mut Params) -> Result<Vec<(f64, f64)>> {
    let values = list(p, "values")?;
    let wavelengths = if p.node.plugin == "irregular" {
        list(p, "wavelengths")?
    } else {
        let range = [("wavelength_min", 360.0), ("wavelength_max", 830.0)].map(|(name, default)| p.f32(name, default));
        let [from, to] = range;
        let (from, to) = (f64::from(from?), f64::from(to?));
        (0..values.len()).map(|i| from + (to - from) * i as f64 / (values.len().max(2) - 1) as f64).collect()
    };
    if wavelengths.len() != values.len() {
        let (w, v) = (wavelengths.len(), values.len());
        return Err(p.node.at.error(format!("{}: {w} wavelengths and {v} values, expected as many", p.node.plugin)));
    }
    match super::spectrum::ascending(wavelengths.into_iter().zip(values).collect()) {
        Ok(Value::Spectrum(pairs)) => Ok(pairs),
        Ok(_) => Ok(Vec::new()),
        Err(m) => Err(p.node.at.error(format!("{}: {m}", p.node.plugin))),
    }
}

fn list(p: &mut Params, name: &str) -> Result<Vec<f64>> {
    let Some(param) = p.get(name) else {
        return Err(p.node.at.error(format!("{} has no \"{name}\"", p.node.plugin)));
    };
    match &param.value {
        Value::Text(text) => numbers(text).map_err(|m| param.at.error(format!("{name}: {m}"))),
        Value::Vector(v) => Ok(v.to_array().to_vec()),
        _ => Err(wrong(param, p.node, "a string of numbers")),
    }
}

/// Planck's law: W / (m² sr nm) over the visible wavelengths.
fn black_body(kelvin: f64) -> Vec<(f64, f64)> {
    const C: f64 = 299_792_458.0;
    const H: f64 = 6.626_070_15e-34;
    const K: f64 = 1.380_649e-23;
    let at = |nm: f64| {
        let m = nm * 1e-9;
        1e-9 * 2.0 * H * C * C / (m.powi(5) * ((H * C / (m * K * kelvin)).exp() - 1.0))
    };
    (360..=830).step_by(5).map(|nm| (f64::from(nm), at(f64::from(nm)))).collect()
}
