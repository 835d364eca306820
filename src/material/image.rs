//! Images of linear RGB pixels, and how they are read from files.

use crate::base::math::{Rgb, linear_from_srgb};
use crate::io::ExrImage;
use crate::{Error, Result};
use image::{DynamicImage, ImageReader};
use std::path::Path;

/// Longest side of an image; a scene file that asks for more is a mistake or an attack.
const MAX_SIDE: u32 = 32_768;
/// Most memory that decoding an image may take, bytes.
const MAX_BYTES: u64 = 2 << 30;

/// Linear RGB pixels, row 0 at the top of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    pub(crate) pixels: Pixels,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Pixels {
    Float(Vec<Rgb>),
    /// Three bytes a pixel, a quarter of the floats' memory and cache misses, and the linear value of each byte.
    Bytes {
        rgb: Vec<u8>,
        linear: Box<[f32; 256]>,
    },
}

impl Image {
    /// An image of width x height pixels, rows from the top.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn new(width: usize, height: usize, pixels: Vec<Rgb>) -> Self {
        assert_eq!(pixels.len(), width * height);
        Self { width, height, pixels: Pixels::Float(pixels) }
    }

    /// An image of 8-bit RGB pixels, three bytes each, and the linear value that each byte stands for.
    fn from_bytes(width: usize, height: usize, rgb: Vec<u8>, linear: [f32; 256]) -> Self {
        assert_eq!(rgb.len(), 3 * width * height);
        Self { width, height, pixels: Pixels::Bytes { rgb, linear: Box::new(linear) } }
    }

    /// Mean of all pixels.
    pub fn mean(&self) -> Rgb {
        let sum: glam::DVec3 = (0..self.width * self.height).map(|i| self.at(i).as_dvec3()).sum();
        (sum / (self.width * self.height) as f64).as_vec3()
    }

    /// The pixel in column `x` and row `y`.
    #[inline]
    pub fn pixel(&self, x: usize, y: usize) -> Rgb {
        self.at(y * self.width + x)
    }

    #[inline]
    fn at(&self, i: usize) -> Rgb {
        match &self.pixels {
            Pixels::Float(pixels) => pixels[i],
            Pixels::Bytes { rgb, linear } => {
                let [r, g, b] = [rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]].map(|byte| linear[byte as usize]);
                Rgb::new(r, g, b)
            }
        }
    }
}

/// Reads PNG, JPEG, BMP, TGA, HDR or EXR. Integer pixels are sRGB-encoded unless `raw`; floats are linear already.
pub fn read(path: &Path, raw: bool) -> Result<Image> {
    let mut file = std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
    let mut magic = [0; 4];
    let is_exr = std::io::Read::read_exact(&mut file, &mut magic).is_ok() && magic == [0x76, 0x2f, 0x31, 0x01];
    let image = if is_exr { read_exr(path)? } else { read_other(path, raw)? };
    if let Pixels::Float(pixels) = &image.pixels
        && let Some(i) = pixels.iter().position(|p| !p.is_finite())
    {
        let (x, y) = (i % image.width, i / image.width);
        return Err(Error::input(path, format!("pixel ({x}, {y}) is {}, expected finite numbers", pixels[i])));
    }
    Ok(image)
}

fn read_exr(path: &Path) -> Result<Image> {
    let exr = ExrImage::read(path)?;
    let named = |name: &str| exr.channels.iter().any(|(n, _)| n == name);
    let pixels = if named("R") && named("G") && named("B") {
        exr.rgb(path, "")?
    } else {
        // One channel is grey, whatever it is called.
        let name = match exr.channels.as_slice() {
            [(only, _)] => only.as_str(),
            _ => "Y",
        };
        exr.f32(path, name)?.into_iter().map(Rgb::splat).collect()
    };
    check_size(path, exr.width, exr.height)?;
    Ok(Image::new(exr.width, exr.height, pixels))
}

fn check_size(path: &Path, width: usize, height: usize) -> Result<()> {
    match width.min(height) {
        0 => Err(Error::input(path, format!("the image has {width} x {height} pixels"))),
        _ => Ok(()),
    }
}

