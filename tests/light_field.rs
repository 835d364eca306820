//! `bake-lightfield` and `render-path --method light-field-probes`.

mod folder;

use folder::Folder;
use reprobe::io::ExrImage;

/// A room with walls of two colours, a floor that is a little rough, and a ball.
const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="70"/>
      <transform name="to_world"><lookat origin="0, 0, 1.7" target="0, -0.5, 0" up="0, 1, 0"/></transform></sensor>
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.5, 0.3"/></bsdf></bsdf>
    <shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="1.5"/><translate y="-1"/></transform>
      <bsdf type="roughplastic"><float name="alpha" value="0.15"/><rgb name="diffuse_reflectance" value="0.3"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="-0.6" z="0"/><float name="radius" value="0.35"/>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.2, 0.4, 0.7"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.8"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="4"/></emitter></shape>
    </scene>"#;
const PATH: &str = r#"{"fov": 70, "size": [48, 32], "frames": [{"origin": [0, 0, 1.7], "target": [0, -0.5, 0]}]}"#;

fn folder() -> Folder {
    Folder::with(SCENE, PATH)
}

/// Mean of a layer over the frame.
fn mean(f: &Folder, frame: &str, layer: &str) -> [f64; 3] {
    let path = f.at(frame);
    let pixels = ExrImage::read(&path).unwrap().rgb(&path, layer).unwrap();
    let sum: glam::DVec3 = pixels.iter().map(|p| p.as_dvec3()).sum();
    (sum / pixels.len() as f64).to_array()
}

fn files(f: &Folder, folder: &str) -> Vec<(String, Vec<u8>)> {
    let mut list: Vec<_> = std::fs::read_dir(f.at(folder))
        .unwrap()
        .map(|e| e.unwrap().path())
        .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&p).unwrap()))
        .collect();
    list.sort();
    list
}

const PLACE: &str = "place-probes scene.xml --grid 2x2x2 --bounds=-1.6,-0.8,-1.6,1.6,1.6,1.6 -o probes.json";
const BAKE: &str = "bake-lightfield scene.xml --probes probes.json --size 128 --spp 8 --bounces 6";
const RENDER: &str = "render-path scene.xml --path path.json --method light-field-probes";

#[test]
fn frames_have_the_light_of_path_tracing() {
    let f = folder();
    f.success(PLACE);
    f.success(&format!("{BAKE} -o lightfield"));
    f.success(&format!("{RENDER} --probes lightfield --samples 32 --set direct_samples=32 -o frames"));
    f.success("render-path scene.xml --path path.json --method path-trace --spp 256 --device cpu -o reference");
    // The method's own approximation: irradiance of eight places for a whole room (some 7 per cent here).
    for (layer, allowed) in [("emission", 1e-3), ("diffuse", 0.1), ("glossy", 0.1)] {
        let [ours, theirs] = ["frames", "reference"].map(|folder| mean(&f, &format!("{folder}/0000.exr"), layer));
        for (a, b) in ours.into_iter().zip(theirs) {
            assert!((a - b).abs() < allowed * b.max(1e-3), "{layer}: {ours:?}, path tracing {theirs:?}");
        }
    }
    // One way of searching finds what the other finds.
    f.success(&format!("{RENDER} --probes lightfield --samples 32 --set direct_samples=32 --trace two-scale -o two-scale"));
    let [a, b] = ["frames", "two-scale"].map(|folder| mean(&f, &format!("{folder}/0000.exr"), "glossy"));
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3 * b), "{a:?} {b:?}");
}

/// Probes in no grid: their frames, their octree, and what is said where that is damaged.
#[test]
fn probes_may_stand_anywhere() {
    let f = folder();
    f.success("place-probes scene.xml --method medial-axis --count 6 -o probes.json");
    let small = BAKE.replace("128", "64");
    f.success(&format!("{small} -o lightfield"));
    let render = format!("{RENDER} --probes lightfield --samples 32 --set direct_samples=32 -o frames");
    f.success(&render);
    f.success("render-path scene.xml --path path.json --method path-trace --spp 256 --device cpu -o reference");
    for (layer, allowed) in [("diffuse", 0.15), ("glossy", 0.1)] {
        let [ours, theirs] = ["frames", "reference"].map(|folder| mean(&f, &format!("{folder}/0000.exr"), layer));
        for (a, b) in ours.into_iter().zip(theirs) {
            assert!((a - b).abs() < allowed * b, "{layer}: {ours:?}, path tracing {theirs:?}");
        }
    }
    assert!(f.success(&format!("{small} -o lightfield")).contains("up to date"));
    let whole = std::fs::read(f.at("lightfield/octree.json")).unwrap();
    std::fs::write(f.at("lightfield/octree.json"), &whole[..whole.len() / 2]).unwrap();
    assert!(f.refusal(&render.replace("frames", "others")).contains("octree.json"));
    f.success(&format!("{small} -o lightfield"));
    assert!(std::fs::read(f.at("lightfield/octree.json")).unwrap() == whole);
}

