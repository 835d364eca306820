//! The passes of `render-path --method glossy-probes`, frame by frame.

use crate::Device;
use reprobe::gpu::Checks;
use reprobe::io::ExrImage;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A floor with a rough coat, a ball of metal, a blurred mirror and a screen with holes, open to the sky at the front.
const SCENE: &str = r#"<scene version="3.0.0">
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
    <shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="1" angle="-90"/><translate y="-1"/></transform>
      <bsdf type="roughplastic"><float name="alpha" value="0.15"/><rgb name="diffuse_reflectance" value="0.3, 0.5, 0.6"/></bsdf></shape>
    <shape type="rectangle" id="back"><transform name="to_world"><scale value="2"/><translate z="-2"/></transform><ref id="wall"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate y="1" angle="90"/><translate x="-2"/></transform>
      <bsdf type="roughconductor"><float name="alpha" value="0.05"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0.2" y="-0.6" z="-0.2"/><float name="radius" value="0.4"/><bsdf type="conductor"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.4"/><translate x="-0.9" y="-0.5" z="0.2"/></transform>
      <bsdf type="mask"><texture type="checkerboard" name="opacity"><rgb name="color0" value="0"/><rgb name="color1" value="1"/>
        <transform name="to_uv"><scale value="3"/></transform></texture><ref id="wall"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>
    <emitter type="constant"><rgb name="radiance" value="0.3, 0.4, 0.6"/></emitter>
    </scene>"#;

const PATH: &str = r#"{"fov": 70, "size": [96, 54], "frames": [
    {"origin": [0, 0, 1.5], "target": [0, -0.5, 0]}, {"origin": [0.2, 0.1, 1.4], "target": [-0.3, -0.5, 0]}]}"#;

/// What changes between its frames: lights and a colour, lights alone in the dark, and shapes.
const LIGHTS: [(&str, &str); 3] = [
    (
        "lights.json",
        r#"{"fps": 10, "materials": [{"id": "wall", "keyframes": [{"time": 0, "albedo": [0.8, 0.2, 0.1]}, {"time": 0.1, "albedo": [0.1, 0.2, 0.9]}]}],
        "lights": [{"type": "directional", "direction": [0.2, -1, -0.4], "irradiance": [2, 2, 2]}]}"#,
    ),
    (
        "dark.json",
        r#"{"fps": 10, "scene_lights": false, "lights": [
        {"type": "point", "intensity": [3, 2, 1], "keyframes": [{"time": 0, "position": [-1, 0, 0.5]}, {"time": 0.1, "position": [1, 0.3, 0.2]}]},
        {"type": "spot", "position": [0, 1, 1], "target": [0, -1, 0], "intensity": [4, 5, 6]}]}"#,
    ),
    (
        "objects.json",
        r#"{"fps": 10, "emission": [{"shape": "back", "radiance": [0.2, 0.3, 0.5]}],
        "lights": [{"type": "area", "position": [1, 1.2, 0], "target": [0, 0, -1], "size": [0.4, 0.3], "radiance": [9, 8, 6]}],
        "objects": [{"type": "sphere", "radius": 0.3, "albedo": [0.7, 0.5, 0.3], "keyframes": [
            {"time": 0, "position": [-0.3, 0.2, -0.5]}, {"time": 0.1, "position": [0.5, 0.1, -0.6]}]}]}"#,
    ),
];

/// A folder with baked probes of both kinds, a light map and curvatures.
pub struct Baked(tempfile::TempDir);

