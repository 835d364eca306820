//! Pictures of EXR layers for people: colours as sRGB, vectors and scalars in false colours, indices in random ones.

use super::{ExrImage, Samples, atomic};
use crate::base::math::hash_words;
use crate::{Error, Result};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::collections::BTreeMap;
use std::path::Path;

/// Bytes of a PNG file before its first chunk that says something about the picture: signature and header.
const PNG_HEAD: usize = 8 + 25;
/// What a PNG file that a stage writes says of itself: a chunk's type, its keyword and its text.
const OURS: &[u8] = b"tEXtSoftware\0reprobe";

/// Three bytes a pixel as a PNG file.
pub fn png(pixels: &[u8], [width, height]: [usize; 2]) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(pixels, width as u32, height as u32, ExtendedColorType::Rgb8)
        .map_err(|e| Error::Request(format!("PNG of {width} x {height}: {e}")))?;
    Ok(bytes)
}

/// Writes a PNG file in one step, and into it who did.
pub fn write_png(path: &Path, pixels: &[u8], size: [usize; 2]) -> Result<()> {
    let mut bytes = png(pixels, size)?;
    let mut sum = flate2::Crc::new();
    sum.update(OURS);
    let length = (OURS.len() - 4) as u32;
    let chunk = [&length.to_be_bytes()[..], OURS, &sum.sum().to_be_bytes()].concat();
    bytes.splice(PNG_HEAD..PNG_HEAD, chunk);
    atomic::write(path, &bytes)
}

/// Refuses to write a picture where a file is that is not one of [`write_png`]'s, or where its name says that it is none.
pub fn check_png(path: &Path) -> Result<()> {
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) {
        return Err(Error::input(path, "expected a name that ends in .png"));
    }
    match std::fs::read(path) {
        Ok(bytes) if !is_ours(&bytes) => {
            Err(Error::input(path, "was not written by reprobe: remove it, or give the picture another name"))
        }
        _ => Ok(()),
    }
}

/// Whether a file that begins like this was written by [`write_png`].
pub fn is_ours(start: &[u8]) -> bool {
    start.get(PNG_HEAD + 4..).is_some_and(|rest| rest.starts_with(OURS))
}

/// A layer of an image as 8-bit RGB.
pub struct Picture {
    /// The layer's name; `image` for channels without a layer.
    pub layer: String,
    /// What its colours mean.
    pub legend: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Rows from the top, three bytes a pixel.
    pub rgb: Vec<u8>,
}

/// A picture of each layer of `image`, in order of their names. `exposure` is in stops, for colours.
pub fn pictures(image: &ExrImage, exposure: f32) -> Vec<Picture> {
    let mut layers: BTreeMap<&str, Vec<(&str, &Samples)>> = BTreeMap::new();
    for (name, samples) in &image.channels {
        let (layer, channel) = name.rsplit_once('.').unwrap_or(("", name));
        layers.entry(layer).or_default().push((channel, samples));
    }
    let mut out = Vec::new();
    let mut add = |layer: String, legend: String, rgb: Vec<[u8; 3]>| {
        out.push(Picture {
            layer,
            legend,
            width: image.width as u32,
            height: image.height as u32,
            rgb: rgb.into_iter().flatten().collect(),
        });
    };
    for (layer, mut channels) in layers {
        let title = if layer.is_empty() { "image" } else { layer };
        for (names, kind) in [(["R", "G", "B"], Kind::Color), (["X", "Y", "Z"], Kind::Vector)] {
            let Some(triple) = take(&mut channels, names) else { continue };
            let (legend, rgb) = match kind {
                Kind::Color => (format!("sRGB, exposure {exposure:+}"), color(&triple, exposure)),
                Kind::Vector => vector(&triple),
            };
            add(title.into(), legend, rgb);
        }
        for (name, samples) in channels {
            let title = if layer.is_empty() { name.to_owned() } else { format!("{layer}.{name}") };
            let (legend, rgb) = match samples {
                Samples::U32(v) => ("random colours, one an index".into(), v.iter().map(|&i| index_color(i)).collect()),
                _ => scalar(&floats(samples)),
            };
            add(title, legend, rgb);
        }
    }
    out
}

enum Kind {
    Color,
    Vector,
}

fn take(channels: &mut Vec<(&str, &Samples)>, names: [&str; 3]) -> Option<[Vec<f32>; 3]> {
    let find = |n: &str| channels.iter().find(|(c, _)| *c == n).map(|(_, s)| floats(s));
    let triple = [find(names[0])?, find(names[1])?, find(names[2])?];
    channels.retain(|(c, _)| !names.contains(c));
    Some(triple)
}

