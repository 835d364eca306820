//! `--denoise`: which denoiser is chosen, what of it the frames say, and what Open Image Denoise is worth in a room of few samples.
//!
//! What needs the library is skipped, with a line that says so, where there is none.

mod folder;

use folder::{Folder, text};
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::exchange::{LoadOptions, load};
use reprobe::io::ExrImage;
use reprobe::method::path_trace::{PathTraceParams, path_trace};
use reprobe::metric::{Raster, display};
use reprobe::scene::Camera;
use reprobe::transport::World;
use reprobe::view::denoise::guides;
use reprobe::view::denoiser::{Denoiser, Kind};
use reprobe::view::layers::LayerImages;
use reprobe::view::oidn::Oidn;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// A floor with some gloss under a lamp.
const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="60"/>
      <transform name="to_world"><lookat origin="0, 1, 4" target="0, 0.8, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
      <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="45"/><translate y="1.6" z="-1"/></transform>
      <emitter type="area"><rgb name="radiance" value="5, 4, 3"/></emitter></shape></scene>"#;
const PATH: &str = r#"{"fov": 60, "size": [48, 27], "frames": [{"origin": [0, 1, 4], "target": [0, 0.8, 0]}]}"#;

/// Whether the library is there; says so where it is not.
fn has_library(test: &str) -> bool {
    Oidn::found().map_err(|why| eprintln!("{test}: skipped: {why}")).is_ok()
}

fn folder() -> Folder {
    let f = Folder::with(SCENE, PATH);
    std::fs::create_dir(f.at("empty")).unwrap();
    f
}

/// The command that path-traces the view into `out`.
fn command(out: &str, more: &str) -> String {
    format!("render-path scene.xml --path path.json --method path-trace --spp 4 --json -o {out} {more}")
}

/// Runs it with the library where it is, or only where `of` says.
fn path_trace_to(f: &Folder, out: &str, of: Option<&str>, more: &str) -> Output {
    let mut run = Command::new(env!("CARGO_BIN_EXE_reprobe"));
    if let Some(place) = of {
        run.env("OIDN_DIR", f.at(place));
    }
    run.args(command(out, more).split_whitespace()).current_dir(f.0.path()).output().unwrap()
}

/// The same, which must succeed; its figures.
fn figures(f: &Folder, out: &str, of: Option<&str>, more: &str) -> Value {
    let output = path_trace_to(f, out, of, more);
    assert!(output.status.success(), "{more}: {}", text(&output.stderr));
    serde_json::from_str(&text(&output.stdout)).unwrap()
}

/// The denoiser that a frame's provenance names, and the frame's bytes.
fn frame(f: &Folder, out: &str) -> (Value, Vec<u8>) {
    let path = f.at(out).join("0000.exr");
    let provenance = ExrImage::read(&path).unwrap().provenance.unwrap();
    (provenance.parameters["parameters"]["denoise"].clone(), std::fs::read(path).unwrap())
}

#[test]
fn without_the_library_plain_denoise_is_the_filter_and_oidn_an_error() {
    let f = folder();
    let plain = figures(&f, "plain", Some("empty"), "--denoise");
    assert_eq!(plain["denoiser"], "filter");
    let (denoiser, bytes) = frame(&f, "plain");
    assert_eq!(denoiser["filter"]["levels"], 5, "{denoiser}");
    f.success(&command("filter", "--denoise filter"));
    assert!(frame(&f, "filter").1 == bytes);
    assert_eq!(figures(&f, "plain", None, "--denoise filter")["frames"][0]["kept"], true);
    let output = path_trace_to(&f, "plain", Some("empty"), "--denoise -v");
    assert!(text(&output.stderr).contains("denoised by filter: Open Image Denoise is not found (OIDN_DIR="), "{output:?}");

    let refusal = |place: &str| {
        let output = path_trace_to(&f, "oidn", Some(place), "--denoise oidn");
        let message = text(&output.stderr);
        assert_eq!((output.status.code(), message.lines().count()), (Some(2), 1), "{message}");
        assert!(message.contains("pip install pyoidn") && message.contains("--denoise filter"), "{message}");
        assert!(!f.at("oidn").exists());
        message
    };
    assert!(refusal("empty").contains("empty: no "));
    assert!(refusal("nowhere").contains("nowhere: no "));
    // What has the name alone.
    for name in ["libOpenImageDenoise.so.2", "libOpenImageDenoise.2.dylib", "OpenImageDenoise.dll"] {
        std::fs::write(f.at("empty").join(name), "no library").unwrap();
    }
    assert!(refusal("empty").contains("OpenImageDenoise"));
    assert_eq!(figures(&f, "again", Some("empty"), "--denoise")["denoiser"], "filter");
    assert_eq!(figures(&f, "none", None, "").get("denoiser"), None);
}

