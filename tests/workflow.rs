//! `scripts/Makefile`: what make knows of outputs and what reprobe knows of them go together.
//!
//! Skipped, with a line that says so, where there is no GNU make.

mod folder;

use folder::{Folder, text};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::SystemTime;

const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="70"/>
      <transform name="to_world"><lookat origin="0, 0, 1.5" target="0, -0.5, 0" up="0, 1, 0"/></transform></sensor>
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
    <shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform>
      <bsdf type="roughplastic"><float name="alpha" value="0.15"/></bsdf></shape>
    <shape type="obj"><string name="filename" value="slab.obj"/>
      <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>
    </scene>"#;

const SLAB: &str = "v -0.4 -0.9 0\nv 0.4 -0.9 0\nv 0.4 -0.2 -0.2\nv -0.4 -0.2 -0.2\nf 1 2 3 4\n";

const PATH: &str = r#"{"fov": 70, "size": [24, 16], "frames": [
    {"origin": [0, 0, 1.5], "target": [0, -0.5, 0]}, {"origin": [0.2, 0.1, 1.4], "target": [0, -0.5, 0]}]}"#;

/// Numbers for a moment, in place of the draft preset's.
const VARIABLES: [&str; 10] = [
    "SCENE=scene.xml",
    "PATH_JSON=path.json",
    "FRAMES=1",
    "SIZE=24x16",
    "SUPERSAMPLE=1",
    "PLACE=--count 8",
    "RESMAP=--size 32x16",
    "QHMAP=--size 32x16",
    "LIGHTMAP=--spp 4 --first-spp 2 --texels 2000 --denoise",
    "REFERENCE=--spp 2",
];

/// The folder of a scene that names a mesh; `None` where there is no GNU make of version 4.
fn folder(test: &str) -> Option<Folder> {
    let version = Command::new("make").arg("--version").output().map(|o| text(&o.stdout)).unwrap_or_default();
    if !version.starts_with("GNU Make") || version.starts_with("GNU Make 3") {
        eprintln!("{test}: skipped: no GNU make of version 4");
        return None;
    }
    let f = Folder::with(SCENE, PATH);
    std::fs::write(f.at("slab.obj"), SLAB).unwrap();
    Some(f)
}

fn make(f: &Folder, more: &[&str]) -> Output {
    let mut command = Command::new("make");
    // Of a make that runs the tests.
    command.env_remove("MAKEFLAGS").env_remove("MAKELEVEL").env_remove("MFLAGS");
    command.arg("-f").arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/Makefile"));
    command.arg(format!("REPROBE={}", env!("CARGO_BIN_EXE_reprobe"))).arg("PROBES=--spp 2").args(VARIABLES);
    command.args(more).current_dir(f.0.path()).output().unwrap()
}

/// Has make do what there is to do; the names of the commands that it ran.
fn commands(f: &Folder, more: &[&str]) -> Vec<String> {
    let output = make(f, more);
    assert!(output.status.success(), "{more:?}: {}", text(&output.stderr));
    let program = env!("CARGO_BIN_EXE_reprobe");
    let command = |line: &str| Some(line.strip_prefix(program)?.split_whitespace().next()?.to_owned());
    text(&output.stdout).lines().filter_map(command).collect()
}

/// Whether make has nothing to do.
fn is_content(f: &Folder, more: &[&str]) -> bool {
    let output = make(f, &[&["-q"], more].concat());
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 1)), "{code:?}: {}", text(&output.stderr));
    code == Some(0)
}

/// The EXR files below a folder, by relative path, with what is in them.
fn images(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut todo = vec![folder.to_path_buf()];
    while let Some(dir) = todo.pop() {
        for entry in std::fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                todo.push(path);
            } else if path.extension().is_some_and(|e| e == "exr") {
                found.push((path.strip_prefix(folder).unwrap().to_path_buf(), std::fs::read(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

const ALL: [&str; 10] = [
    "bake-lightmap",
    "bake-probes",
    "compare",
    "compare",
    "curvature",
    "place-probes",
    "qhmap",
    "render-path",
    "render-path",
    "resmap",
];

fn sorted(mut names: Vec<String>) -> Vec<String> {
    names.sort();
    names
}

#[test]
fn make_is_content_until_something_changes_and_then_makes_what_depends_on_it() {
    let Some(f) = folder("make_is_content_until_something_changes_and_then_makes_what_depends_on_it") else { return };
    assert_eq!(sorted(commands(&f, &[])), ALL);
    assert!(f.at("out/report-glossy/metrics.json").exists());
    let whole = images(&f.at("out"));
    assert!(is_content(&f, &[]));
    assert!(commands(&f, &[]).is_empty());

    // A bake that was killed: some of its files, and no set.json.
    let baked = whole.iter().map(|(path, _)| path).find(|p| p.starts_with("probes")).unwrap();
    std::fs::remove_file(f.at("out").join(baked)).unwrap();
    std::fs::remove_file(f.at("out/probes/set.json")).unwrap();
    let render = "render-path scene.xml --probes out/probes --lightmap out/lightmap.exr --curvature out/curvature.exr -o frames";
    assert!(f.refusal(render).contains("set.json"));
    assert!(!is_content(&f, &[]));
    assert_eq!(commands(&f, &[])[..2], ["bake-probes", "render-path"]);
    assert!(is_content(&f, &[]) && images(&f.at("out")) == whole);

    // What make does not know is missing, reprobe makes when it is asked.
    std::fs::remove_file(f.at("out/frames/0001.exr")).unwrap();
    assert_eq!(sorted(commands(&f, &["-B"])), ALL);
    assert!(is_content(&f, &[]) && images(&f.at("out")) == whole);

    // The scene, and a mesh that it names: all stages look, and find everything as it should be.
    for file in ["scene.xml", "slab.obj"] {
        std::fs::File::options().write(true).open(f.at(file)).unwrap().set_modified(SystemTime::now()).unwrap();
        assert!(!is_content(&f, &[]), "{file}");
        assert_eq!(sorted(commands(&f, &[])), ALL, "{file}");
        assert!(is_content(&f, &[]) && images(&f.at("out")) == whole, "{file}");
    }

    // Another option is something that changes, too.
    let more = ["REFERENCE=--spp 3"];
    assert!(!is_content(&f, &more));
    assert_eq!(commands(&f, &more), ["render-path", "compare", "compare"]);
    assert!(is_content(&f, &more) && images(&f.at("out")) != whole);

    // Clean leaves what is not ours.
    std::fs::write(f.at("out/notes.txt"), "mine").unwrap();
    make(&f, &["clean"]);
    let left: Vec<_> = std::fs::read_dir(f.at("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["notes.txt"]);
}

#[test]
fn shards_of_make_write_the_files_of_the_whole() {
    let Some(f) = folder("shards_of_make_write_the_files_of_the_whole") else { return };
    commands(&f, &[]);
    let sharded = ["OUT=sharded", "SHARDS=2", "-j2"];
    let ran = commands(&f, &sharded);
    // Each shard, and the run that completes them.
    for (stage, count) in [("bake-lightmap", 3), ("bake-probes", 3), ("render-path", 6)] {
        assert_eq!(ran.iter().filter(|name| *name == stage).count(), count, "{ran:?}");
    }
    assert!(images(&f.at("out")) == images(&f.at("sharded")));
    f.success("compare out/frames sharded/frames -o report --max-rmse 0");
    assert!(is_content(&f, &sharded) && is_content(&f, &["OUT=sharded"]));
}
