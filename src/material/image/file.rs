//! Image files: PNG, JPEG, BMP, TGA, PNM, PFM, HDR and EXR.

use super::{Image, Pixels};
use crate::base::math::{Rgb, linear_from_srgb};
use crate::io::{ExrImage, could_hold, read_named};
use crate::{Error, Result};
use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader};
use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

/// Longest side of an image; a scene file that asks for more is a mistake or an attack.
const MAX_SIDE: u32 = 32_768;
/// Most memory that decoding an image may take, bytes.
const MAX_BYTES: u64 = 2 << 30;

/// What of an image is taken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Take {
    /// Colours; integers are sRGB-encoded.
    #[default]
    Color,
    /// Colours; integers are linear.
    Linear,
    /// One of red, green, blue and alpha (0 to 3) as grey; integers are linear. Alpha is 1 where the file has none.
    Channel(u8),
}

/// How an image is to be taken.
#[derive(Debug, Clone, Copy, Default)]
pub struct ReadOptions {
    /// What of it.
    pub take: Take,
    /// A file that ends early is taken as far as it goes.
    pub allow_truncated: bool,
}

/// Reads a file, and tells what was odd about it. Integer pixels are what [`Take`] says; floats are linear already, those of an
/// EXR file turned into Rec.709.
pub fn read(path: &Path, options: ReadOptions) -> Result<(Image, Vec<String>)> {
    decode(path, &read_named(path)?, options)
}

/// [`read`], of a file that is in memory; messages call it `path`.
pub fn decode(path: &Path, bytes: &[u8], options: ReadOptions) -> Result<(Image, Vec<String>)> {
    let mut odd = Vec::new();
    let is_exr = bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]);
    let channel = |image: Image| match options.take {
        Take::Channel(channel) => image.channel(channel),
        Take::Color | Take::Linear => image,
    };
    let mut image = match bytes.first_chunk() {
        _ if is_exr => channel(read_exr(path, bytes, &mut odd)?),
        Some(b"PF" | b"Pf") => channel(read_pfm(bytes).map_err(|message| Error::input(path, message))?),
        _ => read_other(path, bytes, options, &mut odd)?,
    };
    if let Pixels::Float(pixels) = &mut image.pixels {
        odd.extend(make_finite(pixels).map(|what| format!("{}: {what}", path.display())));
    }
    Ok((image, odd))
}

/// Infinities (those below 0 become 0), such as a sun that half floats cannot hold, become the largest half float, or the image's largest number if that is more;
/// what is no number becomes 0. Says what was changed.
fn make_finite(pixels: &mut [Rgb]) -> Option<String> {
    const LARGEST_HALF: f32 = 65504.0;
    let largest = pixels.iter().flat_map(|p| p.to_array()).filter(|x| x.is_finite()).fold(LARGEST_HALF, f32::max);
    let (mut infinite, mut no_number) = (0, 0);
    for p in pixels.iter_mut().filter(|p| !p.is_finite()) {
        infinite += usize::from(p.to_array().iter().any(|x| x.is_infinite()));
        no_number += usize::from(p.is_nan());
        *p = p.map(|x| if x.is_nan() || x == f32::NEG_INFINITY { 0.0 } else { x.min(largest) });
    }
    let told = [(infinite, format!("infinite, taken for {largest}")), (no_number, "no number, taken for 0".into())];
    let told: Vec<_> = told.into_iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} pixels are {what}")).collect();
    (!told.is_empty()).then(|| told.join("; "))
}

fn read_exr(path: &Path, bytes: &[u8], odd: &mut Vec<String>) -> Result<Image> {
    let exr = ExrImage::from_bytes(path, bytes)?;
    check_size(path, exr.width, exr.height)?;
    let (pixels, others) = exr.picture(path)?;
    odd.extend(others.map(|others| format!("{}: {others}", path.display())));
    Ok(Image::new(exr.width, exr.height, pixels))
}

