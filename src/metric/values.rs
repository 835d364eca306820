//! `images/NNNN_values.js`: the radiance and the errors of a frame's pixels, for the report to tell below the pointer.
//!
//! A browser lets a page that is a file show pictures but not read them, and run scripts that lie beside it: hence a script, with a
//! PNG picture in it, which the page reads when a pixel is first asked for. The picture holds four parts, one below the other: the
//! upper eight of twelve bits of the image, those of the reference, the lower four of both, and the errors.

use super::{Comparison, Raster, report};
use crate::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// What twelve bits tell of: 2^-20 to 2^16 in steps of 0.6 %. `report.html` knows these numbers too.
const OCTAVES: [f32; 2] = [-20.0, 16.0];
const LARGEST: f32 = 4095.0;

/// Where the script of frame number `index` lies, relative to `index.html`.
pub fn path(index: usize) -> String {
    format!("images/{index:04}_values.js")
}

/// The script of frame number `index`, of the radiance of image and reference.
pub fn script(index: usize, radiance: [&Raster; 2], comparison: &Comparison) -> Result<String> {
    let [a, b] = radiance.map(|r| r.pixels.iter().flat_map(|p| p.to_array()).map(code).collect::<Vec<u16>>());
    let upper = |codes: &[u16]| codes.iter().map(|c| (c >> 4) as u8).collect::<Vec<_>>();
    let lower = a.iter().zip(&b).map(|(a, b)| ((a & 15) << 4 | (b & 15)) as u8).collect();
    let maps = &comparison.maps;
    let errors = (0..maps.flip.len()).flat_map(|i| [maps.difference[i], maps.dssim[i], maps.flip[i]]).map(root).collect();
    let [width, height] = radiance[0].size;
    let png = report::png(&[upper(&a), upper(&b), lower, errors].concat(), [width, 4 * height])?;
    Ok(format!("reprobeValues({index}, \"{}\");\n", STANDARD.encode(png)))
}

/// Radiance on a logarithmic scale; 0 stands for what is less than all of it.
fn code(x: f32) -> u16 {
    let [low, high] = OCTAVES;
    if x < low.exp2() {
        return 0;
    }
    (1.0 + (x.log2() - low) * (LARGEST - 1.0) / (high - low)).round().min(LARGEST) as u16
}

/// The root of an error in [0, 1], as small errors want smaller steps.
fn root(error: f32) -> u8 {
    (error.clamp(0.0, 1.0).sqrt() * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;

    /// As the page has it.
    fn radiance(code: u16) -> f32 {
        if code == 0 { 0.0 } else { ((f32::from(code) - 1.0) * 36.0 / 4094.0 - 20.0).exp2() }
    }

    #[test]
    fn the_page_has_the_scale_and_gets_back_what_was_written() {
        let page = include_str!("report.html");
        assert!(page.contains("code ? 2 ** ((code - 1) * 36 / 4094 - 20) : 0"));
        for x in [1e-6, 0.001, 0.5, 1.0, 37.2, 65536.0] {
            assert!((radiance(code(x)) / x - 1.0).abs() < 0.0031, "{x}: {}", radiance(code(x)));
        }
        assert_eq!([-1.0, 0.0, 1e-7, 1e9].map(code), [0, 0, 0, 4095]);
        for x in [0.0, 0.001, 0.1, 0.5, 1.0] {
            assert!(((f32::from(root(x)) / 255.0).powi(2) - x).abs() < 0.002, "{x}");
        }
    }

    #[test]
    fn the_script_holds_a_picture_of_four_parts() {
        let flat = |x: f32| Raster { size: [12, 11], pixels: vec![Rgb::new(x, 0.0, 1.0); 132] };
        let (a, b) = (flat(0.25), flat(0.5));
        let script = script(3, [&a, &b], &super::super::compare(&a, &b, 0.0)).unwrap();
        let png = script.strip_prefix("reprobeValues(3, \"").and_then(|s| s.strip_suffix("\");\n")).unwrap();
        let picture = image::load_from_memory(&STANDARD.decode(png).unwrap()).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (12, 44));
        let part = |i: u32| picture.get_pixel(5, 4 + 11 * i).0.map(u16::from);
        let red = |i: u32, shift: u16| radiance(part(i)[0] << 4 | (part(2)[0] >> shift & 15));
        assert!((red(0, 4) - 0.25).abs() < 0.001 && (red(1, 0) - 0.5).abs() < 0.002);
        // A third of the sRGB values' difference, 0.735 - 0.537.
        assert!(((f32::from(part(3)[0] as u8) / 255.0).powi(2) - 0.066).abs() < 0.002, "{:?}", part(3));
    }
}
