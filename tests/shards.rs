//! `--shard`: what is made in parts is what one run makes, and goes on from whatever is there.

mod folder;

use folder::Folder;
use std::collections::BTreeMap;

/// A room with a glossy floor, and a box on it.
const SCENE: &str = r#"<scene version="3.0.0">
<bsdf type="twosided" id="wall"><bsdf type="diffuse"/></bsdf>
<shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="1" angle="-90"/><translate y="-1"/></transform>
  <bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>
<shape type="cube"><transform name="to_world"><scale x="0.2" y="0.6" z="0.6"/><translate y="-0.4"/></transform><ref id="wall"/></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
  <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>
</scene>"#;

/// Round the box: a probe close to its far side serves ever less of the floor.
const PATH: &str = r#"{"fov": 70, "size": [48, 27], "frames": [
{"origin": [-1.2, 0.2, 0], "target": [0, -0.6, 0]}, {"origin": [-0.9, 0.3, 1.0], "target": [0, -0.6, 0]},
{"origin": [-0.4, 0.4, 1.4], "target": [0, -0.6, 0]}, {"origin": [0, 0.5, 1.6], "target": [0, -0.6, 0]},
{"origin": [0.4, 0.6, 1.5], "target": [0, -0.6, 0]}]}"#;

fn room(grid: &str) -> Folder {
    let f = Folder::with(SCENE, PATH);
    f.success(&format!("place-probes scene.xml --grid {grid} --bounds 0.3,-0.8,-0.2,0.4,-0.7,0.2 -o probes.json"));
    f
}

/// The EXR and JSON files of a folder, but for what tells times.
fn files(f: &Folder, folder: &str) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(f.at(folder)).unwrap().map(|e| e.unwrap());
    let named = entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap()));
    named.filter(|(name, _)| name != "timings.json").collect()
}

#[test]
fn maps_of_shards_are_those_of_the_whole() {
    let f = room("1x1x2");
    for (stage, from, size) in [("resmap scene.xml --probes probes.json", "resmap", "64x32"), ("qhmap resmap", "qhmap", "64x32")]
    {
        let command = format!("{stage} --size {size} -o");
        f.success(&format!("{command} {from}"));
        assert!(f.success(&format!("{command} parts-{from} --shard 1/2")).contains("1 are still missing"));
        assert!(!f.at(&format!("parts-{from}/set.json")).exists());
        f.success(&format!("{command} parts-{from} --shard 0/2"));
        assert!(files(&f, from) == files(&f, &format!("parts-{from}")), "{from}");
    }
}

#[test]
fn frames_that_take_colour_from_those_before_are_the_same_in_shards_and_when_one_is_made_anew() {
    let f = room("1x1x1");
    f.success("resmap scene.xml --probes probes.json --size 64x32 -o resmap");
    f.success("qhmap resmap --size 64x32 -o qhmap");
    f.success("curvature scene.xml -o curvature.exr");
    f.success("bake-lightmap scene.xml --texels 2000 --spp 8 -o lightmap.exr");
    f.success("bake-probes scene.xml --probes probes.json --qhmap qhmap --lightmap lightmap.exr --spp 4 -o probes");
    let render = "render-path scene.xml --path path.json --probes probes --lightmap lightmap.exr --curvature curvature.exr -o";
    f.success(&format!("{render} whole"));
    let whole = files(&f, "whole");
    assert_eq!(whole.len(), 5);
    f.success(&format!("{render} alone --frames 3"));
    let glossy = |folder: &str| {
        let path = f.at(&format!("{folder}/0003.exr"));
        reprobe::io::ExrImage::read(&path).unwrap().rgb(&path, "glossy").unwrap()
    };
    assert!(glossy("whole") != glossy("alone"), "no pixel takes its colour from the frame before: the test tests nothing");

    for i in [2, 0, 1] {
        let said = f.success(&format!("{render} parts --shard {i}/3"));
        assert_eq!(said.contains("still missing"), i != 1, "{said}");
    }
    assert!(files(&f, "parts") == whole);
    std::fs::remove_file(f.at("parts/0003.exr")).unwrap();
    assert!(f.success(&format!("{render} parts")).contains("4 of them finished already"));
    assert!(files(&f, "parts") == whole);
    let message = f.refusal("render-path scene.xml --method path-trace --shard 0/2 --budget-ms 100 -o timed");
    assert!(message.contains("--shard"), "{message}");
}
