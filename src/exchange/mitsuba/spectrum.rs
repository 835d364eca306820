//! Colours as a scene file gives them: RGB, sRGB, and spectra reduced to linear Rec.709.
//!
//! Ours, after what Mitsuba's RGB variants do: a reflectance is seen under D65, an emitter as it is. One number is
//! grey for a reflectance, but the white of equal energy, slightly red, for an emitter.

use super::tree::Value;
use crate::base::math::{Rgb, linear_from_srgb};
use crate::io::{read_named, text};
use crate::{Error, Result};
use std::path::Path;

/// Linear Rec.709 of a spectrum that is 1 at all wavelengths.
pub const EQUAL_ENERGY_WHITE: Rgb = Rgb::new(1.204_79, 0.948_291, 0.908_916);

/// A number; nothing but finite ones pass.
pub fn number(text: &str) -> std::result::Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() && (x as f32).is_finite() => Ok(x),
        _ => Err(format!("found \"{}\", expected a finite number", text.trim())),
    }
}

/// Numbers between commas or spaces.
pub fn numbers(text: &str) -> std::result::Result<Vec<f64>, String> {
    text.split([',', ' ', '\t', '\n', '\r', ';']).filter(|t| !t.is_empty()).map(number).collect()
}

/// One or three numbers, or `#rrggbb` (taken as linear, as Mitsuba 0.6 does; [`srgb`] decodes).
pub fn rgb(text: &str) -> std::result::Result<Rgb, String> {
    if let Some(hex) = text.trim().strip_prefix('#') {
        let bad = || format!("found \"{}\", expected #rrggbb", text.trim());
        if hex.len() != 6 || !hex.is_ascii() {
            return Err(bad());
        }
        let code = u32::from_str_radix(hex, 16).map_err(|_| bad())?;
        return Ok(Rgb::from_array([16, 8, 0].map(|shift| (code >> shift & 255) as f32 / 255.0)));
    }
    match numbers(text)?.as_slice() {
        [v] => Ok(Rgb::splat(*v as f32)),
        [r, g, b] => Ok(Rgb::new(*r as f32, *g as f32, *b as f32)),
        other => Err(format!("found {} numbers, expected 3 (red, green, blue)", other.len())),
    }
}

/// As [`rgb`], but sRGB-encoded.
pub fn srgb(text: &str) -> std::result::Result<Rgb, String> {
    rgb(text).map(|c| Rgb::from_array(c.to_array().map(linear_from_srgb)))
}

/// One number, or pairs `wavelength:value`.
pub fn parse(text: &str) -> std::result::Result<Value, String> {
    if !text.contains(':') {
        return match numbers(text)?.as_slice() {
            [v] => Ok(Value::Uniform(*v)),
            [r, g, b] => Ok(Value::Color(Rgb::new(*r as f32, *g as f32, *b as f32))),
            other => Err(format!("found {} numbers, expected one, or pairs wavelength:value", other.len())),
        };
    }
    let pairs = text.split([',', ' ', '\t', '\n', '\r']).filter(|t| !t.is_empty()).map(|pair| {
        let (w, v) = pair.split_once(':').ok_or_else(|| format!("found \"{pair}\", expected wavelength:value"))?;
        Ok((number(w)?, number(v)?))
    });
    ascending(pairs.collect::<std::result::Result<_, String>>()?)
}

/// A file of lines `wavelength value`, `#` for comments.
pub fn parse_file(path: &Path) -> Result<Value> {
    let mut pairs = Vec::new();
    for (i, line) in text(path, read_named(path)?)?.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default();
        match numbers(content).map_err(|m| Error::at_line(path, i as u32 + 1, m))?.as_slice() {
            [] => {}
            [w, v] => pairs.push((*w, *v)),
            other => {
                return Err(Error::at_line(
                    path,
                    i as u32 + 1,
                    format!("found {} numbers, expected wavelength and value", other.len()),
                ));
            }
        }
    }
    ascending(pairs).map_err(|m| Error::input(path, m))
}

