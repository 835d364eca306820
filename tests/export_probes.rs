//! `export-probes` of sets that see by a light map, in a furnace: a closed room whose walls all send out the same radiance.

mod folder;

use folder::Folder;

/// Walls of albedo 1/2 that emit 1 send out 2 in all, half of it diffuse; the floor is a perfect mirror, which shows 2.
const SCENE: &str = r#"<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="70"/>
  <transform name="to_world"><lookat origin="0, 0, 0" target="0, -0.5, 1" up="0, 1, 0"/></transform></sensor>
<shape type="cube"><boolean name="flip_normals" value="true"/><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
  <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-0.999"/></transform>
  <bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>
</scene>"#;

/// The mean over all directions of what a probe's diffuse light says.
fn mean(f: &Folder, folder: &str) -> f64 {
    let table: serde_json::Value =
        serde_json::from_slice(&std::fs::read(f.at(&format!("{folder}/probes.json"))).unwrap()).unwrap();
    assert_eq!(table["probes"].as_array().unwrap().len(), 1);
    for file in ["0000.ktx2", "0000_diffuse.ktx2", "volume.ktx2"] {
        assert!(f.success(&format!("info {folder}/{file}")).contains("export-probes"), "{file}");
    }
    table["probes"][0]["harmonics"][0][1].as_f64().unwrap() / (4.0 * std::f64::consts::PI).sqrt()
}

#[test]
fn a_furnace_is_as_bright_as_its_walls_and_its_mirror() {
    let f = Folder::with(SCENE, "{}");
    f.success("place-probes scene.xml --grid 1x1x1 --bounds=-0.1,-0.1,-0.1,0.1,0.1,0.1 -o probes.json");
    f.success("bake-lightmap scene.xml --texels 600 --spp 256 -o lightmap.exr");
    f.success("resmap scene.xml --probes probes.json --size 64x32 -o resmap");
    f.success("qhmap resmap --size 128x64 -o qhmap");
    f.success("bake-probes scene.xml --probes probes.json --qhmap qhmap --lightmap lightmap.exr --spp 4 -o probes");
    f.success("bake-transport scene.xml --probes probes.json --texels 600 --rays 64 --relight-rays 200 -o transport");

    let lit = "--scene scene.xml --lightmap lightmap.exr --size 16";
    f.success(&format!("export-probes probes {lit} -o engine"));
    f.success(&format!("export-probes transport {lit} -o diffuse"));
    // Five walls of six, a sixth of the sphere each, and the floor.
    let (with_mirror, without) = (mean(&f, "engine"), mean(&f, "diffuse"));
    assert!((without - 5.0 / 6.0).abs() < 0.02, "{without}");
    assert!((with_mirror - 7.0 / 6.0).abs() < 0.03, "{with_mirror}");

    assert!(f.refusal("export-probes probes -o none").contains("--lightmap"));
    assert!(f.refusal("export-probes qhmap --scene scene.xml --lightmap lightmap.exr -o none").contains("qhmap"));
}
