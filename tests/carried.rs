//! What files say of themselves that are neither EXR nor JSON, as `info` tells it: each says which stage wrote it, of which inputs, and is
//! the same to the last bit when it is made again.

mod folder;

use folder::{Folder, text};
use reprobe::io::provenance::hash_file;
use serde_json::Value;
use std::process::Command;

const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><transform name="to_world"><lookat origin="0, 0, 1.5" target="0, -0.5, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="cube"><transform name="to_world"><scale value="2"/></transform><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.4"/><translate y="-0.4" z="0.2"/></transform>
      <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape></scene>"#;
const PATH: &str = r#"{"fov": 70, "size": [24, 16], "frames": [{"origin": [0, 0, 1.5], "target": [0, -0.5, 0]}]}"#;

fn told(f: &Folder, file: &str) -> Value {
    serde_json::from_str(&f.success(&format!("info {file} --json"))).unwrap()
}

/// Runs a command twice, on one thread and on two; checks what each file that it writes says of itself.
fn check(f: &Folder, command: &str, files: &[&str], scene: &str, input: Option<(&str, &str)>) {
    let bytes = |threads: u32| -> Vec<Vec<u8>> {
        f.success(&format!("{command} --threads {threads}"));
        files.iter().map(|file| std::fs::read(f.at(file)).unwrap()).collect()
    };
    assert!(bytes(1) == bytes(2), "{command}: other bytes");
    for file in files {
        let provenance = &told(f, file)["provenance"];
        assert_eq!(provenance["version"], env!("CARGO_PKG_VERSION"), "{file}");
        assert_eq!(provenance["stage"].as_str(), command.split(' ').next(), "{file}");
        assert_eq!(provenance["scene"], scene, "{file}");
        if let Some((role, from)) = input {
            assert_eq!(provenance["inputs"][role], hash_file(&f.at(from)).unwrap(), "{file}");
        }
        let shown = f.success(&format!("info {file}"));
        assert!(shown.contains("provenance:\n") && shown.contains("\"version\""), "{shown}");
    }
}

#[test]
fn every_kind_of_file_says_where_it_came_from() {
    let f = Folder::with(SCENE, PATH);
    f.success("render-path scene.xml --path path.json --method path-trace --spp 1 -o frames");
    f.success("place-probes scene.xml --grid 1x1x1 --bounds=-1,-1,0.5,1,1,1.5 -o one.json");
    f.success("bake-lightfield scene.xml --probes one.json --size 16 --spp 1 -o lightfield");
    f.success("bake-transport scene.xml --probes one.json --texels 200 -o transport");
    let scene = told(&f, "frames/0000.exr")["provenance"]["scene"].as_str().unwrap().to_owned();
    assert_eq!(scene.len(), 64);
    let frame = Some(("file", "frames/0000.exr"));
    let light = Some(("probes", "lightfield/set.json"));
    check(&f, "view frames/0000.exr --layer glossy --exposure 1 -o glossy.png", &["glossy.png"], &scene, frame);
    check(
        &f,
        "place-probes scene.xml --count 2 --picture plan.png --coverage-picture seen.png -o p.json",
        &["plan.png", "seen.png"],
        &scene,
        None,
    );
    check(&f, "inspect-lightfield scene.xml --probes lightfield --probe 0 -o maps.png", &["maps.png"], &scene, light);
    check(
        &f,
        "inspect-lightfield scene.xml --probes lightfield --size 24x16 --pixel 12,8 -o way.png",
        &["way.png"],
        &scene,
        light,
    );
    let transport = Some(("probes", "transport/set.json"));
    check(&f, "inspect-transport scene.xml --probes transport -o lost.png", &["lost.png"], &scene, transport);
    let textures = ["engine/0000.ktx2", "engine/0000_diffuse.ktx2", "engine/volume.ktx2"];
    check(&f, "export-probes lightfield --format ktx2 --size 8 -o engine", &textures, &scene, light);
    check(&f, "export-gltf scene.xml -o scene.glb", &["scene.glb"], &scene, None);
    assert!(f.success("info scene.glb").starts_with("scene.glb: scene\n"));
    assert_eq!(told(&f, "engine/volume.ktx2")["size"], serde_json::json!([1, 2, 3]));
    f.success("render-path scene.xml --path path.json --method path-trace --spp 2 -o reference");
    let pages = ["report/index.html", "report/images/0000_image.png", "report/images/0000_flip.png"];
    check(&f, "compare frames reference -o report", &pages, "", None);
    let picture = &told(&f, "report/images/0000_flip.png")["provenance"]["inputs"];
    assert_eq!(picture["reference"], hash_file(&f.at("reference/0000.exr")).unwrap());
    assert_eq!(told(&f, "report/index.html")["provenance"], told(&f, "report/metrics.json")["content"]["provenance"]);
    f.success("info frames/0000.exr --pictures look");
    let provenance = &told(&f, "look/0000_glossy.png")["provenance"];
    assert_eq!((provenance["stage"].as_str(), provenance["parameters"]["layer"].as_str()), (Some("info"), Some("glossy")));
    for folder in ["engine", "report"] {
        assert!(f.success(&format!("info {folder}")).contains("provenance"), "{folder}");
    }
}

