//! The commands that README and the tutorial show, pasted as they stand.

use std::path::Path;
use std::process::Command;

/// A box with a lamp and a little metal: small enough for the numbers that they have for real rooms.
const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><transform name="to_world"><lookat origin="0, 0, 1.5" target="0, -0.5, 0" up="0, 1, 0"/></transform></sensor>
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"/></bsdf>
    <shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.4"/><translate y="-0.4" z="0.2"/></transform>
      <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>
    </scene>"#;
const PATH: &str = r#"{"fov": 70, "size": [24, 16], "frames": [{"origin": [0, 0, 1.5], "target": [0, -0.5, 0]}]}"#;

/// The lines of a document's shell blocks that call `reprobe`, by its name or through cargo.
fn commands(document: &str) -> Vec<String> {
    let blocks = document.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    let lines = blocks.flat_map(str::lines).map(|line| line.replace("cargo run --release -- ", "reprobe "));
    lines.filter(|line| line.starts_with("reprobe ")).collect()
}

/// Runs a document's commands, one after the other, in a folder with that scene and path.
fn run(document: &str) -> tempfile::TempDir {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.xml"), SCENE).unwrap();
    std::fs::write(folder.path().join("path.json"), PATH).unwrap();
    let commands = commands(&std::fs::read_to_string(root.join(document)).unwrap());
    assert!(commands.len() > 10, "{commands:?}");
    let has_ffmpeg = Command::new("ffmpeg").arg("-version").output().is_ok();
    for line in commands {
        let mut words: Vec<&str> = line.split_whitespace().skip(1).collect();
        // What takes minutes is planned here, and run in tests/pipeline.rs and tests/evaluate.rs.
        if ["run", "evaluate"].contains(&words[0]) {
            words.push("--dry-run");
        }
        if words[0] == "video" && !has_ffmpeg {
            eprintln!("skipped, as ffmpeg is not on the PATH: {line}");
            continue;
        }
        let place = if words[0] == "run" { root } else { folder.path() };
        let output = Command::new(env!("CARGO_BIN_EXE_reprobe")).args(&words).current_dir(place).output().unwrap();
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    }
    folder
}

#[test]
fn commands_of_the_readme_run_as_they_stand() {
    assert!(run("README.md").path().join("report/index.html").is_file());
}

#[test]
fn commands_of_the_tutorial_run_as_they_stand() {
    let folder = run("docs/tutorial.md");
    // What its pictures are made of.
    for file in ["plan.png", "probe.png", "report/images/0000_flip.png", "scene.glb", "engine/0003.ktx2"] {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
}

/// Every picture that a document of ours shows is there.
#[test]
fn pictures_that_documents_show_are_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let in_docs = std::fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path());
    for document in in_docs.chain([root.join("README.md")]).filter(|path| path.extension().is_some_and(|e| e == "md")) {
        let text = std::fs::read_to_string(&document).unwrap();
        for rest in text.split("![").skip(1) {
            let target = rest.split("](").nth(1).and_then(|t| t.split(')').next()).unwrap_or_default();
            assert!(document.with_file_name(target).is_file(), "{}: {target}", document.display());
        }
    }
}
