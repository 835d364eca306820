//! `render-path --method path-trace` from the command line.

use reprobe::io::ExrImage;
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Output};

/// A floor under a lamp, and a camera that sees both.
fn write_scene(path: &Path, with_lamp: bool) {
    let mut scene = json!({
        "type": "scene",
        "sensor": {
            "type": "perspective", "fov": 60,
            "to_world": [{"look_at": {"origin": [0, 1, 4], "target": [0, 0.8, 0], "up": [0, 1, 0]}}],
            "film": {"type": "hdrfilm", "width": 24, "height": 12}
        },
        "floor": {
            "type": "rectangle", "to_world": [{"rotate": {"axis": [1, 0, 0], "angle": -90}}, {"scale": 3}],
            "bsdf": {"type": "roughplastic", "diffuse_reflectance": {"type": "rgb", "value": [0.5, 0.4, 0.3]}, "alpha": 0.2}
        }
    });
    if with_lamp {
        scene["lamp"] = json!({
            "type": "rectangle",
            "to_world": [{"rotate": {"axis": [1, 0, 0], "angle": 45}}, {"translate": [0, 1.6, -1]}],
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [5, 4, 3]}}
        });
    }
    std::fs::write(path, scene.to_string()).unwrap();
}

fn reprobe(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_reprobe")).args(args).output().unwrap()
}

/// Renders into `out` and returns `--json`'s figures.
fn render(scene: &Path, out: &Path, more: &[&str]) -> Value {
    let fixed = ["render-path", scene.to_str().unwrap(), "-o", out.to_str().unwrap(), "--method", "path-trace", "--json"];
    let output = reprobe(&[&fixed, more].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_frame_has_all_layers_and_is_kept_until_something_changes() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, out) = (dir.path().join("scene.json"), dir.path().join("frames"));
    write_scene(&scene, true);
    let frame = out.join("0000.exr");
    let options = ["--spp", "4", "--aov", "all"];

    assert_eq!(render(&scene, &out, &options)["frames"][0]["kept"], false);
    let image = ExrImage::read(&frame).unwrap();
    assert_eq!((image.width, image.height), (24, 12));
    let [full, emission, diffuse, glossy] = ["", "emission", "diffuse", "glossy"].map(|l| image.rgb(&frame, l).unwrap());
    for i in 0..full.len() {
        assert_eq!(full[i], emission[i] + diffuse[i] + glossy[i]);
    }
    for layer in [&emission, &diffuse, &glossy] {
        assert!(layer.iter().any(|c| c.min_element() > 0.0));
    }
    for name in ["depth", "normal.Y", "position.Z", "albedo.R", "alpha"] {
        assert!(image.f32(&frame, name).unwrap().iter().any(|&x| x != 0.0), "{name}");
    }
    assert!(image.u32(&frame, "material").unwrap().contains(&0));

    let bytes = std::fs::read(&frame).unwrap();
    assert_eq!(render(&scene, &out, &options)["frames"][0]["kept"], true);
    std::fs::remove_file(&frame).unwrap();
    let again = render(&scene, &out, &["--spp", "4", "--aov", "all", "--threads", "1"]);
    assert_eq!(again["frames"][0]["kept"], false);
    assert!(std::fs::read(&frame).unwrap() == bytes, "the same bits, whatever the threads");
    assert_eq!(render(&scene, &out, &["--spp", "5", "--aov", "all"])["frames"][0]["kept"], false);
    let timings: Value = serde_json::from_slice(&std::fs::read(out.join("timings.json")).unwrap()).unwrap();
    assert!(timings["frames"][0]["passes_ms"]["path_trace"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_path_gives_a_frame_for_each_of_its_cameras() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, path, out) = (dir.path().join("scene.json"), dir.path().join("path.json"), dir.path().join("frames"));
    write_scene(&scene, true);
    let frames = [[0.0, 1.0, 4.0], [1.0, 1.0, 4.0]].map(|o| json!({"origin": o, "target": [0, 0.8, 0]}));
    std::fs::write(&path, json!({"fov": 50, "size": [100, 50], "frames": frames}).to_string()).unwrap();
    let figures = render(&scene, &out, &["--path", path.to_str().unwrap(), "--size", "8x6", "--spp", "2"]);
    assert_eq!(figures["frames"].as_array().unwrap().len(), 2);
    let [first, second] = ["0000.exr", "0001.exr"].map(|n| ExrImage::read(&out.join(n)).unwrap());
    assert_eq!((second.width, second.height), (8, 6));
    assert!(first.channels != second.channels);
}

#[test]
fn bad_requests_end_with_code_2_and_say_why() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, dark) = (dir.path().join("scene.json"), dir.path().join("dark.json"));
    write_scene(&scene, true);
    write_scene(&dark, false);
    let out = dir.path().join("frames");
    let [scene, dark, out_text] = [&scene, &dark, &out].map(|p| p.to_str().unwrap());
    for (input, more, says) in [
        (dark, vec![], "no emitter"),
        (scene, vec!["--size", "0x5"], "expected WIDTHxHEIGHT"),
        (scene, vec!["--spp", "0"], "--spp"),
        (scene, vec!["--path", "nowhere.json"], "nowhere.json"),
        ("nowhere.xml", vec![], "nowhere.xml"),
    ] {
        let output = reprobe(&[&["render-path", input, "-o", out_text, "--method", "path-trace"], &more[..]].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{more:?}: {message}");
        assert!(message.contains(says) && !message.contains("panicked"), "{more:?}: {message}");
        assert!(!out.exists(), "{more:?} wrote something");
    }
}