fn read_other(path: &Path, raw: bool) -> Result<Image> {
    let bad = |e: image::ImageError| Error::input(path, format!("not a readable image: {e}"));
    let io = |e| Error::io(path, e);
    let mut reader = ImageReader::open(path).map_err(io)?.with_guessed_format().map_err(io)?;
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let decoded = reader.decode().map_err(bad)?;
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    check_size(path, width, height)?;
    let decode = |x: f32| if raw { x } else { linear_from_srgb(x) };
    let color = |p: &[f32]| Rgb::new(p[0], p[1], p[2]);
    let pixels = match &decoded {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            decoded.into_rgb32f().as_raw().chunks_exact(3).map(color).collect()
        }
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let rgb = decoded.into_rgb16();
            rgb.as_raw().chunks_exact(3).map(|p| Rgb::from_array([0, 1, 2].map(|i| decode(f32::from(p[i]) / 65535.0)))).collect()
        }
        _ => {
            let linear = std::array::from_fn(|i| decode(i as f32 / 255.0));
            return Ok(Image::from_bytes(width, height, decoded.into_rgb8().into_raw(), linear));
        }
    };
    Ok(Image::new(width, height, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values: Mitsuba 3.9.1, `bitmap` at a texel's centre, of 8-bit pixels (255, 228, 34) and a 16-bit grey of 17902.
    #[test]
    fn integers_are_srgb_unless_raw_and_alpha_is_dropped() {
        let dir = tempfile::tempdir().unwrap();
        let rgba = dir.path().join("a.png");
        image::RgbaImage::from_pixel(2, 1, image::Rgba([255, 228, 34, 160])).save(&rgba).unwrap();
        let p = read(&rgba, false).unwrap().pixel(1, 0);
        assert!((p - Rgb::new(1.0, 0.775_822, 0.015_996)).abs().max_element() < 1e-5, "{p}");
        let p = read(&rgba, true).unwrap().pixel(1, 0);
        assert!((p - Rgb::new(1.0, 0.894_118, 0.133_333)).abs().max_element() < 1e-5, "{p}");
        let grey = dir.path().join("g.png");
        image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(1, 1, image::Luma([17902])).save(&grey).unwrap();
        let p = read(&grey, false).unwrap().pixel(0, 0);
        assert!((p - Rgb::splat(0.060_64)).abs().max_element() < 3e-5, "{p}");
    }

    #[test]
    fn floats_are_linear_in_every_container() {
        let dir = tempfile::tempdir().unwrap();
        let color = Rgb::new(0.5, 4.0, 0.25);
        let exr = dir.path().join("a.exr");
        ExrImage::new(1, 2).with_rgb("", &[color; 2]).write(&exr).unwrap();
        assert_eq!(read(&exr, false).unwrap(), Image::new(1, 2, vec![color; 2]));
        let hdr = dir.path().join("a.hdr");
        image::Rgb32FImage::from_pixel(1, 1, image::Rgb(color.to_array())).save(&hdr).unwrap();
        assert!((read(&hdr, false).unwrap().pixel(0, 0) - color).abs().max_element() < 0.03);
        let grey = dir.path().join("y.exr");
        ExrImage::new(1, 1).with_f32("depth", vec![3.0]).write(&grey).unwrap();
        assert_eq!(read(&grey, true).unwrap().pixel(0, 0), Rgb::splat(3.0));
    }

    #[test]
    fn broken_images_name_their_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        image::RgbImage::new(16, 16).save(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        // A header that promises a billion pixels.
        let mut bomb = bytes.clone();
        bomb[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
        for content in [&bytes[..bytes.len() / 2], b"nonsense", b"", &bomb] {
            std::fs::write(&path, content).unwrap();
            let message = read(&path, false).unwrap_err().to_string();
            assert!(message.contains("a.png"), "{message}");
        }
        let nan = dir.path().join("nan.exr");
        ExrImage::new(1, 1).with_f32("Y", vec![f32::NAN]).write(&nan).unwrap();
        assert!(read(&nan, false).unwrap_err().to_string().contains("pixel (0, 0)"));
    }
}