/// Where there is an ffmpeg; the test of `io::video` needs none.
#[test]
fn videos_say_where_they_came_from() {
    if Command::new("ffmpeg").arg("-version").output().is_err() {
        eprintln!("skipped: ffmpeg is not on the PATH");
        return;
    }
    let f = Folder::with(SCENE, PATH);
    f.success("render-path scene.xml --path path.json --method path-trace --spp 1 -o frames");
    let scene = told(&f, "frames/0000.exr")["provenance"]["scene"].as_str().unwrap().to_owned();
    for name in ["walk.mp4", "walk.webm", "walk.gif"] {
        check(&f, &format!("video frames -o {name}"), &[name], &scene, None);
    }
    // What players show is the same.
    let probe = |name: &str| {
        let arguments = ["-v", "error", "-show_entries", "format_tags=comment", "-of", "default=nw=1:nk=1", name];
        Command::new("ffprobe").args(arguments).current_dir(f.0.path()).output().map(|o| text(&o.stdout))
    };
    for name in ["walk.mp4", "walk.webm"] {
        if let Ok(comment) = probe(name) {
            let comment: Value = serde_json::from_str(comment.trim()).unwrap();
            assert_eq!(comment, told(&f, name)["provenance"], "{name}");
        }
    }
}

#[test]
fn what_others_wrote_has_no_provenance_and_what_is_damaged_is_an_error() {
    let f = Folder::with(SCENE, PATH);
    std::fs::write(f.at("page.html"), "<p>const data</p>").unwrap();
    std::fs::write(f.at("holiday.mp4"), b"\0\0\0\x20ftypisom").unwrap();
    for name in ["page.html", "holiday.mp4"] {
        assert!(told(&f, name)["provenance"].is_null(), "{name}");
        assert!(f.success(&format!("info {name}")).contains("no provenance"), "{name}");
    }
    std::fs::write(f.at("cut.html"), "<script>const data = {\"a\": ").unwrap();
    std::fs::write(f.at("a.png"), b"\x89PNG").unwrap();
    std::fs::write(f.at("a.ktx2"), b"\xabKTX 20\xbb\r\n\x1a\n").unwrap();
    std::fs::create_dir(f.at("empty")).unwrap();
    for (name, expected) in [
        ("cut.html", "cut.html: the data of the page"),
        ("a.png", "a.png: not a readable PNG file"),
        ("a.ktx2", "a.ktx2: not a readable KTX 2.0 file"),
        ("none.webm", "none.webm"),
        ("empty", "empty: found no EXR file"),
    ] {
        let message = f.refusal(&format!("info {name}"));
        assert!(message.contains(expected), "{message}");
    }
}