impl Baked {
    pub fn new() -> Self {
        let baked = Self(tempfile::tempdir().unwrap());
        std::fs::write(baked.at("scene.xml"), SCENE).unwrap();
        std::fs::write(baked.at("path.json"), PATH).unwrap();
        for (name, text) in LIGHTS {
            std::fs::write(baked.at(name), text).unwrap();
        }
        let run = "run scene.xml --path path.json -o out --preset draft --probes 18 --probe-size 128x64 --spp 4 --all-texels \
            --lightmap-spp 4 --texel 0.1 --no-reference --quiet";
        let output = baked.reprobe(run);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let bake = "bake-lightfield scene.xml --probes out/probes.json -o out/lightfield --size 32 --spp 2 --bounces 2 --quiet";
        let output = baked.reprobe(bake);
        assert!(output.status.success(), "{}", text(&output.stderr));
        for options in ["-o out/transport", "-o out/first-order --receiver sh1 --volume 0.5"] {
            let bake = "bake-transport scene.xml --probes out/probes.json --texel 0.2 --rays 32 --relight-rays 400 --quiet";
            let output = baked.reprobe(&format!("{bake} {options}"));
            assert!(output.status.success(), "{}", text(&output.stderr));
        }
        baked
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn reprobe(&self, args: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_reprobe")).args(args.split_whitespace()).current_dir(self.0.path()).output().unwrap()
    }

    /// Renders into the folder `name`, on the CPU without a device. Options of another method begin with `--method`.
    pub fn render(&self, name: &str, device: Option<&Device>, options: &str) -> Output {
        let choice = device.map_or("cpu", |d| d.name.as_str());
        let inputs = match options.split_whitespace().nth(1).filter(|_| options.starts_with("--method")) {
            Some("path-trace") => "",
            Some("light-field-probes") => "--probes out/lightfield",
            Some("radiance-probes") if options.contains("--probes") => "",
            Some("radiance-probes") => "--probes out/transport",
            Some("many-light") => "",
            Some("ulr") => "--probes out/probes --lightmap out/lightmap.exr",
            Some(_) => "--lightmap out/lightmap.exr",
            None => "--probes out/probes --lightmap out/lightmap.exr --curvature out/curvature.exr",
        };
        let mut args = vec!["render-path", "scene.xml", "--path", "path.json", "-o", name, "--device", choice, "--json"];
        args.extend(inputs.split_whitespace().chain(options.split_whitespace()));
        let mut command = Command::new(env!("CARGO_BIN_EXE_reprobe"));
        if let Some(device) = device {
            command.env(Checks::VARIABLE, device.checks_word());
        }
        command.args(args).current_dir(self.0.path()).output().unwrap()
    }

    /// The frames of the CPU and of the adapter, and the latter's timings.
    pub fn both(&self, device: &Device, name: &str, options: &str) -> (Vec<[ExrImage; 2]>, Value) {
        let folders = ["cpu", "gpu"].map(|d| format!("{name}-{d}-checks-{}", device.checks_word()));
        let [_, gpu] = [0, 1].map(|i| {
            let output = self.render(&folders[i], [None, Some(device)][i], options);
            assert!(output.status.success(), "{options}: {}", text(&output.stderr));
            serde_json::from_slice(&output.stdout).unwrap()
        });
        let frame = |n: usize| [0, 1].map(|i| ExrImage::read(&self.at(&folders[i]).join(format!("{n:04}.exr"))).unwrap());
        ((0..2).map(frame).collect(), gpu)
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub fn rmse(images: &[ExrImage; 2], layer: &str) -> f32 {
    let [a, b] = images.each_ref().map(|i| i.rgb(Path::new(""), layer).unwrap());
    let sum: f32 = a.iter().zip(&b).map(|(a, b)| (*a - *b).length_squared()).sum();
    (sum / (3 * a.len()) as f32).sqrt()
}

/// Frames of the CPU and the GPU, rendered with `--aov all`, pass by pass.
fn check(images: &[ExrImage; 2]) {
    let floats = |name: &str| images.each_ref().map(|i| i.f32(Path::new(""), name).unwrap());
    let words = |name: &str| images.each_ref().map(|i| i.u32(Path::new(""), name).unwrap());
    let pixels = images[0].width * images[0].height;
    let share = |count: usize| count as f32 / pixels as f32;
    let differ = |name: &str, tolerance: f32| {
        let [a, b] = floats(name);
        share(a.iter().zip(&b).filter(|(a, b)| (*a - *b).abs() > tolerance * (1.0 + a.abs())).count())
    };
    for axis in ["X", "Y", "Z"] {
        assert!(differ(&format!("reflected.{axis}"), 1e-4) < 1e-3, "reflected.{axis}");
    }
    for name in ["curvature.k1", "curvature.k2", "covariance.xx", "covariance.xy", "covariance.yy"] {
        assert!(differ(name, 1e-3) < 1e-3, "{name}: {}", differ(name, 1e-3));
    }
    // The same probe and texel but for ties, which have the same energy.
    let ([x, y], probe) = (["texel.X", "texel.Y"].map(floats), words("probe"));
    let chosen = |i: usize, k: usize| (probe[k][i], x[k][i].floor() as i32, y[k][i].floor() as i32);
    let other = share((0..pixels).filter(|&i| chosen(i, 0) != chosen(i, 1)).count());
    assert!(other < 0.01, "{other} of the pixels have another best sample");
    assert!(differ("energy", 1e-3) < 2e-3, "energies: {}", differ("energy", 1e-3));
    for layer in ["gathered", "emission", "diffuse", "glossy", ""] {
        assert!(rmse(images, layer) < 1e-3, "{layer}: {}", rmse(images, layer));
    }
    let glossy = images[0].rgb(Path::new(""), "glossy").unwrap();
    assert!(glossy.iter().filter(|c| c.max_element() > 0.0).count() * 3 > pixels, "next to nothing is glossy");
}

pub fn frames_are_the_cpus(device: &Device) {
    let baked = device.baked();
    for (name, options) in [
        ("default", ""),
        ("paper", "--paper"),
        // One probe, so that some pixels come from the frame before; sub-pixels, and the kernel with tails.
        ("fine", "--set gather.probes=1 --supersample 2 --set filter.kernel=ggx --set gather.bilinear=nearest"),
        // Memory for hardly more than one probe of the eight.
        ("small", "--gpu-memory 8M --set gather.albedo_ratio=false --set gather.anchors=3"),
        // Rays of the host, weighed against the device's colours.
        ("joined", "--set rays.per_pixel=4 --set rays.window=2"),
    ] {
        let (frames, timings) = baked.both(device, name, &format!("{options} --aov all"));
        for (n, images) in frames.iter().enumerate() {
            eprintln!("{name}, frame {n}");
            check(images);
        }
        for pass in ["gather", "footprint", "filter", "composite"] {
            assert!(timings["mean_ms"][pass].as_f64().unwrap() > 0.0, "{name}: {pass}");
        }
        assert!(timings["device"].is_string() && ["cpu", "gpu"].contains(&timings["clock"].as_str().unwrap()));
        if name == "small" {
            let bytes = timings["gpu_probe_memory_bytes"].as_u64().unwrap();
            assert!((500_000..2_000_000).contains(&bytes), "{bytes} bytes of probes");
        }
    }
    for (name, options) in [
        ("shapes", "--method path-trace --spp 4 --denoise --lights objects.json"),
        ("rays", "--method lightmap-rt --samples 8 --supersample 2"),
        ("mirrors", "--method image-space-gather --supersample 2"),
    ] {
        let (frames, timings) = baked.both(device, name, options);
        for images in &frames {
            for layer in ["emission", "diffuse", "glossy", ""] {
                // A ray that rounding sends another way is another sample.
                let is_sampled = name == "shapes" || (name == "rays" && ["glossy", ""].contains(&layer));
                let most = if is_sampled { 5e-3 } else { 1e-3 };
                eprintln!("{name}, {layer}: {}", rmse(images, layer));
                assert!(rmse(images, layer) < most, "{name}, {layer}: {}", rmse(images, layer));
            }
        }
        assert!(timings["device"].is_string() && timings["frame_ms"].as_f64().unwrap() > 0.0);
    }
    for (options, expected) in [
        ("--set filter.method=full", "filter.method"),
        ("--gpu-memory 1M", "--gpu-memory"),
        ("--gpu-memory 1T", "like 512M or 2G"),
    ] {
        let output = baked.render("refused", Some(device), options);
        assert!(output.status.code() == Some(2) && text(&output.stderr).contains(expected), "{}", text(&output.stderr));
        assert!(!baked.at("refused").join("0000.exr").exists());
    }
}