/// Checks a list of (wavelength, value).
pub fn ascending(pairs: Vec<(f64, f64)>) -> std::result::Result<Value, String> {
    if pairs.len() < 2 {
        return Err(format!("found {} wavelengths, expected at least 2", pairs.len()));
    }
    match pairs.windows(2).find(|p| p[0].0 >= p[1].0) {
        Some(p) => Err(format!("wavelength {} follows {}: expected them ascending", p[1].0, p[0].0)),
        None => Ok(Value::Spectrum(pairs)),
    }
}

/// Linear Rec.709 of a sampled spectrum (zero outside its wavelengths), floored at 0 where it lies outside the gamut.
pub fn reduce(pairs: &[(f64, f64)], emitter: bool) -> Rgb {
    // Steps of 1 nm: user tables may be finer than ours.
    let (mut xyz, mut norm) = ([0f64; 3], 0f64);
    for nm in 360..=830 {
        let nm = f64::from(nm);
        let cie = cie_at(nm);
        let weight = if emitter { 1.0 } else { cie[3] };
        let value = interpolate(pairs, nm);
        for i in 0..3 {
            xyz[i] += cie[i] * weight * value;
        }
        norm += cie[1] * weight;
    }
    let [x, y, z] = xyz.map(|v| v / norm);
    let rgb = [
        3.240_479 * x - 1.537_15 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    ];
    Rgb::from_array(rgb.map(|c| c.max(0.0) as f32))
}

fn interpolate(pairs: &[(f64, f64)], nm: f64) -> f64 {
    let i = pairs.partition_point(|p| p.0 < nm);
    match (i.checked_sub(1).map(|j| pairs[j]), pairs.get(i)) {
        (_, Some(&(w, v))) if w == nm => v,
        (Some((w0, v0)), Some(&(w1, v1))) => v0 + (v1 - v0) * (nm - w0) / (w1 - w0),
        _ => 0.0,
    }
}

fn cie_at(nm: f64) -> [f64; 4] {
    let x = (nm - 360.0) / 10.0;
    let i = (x as usize).min(CIE.len() - 2);
    let t = x - i as f64;
    std::array::from_fn(|c| f64::from(CIE[i][c]) * (1.0 - t) + f64::from(CIE[i + 1][c]) * t)
}