#[test]
fn parameters_of_the_denoisers_are_named_and_checked() {
    let f = folder();
    // They were the filter's before there was another.
    assert_eq!(figures(&f, "set", None, "--denoise --set levels=1")["denoiser"], "filter");
    let message = f.refusal(&command("x", "--denoise filter --set guide_samples=2"));
    assert!(message.contains("no such parameter") && message.contains("despeckle"), "{message}");
    if has_library("parameters_of_the_denoisers_are_named_and_checked") {
        let message = f.refusal(&command("x", "--denoise oidn --set levels=1"));
        assert!(message.contains("no such parameter") && message.contains("mirror_alpha"), "{message}");
        let message = f.refusal(&command("x", "--denoise oidn --set guide_samples=0"));
        assert!(message.contains("guide_samples=0: expected 1 to 8"), "{message}");
    }
}

#[test]
fn many_lights_have_either_denoiser_with_its_parameters() {
    let f = folder();
    let command = |out: &str, more: &str| {
        format!("render-path scene.xml --path path.json --method many-light --set vpls=64 --json -o {out} {more}")
    };
    f.success(&command("filter", "--denoise=filter --set denoise.filter.levels=2"));
    let (denoiser, filtered) = frame(&f, "filter");
    assert_eq!(denoiser["filter"]["levels"], 2, "{denoiser}");
    let message = f.refusal(&command("x", "--denoise=filter --set denoise.filter.levels=13"));
    assert!(message.contains("levels=13: expected 0 to 12"), "{message}");
    if has_library("many_lights_have_either_denoiser_with_its_parameters") {
        f.success(&command("oidn", "--denoise=oidn"));
        let (denoiser, bytes) = frame(&f, "oidn");
        assert_eq!(denoiser["oidn"]["version"][0], 2, "{denoiser}");
        assert!(bytes != filtered);
    }
}

#[test]
fn frames_say_which_denoiser_they_had_and_have_the_same_bits_on_any_number_of_threads() {
    if !has_library("frames_say_which_denoiser_they_had_and_have_the_same_bits_on_any_number_of_threads") {
        return;
    }
    let f = folder();
    let plain = figures(&f, "plain", None, "--denoise --threads 1");
    assert!(plain["denoiser"].as_str().unwrap().starts_with("oidn 2."), "{plain}");
    let (denoiser, bytes) = frame(&f, "plain");
    assert_eq!(denoiser["oidn"]["version"][0], 2, "{denoiser}");
    figures(&f, "named", None, "--denoise oidn --threads 3");
    assert!(frame(&f, "named").1 == bytes, "other bits with other threads, or where it is named");
    assert_eq!(figures(&f, "plain", None, "--denoise=oidn")["frames"][0]["kept"], true);
    // The same command without the library makes other frames, and does not keep these.
    assert_eq!(figures(&f, "plain", Some("empty"), "--denoise")["frames"][0]["kept"], false);
    assert!(frame(&f, "plain").1 != bytes);
}