/// Floats, rows from the bottom, after a head of "PF" (or "Pf" for grey), width, height and a factor that is below 0 where they are
/// little-endian.
fn read_pfm(bytes: &[u8]) -> std::result::Result<Image, String> {
    let head = "a PFM file: expected PF or Pf, width, height and scale";
    let mut at = 0;
    let mut word = || {
        let start = at + bytes[at..].iter().position(|b| !b.is_ascii_whitespace())?;
        let end = start + bytes[start..].iter().position(u8::is_ascii_whitespace)?;
        at = end;
        std::str::from_utf8(&bytes[start..end]).ok()
    };
    let channels = if word() == Some("PF") { 3 } else { 1 };
    let mut side = || word().and_then(|w| w.parse::<u32>().ok()).filter(|n| (1..=MAX_SIDE).contains(n));
    let (Some(width), Some(height)) = (side(), side()) else { return Err(head.into()) };
    let scale = word().and_then(|w| w.parse::<f32>().ok()).filter(|s| s.is_finite() && *s != 0.0).ok_or(head)?;
    let (width, height) = (width as usize, height as usize);
    let rows = bytes.get(at + 1..).unwrap_or_default();
    let expected = width * height * channels * 4;
    if rows.len() < expected {
        return Err(format!("a PFM file of {width} x {height} pixels with {} bytes of them: expected {expected}", rows.len()));
    }
    let number = |b: &[u8]| {
        let b = b.try_into().unwrap_or_default();
        scale.abs() * if scale < 0.0 { f32::from_le_bytes(b) } else { f32::from_be_bytes(b) }
    };
    let pixel = |p: &[u8]| match channels {
        3 => Rgb::new(number(&p[..4]), number(&p[4..8]), number(&p[8..])),
        _ => Rgb::splat(number(p)),
    };
    let rows = rows[..expected].chunks_exact(width * channels * 4).rev();
    Ok(Image::new(width, height, rows.flat_map(|row| row.chunks_exact(channels * 4)).map(pixel).collect()))
}

fn check_size(path: &Path, width: usize, height: usize) -> Result<()> {
    match width.min(height) {
        0 => Err(Error::input(path, format!("the image has {width} x {height} pixels"))),
        _ => Ok(()),
    }
}

fn read_other(path: &Path, bytes: &[u8], options: ReadOptions, odd: &mut Vec<String>) -> Result<Image> {
    let bad = |e: image::ImageError| Error::input(path, format!("not a readable image: {e}"));
    let bytes = radiance(bytes);
    let mut reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format().map_err(|e| Error::io(path, e))?;
    match reader.format() {
        None => reader.set_format(ImageFormat::from_path(path).map_err(bad)?),
        Some(ImageFormat::Png) if !palette_is_whole(&bytes) => {
            return Err(Error::input(path, "not a readable image: its palette is no list of up to 256 colours of three bytes"));
        }
        Some(ImageFormat::Jpeg) if !jpeg_is_whole(&bytes) => {
            let early = "the picture's data ends early: its JPEG has no end marker";
            if !options.allow_truncated {
                let message = format!("{early} (viewers show it with its last rows wrong; --allow-truncated takes it so)");
                return Err(Error::input(path, message));
            }
            odd.push(format!("{}: {early}; its last rows are wrong", path.display()));
        }
        Some(_) => {}
    }
    reader.limits(limits());
    let decoder = reader.into_decoder().map_err(bad)?;
    let (width, height) = decoder.dimensions();
    check_size(path, width as usize, height as usize)?;
    limits().reserve(decoder.total_bytes()).map_err(bad)?;
    let bits = u64::from(width) * u64::from(height) * u64::from(decoder.original_color_type().bits_per_pixel());
    if !could_hold(bytes.len(), bits / 8) {
        let message = format!("{} bytes cannot hold {width} x {height} pixels: not a whole image", bytes.len());
        return Err(Error::input(path, message));
    }
    DynamicImage::from_decoder(decoder).map(|decoded| linear(decoded, options.take)).map_err(bad)
}

