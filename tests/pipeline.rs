//! `run`, and what its stages do when they are interrupted or given what does not fit.

mod folder;

use folder::{Folder, text};
use reprobe::io::ExrImage;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="70"/>
      <transform name="to_world"><lookat origin="0, 0, 1.5" target="0, -0.5, 0" up="0, 1, 0"/></transform></sensor>
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
    <shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform>
      <bsdf type="roughplastic"><float name="alpha" value="0.15"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="-0.6" z="0"/><float name="radius" value="0.35"/>
      <bsdf type="conductor"/></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>
    </scene>"#;

const PATH: &str = r#"{"fov": 70, "size": [32, 18], "frames": [
    {"origin": [0, 0, 1.5], "target": [0, -0.5, 0]}, {"origin": [0.2, 0.1, 1.4], "target": [0, -0.5, 0]}]}"#;

fn folder() -> Folder {
    Folder::with(SCENE, PATH)
}

/// Runs a command that must succeed; its `--json` figures.
fn figures(f: &Folder, args: &str) -> Value {
    serde_json::from_str(&f.success(&format!("{args} --json"))).unwrap()
}

const RUN: &str = "run scene.xml --path path.json -o out --preset draft --probes 8 --probe-size 32x16 --spp 4 --size 32x18 \
    --lightmap-spp 4 --texel 0.2 --reference-spp 8 --supersample 1";

/// Content of every file below a folder, by relative path, but for those that hold times.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut todo = vec![folder.to_path_buf()];
    while let Some(dir) = todo.pop() {
        for entry in std::fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                todo.push(path);
            } else if path.file_name().is_some_and(|n| n != "timings.json") {
                files.push((path.strip_prefix(folder).unwrap().to_path_buf(), std::fs::read(&path).unwrap()));
            }
        }
    }
    files.sort();
    files
}

#[test]
fn run_makes_frames_and_a_report_and_threads_do_not_change_a_bit() {
    let f = folder();
    figures(&f, &format!("{RUN} --threads 1"));
    let image = ExrImage::read(&f.at("out/frames/0001.exr")).unwrap();
    assert_eq!((image.width, image.height), (32, 18));
    for layer in ["glossy", "diffuse", "emission"] {
        let pixels = image.rgb(Path::new(""), layer).unwrap();
        assert!(pixels.iter().any(|p| p.max_element() > 0.0) || layer == "emission", "the {layer} layer is black");
        assert!(pixels.iter().all(|p| p.is_finite()));
    }
    for name in ["report/index.html", "report/metrics.json", "report-glossy/metrics.json"] {
        assert!(f.at("out").join(name).exists(), "{name}");
    }
    let first = contents(&f.at("out"));
    std::fs::remove_dir_all(f.at("out")).unwrap();
    figures(&f, &format!("{RUN} --threads 3"));
    let second = contents(&f.at("out"));
    let names = |c: &[(PathBuf, Vec<u8>)]| c.iter().map(|(p, _)| p.clone()).collect::<Vec<_>>();
    assert_eq!(names(&first), names(&second));
    for (a, b) in first.iter().zip(&second) {
        assert!(a.1 == b.1, "{} differs", a.0.display());
    }
}

/// The scene and its path with all lengths multiplied by `scale`.
fn scaled(f: &Folder, scale: f64) {
    let number = |x: &str| (x.trim().parse::<f64>().unwrap() * scale).to_string();
    let vector = |x: &str| x.split(',').map(number).collect::<Vec<_>>().join(", ");
    let shapes = SCENE.replace("</transform>", &format!("<scale value=\"{scale}\"/></transform>"));
    let look = |name: &str, text: &str| {
        let (before, rest) = text.split_once(&format!("{name}=\"")).unwrap();
        let (value, after) = rest.split_once('"').unwrap();
        format!("{before}{name}=\"{}\"{after}", vector(value))
    };
    // The camera's own transform is a frame without a scale.
    let camera = shapes.replacen(&format!("<scale value=\"{scale}\"/>"), "", 1);
    let scene = look("target", &look("origin", &camera));
    let ball = format!("<transform name=\"to_world\"><scale value=\"{scale}\"/></transform><bsdf type=\"conductor\"/>");
    std::fs::write(f.at("scene.xml"), scene.replace("<bsdf type=\"conductor\"/>", &ball)).unwrap();
    let mut path: Value = serde_json::from_str(PATH).unwrap();
    for frame in path["frames"].as_array_mut().unwrap() {
        for end in ["origin", "target"] {
            for x in frame[end].as_array_mut().unwrap() {
                *x = (x.as_f64().unwrap() * scale).into();
            }
        }
    }
    std::fs::write(f.at("path.json"), path.to_string()).unwrap();
}

