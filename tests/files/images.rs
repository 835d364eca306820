//! Image files: what they mean, and those that are not whole.

use super::{Folder, pattern};
use glam::Vec3;
use reprobe::exchange::LoadOptions;
use reprobe::io::ExrImage;
use reprobe::material::image::{Image, ReadOptions, read};
use std::fs;

fn whole(folder: &Folder, name: &str) -> Image {
    let (image, odd) = read(&folder.path(name), ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(odd.is_empty(), "{odd:?}");
    image
}

/// A picture in each format, by its file's name.
fn pictures(folder: &Folder) -> Vec<String> {
    let picture = image::RgbImage::from_fn(64, 48, |x, y| image::Rgb(pattern(x / 8, y / 8 + x % 3)));
    let formats = ["a.png", "a.jpg", "a.bmp", "a.tga"];
    formats.iter().for_each(|name| picture.save(folder.path(name)).unwrap());
    let linear = image::Rgb32FImage::from_fn(64, 48, |x, y| image::Rgb(pattern(x / 8, y / 8 + x % 3).map(f32::from)));
    linear.save(folder.path("a.hdr")).unwrap();
    let pixels: Vec<Vec3> = linear.pixels().map(|p| Vec3::from(p.0)).collect();
    ExrImage::new(64, 48).with_rgb("", &pixels).write(&folder.path("a.exr")).unwrap();
    formats.iter().map(|&name| name.to_owned()).chain(["a.hdr".into(), "a.exr".into()]).collect()
}

#[test]
fn an_image_that_ends_early_is_an_error_that_names_it() {
    let folder = Folder::new();
    for name in pictures(&folder) {
        let bytes = fs::read(folder.path(&name)).unwrap();
        whole(&folder, &name);
        for i in 1..=40 {
            let cut = bytes.len() * i / 41;
            fs::write(folder.path(&name), &bytes[..cut]).unwrap();
            let message = match read(&folder.path(&name), ReadOptions::default()) {
                Ok(_) => panic!("{name} cut at {cut} of {} is accepted", bytes.len()),
                Err(e) => e.to_string(),
            };
            assert!(message.contains(&name), "{message}");
        }
    }
}

#[test]
fn a_jpeg_that_ends_early_is_taken_when_asked_for() {
    let folder = Folder::new();
    let reference = pictures(&folder).len();
    assert!(reference > 0);
    let bytes = fs::read(folder.path("a.jpg")).unwrap();
    let before = whole(&folder, "a.jpg");
    fs::write(folder.path("a.jpg"), &bytes[..bytes.len() * 3 / 4]).unwrap();
    let body = "<shape type='cube'/><emitter type='envmap'><string name='filename' value='a.jpg'/></emitter>";
    let message = folder.error(body);
    assert!(message.contains("a.jpg") && message.contains("ends early") && message.contains("--allow-truncated"), "{message}");
    let options = LoadOptions { allow_truncated: true, ..LoadOptions::default() };
    let scene = folder.load_with(body, &options).unwrap();
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("a.jpg"), "{:?}", scene.warnings);
    let (cut, _) = read(&folder.path("a.jpg"), ReadOptions { allow_truncated: true, ..ReadOptions::default() }).unwrap();
    assert_eq!(cut.pixel(5, 2), before.pixel(5, 2), "the first rows are as they were");
    // What follows the end marker, and a thumbnail's own marker before it, change nothing.
    let mut padded = bytes.clone();
    padded.extend([0; 100]);
    let thumbnail = [&bytes[..2], &[0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9], &bytes[2..bytes.len() / 2]].concat();
    fs::write(folder.path("a.jpg"), padded).unwrap();
    assert_eq!(whole(&folder, "a.jpg"), before);
    fs::write(folder.path("a.jpg"), thumbnail).unwrap();
    assert!(read(&folder.path("a.jpg"), ReadOptions::default()).is_err());
}

