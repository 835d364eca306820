//! The commands that README shows, pasted as they stand.

use std::path::Path;
use std::process::Command;

/// A box with a lamp and a little metal: small enough for the numbers that README has for real rooms.
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

/// The lines of README's shell blocks that call `reprobe`, by its name or through cargo.
fn commands(readme: &str) -> Vec<String> {
    let blocks = readme.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    let lines = blocks.flat_map(str::lines).map(|line| line.replace("cargo run --release -- ", "reprobe "));
    lines.filter(|line| line.starts_with("reprobe ")).collect()
}

#[test]
fn commands_of_the_readme_run_as_they_stand() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.xml"), SCENE).unwrap();
    std::fs::write(folder.path().join("path.json"), PATH).unwrap();
    let commands = commands(&std::fs::read_to_string(root.join("README.md")).unwrap());
    assert!(commands.len() > 10, "{commands:?}");
    for line in commands {
        let mut words: Vec<&str> = line.split_whitespace().skip(1).collect();
        // What takes minutes is planned here, and run in tests/pipeline.rs and tests/evaluate.rs.
        if ["run", "evaluate"].contains(&words[0]) {
            words.push("--dry-run");
        }
        let place = if words[0] == "run" { root } else { folder.path() };
        let output = Command::new(env!("CARGO_BIN_EXE_reprobe")).args(&words).current_dir(place).output().unwrap();
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    }
    assert!(folder.path().join("report/index.html").is_file());
}