#[test]
fn a_room_in_any_unit_looks_as_in_metres() {
    let frames = |scale: f64| {
        let f = folder();
        scaled(&f, scale);
        let output = f.reprobe(&format!("{RUN} --frames 0"));
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert_eq!(text(&output.stderr).contains("--unit-scale"), scale != 1.0, "{}", text(&output.stderr));
        ["frames", "reference"].map(|folder| {
            let image = ExrImage::read(&f.at("out").join(folder).join("0000.exr")).unwrap();
            image.rgb(Path::new(""), "glossy").unwrap()
        })
    };
    let metres = frames(1.0);
    for scale in [1e-6, 1e5] {
        for (a, b) in metres.iter().zip(frames(scale)) {
            // Lengths are rounded in the last place: few paths take another turn.
            let differs = a.iter().zip(&b).filter(|(a, b)| (**a - **b).length() > 1e-3 * (1.0 + a.length())).count();
            let mean = |pixels: &[glam::Vec3]| pixels.iter().map(|p| p.element_sum()).sum::<f32>();
            assert!(differs < a.len() / 20, "{scale}: {differs} of {} pixels", a.len());
            assert!((mean(&b) / mean(a) - 1.0).abs() < 0.01, "{scale}: {} to {}", mean(&b), mean(a));
        }
    }
}

#[test]
fn run_goes_through_with_the_papers_text() {
    let f = folder();
    figures(&f, &format!("{RUN} --paper"));
    let frame = ExrImage::read(&f.at("out/frames/0001.exr")).unwrap();
    assert!(frame.rgb(Path::new(""), "glossy").unwrap().iter().any(|p| p.max_element() > 0.0));
}

#[test]
fn run_compares_the_layers_that_a_reference_has() {
    let f = folder();
    std::fs::create_dir(f.at("given")).unwrap();
    let message = f.refusal(&format!("{RUN} --reference given"));
    assert!(message.contains("given: found no EXR file"), "{message}");
    for frame in ["0000.exr", "0001.exr"] {
        ExrImage::new(32, 18).with_rgb("glossy", &[glam::Vec3::ZERO; 32 * 18]).write(&f.at("given").join(frame)).unwrap();
    }
    figures(&f, &format!("{RUN} --reference given"));
    assert!(f.at("out/report-glossy/metrics.json").exists() && !f.at("out/report").exists());
}

#[test]
fn run_again_does_only_what_is_missing() {
    let f = folder();
    figures(&f, RUN);
    let before = contents(&f.at("out"));
    let bake = |figures: &Value| figures["stages"][5]["figures"].clone();
    assert_eq!(bake(&figures(&f, RUN))["baked"], 0);
    // A bake that was killed has some probes, and no set.json.
    std::fs::remove_file(f.at("out/probes/set.json")).unwrap();
    std::fs::remove_file(f.at("out/probes/0000.exr")).unwrap();
    std::fs::write(f.at("out/probes/.reprobe-x.tmp"), "half a file").unwrap();
    let message = f.refusal(&render(""));
    assert!(message.contains("set.json") && message.contains("bake-probes"), "{message}");
    assert_eq!(bake(&figures(&f, RUN))["baked"], 1);
    assert!(!f.at("out/probes/.reprobe-x.tmp").exists());
    assert!(contents(&f.at("out")) == before, "the resumed bake differs from the whole one");
}