#[test]
fn channels_are_found_in_their_layers() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let color = Vec3::new(0.1, 0.2, 0.3);
    let grey = |name: &str| ExrImage::new(1, 1).with_f32(name, vec![0.5]);
    ExrImage::new(1, 1)
        .with_rgb("ViewLayer.AO", &[Vec3::ONE])
        .with_rgb("ViewLayer.Combined", &[color])
        .with_f32("ViewLayer.Combined.A", vec![1.0])
        .with_f32("ViewLayer.Depth.Z", vec![9.0])
        .write(&path)
        .unwrap();
    let (image, odd) = read(&path, ReadOptions::default()).unwrap();
    assert_eq!(image.pixel(0, 0), color);
    assert!(odd[0].contains("\"ViewLayer.Combined\" is taken"), "{odd:?}");
    ExrImage::new(1, 1).with_rgb("beauty", &[color]).write(&path).unwrap();
    assert_eq!(whole(&folder, "a.exr").pixel(0, 0), color);
    for file in [grey("Y"), grey("depth"), grey("Y").with_f32("A", vec![1.0]), grey("Image.Y").with_f32("Image.A", vec![1.0])] {
        file.write(&path).unwrap();
        assert_eq!(whole(&folder, "a.exr").pixel(0, 0), Vec3::splat(0.5));
    }
    grey("u").with_f32("v", vec![1.0]).write(&path).unwrap();
    let message = read(&path, ReadOptions::default()).unwrap_err().to_string();
    assert!(message.contains("a.exr") && message.contains("found u, v"), "{message}");
}

#[test]
fn infinite_texels_are_clamped_with_a_warning() {
    let folder = Folder::new();
    let sun = Vec3::new(f32::INFINITY, 70_000.0, 1.0);
    let pixels = [sun, Vec3::new(f32::NAN, 2.0, f32::NEG_INFINITY), Vec3::ONE];
    ExrImage::new(3, 1).with_rgb("", &pixels).write(&folder.path("sky.exr")).unwrap();
    let (image, odd) = read(&folder.path("sky.exr"), ReadOptions::default()).unwrap();
    assert_eq!(image.pixel(0, 0), Vec3::new(70_000.0, 70_000.0, 1.0));
    assert_eq!(image.pixel(1, 0), Vec3::new(0.0, 2.0, 0.0));
    assert_eq!(image.pixel(2, 0), Vec3::ONE);
    assert!(odd.len() == 1 && odd[0].contains("2 pixels are infinite") && odd[0].contains("1 pixels are no number"), "{odd:?}");
    let scene = folder.load("<shape type='cube'/><emitter type='envmap'><string name='filename' value='sky.exr'/></emitter>");
    assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("sky.exr"), "{:?}", scene.warnings);
    // A half's sun.
    let half =
        ExrImage { channels: vec![("Y".into(), reprobe::io::Samples::F16(vec![half::f16::INFINITY]))], ..ExrImage::new(1, 1) };
    half.write(&folder.path("h.exr")).unwrap();
    assert_eq!(read(&folder.path("h.exr"), ReadOptions::default()).unwrap().0.pixel(0, 0), Vec3::splat(65_504.0));
}

/// One picture in two sets of primaries is one picture to `compare`.
#[test]
fn compare_sees_through_primaries() {
    use exr::prelude::*;
    let folder = Folder::new();
    // The inverse of what Rec. 2020 becomes, so that both files mean the same.
    let write = |name: &str, wide: bool| {
        let file = folder.path(name);
        let color = |p: Vec2<usize>| {
            let [r, g, b] = pattern(p.x() as u32 / 2, p.y() as u32 / 2).map(|c| f32::from(c) / 255.0);
            if !wide {
                return (r, g, b);
            }
            // ITU-R BT.2087: from Rec.709 to Rec. 2020.
            let row = |m: [f32; 3]| m[0] * r + m[1] * g + m[2] * b;
            (row([0.627404, 0.329283, 0.043313]), row([0.069097, 0.919540, 0.011362]), row([0.016391, 0.088013, 0.895595]))
        };
        let mut image = Image::from_channels((16, 16), SpecificChannels::rgb(color));
        let (red, green, blue) = (Vec2(0.708, 0.292), Vec2(0.17, 0.797), Vec2(0.131, 0.046));
        image.attributes.chromaticities =
            wide.then_some(attribute::Chromaticities { red, green, blue, white: Vec2(0.3127, 0.329) });
        image.write().to_file(&file).unwrap();
    };
    write("a.exr", false);
    write("b.exr", true);
    let out = std::process::Command::new(env!("CARGO_BIN_EXE_reprobe"))
        .args(["compare", "a.exr", "b.exr", "-o", "report", "--max-rmse", "1e-5"])
        .current_dir(folder.0.path())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stdout));
}
