//! Reads image files into linear RGB.

use super::spectrum::linear_from_srgb;
use super::texture::Image;
use crate::io::ExrImage;
use crate::math::Rgb;
use crate::{Error, Result};
use image::{DynamicImage, ImageReader};
use std::path::Path;

/// Longest side of an image; a scene file that asks for more is a mistake or an attack.
const MAX_SIDE: u32 = 32_768;
/// Most memory that decoding an image may take, bytes.
const MAX_BYTES: u64 = 2 << 30;

/// Reads PNG, JPEG, BMP, TGA, HDR or EXR. Integer pixels are sRGB-encoded unless `raw`; floats are linear already.
pub fn read(path: &Path, raw: bool) -> Result<Image> {
    let mut file = std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
    let mut magic = [0; 4];
    let is_exr = std::io::Read::read_exact(&mut file, &mut magic).is_ok() && magic == [0x76, 0x2f, 0x31, 0x01];
    let image = if is_exr { read_exr(path)? } else { read_other(path, raw)? };
    match image.pixels.iter().position(|p| !p.is_finite()) {
        Some(i) => {
            let (x, y) = (i % image.width, i / image.width);
            Err(Error::input(path, format!("pixel ({x}, {y}) is {}, expected finite numbers", image.pixels[i])))
        }
        None => Ok(image),
    }
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
    Ok(Image { width: exr.width, height: exr.height, pixels })
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
            let table: [f32; 256] = std::array::from_fn(|i| decode(i as f32 / 255.0));
            let rgb = decoded.into_rgb8();
            rgb.as_raw().chunks_exact(3).map(|p| Rgb::from_array([0, 1, 2].map(|i| table[p[i] as usize]))).collect()
        }
    };
    Ok(Image { width, height, pixels })
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
        let p = read(&rgba, false).unwrap().pixels[1];
        assert!((p - Rgb::new(1.0, 0.775_822, 0.015_996)).abs().max_element() < 1e-5, "{p}");
        let p = read(&rgba, true).unwrap().pixels[1];
        assert!((p - Rgb::new(1.0, 0.894_118, 0.133_333)).abs().max_element() < 1e-5, "{p}");
        let grey = dir.path().join("g.png");
        image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(1, 1, image::Luma([17902])).save(&grey).unwrap();
        let p = read(&grey, false).unwrap().pixels[0];
        assert!((p - Rgb::splat(0.060_64)).abs().max_element() < 3e-5, "{p}");
    }

    #[test]
    fn floats_are_linear_in_every_container() {
        let dir = tempfile::tempdir().unwrap();
        let color = Rgb::new(0.5, 4.0, 0.25);
        let exr = dir.path().join("a.exr");
        ExrImage::new(1, 2).with_rgb("", &[color; 2]).write(&exr).unwrap();
        assert_eq!(read(&exr, false).unwrap(), Image { width: 1, height: 2, pixels: vec![color; 2] });
        let hdr = dir.path().join("a.hdr");
        image::Rgb32FImage::from_pixel(1, 1, image::Rgb(color.to_array())).save(&hdr).unwrap();
        assert!((read(&hdr, false).unwrap().pixels[0] - color).abs().max_element() < 0.03);
        let grey = dir.path().join("y.exr");
        ExrImage::new(1, 1).with_f32("depth", vec![3.0]).write(&grey).unwrap();
        assert_eq!(read(&grey, true).unwrap().pixels, [Rgb::splat(3.0)]);
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