fn render(more: &str) -> String {
    format!(
        "render-path scene.xml --path path.json --size 32x18 --probes out/probes --curvature out/curvature.exr \
         --lightmap out/lightmap.exr -o again {more}"
    )
}

#[test]
fn rays_beside_probes_are_nearer_and_threads_do_not_change_a_bit() {
    let f = folder();
    figures(&f, RUN);
    let size = "scene.xml --path path.json --size 32x18";
    figures(&f, &format!("render-path {size} --method path-trace --spp 1024 -o reference"));
    let rays = "--set rays.per_pixel=128 --set rays.window=2";
    figures(&f, &render(&format!("{rays} --threads 1")));
    let joined = std::fs::read(f.at("again/0001.exr")).unwrap();
    std::fs::remove_dir_all(f.at("again")).unwrap();
    figures(&f, &render(&format!("{rays} --threads 3")));
    assert!(joined == std::fs::read(f.at("again/0001.exr")).unwrap(), "other bits on other threads");
    let error = |frames: &str| {
        let report = figures(&f, &format!("compare {frames} reference --layer glossy -o report"));
        report["mean"]["rmse_rgb"].as_f64().unwrap()
    };
    let [probes, joined] = ["out/frames", "again"].map(error);
    assert!(joined < 0.9 * probes, "probes {probes}, joined {joined}");

    // Our own filter looks less far where rays are many, unless it is told to.
    for (set, levels) in [("16", 1), ("4", 2), ("4 --set denoise.filter.levels=3", 3)] {
        figures(&f, &render(&format!("--denoise=filter --set rays.per_pixel={set}")));
        let shown: Value = serde_json::from_str(&f.success("info again/0001.exr --json")).unwrap();
        assert_eq!(shown["provenance"]["parameters"]["parameters"]["denoise"]["filter"]["levels"], levels, "{set}");
    }
    let message = f.refusal(&render("--denoise=filter"));
    assert!(message.contains("--set rays.per_pixel=24"), "{message}");
    let message = f.refusal(&render("--set rays.per_pixel=1"));
    assert!(message.contains("0, or 2 and more"), "{message}");
    let message = f.refusal(&render("--set rays.per_pixel=4").replace("--lightmap out/lightmap.exr", ""));
    assert!(message.contains("--lightmap FILE"), "{message}");
}

#[test]
fn inputs_from_another_scene_or_another_run_are_refused() {
    let f = folder();
    figures(&f, RUN);
    let message = f.refusal(&render("--supersample 2"));
    assert!(message.contains("other views") && message.contains("--for-path"), "{message}");
    figures(&f, &render("--frames 1"));
    let message = f.refusal(&render("--set gather.falof=3"));
    assert!(message.contains("gather.falloff=128"), "{message}");

    // Another camera is no other scene, another colour is.
    std::fs::write(f.at("scene.xml"), SCENE.replace("0, 0, 1.5\"", "0, 0.1, 1.5\"")).unwrap();
    figures(&f, &render(""));
    std::fs::write(f.at("scene.xml"), SCENE.replace("0.6, 0.5, 0.4", "0.6, 0.5, 0.3")).unwrap();
    let message = f.refusal(&render(""));
    assert!(message.contains("another scene") && message.contains("curvature.exr"), "{message}");
    let message = f.refusal("render-path scene.xml --path path.json --size 32x18 --method ulr --probes out/probes -o again");
    assert!(message.contains("another scene") && message.contains("set.json"), "{message}");
    let message = f.refusal("resmap scene.xml --probes out/probes.json -o out/resmap");
    assert!(message.contains("another scene") && message.contains("probes.json"), "{message}");
    std::fs::write(f.at("scene.xml"), SCENE).unwrap();

    // Probes placed anew: the old maps do not fit.
    figures(&f, "place-probes scene.xml --grid 2x2x1 -o out/probes.json");
    let message = f.refusal("bake-probes scene.xml --probes out/probes.json --qhmap out/qhmap -o out/new");
    assert!(message.contains("qhmap"), "{message}");
}

