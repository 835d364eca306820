//! Every stage and a frame, by each instruction set that the machine has: the same bits.

mod folder;

use folder::{Folder, text};
use reprobe::base::simd::Lanes;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const SCENE: &str = r#"<scene version="3.0.0">
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
    <shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform>
      <bsdf type="roughplastic"><float name="alpha" value="0.15"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="-0.6" z="0"/><float name="radius" value="0.35"/>
      <bsdf type="conductor"/></shape>
    <shape type="sphere"><point name="center" x="0.6" y="-0.7" z="0.3"/><float name="radius" value="0.25"/>
      <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>
    </scene>"#;

const PATH: &str = r#"{"fov": 70, "size": [96, 54], "frames": [
    {"origin": [0, 0, 1.5], "target": [0, -0.5, 0]}, {"origin": [0.2, 0.1, 1.4], "target": [0, -0.5, 0]}]}"#;

const RUN: &str = "run scene.xml --path path.json -o out --preset draft --probes 8 --probe-size 64x32 --spp 4 --size 96x54 \
    --lightmap-spp 4 --texel 0.2 --reference-spp 1 --supersample 1";

fn run(f: &Folder, args: &str, simd: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reprobe"));
    command.args(args.split_whitespace()).current_dir(f.0.path()).env(Lanes::VARIABLE, simd).output().unwrap()
}

/// All EXR files below a folder.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let (mut found, mut todo) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(dir) = todo.pop() {
        for entry in std::fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => todo.push(path),
                false if path.extension().is_some_and(|e| e == "exr") => {
                    found.push((path.strip_prefix(folder).unwrap().to_path_buf(), std::fs::read(&path).unwrap()));
                }
                false => {}
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_instruction_set_writes_the_same_bits() {
    let forms: Vec<&str> = Lanes::all().into_iter().map(Lanes::name).collect();
    if forms.len() < 3 {
        println!("of the forms, this machine has {forms:?}");
    }
    let f = Folder::with(SCENE, PATH);
    let mut first: Option<Vec<(PathBuf, Vec<u8>)>> = None;
    for form in forms {
        let output = run(&f, RUN, form);
        assert!(output.status.success(), "{form}: {}", text(&output.stderr));
        let timings = std::fs::read_to_string(f.at("out/frames/timings.json")).unwrap();
        assert!(timings.contains(&format!("\"simd\": \"{form}\"")), "{form}: {timings}");
        let found = files(&f.at("out"));
        std::fs::remove_dir_all(f.at("out")).unwrap();
        let Some(first) = &first else {
            assert!(found.len() > 8 && found.iter().any(|(name, _)| name.ends_with("frames/0001.exr")), "{}", found.len());
            first = Some(found);
            continue;
        };
        assert_eq!(first.len(), found.len());
        for (a, b) in first.iter().zip(&found) {
            assert!(a == b, "{} differs by {form}", a.0.display());
        }
    }
}

#[test]
fn a_form_that_is_none_is_an_error_that_says_what_is() {
    let f = Folder::with(SCENE, PATH);
    let output = run(&f, "info scene.xml", "sse9");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("REPROBE_SIMD=sse9: expected one of avx512, avx2, portable"), "{said}");
    assert!(f.refusal("info nothing.xml").contains("nothing.xml"));
    f.success("info scene.xml");
}