fn floats(samples: &Samples) -> Vec<f32> {
    match samples {
        Samples::F16(v) => v.iter().map(|x| x.to_f32()).collect(),
        Samples::F32(v) => v.clone(),
        Samples::U32(v) => v.iter().map(|&x| x as f32).collect(),
    }
}

fn byte(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// The sRGB transfer function, linear to display.
pub fn srgb(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

fn color(triple: &[Vec<f32>; 3], exposure: f32) -> Vec<[u8; 3]> {
    let scale = exposure.exp2();
    (0..triple[0].len()).map(|i| std::array::from_fn(|c| byte(srgb(triple[c][i] * scale)))).collect()
}

/// The 1st and 99th percentile of the finite values.
fn range(values: &[f32]) -> (f32, f32) {
    let mut v: Vec<f32> = values.iter().copied().filter(|x| x.is_finite()).collect();
    if v.is_empty() {
        return (0.0, 1.0);
    }
    v.sort_by(f32::total_cmp);
    let at = |q: f32| v[((v.len() - 1) as f32 * q) as usize];
    (at(0.01), at(0.99))
}

fn vector(triple: &[Vec<f32>; 3]) -> (String, Vec<[u8; 3]>) {
    let ranges: [(f32, f32); 3] = std::array::from_fn(|c| range(&triple[c]));
    let legend = ranges.map(|(lo, hi)| format!("{lo:.3} to {hi:.3}")).join(", ");
    let value = |c: usize, i: usize| byte((triple[c][i] - ranges[c].0) / (ranges[c].1 - ranges[c].0).max(1e-20));
    (
        (format!("X, Y, Z as red, green, blue: {legend}")),
        (0..triple[0].len()).map(|i| std::array::from_fn(|c| value(c, i))).collect(),
    )
}

/// Finite values from dark to bright, and what the colours mean.
pub fn scalar(values: &[f32]) -> (String, Vec<[u8; 3]>) {
    let (lo, hi) = range(values);
    let rgb = values.iter().map(|&v| if v.is_finite() { heat((v - lo) / (hi - lo).max(1e-20)) } else { [255, 0, 255] }).collect();
    (format!("{lo:.4} (dark) to {hi:.4} (bright); magenta is not finite"), rgb)
}

/// Black over violet, red and yellow to white: brightness grows with `x` in [0, 1].
pub fn heat(x: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 6] =
        [[0.0, 0.0, 0.02], [0.25, 0.04, 0.41], [0.58, 0.15, 0.40], [0.87, 0.32, 0.23], [0.99, 0.65, 0.04], [0.99, 1.0, 0.80]];
    let t = x.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let i = (t as usize).min(STOPS.len() - 2);
    std::array::from_fn(|c| byte(STOPS[i][c] + (STOPS[i + 1][c] - STOPS[i][c]) * (t - i as f32)))
}

fn index_color(i: u32) -> [u8; 3] {
    if i == u32::MAX {
        return [0; 3];
    }
    let h = hash_words(&[i]);
    [64 + (h & 0xbf) as u8, 64 + (h >> 8 & 0xbf) as u8, 64 + (h >> 16 & 0xbf) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_layer_becomes_one_picture() {
        let image = ExrImage::new(2, 1)
            .with_rgb("glossy", &[glam::Vec3::ONE, glam::Vec3::ZERO])
            .with_u32("reflector.triangle", vec![3, u32::MAX])
            .with_f32("m", vec![0.0, f32::NAN]);
        let all = pictures(&image, 0.0);
        assert_eq!(all.iter().map(|p| p.layer.as_str()).collect::<Vec<_>>(), ["m", "glossy", "reflector.triangle"]);
        assert_eq!(all[1].rgb, [255, 255, 255, 0, 0, 0]);
        assert_eq!(all[0].rgb[3..], [255, 0, 255]);
        assert_eq!(all[2].rgb[3..], [0, 0, 0]);
    }

    #[test]
    fn our_pictures_are_told_from_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        check_png(&path).unwrap();
        write_png(&path, &[1, 2, 3, 4, 5, 6], [2, 1]).unwrap();
        check_png(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(image::load_from_memory(&bytes).unwrap().to_rgb8().as_raw(), &[1, 2, 3, 4, 5, 6]);
        std::fs::write(&path, png(&[0; 3], [1, 1]).unwrap()).unwrap();
        assert!(check_png(&path).unwrap_err().to_string().contains("not written by reprobe"));
        assert!(check_png(&folder.path().join("scene.xml")).unwrap_err().to_string().contains(".png"));
    }

    #[test]
    fn heat_grows_brighter() {
        let sum = |x: f32| heat(x).iter().map(|&c| u32::from(c)).sum::<u32>();
        assert!((1..=20).all(|i| sum(i as f32 / 20.0) > sum((i - 1) as f32 / 20.0)));
    }
}
