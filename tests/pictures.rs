//! `view`: what is in the pictures that people look at.

mod folder;

use folder::Folder;
use glam::Vec3;
use image::RgbImage;
use reprobe::io::ExrImage;
use reprobe::io::picture::heat;
use serde_json::Value;

fn folder() -> Folder {
    Folder::with("", "")
}

fn png(f: &Folder, name: &str) -> RgbImage {
    image::open(f.at(name)).unwrap().to_rgb8()
}

fn figures(f: &Folder, args: &str) -> Value {
    serde_json::from_str(&f.success(&format!("{args} --json"))).unwrap()
}

/// Two by two pixels with a layer of each kind.
fn layered() -> ExrImage {
    let grey = [0.0, 0.25, 1.0, 4.0].map(Vec3::splat);
    ExrImage::new(2, 2)
        .with_rgb("glossy", &[Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO])
        .with_rgb("", &grey)
        .with_f32("depth", vec![1.0, 2.0, 3.0, f32::INFINITY])
        .with_u32("reflector.triangle", vec![5, 5, 9, u32::MAX])
        .with_f32("reflector.u", vec![0.0, 0.5, 0.5, 1.0])
}

#[test]
fn a_layer_is_drawn_pixel_by_pixel() {
    let f = folder();
    layered().write(&f.at("a.exr")).unwrap();
    let said = f.success("view a.exr -o image.png");
    assert!(
        said.starts_with("image.png: 2 x 2\n") && said.contains("a.exr image: sRGB, exposure +0; values from 0 to 4"),
        "{said}"
    );
    // 0.25 is 137 of sRGB by its definition.
    assert_eq!(png(&f, "image.png").into_raw(), [0, 0, 0, 137, 137, 137, 255, 255, 255, 255, 255, 255]);
    f.success("view a.exr --layer full --exposure -2 -o image.png");
    assert_eq!(png(&f, "image.png").get_pixel(1, 1).0, [255; 3]);
    assert_eq!(png(&f, "image.png").get_pixel(0, 1).0, [137; 3]);
    f.success("view a.exr --layer glossy --scale 3 -o large.png");
    let large = png(&f, "large.png");
    assert_eq!(large.dimensions(), (6, 6));
    assert!(large.enumerate_pixels().all(|(x, y, p)| p.0
        == match (x / 3, y / 3) {
            (0, 0) => [255, 0, 0],
            (1, 0) => [0, 255, 0],
            (0, 1) => [0, 0, 255],
            _ => [0; 3],
        }));
    let depth = figures(&f, "view a.exr --layer depth --range 1,5 -o depth.png");
    assert_eq!(png(&f, "depth.png").into_raw(), [heat(0.0), heat(0.25), heat(0.5), [255, 0, 255]].concat());
    let told = &depth["pictures"][0];
    assert_eq!((told["least"].as_f64(), told["greatest"].as_f64(), told["not_finite"].as_u64()), (Some(1.0), Some(3.0), Some(1)));
    assert_eq!((told["layer"].as_str(), told["kind"].as_str()), (Some("depth"), Some("numbers")));
    let triangles = figures(&f, "view a.exr --layer reflector.triangle -o t.png");
    let picture = png(&f, "t.png");
    let [a, b, c, none] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| picture.get_pixel(x, y).0);
    assert!(a == b && a != c && none == [0; 3] && a != none, "{picture:?}");
    assert_eq!((triangles["pictures"][0]["none"].as_u64(), triangles["pictures"][0]["greatest"].as_f64()), (Some(1), Some(9.0)));
}

