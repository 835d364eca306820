//! `view` and `video`: what is in the files of pictures that people look at.

mod folder;

use folder::{Folder, text};
use glam::Vec3;
use image::RgbImage;
use reprobe::io::ExrImage;
use reprobe::io::picture::heat;
use serde_json::Value;
use std::process::{Command, Stdio};

/// A lamp that fills the view: frames need no more.
const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><transform name="to_world"><lookat origin="0, 0, 1" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle"><emitter type="area"><rgb name="radiance" value="0.5"/></emitter></shape></scene>"#;
const PATH: &str = r#"{"fov": 60, "size": [6, 4], "fps": 5, "keyframes": [
    {"time": 0, "origin": [0, 0, 1], "target": [0, 0, 0]}, {"time": 0.4, "origin": [0, 0, 1.2], "target": [0, 0, 0]}]}"#;

fn folder() -> Folder {
    Folder::with(SCENE, PATH)
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

/// Grey frames, each of its own brightness.
fn walk(f: &Folder, name: &str, [width, height]: [usize; 2], greys: &[(u32, f32)]) {
    std::fs::create_dir_all(f.at(name)).unwrap();
    for (number, grey) in greys {
        let pixels = vec![Vec3::splat(*grey); width * height];
        let image = ExrImage::new(width, height).with_rgb("", &pixels).with_f32("depth", vec![*grey; width * height]);
        image.write(&f.at(name).join(format!("{number:04}.exr"))).unwrap();
    }
}

/// The program with another one in ffmpeg's place.
fn with_ffmpeg(f: &Folder, ffmpeg: &str, args: &str) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reprobe"));
    command.args(args.split_whitespace()).current_dir(f.0.path()).env("FFMPEG", ffmpeg).output().unwrap()
}

/// A program that keeps the frames that it is given as they are, and what it was called with.
#[cfg(unix)]
fn recorder(f: &Folder, then: &str) -> String {
    use std::os::unix::fs::PermissionsExt;
    let script = format!(
        "#!/bin/sh\nif [ \"$1\" = -version ]; then exit; fi\necho \"$@\" > {}\nfor last; do :; done\ncat > \"${{last#file:}}\"\n{then}\n",
        f.at("words").display()
    );
    let path = f.at("recorder");
    std::fs::write(&path, script).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path.display().to_string()
}