/// Colour matching functions x, y, z (CIE 1931, 2 degrees) and the illuminant D65 (relative), 360 to 830 nm by 10 nm.
#[rustfmt::skip]
const CIE: [[f32; 4]; 48] = [
    [0.00013, 0.000004, 0.000606, 0.471106], [0.000415, 0.000012, 0.001946, 0.526166],
    [0.001368, 0.000039, 0.00645, 0.504816], [0.004243, 0.00012, 0.02005, 0.552016],
    [0.01431, 0.000396, 0.06785, 0.83593], [0.04351, 0.00121, 0.2074, 0.924125],
    [0.13438, 0.004, 0.6456, 0.94378], [0.2839, 0.0116, 1.3856, 0.875602],
    [0.34828, 0.023, 1.74706, 1.05927], [0.3362, 0.038, 1.77211, 1.18193],
    [0.2908, 0.06, 1.6692, 1.190051], [0.19536, 0.09098, 1.28764, 1.160242],
    [0.09564, 0.13902, 0.81295, 1.17097], [0.03201, 0.20802, 0.46518, 1.09913],
    [0.0049, 0.323, 0.272, 1.104615], [0.0093, 0.503, 0.1582, 1.088938],
    [0.06327, 0.71, 0.07825, 1.058512], [0.1655, 0.862, 0.04216, 1.087796],
    [0.2904, 0.954, 0.0203, 1.054623], [0.43345, 0.99495, 0.00875, 1.050997],
    [0.5945, 0.995, 0.0039, 1.010127], [0.7621, 0.952, 0.0021, 0.973098],
    [0.9163, 0.87, 0.00165, 0.967581], [1.0263, 0.757, 0.0011, 0.895837],
    [1.0622, 0.631, 0.0008, 0.909177], [1.0026, 0.503, 0.00034, 0.905065],
    [0.85445, 0.381, 0.00019, 0.885869], [0.6424, 0.265, 0.00005, 0.841321],
    [0.4479, 0.175, 0.00002, 0.845469], [0.2835, 0.107, 0.0, 0.808373],
    [0.1649, 0.061, 0.0, 0.81027], [0.0874, 0.032, 0.0, 0.831111],
    [0.04677, 0.017, 0.0, 0.79077], [0.0227, 0.00821, 0.0, 0.704274],
    [0.011359, 0.004102, 0.0, 0.723343], [0.00579, 0.002091, 0.0, 0.75102],
    [0.002899, 0.001047, 0.0, 0.622279], [0.00144, 0.00052, 0.0, 0.705934],
    [0.00069, 0.000249, 0.0, 0.758474], [0.000332, 0.00012, 0.0, 0.642367],
    [0.000166, 0.00006, 0.0, 0.468883], [0.000083, 0.00003, 0.0, 0.67482],
    [0.000042, 0.000015, 0.0, 0.640247], [0.000021, 0.000007, 0.0, 0.649552],
    [0.00001, 0.000004, 0.0, 0.60054], [0.000005, 0.000002, 0.0, 0.524852],
    [0.000003, 0.000001, 0.0, 0.580223], [0.000001, 0.0, 0.0, 0.609233],
];

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Rgb, b: [f32; 3], tolerance: f32) {
        assert!((a - Rgb::from_array(b)).abs().max_element() < tolerance, "{a} against {b:?}");
    }

    #[test]
    fn equal_energy_is_slightly_red_as_an_emitter() {
        close(reduce(&[(360.0, 1.0), (830.0, 1.0)], true), EQUAL_ENERGY_WHITE.to_array(), 2e-3);
        close(reduce(&[(360.0, 1.0), (830.0, 1.0)], false), [1.0; 3], 4e-3);
    }

    /// Values: Mitsuba 3.9.1, scalar_rgb, `reflectance` of a diffuse and `radiance` of a constant emitter.
    #[test]
    fn wavelength_lists_reduce_as_in_mitsuba() {
        let list = [(400.0, 0.1), (500.0, 0.2), (600.0, 0.6), (700.0, 0.5)];
        close(reduce(&list, false), [0.669582, 0.368142, 0.120002], 3e-3);
        close(reduce(&list, true), [0.773132, 0.353603, 0.103548], 3e-3);
        let ramp = [(360.0, 0.0), (830.0, 1.0)];
        close(reduce(&ramp, false), [0.600295, 0.388922, 0.17177], 3e-3);
        close(reduce(&ramp, true), [0.705542, 0.370655, 0.14984], 3e-3);
    }

    #[test]
    fn colours_read_or_say_what_is_wrong() {
        close(rgb("0.1, 0.2, 0.3").unwrap(), [0.1, 0.2, 0.3], 1e-7);
        close(rgb("0.1 0.2 0.3").unwrap(), [0.1, 0.2, 0.3], 1e-7);
        close(rgb(" 0.5 ").unwrap(), [0.5; 3], 1e-7);
        close(rgb("#ff8000").unwrap(), [1.0, 128.0 / 255.0, 0.0], 1e-7);
        close(srgb("#ff8000").unwrap(), [1.0, 0.215_861, 0.0], 1e-6);
        for bad in ["", "1, 2", "#ff80", "#gg0000", "#äöü", "nan, 0, 0", "inf", "1e300", "red"] {
            assert!(rgb(bad).is_err(), "{bad}");
        }
        for bad in ["400:1", "500:1, 400:2", "400:1, 400:1", "400:x, 500:1", "1, 2"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