#[test]
fn broken_files_are_refused_by_name() {
    let f = folder();
    figures(&f, RUN);
    let bytes = std::fs::read(f.at("out/probes/0002.exr")).unwrap();
    for (file, command) in [
        ("out/probes/0002.exr", render("")),
        ("out/probes/0002_forward.exr", render("")),
        ("out/probes/set.json", render("")),
        ("out/curvature.exr", render("")),
        ("out/lightmap.exr", render("")),
        ("out/probes.json", "resmap scene.xml --probes out/probes.json -o new".into()),
        ("out/resmap/set.json", "qhmap out/resmap -o new".into()),
        ("path.json", render("")),
        ("scene.xml", render("")),
    ] {
        let whole = std::fs::read(f.at(file)).unwrap();
        for broken in [&whole[..whole.len() / 2], &b"nonsense"[..], &b""[..]] {
            std::fs::write(f.at(file), broken).unwrap();
            let message = f.refusal(&command);
            let name = Path::new(file).file_name().unwrap().to_str().unwrap();
            assert!(message.contains(name), "{file}: {message}");
        }
        std::fs::write(f.at(file), whole).unwrap();
        let _ = std::fs::remove_dir_all(f.at("again"));
        let _ = std::fs::remove_dir_all(f.at("new"));
    }
    assert_eq!(bytes, std::fs::read(f.at("out/probes/0002.exr")).unwrap());
}

#[test]
fn an_output_that_cannot_be_written_is_an_error() {
    let f = folder();
    std::fs::write(f.at("file"), "in the way").unwrap();
    let message = f.refusal("curvature scene.xml -o file/curvature.exr");
    assert!(message.contains("file"), "{message}");
    // A limit on file size cuts a write short, as a full disk does.
    if cfg!(target_os = "linux") {
        let script =
            format!("trap '' XFSZ; ulimit -f 1; exec {} curvature scene.xml -o curvature.exr", env!("CARGO_BIN_EXE_reprobe"));
        let output = Command::new("bash").args(["-c", &script]).current_dir(f.0.path()).output().unwrap();
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("curvature.exr") && !message.contains("panicked"), "{message}");
        assert!(!f.at("curvature.exr").exists());
        assert!(std::fs::read_dir(f.0.path()).unwrap().all(|e| !e.unwrap().file_name().to_string_lossy().ends_with(".tmp")));
    }
}

#[test]
fn a_dry_run_prints_the_commands_and_writes_nothing() {
    let f = folder();
    let output = f.reprobe(&format!("{RUN} --dry-run"));
    let lines: Vec<String> = text(&output.stdout).lines().map(str::to_owned).collect();
    let commands = ["place-probes", "resmap", "qhmap", "curvature", "bake-lightmap", "bake-probes", "render-path", "render-path"];
    for (line, command) in lines.iter().zip(commands) {
        assert!(line.starts_with(&format!("reprobe {command} ")), "{line}");
    }
    assert!(lines.len() >= 9 && !f.at("out").exists());
}

#[test]
fn every_baseline_writes_the_layers_and_keeps_its_frames() {
    let f = folder();
    figures(&f, &format!("{RUN} --all-texels --no-reference"));
    for (method, inputs) in [
        ("ulr", "--probes out/probes --lightmap out/lightmap.exr --supersample 2"),
        ("image-space-gather", "--lightmap out/lightmap.exr --samples 20"),
        ("lightmap-rt", "--lightmap out/lightmap.exr --samples 2 --max-depth 2 --denoise"),
        ("path-trace", "--spp 2 --denoise"),
    ] {
        let command = format!("render-path scene.xml --path path.json --size 32x18 --method {method} -o {method} {inputs}");
        let first = figures(&f, &format!("{command} --threads 1"));
        assert_eq!(first["method"], method);
        assert!(first["frame_ms"].as_f64().unwrap() > 0.0);
        let before = contents(&f.at(method));
        let frame = ExrImage::read(&f.at(method).join("0001.exr")).unwrap();
        let [full, emission, diffuse, glossy] =
            ["", "emission", "diffuse", "glossy"].map(|l| frame.rgb(Path::new(""), l).unwrap());
        for i in 0..full.len() {
            assert_eq!(full[i], emission[i] + diffuse[i] + glossy[i]);
        }
        assert!(glossy.iter().any(|c| c.max_element() > 0.0) && diffuse.iter().any(|c| c.max_element() > 0.0), "{method}");
        assert_eq!(figures(&f, &command)["frames"][1]["kept"], true, "{method}");
        std::fs::remove_file(f.at(method).join("0000.exr")).unwrap();
        let again = figures(&f, &format!("{command} --threads 3"));
        assert_eq!((&again["frames"][0]["kept"], &again["frames"][1]["kept"]), (&Value::Bool(false), &Value::Bool(true)));
        assert!(contents(&f.at(method)) == before, "{method}: other bits with other threads");
        std::fs::remove_file(f.at(method).join("0000.exr")).unwrap();
        let message = f.refusal(&format!("{command} --device gpu:none"));
        assert!(message.contains("--device"), "{message}");
    }
}