#[cfg(unix)]
#[test]
fn frames_reach_the_encoder_in_order_and_padded() {
    let f = folder();
    let ffmpeg = recorder(&f, "");
    // Out of the order of letters, and with files that are no frames beside them.
    let greys: Vec<(u32, f32)> = (9990..10_020).map(|n| (n, (n - 9990) as f32 / 30.0)).collect();
    walk(&f, "frames", [5, 3], &greys);
    std::fs::copy(f.at("frames/9990.exr"), f.at("frames/9990_forward.exr")).unwrap();
    walk(&f, "other", [2, 3], &greys.iter().map(|(n, _)| (*n, 1.0)).collect::<Vec<_>>());
    let run = |args: &str| {
        let output = with_ffmpeg(&f, &ffmpeg, args);
        assert!(output.status.success(), "{args}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    let said = run("video frames --beside other -o walk.mp4");
    assert!(said.starts_with("walk.mp4: 30 frames of 8 x 4 at 24 a second, 1.2 s"), "{said}");
    let bytes = std::fs::read(f.at("walk.mp4")).unwrap();
    let (frames, mark) = bytes.split_at(30 * 8 * 4 * 3);
    assert_eq!(mark[..4], (mark.len() as u32).to_be_bytes());
    assert!(mark[4..].starts_with(b"free\0provenance\0{") && mark.ends_with(b"}made by reprobe"));
    let mut brightest = None;
    for frame in frames.chunks(8 * 4 * 3) {
        let pixel = |x: usize, y: usize| frame[3 * (8 * y + x)];
        assert!((0..4).all(|y| (0..5).all(|x| pixel(x, y) == frame[0]) && (5..8).all(|x| pixel(x, y) == 255)), "{frame:?}");
        assert!(Some(frame[0]) > brightest, "{} follows {brightest:?}", frame[0]);
        brightest = Some(frame[0]);
    }
    let words = std::fs::read_to_string(f.at("words")).unwrap();
    for expected in ["-s 8x4 -r 24 -i -", "-c:v libx264", "-pix_fmt yuv420p", "-crf 16 -movflags +faststart"] {
        assert!(words.contains(expected), "{words}");
    }
    // Numbers are drawn in the range of the first frame: it is all dark, and all others are bright. An animation may have odd sides.
    run("video frames --layer depth -o walk.gif");
    let bytes = std::fs::read(f.at("walk.gif")).unwrap();
    assert_eq!(bytes[..3], heat(0.0));
    assert_eq!(bytes[29 * 45..][..3], heat(1.0));
    run("video frames --layer depth --range 0,2 --fps 12.5 -o walk.gif");
    let bytes = std::fs::read(f.at("walk.gif")).unwrap();
    assert_eq!(bytes[15 * 45..][..3], heat(0.25));
    assert!(std::fs::read_to_string(f.at("words")).unwrap().contains("-r 12.5"));
    // Some are missing.
    std::fs::remove_file(f.at("frames/10003.exr")).unwrap();
    let output = with_ffmpeg(&f, &ffmpeg, "video frames -o walk.mp4");
    let message = text(&output.stderr);
    assert!(message.contains("has 29 of the frames 9990 to 10019: the video leaves out 1"), "{message}");
}

#[cfg(unix)]
#[test]
fn a_video_that_fails_leaves_nothing() {
    let f = folder();
    walk(&f, "frames", [64, 64], &[(0, 0.5), (1, 0.5), (2, 0.5)]);
    walk(&f, "short", [64, 64], &[(0, 0.5), (1, 0.5)]);
    walk(&f, "low", [64, 32], &[(0, 0.5), (1, 0.5), (2, 0.5)]);
    walk(&f, "mixed", [64, 64], &[(0, 0.5), (1, 0.5)]);
    walk(&f, "mixed", [32, 64], &[(2, 0.5)]);
    walk(&f, "cut", [64, 64], &[(0, 0.5), (1, 0.5)]);
    std::fs::write(f.at("cut/0001.exr"), &std::fs::read(f.at("cut/0000.exr")).unwrap()[..200]).unwrap();
    std::fs::create_dir(f.at("empty")).unwrap();
    std::fs::write(f.at("holiday.mp4"), b"\0\0\0\x20ftypisom").unwrap();
    let fine = recorder(&f, "");
    let count = || std::fs::read_dir(f.0.path()).unwrap().count();
    let before = count();
    for (args, expected) in [
        ("frames -o walk.avi", "walk.avi: expected a name that ends in .mp4, .webm or .gif"),
        ("frames -o holiday.mp4", "not written by reprobe"),
        ("frames --layer magic -o walk.mp4", "0000.exr: has no layer \"magic\": expected one of image, depth"),
        ("frames --layer depth --exposure 1 -o walk.mp4", "--exposure is for colours"),
        ("frames --fps 0 -o walk.mp4", "--fps=0: expected"),
        ("frames --beside short -o walk.mp4", "short: no 0002.exr, which frames has"),
        ("short --beside frames -o walk.mp4", "short: no 0002.exr, which frames has"),
        ("frames --beside low -o walk.mp4", "low/0000.exr: has 64 x 32 pixels, frames/0000.exr has 64 x 64: expected one height"),
        ("mixed -o walk.mp4", "mixed/0002.exr: has 32 x 64 pixels: expected 64 x 64"),
        ("cut -o walk.mp4", "cut/0001.exr"),
        ("empty -o walk.mp4", "empty: found no frame"),
        ("none -o walk.mp4", "none"),
    ] {
        let output = with_ffmpeg(&f, &fine, &format!("video {args}"));
        let message = text(&output.stderr);
        assert!(
            output.status.code() == Some(2) && message.contains(expected) && !message.contains("panicked"),
            "{args}: {message}"
        );
        // What the recorder was called with is a file of its own.
        let _ = std::fs::remove_file(f.at("words"));
        assert_eq!(count(), before, "{args}");
    }
    // The encoder fails at its end, or before it has read anything.
    for (name, script) in [("at its end", recorder(&f, "echo no such codec >&2; exit 1")), ("at once", "false".into())] {
        let output = with_ffmpeg(&f, &script, "video frames -o walk.mp4");
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(2) && message.contains("walk.mp4: ffmpeg failed"), "{name}: {message}");
        assert!(name == "at once" || message.contains("no such codec"), "{message}");
        let _ = std::fs::remove_file(f.at("words"));
        assert_eq!(count(), before, "{name}");
    }
}

#[test]
fn without_ffmpeg_it_says_how_to_get_it() {
    let f = folder();
    walk(&f, "frames", [4, 4], &[(0, 0.5)]);
    let named = with_ffmpeg(&f, "/nowhere/ffmpeg", "video frames -o walk.mp4");
    assert!(text(&named.stderr).contains("$FFMPEG: /nowhere/ffmpeg: "), "{}", text(&named.stderr));
    let mut command = Command::new(env!("CARGO_BIN_EXE_reprobe"));
    let command =
        command.args(["video", "frames", "-o", "walk.mp4"]).current_dir(f.0.path()).env_remove("FFMPEG").env("PATH", "");
    let output = command.output().unwrap();
    let message = text(&output.stderr);
    assert!(output.status.code() == Some(2) && message.contains("apt-get install ffmpeg"), "{message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
}

/// Whether there is an ffmpeg to test with; says so where there is none.
fn has_ffmpeg() -> bool {
    let found = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !found {
        eprintln!("skipped: ffmpeg is not on the PATH");
    }
    found
}

/// A video's frames as ffmpeg decodes them, of that size.
fn decoded(f: &Folder, name: &str, [width, height]: [u32; 2]) -> Vec<RgbImage> {
    let mut command = Command::new("ffmpeg");
    let command = command.args(["-loglevel", "error", "-i", name, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]);
    let output = command.current_dir(f.0.path()).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let size = (3 * width * height) as usize;
    assert_eq!(output.stdout.len() % size, 0, "{name}");
    output.stdout.chunks(size).map(|frame| RgbImage::from_raw(width, height, frame.to_vec()).unwrap()).collect()
}

/// Frames of one colour each come back out of each kind of file, in their number, size and colour.
#[test]
fn a_video_decodes_to_its_frames() {
    if !has_ffmpeg() {
        return;
    }
    let f = folder();
    std::fs::create_dir(f.at("frames")).unwrap();
    let colours = [Vec3::new(0.8, 0.1, 0.1), Vec3::new(0.1, 0.6, 0.1), Vec3::new(0.1, 0.2, 0.9), Vec3::splat(0.2), Vec3::ONE];
    for (i, colour) in colours.iter().enumerate() {
        let image = ExrImage::new(33, 24).with_rgb("", &vec![*colour; 33 * 24]);
        image.write(&f.at("frames").join(format!("{i:04}.exr"))).unwrap();
    }
    let expected = |i: usize| -> [u8; 3] {
        let encode = |x: f32| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        colours[i].to_array().map(|x| (encode(x) * 255.0).round() as u8)
    };
    for (name, size) in [("walk.mp4", [34, 24]), ("walk.webm", [34, 24]), ("walk.gif", [33, 24])] {
        // Twice: one of ours may be written again.
        for _ in 0..2 {
            f.success(&format!("video frames -o {name} --fps 10"));
        }
        let frames = decoded(&f, name, size);
        assert_eq!(frames.len(), colours.len(), "{name}");
        for (i, frame) in frames.iter().enumerate() {
            let mean = |c: usize| frame.pixels().map(|p| f64::from(p.0[c])).sum::<f64>() / f64::from(size[0] * size[1]);
            let off = (0..3).map(|c| (mean(c) - f64::from(expected(i)[c])).abs()).fold(0.0, f64::max);
            assert!(off < 4.0, "{name}, frame {i}: {:?} off by {off}", expected(i));
        }
    }
}

/// Frames know how fast the camera path is.
#[test]
fn the_pace_is_that_of_the_camera_path() {
    if !has_ffmpeg() {
        return;
    }
    let f = folder();
    f.success("render-path scene.xml --path path.json --method path-trace --spp 1 -o frames");
    let told = figures(&f, "video frames -o walk.mp4");
    assert_eq!((told["fps"].as_f64(), told["frames"].as_u64()), (Some(5.0), Some(3)), "{told}");
    assert_eq!(decoded(&f, "walk.mp4", [6, 4]).len(), 3);
    assert_eq!(figures(&f, "video frames --fps 30 -o walk.mp4")["fps"], 30.0);
}