/// Whether a PNG file's palette, where it has one, is as the format says; the crate that decodes it takes that for granted.
fn palette_is_whole(png: &[u8]) -> bool {
    let mut rest = png.get(8..).unwrap_or_default();
    while let Some((&[a, b, c, d, ref kind @ ..], content)) = rest.split_first_chunk::<8>() {
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        if kind == b"PLTE" && (!length.is_multiple_of(3) || length > 3 * 256) {
            return false;
        }
        // After its content comes a checksum.
        rest = content.get(length.saturating_add(4)..).unwrap_or_default();
    }
    true
}

fn limits() -> image::Limits {
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(MAX_BYTES);
    limits
}

fn linear(decoded: DynamicImage, take: Take) -> Image {
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let decode = |x: f32| if take == Take::Color { linear_from_srgb(x) } else { x };
    let decoded = match take {
        Take::Channel(channel) => one_channel(decoded, usize::from(channel)),
        Take::Color | Take::Linear => decoded,
    };
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
            return Image::from_bytes(width, height, decoded.into_rgb8().into_raw(), linear);
        }
    };
    Image::new(width, height, pixels)
}

/// One of an image's four channels, as a grey image.
fn one_channel(decoded: DynamicImage, channel: usize) -> DynamicImage {
    let (width, height) = (decoded.width(), decoded.height());
    fn every<T: Copy>(rgba: &[T], channel: usize) -> Vec<T> {
        rgba.iter().skip(channel).step_by(4).copied().collect()
    }
    let grey = match &decoded {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let values = every(decoded.into_rgba32f().as_raw(), channel);
            let rgb = values.into_iter().flat_map(|x| [x; 3]).collect();
            image::Rgb32FImage::from_raw(width, height, rgb).map(DynamicImage::ImageRgb32F)
        }
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let values = every(decoded.into_rgba16().as_raw(), channel);
            image::ImageBuffer::from_raw(width, height, values).map(DynamicImage::ImageLuma16)
        }
        _ => {
            let values = every(decoded.into_rgba8().as_raw(), channel);
            image::GrayImage::from_raw(width, height, values).map(DynamicImage::ImageLuma8)
        }
    };
    grey.unwrap_or_default()
}

/// A Radiance picture as the decoder knows it: `#?RGBE` and others stand for `#?RADIANCE`, and lines may end as on Windows.
fn radiance(bytes: &[u8]) -> Cow<'_, [u8]> {
    let Some(length) = bytes.strip_prefix(b"#?").and_then(|rest| rest.iter().take(40).position(|b| *b == b'\n')) else {
        return Cow::Borrowed(bytes);
    };
    let windows = bytes[1 + length] == b'\r';
    if !windows && bytes.starts_with(b"#?RADIANCE") {
        return Cow::Borrowed(bytes);
    }
    let mut rest = Cow::Borrowed(&bytes[2 + length..]);
    // The head ends with the line of the size, which follows an empty one.
    let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").map(|i| i + 4);
    let end = end.and_then(|i| Some(i + bytes[i..].iter().position(|b| *b == b'\n')? + 1));
    if let (true, Some(end)) = (windows, end) {
        let head = bytes[2 + length..end].iter().filter(|b| **b != b'\r');
        rest = Cow::Owned(head.chain(&bytes[end..]).copied().collect());
    }
    Cow::Owned([b"#?RADIANCE", &*rest].concat())
}