fn rmse<'a>(a: impl Iterator<Item = (&'a Rgb, &'a Rgb)>) -> f32 {
    let (sum, count) = a.fold((0.0, 0), |(sum, count), (a, b)| (sum + (*a - *b).length_squared(), count + 3));
    (sum / count as f32).sqrt()
}

/// Pixels whose display value differs from a neighbour's by more than 0.3.
fn edges(image: &[Rgb], width: usize) -> Vec<bool> {
    let far = |a: Rgb, b: Rgb| (a - b).abs().max_element() > 0.3;
    let at = |i: usize| {
        let right = !(i + 1).is_multiple_of(width) && far(image[i], image[i + 1]);
        right || image.get(i + width).is_some_and(|&below| far(image[i], below))
    };
    (0..image.len()).map(at).collect()
}

#[test]
fn oidn_is_nearer_to_a_room_of_many_samples_than_the_filter_and_keeps_what_a_mirror_shows() {
    const SAMPLES: u32 = 4;
    if !has_library("oidn_is_nearer_to_a_room_of_many_samples_than_the_filter_and_keeps_what_a_mirror_shows") {
        return;
    }
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/room/scene.xml");
    let world = World::new(load(&scene, &LoadOptions::default()).unwrap());
    let camera = Camera { size: [80, 45], ..world.scene.sensor.clone().unwrap() };
    let traced =
        |spp, seed| path_trace(&world, &camera, &PathTraceParams { spp, ..PathTraceParams::default() }, seed, 0, &Silent);
    // At eight samples the filter takes next to nothing off the glossy layer.
    let (reference, noisy) = (traced(512, 1), traced(SAMPLES, 2));
    let denoised = |kind| -> LayerImages {
        let denoiser = Denoiser::choose(Some(kind), &[]).unwrap();
        let guides = guides(&world, &camera, denoiser.mirror_alpha(), denoiser.guide_samples(SAMPLES), 2, 0);
        denoiser.denoise(&noisy, &guides, 80).unwrap()
    };
    let (oidn, filter) = (denoised(Kind::Oidn), denoised(Kind::Filter));
    assert!(oidn.diffuse.iter().chain(&oidn.glossy).all(|c| c.is_finite() && c.min_element() >= 0.0));
    assert_eq!(oidn.emission, noisy.emission);
    let full = oidn.full();
    assert!((0..full.len()).all(|i| full[i] == oidn.emission[i] + oidn.diffuse[i] + oidn.glossy[i]));
    // As they are displayed: a lamp's edge would outweigh all else.
    let shown = |pixels: Vec<Rgb>| display(&Raster { size: [80, 45], pixels }, 0.0).pixels;
    let layers = |l: &LayerImages| [l.full(), l.diffuse.clone(), l.glossy.clone()].map(shown);
    for (name, k) in [("full", 0), ("diffuse", 1), ("glossy", 2)] {
        let [truth, noisy, oidn, filter] = [&reference, &noisy, &oidn, &filter].map(|l| layers(l)[k].clone());
        let error = |image: &[Rgb]| rmse(image.iter().zip(&truth));
        let errors = [error(&noisy), error(&filter), error(&oidn)];
        assert!(errors[2] < 0.9 * errors[1] && errors[1] < errors[0], "{name}: noisy, filter, oidn: {errors:?}");
        let edges = edges(&truth, 80);
        let at_edges =
            |image: &[Rgb]| rmse(image.iter().zip(&truth).zip(&edges).filter(|(_, edge)| **edge).map(|(pair, _)| pair));
        let errors = [at_edges(&noisy), at_edges(&filter), at_edges(&oidn)];
        assert!(edges.iter().filter(|e| **e).count() > 100);
        assert!(errors[2] < 0.9 * errors[0] && errors[2] < errors[1], "{name} at edges: noisy, filter, oidn: {errors:?}");
    }
}