#[test]
fn a_budget_chooses_a_sample_count_that_gives_the_same_frames_again() {
    let f = folder();
    figures(&f, &format!("{RUN} --no-reference"));
    let command = |more: &str| format!("render-path scene.xml --path path.json --size 32x18 {more}");
    let path_trace = |more: &str| command(&format!("--method path-trace {more}"));
    let chosen = figures(&f, &path_trace("-o a --budget-ms 200"));
    let spp = chosen["samples"].as_u64().unwrap();
    assert!(spp > 1 && chosen["budget_ms"] == 200.0, "{chosen}");
    assert_eq!(figures(&f, &path_trace(&format!("-o b --spp {spp}")))["samples"].as_u64(), Some(spp));
    assert!(contents(&f.at("a")) == contents(&f.at("b")));
    let lightmap_rt = command("--method lightmap-rt --lightmap out/lightmap.exr -o c");
    let matched = figures(&f, &format!("{lightmap_rt} --match-time a"));
    assert!(matched["samples"].as_u64().unwrap() >= 1 && matched["budget_ms"].as_f64().unwrap() > 0.0);

    let message = f.refusal(&path_trace("-o d --budget-ms 200 --spp 3"));
    assert!(message.contains("cannot be used with"), "{message}");
    assert!(f.refusal(&path_trace("-o d --budget-ms 0")).contains("budget"));
    assert!(f.refusal(&path_trace("-o d --match-time nowhere")).contains("nowhere"));
    // Kept frames keep their times; without these, none is known.
    figures(&f, &path_trace(&format!("-o b --spp {spp}")));
    assert!(figures(&f, &path_trace("-o d --match-time b"))["budget_ms"].as_f64().unwrap() > 0.0);
    std::fs::remove_file(f.at("b/timings.json")).unwrap();
    figures(&f, &path_trace(&format!("-o b --spp {spp}")));
    assert!(f.refusal(&path_trace("-o d --match-time b")).contains("render them again"));
    let ulr = command("--method ulr --probes out/probes -o d --budget-ms 200");
    assert!(f.refusal(&ulr).contains("--budget-ms: --method ulr has no use for it"));
    assert!(f.refusal(&path_trace("-o d --denoise --layers full")).contains("--layers full"));
    assert!(f.refusal(&command("--probes out/probes -o d --budget-ms 200")).contains("--method glossy-probes has no use"));
    assert!(
        f.refusal(&command("--method ulr --probes out/probes -o d --denoise"))
            .contains("path-trace, lightmap-rt, many-light has")
    );
    assert!(f.refusal(&command("--method ulr --probes out/probes -o d --set supersample=0")).contains("1 to 8"));
}

#[test]
fn nothing_is_written_over_an_input_or_a_file_of_somebody_elses() {
    let f = folder();
    for (name, text) in [("ball.obj", "v 0 0 0\n"), ("notes.json", "{}")] {
        std::fs::write(f.at(name), text).unwrap();
    }
    let before = contents(f.0.path());
    for (command, expected) in [
        ("place-probes scene.xml --grid 1x1x1 -o scene.xml", "an input"),
        ("place-probes scene.xml --path path.json -o ./path.json", "an input"),
        ("place-probes scene.xml --grid 1x1x1 -o notes.json", "not written by reprobe"),
        ("curvature scene.xml -o ball.obj", "not written by reprobe"),
        ("bake-lightmap scene.xml -o ball.obj", "not written by reprobe"),
    ] {
        let message = f.refusal(command);
        assert!(message.contains(expected), "{command}: {message}");
    }
    assert!(contents(f.0.path()) == before, "something was written");
}