/// Whether a JPEG's segments go on to the end marker: the decoder fills in what is missing without a word.
fn jpeg_is_whole(bytes: &[u8]) -> bool {
    let mut i = 2;
    while let Some(&[mark, kind]) = bytes.get(i..i + 2) {
        i += match (mark, kind) {
            (0xff, 0xd9) => return true,
            // Filling.
            (0xff, 0xff) => 1,
            // Data, a marker's byte among data, restarts.
            (0xff, 0x00 | 0x01 | 0xd0..=0xd7) => 2,
            (0xff, _) => match bytes.get(i + 2..i + 4) {
                Some(length) => 2 + usize::from(u16::from_be_bytes([length[0], length[1]])),
                None => return false,
            },
            _ => 1,
        };
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image without any oddity.
    fn read(path: &Path, raw: bool) -> Result<Image> {
        let take = if raw { Take::Linear } else { Take::Color };
        super::read(path, ReadOptions { take, ..ReadOptions::default() }).map(|(image, odd)| {
            assert!(odd.is_empty(), "{odd:?}");
            image
        })
    }

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
    fn single_channels_are_linear_and_alpha_is_one_where_there_is_none() {
        let dir = tempfile::tempdir().unwrap();
        let of = |path: &Path, channel: u8| {
            let options = ReadOptions { take: Take::Channel(channel), ..ReadOptions::default() };
            super::read(path, options).unwrap().0.pixel(0, 0)
        };
        let (rgba, rgb, deep) = (dir.path().join("a.png"), dir.path().join("b.png"), dir.path().join("c.png"));
        image::RgbaImage::from_pixel(1, 1, image::Rgba([255, 51, 102, 204])).save(&rgba).unwrap();
        image::RgbImage::from_pixel(1, 1, image::Rgb([255, 51, 102])).save(&rgb).unwrap();
        image::ImageBuffer::from_pixel(1, 1, image::Rgba([0u16, 13107, 65535, 26214])).save(&deep).unwrap();
        for (path, expected) in [(&rgba, [1.0, 0.2, 0.4, 0.8]), (&rgb, [1.0, 0.2, 0.4, 1.0]), (&deep, [0.0, 0.2, 1.0, 0.4])] {
            for (channel, expected) in expected.into_iter().enumerate() {
                let found = of(path, channel as u8);
                assert!((found - Rgb::splat(expected)).abs().max_element() < 1e-6, "{path:?} {channel}: {found}");
            }
        }
        let exr = dir.path().join("a.exr");
        ExrImage::new(1, 1).with_rgb("", &[Rgb::new(0.5, 4.0, 0.25)]).write(&exr).unwrap();
        assert_eq!((of(&exr, 1), of(&exr, 3)), (Rgb::splat(4.0), Rgb::ONE));
    }

    /// Values: Mitsuba 3.9.1's `Bitmap` of the same files.
    #[test]
    fn portable_maps_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let numbers = [0.1f32, 0.1, 0.2, 0.5, 0.25, 4.0];
        let path = dir.path().join("a.pfm");
        for (head, little, factor) in [("PF\n1 2\n-1.0\n", true, 1.0), ("PF 1 2 1\n", false, 1.0), ("PF\n1\n2\n-2\n", true, 2.0)]
        {
            let data = numbers.iter().flat_map(|x| if little { x.to_le_bytes() } else { x.to_be_bytes() });
            std::fs::write(&path, head.bytes().chain(data).collect::<Vec<u8>>()).unwrap();
            let image = read(&path, false).unwrap();
            assert_eq!(image.pixel(0, 1), Rgb::new(0.1, 0.1, 0.2) * factor, "{head}");
            assert_eq!(image.pixel(0, 0), Rgb::new(0.5, 0.25, 4.0) * factor, "{head}");
        }
        for bad in [&b"PF\n1 2\n-1.0\n1234"[..], b"PF\n0 2\n-1\n", b"PF", b"PF\n99999999 99999999\n-1\n", b"Pf\n1 1\n0\n1234"] {
            std::fs::write(&path, bad).unwrap();
            assert!(read(&path, false).unwrap_err().to_string().contains("a PFM file"));
        }
        let path = dir.path().join("a.ppm");
        std::fs::write(&path, b"P6\n1 1\n255\n\xff\xe4\x22").unwrap();
        assert!((read(&path, false).unwrap().pixel(0, 0) - Rgb::new(1.0, 0.775_822, 0.015_996)).abs().max_element() < 1e-5);
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
    }
}