#[test]
fn without_a_layer_the_most_telling_one_is_drawn() {
    let f = folder();
    let pixel = [Vec3::ONE];
    for (image, expected) in [
        (ExrImage::new(1, 1).with_rgb("mirrored", &pixel).with_rgb("glossy", &pixel), "glossy"),
        (ExrImage::new(1, 1).with_rgb("back", &pixel).with_rgb("irradiance", &pixel), "irradiance"),
        (ExrImage::new(1, 1).with_f32("facing", vec![1.0]).with_f32("m", vec![1.0]), "m"),
        (ExrImage::new(9000, 1).with_f32("k1", vec![0.0; 9000]).with_f32("d1.X", vec![0.0; 9000]), "k1"),
        (ExrImage::new(1, 1).with_u32("receiver", vec![u32::MAX]), "receiver"),
        (ExrImage::new(1, 1).with_f32("a", vec![f32::NAN]), "a"),
    ] {
        image.write(&f.at("a.exr")).unwrap();
        assert_eq!(figures(&f, "view a.exr -o a.png")["pictures"][0]["layer"], expected);
        assert_eq!(png(&f, "a.png").width() as usize, image.width);
    }
    // What falls on a white wall is pi times what comes from it.
    ExrImage::new(1, 1).with_rgb("irradiance", &[Vec3::splat(0.25 * std::f32::consts::PI)]).write(&f.at("a.exr")).unwrap();
    f.success("view a.exr -o a.png");
    assert_eq!(png(&f, "a.png").get_pixel(0, 0).0, [137; 3]);
}

#[test]
fn several_layers_and_files_are_put_on_a_sheet() {
    let f = folder();
    std::fs::create_dir(f.at("other")).unwrap();
    layered().write(&f.at("a.exr")).unwrap();
    ExrImage::new(2, 2).with_rgb("glossy", &[Vec3::Y; 4]).write(&f.at("other/a.exr")).unwrap();
    let layers = |args: &str| -> Vec<String> {
        let figures = figures(&f, args);
        figures["pictures"].as_array().unwrap().iter().map(|p| p["layer"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(layers("view a.exr --layer all -o all.png"), ["image", "depth", "glossy", "reflector.triangle", "reflector.u"]);
    assert_eq!(layers("view a.exr --layer glossy,depth -o two.png"), ["glossy", "depth"]);
    assert_eq!(layers("view a.exr other/a.exr --layer glossy --scale 20 -o both.png"), ["glossy", "glossy"]);
    let both = png(&f, "both.png");
    let green = both.pixels().filter(|p| p.0 == [0, 255, 0]).count();
    assert_eq!(green, 20 * 20 * 5, "one pixel of the first file and four of the second, 20 x 20 each");
    // A colour is there for one of the layers, and numbers for another.
    f.success("view a.exr --layer glossy,depth --exposure 1 --range 0,1 -o two.png");
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let f = folder();
    layered().write(&f.at("a.exr")).unwrap();
    std::fs::write(f.at("photograph.png"), b"\x89PNG").unwrap();
    for (args, expected) in [
        (
            "a.exr --layer magic -o a.png",
            "a.exr: has no layer \"magic\": expected one of image, depth, glossy, reflector.triangle, reflector.u",
        ),
        ("a.exr --layer depth, -o a.png", "has no layer \"\""),
        ("a.exr --layer depth --exposure 1 -o a.png", "--exposure is for colours; the layer holds numbers"),
        ("a.exr --range 0,1 -o a.png", "--range is for numbers and vectors; the layer holds colours"),
        ("a.exr --layer depth --range 1,1 -o a.png", "--range 1,1: expected two finite numbers"),
        ("a.exr --layer depth --range 1 -o a.png", "expected 2 numbers"),
        ("a.exr --scale 0 -o a.png", "--scale=0: expected 1 to 64"),
        ("a.exr -o a.jpg", "ends in .png"),
        ("a.exr -o photograph.png", "not written by reprobe"),
        ("scene.xml -o a.png", "scene.xml: not a readable EXR file"),
        ("none.exr -o a.png", "none.exr"),
        ("a.exr --device gpu -o a.png", "view runs on the CPU alone"),
    ] {
        let message = f.refusal(&format!("view {args}"));
        assert!(message.contains(expected), "{args}: {message}");
        assert!(!f.at("a.png").exists(), "{args}");
    }
    ExrImage::new(200, 200).with_f32("a", vec![0.0; 40_000]).write(&f.at("large.exr")).unwrap();
    assert!(f.refusal("view large.exr --scale 64 -o a.png").contains("--scale 64: 12800 x 12800 pixels are more than"));
}