#[test]
fn bakes_are_the_same_in_shards_on_one_thread_and_after_damage() {
    let f = folder();
    f.success(PLACE);
    let small = BAKE.replace("128", "16");
    f.success(&format!("{small} -o whole"));
    let whole = files(&f, "whole");
    // Eight probes of three files, and the set.
    assert_eq!(whole.len(), 25, "{:?}", whole.iter().map(|f| &f.0).collect::<Vec<_>>());
    f.success(&format!("{small} --threads 1 --shard 1/2 -o shards"));
    assert!(!f.at("shards/set.json").exists());
    assert!(f.refusal(&format!("{RENDER} --probes shards -o frames")).contains("not finished"));
    f.success(&format!("{small} --threads 1 --shard 0/2 -o shards"));
    assert!(files(&f, "shards") == whole, "shards make other files than one run");
    for (name, bytes) in &whole {
        let damaged = if name.contains("light") { Vec::new() } else { bytes[..bytes.len() / 2].to_vec() };
        std::fs::write(f.at("shards").join(name), damaged).unwrap();
        f.success(&format!("{small} -o shards"));
        assert!(files(&f, "shards") == whole, "{name} is not made again");
    }
    assert!(f.success(&format!("{small} -o whole")).contains("up to date"));
}

#[test]
fn probes_in_no_grid_make_frames() {
    let f = folder();
    f.success("place-probes scene.xml --method sdf --count 3 -o probes.json");
    f.success(&format!("{} -o lightfield", BAKE.replace("128", "32")));
    f.success(&format!("{RENDER} --probes lightfield --samples 2 -o frames"));
    f.success("render-path scene.xml --path path.json --method path-trace --spp 64 --device cpu -o reference");
    let [ours, theirs] = ["frames", "reference"].map(|folder| mean(&f, &format!("{folder}/0000.exr"), "glossy")[0]);
    assert!((ours - theirs).abs() < 0.15 * theirs, "{ours}, path tracing {theirs}");
}

#[test]
fn what_does_not_fit_is_refused() {
    let f = folder();
    f.success(PLACE);
    assert!(f.refusal("bake-lightfield scene.xml --probes probes.json --size 100 -o out").contains("power of two"));
    f.success(&format!("{} -o lightfield", BAKE.replace("128", "16")));
    assert!(f.refusal(&format!("{RENDER} --probes lightfield --trace all -o frames")).contains("expected two-scale or hi-z"));
    std::fs::write(f.at("other.xml"), SCENE.replace("0.35", "0.3")).unwrap();
    let other = RENDER.replace("scene.xml", "other.xml");
    assert!(f.refusal(&format!("{other} --probes lightfield -o frames")).contains("another scene"));
    assert!(f.refusal(&format!("{} -o out", BAKE.replace("scene.xml", "other.xml"))).contains("another scene"));
    // Probes in the middle of nowhere.
    std::fs::write(f.at("open.xml"), "<scene version='3.0.0'><shape type='rectangle'/></scene>").unwrap();
    f.success("place-probes open.xml --grid 2x1x1 --bounds=500,0,0,502,1,1 -o far.json");
    let message = f.refusal("bake-lightfield open.xml --probes far.json --size 16 -o far");
    assert!(message.contains("far.json") && message.contains("sees any surface"), "{message}");
    // Somebody else's probes.
    std::fs::write(f.at("lightfield/set.json"), "{}").unwrap();
    assert!(f.refusal(&format!("{RENDER} --probes lightfield -o frames")).contains("set.json"));
}

#[test]
fn evaluations_tell_what_the_probes_take() {
    let f = folder();
    let bakes = "--bake place-probes:--count=8 --bake bake-lightfield:--size=16 --bake bake-lightfield:--spp=1";
    let options = "--methods light-field-probes --size 24x16 --supersample 1 --reference-spp 2 --device cpu --json";
    let text = f.success(&format!("evaluate scene.xml --path path.json -o evaluation {options} {bakes}"));
    let figures: serde_json::Value = serde_json::from_str(&text).unwrap();
    let probes = &figures["costs"]["methods"]["light-field-probes"]["probes"];
    let count = probes["count"].as_u64().unwrap();
    assert!((2..=12).contains(&count), "{probes}");
    assert_eq!((&probes["baked"], &probes["size"]), (&count.into(), &serde_json::json!([16, 16])));
    // Two words a texel and one for each of 341 squares, three halves for each of 336, five floats for each of 32 x 32.
    assert_eq!(probes["bytes"], count * (256 * 8 + 341 * 4 + 336 * 6 + 1024 * 20));
    assert!(std::fs::read_to_string(f.at("evaluation/evaluation.md")).unwrap().contains("| 16 x 16 |"));
}
