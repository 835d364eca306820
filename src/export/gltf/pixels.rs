//! Pictures of 8-bit pixels, and PNG files of them.

use crate::Result;
use crate::base::math::Rgb;
use crate::io::picture::{byte, srgb};
use crate::io::png;
use crate::material::image::Image;
use image::ExtendedColorType;

/// What RGBM stands for at most: the factor of `MX_lightmap`'s decoder.
pub const RGBM_RANGE: f32 = 34.49;
/// The power of its alpha.
const RGBM_POWER: f32 = 2.2;

/// Pixels as they are to be written.
pub struct Picture {
    bytes: Vec<u8>,
    size: [usize; 2],
    kind: ExtendedColorType,
}

impl Picture {
    /// What pictures with the same pixels have in common, and no others.
    pub fn key(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        self.size.iter().for_each(|&n| {
            hasher.update(&(n as u64).to_le_bytes());
        });
        *hasher.update(&self.bytes).finalize().as_bytes()
    }

    /// A file.
    pub fn png(&self) -> Result<Vec<u8>> {
        png::encoded(&self.bytes, self.size, self.kind)
    }
}

fn picture(bytes: Vec<u8>, size: [usize; 2], kind: ExtendedColorType) -> Picture {
    Picture { bytes, size, kind }
}

/// A texture's colours, sRGB-encoded, with coverage where there is one: a value in [0, 1] a pixel.
pub fn color(image: &Image, coverage: Option<&Image>) -> Picture {
    let size = [image.width, image.height];
    let display = |x: f32| byte(srgb(x));
    match coverage {
        None => picture(each(size, |x, y| image.pixel(x, y).to_array().map(display)), size, ExtendedColorType::Rgb8),
        Some(coverage) => {
            let pixel = |x, y| {
                let [r, g, b] = image.pixel(x, y).to_array().map(display);
                [r, g, b, byte(at(coverage, x, y, size))]
            };
            picture(each(size, pixel), size, ExtendedColorType::Rgba8)
        }
    }
}

/// Numbers in [0, 1] as they are.
pub fn linear(image: &Image) -> Picture {
    let size = [image.width, image.height];
    picture(each(size, |x, y| image.pixel(x, y).to_array().map(byte)), size, ExtendedColorType::Rgb8)
}

/// Roughness in green and metalness in blue, at the size of the larger image.
pub fn roughness_metalness(roughness: &Image, metalness: &Image) -> Picture {
    let size = [roughness.width.max(metalness.width), roughness.height.max(metalness.height)];
    let pixel = |x, y| [255, byte(at(roughness, x, y, size)), byte(at(metalness, x, y, size))];
    picture(each(size, pixel), size, ExtendedColorType::Rgb8)
}

/// Radiance or irradiance of any size: colour times 34.49 alpha^2.2, as `MX_lightmap` decodes it.
pub fn rgbm(pixels: &[Rgb], size: [usize; 2]) -> Picture {
    picture(pixels.iter().flat_map(|p| rgbm_pixel(*p)).collect(), size, ExtendedColorType::Rgba8)
}

/// The least alpha that holds the largest channel, and the channels under it.
fn rgbm_pixel(p: Rgb) -> [u8; 4] {
    let p = p.max(Rgb::ZERO) / RGBM_RANGE;
    let largest = p.max_element().min(1.0);
    let alpha = ((largest.powf(1.0 / RGBM_POWER) * 255.0).ceil()).clamp(1.0, 255.0);
    let scale = (alpha / 255.0).powf(RGBM_POWER);
    let [r, g, b] = (p / scale).to_array().map(byte);
    [r, g, b, alpha as u8]
}

/// A picture's luminance relative to its brightest, for viewers that know occlusion alone.
pub fn occlusion(shares: &[f32], size: [usize; 2]) -> Picture {
    picture(shares.iter().map(|&x| byte(x)).collect(), size, ExtendedColorType::L8)
}

/// The red of the pixel at a place of an image of another size.
fn at(image: &Image, x: usize, y: usize, [width, height]: [usize; 2]) -> f32 {
    image.pixel(x * image.width / width, y * image.height / height).x
}

fn each<const N: usize>([width, height]: [usize; 2], pixel: impl Fn(usize, usize) -> [u8; N]) -> Vec<u8> {
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| pixel(x, y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decoded as the extension's text says, every value comes back within a step of its own alpha.
    #[test]
    fn rgbm_keeps_two_digits_from_a_thousandth_to_thirty() {
        for exponent in -30..=15 {
            let p = Rgb::new(1.0, 0.5, 0.1) * 1.26f32.powi(exponent);
            let [r, g, b, a] = rgbm_pixel(p).map(|byte| f32::from(byte) / 255.0);
            let decoded = Rgb::new(r, g, b) * (34.49 * a.powf(2.2));
            let error = (decoded - p).abs().max_element() / p.max_element();
            assert!(error < 0.5 / 255.0 * 1.6 + 1e-4, "{p}: {decoded}");
        }
    }
}