#[test]
fn outputs_that_are_up_to_date_are_as_new_as_if_they_were_written() {
    let f = folder();
    figures(&f, &format!("{RUN} --no-reference"));
    let old = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000_000);
    let light = "bake-lightmap scene.xml -o l.exr --spp 1 --texel 0.5";
    let resmap = "resmap scene.xml --probes out/probes.json -o r --size 32x16";
    let qhmap = "qhmap r -o q --size 32x16";
    let bake = "bake-probes scene.xml --probes out/probes.json --qhmap q --spp 1 -o p";
    for (command, file) in [(light, "l.exr"), (resmap, "r/set.json"), (qhmap, "q/set.json"), (bake, "p/set.json")] {
        figures(&f, command);
        let text = std::fs::read(f.at(file)).unwrap();
        std::fs::File::options().write(true).open(f.at(file)).unwrap().set_modified(old).unwrap();
        figures(&f, command);
        assert!(std::fs::metadata(f.at(file)).unwrap().modified().unwrap() > old, "{command}: make would ask for it for ever");
        assert!(std::fs::read(f.at(file)).unwrap() == text, "{command}");
    }
}

#[test]
fn threads_have_a_bound() {
    let f = folder();
    assert!(f.refusal("curvature scene.xml -o c.exr --threads 100000").contains("expected 1 to 1024"));
    assert!(f.refusal("curvature scene.xml -o c.exr --threads 0").contains("expected 1 to 1024"));
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_device_behind_stdout_is_an_error_and_a_closed_pipe_is_none() {
    let f = folder();
    let command = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_reprobe"));
        command.args(["curvature", "scene.xml", "-o", "c.exr"]).current_dir(f.0.path());
        command
    };
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = command().stdout(full).output().unwrap();
    let message = text(&output.stderr);
    assert!(
        output.status.code() == Some(2) && message.contains("cannot be printed") && !message.contains("panicked"),
        "{message}"
    );
    // The reading end is closed before anything is written.
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = command().stdout(writer).output().unwrap();
    assert!(output.status.success() && !text(&output.stderr).contains("error"), "{}", text(&output.stderr));
    // What is said besides the result may be lost.
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    assert!(command().stderr(full).output().unwrap().status.success());
}

#[test]
fn frames_that_an_earlier_run_left_are_not_counted() {
    let f = folder();
    figures(&f, RUN);
    // Frame 0 stays in the folders, of another size and seed.
    figures(&f, &format!("{RUN} --size 48x27 --frames 1 --seed 7").replace("--size 32x18 ", ""));
    for report in ["report", "report-glossy"] {
        let metrics: Value =
            serde_json::from_slice(&std::fs::read(f.at("out").join(report).join("metrics.json")).unwrap()).unwrap();
        let names: Vec<&str> = metrics["frames"].as_array().unwrap().iter().map(|f| f["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["0001"]);
        assert_eq!(metrics["mean"]["rmse_rgb"], metrics["frames"][0]["rmse_rgb"]);
    }
    // All of a path's frames, where its end was cut off.
    let (first, _) = PATH.split_once("}, {").unwrap();
    std::fs::write(f.at("path.json"), format!("{first}}}]}}")).unwrap();
    let figures = figures(&f, RUN);
    let compared = figures["stages"].as_array().unwrap().last().unwrap();
    assert!(compared["command"].as_str().unwrap().contains("--frames 0"), "{compared}");
    assert_eq!(compared["figures"]["frames"].as_array().unwrap().len(), 1);
    assert!(f.refusal("compare out/frames out/reference -o c --frames 5").contains("none of the frames 5"));
    assert!(f.refusal("compare out/frames/0000.exr out/reference/0000.exr -o c --frames 0").contains("two folders"));
}
