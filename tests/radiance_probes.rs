//! `bake-transport`, `relight` and `render-path --method radiance-probes`.

mod folder;
mod layers;

use folder::Folder;
use layers::{layer, squares};
use reprobe::base::math::Rgb;

/// A closed room with walls of two colours and a block in it.
const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="75"/>
      <transform name="to_world"><lookat origin="0, 0, 1.7" target="0, -0.4, 0" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="36"/><integer name="height" value="24"/></film></sensor>
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.5, 0.3"/></bsdf></bsdf>
    <bsdf type="roughplastic" id="block"><float name="alpha" value="0.3"/><rgb name="diffuse_reflectance" value="0.2, 0.4, 0.7"/></bsdf>
    <shape type="cube" id="room"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="cube" id="box"><transform name="to_world"><scale x="0.5" y="0.7" z="0.4"/><rotate y="1" angle="30"/>
      <translate x="0.2" y="-1.3" z="-0.5"/></transform><ref id="block"/></shape>
    <shape type="rectangle" id="lamp"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.6"/><translate y="1.9"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf><emitter type="area"><rgb name="radiance" value="6"/></emitter></shape>
    </scene>"#;
/// A light that goes from one side to the other, and walls that turn red.
const LIGHTS: &str = r#"{"fps": 1, "scene_lights": false,
    "lights": [{"type": "point", "intensity": [4, 4, 4],
                "keyframes": [{"time": 0, "position": [-1.2, 1, 0.5]}, {"time": 2, "position": [1.2, 1, 0.5]}]}],
    "materials": [{"id": "wall", "keyframes": [{"time": 0, "albedo": [0.7, 0.5, 0.3]}, {"time": 2, "albedo": [0.7, 0.1, 0.1]}]}]}"#;
const PATH: &str = r#"{"fov": 75, "size": [36, 24], "frames": [{"origin": [0, 0, 1.7], "target": [0, -0.4, 0]}]}"#;
const PLACE: &str = "place-probes scene.xml --grid 3x3x3 --bounds=-1.6,-1.6,-1.6,1.6,1.6,1.6 -o probes.json";
const BAKE: &str = "bake-transport scene.xml --probes probes.json --texel 0.15 --rays 128 --relight-rays 1000";
const RENDER: &str = "render-path scene.xml --path path.json --method radiance-probes";

fn folder() -> Folder {
    let f = Folder::with(SCENE, PATH);
    std::fs::write(f.at("lights.json"), LIGHTS).unwrap();
    f.success(PLACE);
    f
}

fn files(f: &Folder, folder: &str) -> Vec<(String, Vec<u8>)> {
    let mut list: Vec<_> = std::fs::read_dir(f.at(folder))
        .unwrap()
        .map(|e| e.unwrap().path())
        .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&p).unwrap()))
        .filter(|(name, _)| name != "timings.json")
        .collect();
    list.sort();
    list
}

#[test]
fn frames_have_the_light_of_path_tracing_whatever_moves() {
    let f = folder();
    f.success(&format!("{BAKE} -o transport"));
    f.success(&format!("{RENDER} --probes transport --lights lights.json --set direct_samples=16 --set bounces=8 -o frames"));
    f.success(
        "render-path scene.xml --path path.json --method path-trace --spp 256 --lights lights.json --device cpu -o reference",
    );
    for frame in 0..3 {
        let name = format!("{frame:04}.exr");
        let [ours, theirs] = ["frames", "reference"].map(|folder| squares(&layer(&f, &format!("{folder}/{name}"), "diffuse")));
        let size = theirs.iter().map(|c| c.y).sum::<f32>() / 36.0;
        for (k, (a, b)) in ours.iter().zip(&theirs).enumerate() {
            // A seventh of the light; in the dark, harmonics of order 7 are too blunt to tell.
            let allowed = 0.14 * b.y + 0.05 * size;
            assert!((a.y - b.y).abs() < allowed || b.y < 0.5 * size, "frame {frame}, square {k}: {} for {}", a.y, b.y);
        }
        let mean = |p: &[Rgb]| p.iter().map(|c| c.y).sum::<f32>() / 36.0;
        // What no probe sees sends nothing (§3.2).
        assert!((mean(&ours) / mean(&theirs) - 1.0).abs() < 0.05, "frame {frame}: {} for {}", mean(&ours), mean(&theirs));
    }
    // Paths along the lobes read the receivers' light: the glossy layer is there as well.
    f.success(&format!(
        "{RENDER} --probes transport --lights lights.json --frames 1 --set gloss_samples=64 --set bounces=8 -o gloss"
    ));
    let gloss = |folder: &str| layer(&f, &format!("{folder}/0001.exr"), "glossy").iter().map(|c| c.y).sum::<f32>();
    assert!((gloss("gloss") / gloss("reference") - 1.0).abs() < 0.1, "{} for {}", gloss("gloss"), gloss("reference"));
    // A ball before the eye's wall takes light from the probes that look at it.
    let ball = r#"{"objects": [{"type": "sphere", "radius": 0.9, "position": [0, 0.9, 0], "albedo": [0, 0, 0]}]}"#;
    std::fs::write(f.at("ball.json"), ball).unwrap();
    std::fs::write(f.at("none.json"), "{}").unwrap();
    for name in ["ball", "none"] {
        f.success(&format!("relight scene.xml --probes transport --lights {name}.json --indirect -o {name}"));
    }
    let [with, without] =
        ["ball", "none"].map(|folder| layer(&f, &format!("{folder}/0000.exr"), "irradiance").iter().map(|c| c.y).sum::<f32>());
    assert!(with > 0.0 && with < 0.9 * without, "{with} {without}");
    let red = |frame: &str| layer(&f, frame, "diffuse").iter().map(|c| c.y / c.x.max(1e-6)).sum::<f32>() / 864.0;
    assert!(red("frames/0002.exr") < 0.8 * red("frames/0000.exr"), "walls turn red");
}

/// Probes of light fields hold the light of their bake, the scene's own lamp; another method's diffuse light makes theirs anew.
#[test]
fn reflections_follow_a_light_that_moves_by_light_field_probes() {
    let f = folder();
    f.success(&format!("{BAKE} -o transport"));
    f.success("bake-lightfield scene.xml --probes probes.json --size 64 --spp 1 --bounces 1 -o lightfield");
    const JOINED: &str =
        "render-path scene.xml --path path.json --method light-field-probes --probes lightfield --diffuse radiance-probes";
    f.success(&format!(
        "{JOINED} --diffuse-probes transport --lights lights.json --samples 32 --set direct_samples=32 --diffuse-set bounces=16 -o frames"
    ));
    f.success(&format!("{RENDER} --probes transport --lights lights.json --set bounces=16 -o own"));
    f.success(
        "render-path scene.xml --path path.json --method path-trace --spp 256 --lights lights.json --device cpu -o reference",
    );
    for frame in ["0000.exr", "0001.exr", "0002.exr"] {
        let of = |folder: &str, name: &str| layer(&f, &format!("{folder}/{frame}"), name);
        assert!(of("frames", "diffuse") == of("own", "diffuse"), "{frame}");
        let [ours, theirs] = ["frames", "reference"].map(|folder| of(folder, "glossy").iter().sum::<Rgb>());
        assert!((ours / theirs - 1.0).abs().max_element() < 0.06, "{frame}: {ours} for {theirs}");
    }
    assert!(f.refusal(&format!("{JOINED} -o none")).contains("--diffuse-probes DIR, written by bake-transport"));
    let glossy = "render-path scene.xml --method glossy-probes --probes p --curvature c --lights lights.json -o none";
    assert!(f.refusal(glossy).contains("its probes hold the light that was baked"));
    let refused = f.refusal(&JOINED.replace("--diffuse radiance-probes", "--diffuse ulr --diffuse-probes transport -o none"));
    assert!(refused.contains("--diffuse ulr: it has no light for others; radiance-probes has"), "{refused}");
}

/// A small ball in the air, half of whose light comes from walls. (A large one takes more light from the probes than it should.)
#[test]
fn shapes_that_a_frame_adds_have_light_by_way_of_the_volume() {
    let f = folder();
    let ball = r#"{"objects": [{"type": "sphere", "radius": 0.12, "position": [-0.3, -0.2, 1.2], "albedo": [0.7, 0.7, 0.7]}]}"#;
    std::fs::write(f.at("ball.json"), ball).unwrap();
    f.success(&format!("{BAKE} --volume 0.4 -o volume"));
    f.success(&format!("{BAKE} -o transport"));
    for folder in ["volume", "transport"] {
        f.success(&format!(
            "{RENDER} --size 72x48 --probes {folder} --lights ball.json --set direct_samples=64 --set bounces=16 -o frames-{folder}"
        ));
    }
    let traced = "render-path scene.xml --path path.json --size 72x48 --method path-trace --lights ball.json --device cpu";
    f.success(&format!("{traced} --spp 128 -o reference"));
    let layer = |folder: &str| layer(&f, &format!("{folder}/0000.exr"), "diffuse");
    let [without, with, expected] = ["frames-transport", "frames-volume", "reference"].map(layer);
    // Pixels that show the ball are those which the volume lights.
    let ball: Vec<usize> = (0..72 * 48).filter(|&i| without[i].y < 0.85 * with[i].y).collect();
    assert!(ball.len() > 300, "{}", ball.len());
    let mean = |pixels: &[Rgb]| ball.iter().map(|&i| pixels[i]).sum::<Rgb>() / ball.len() as f32;
    let [without, with, expected] = [without, with, expected].map(|pixels| mean(&pixels));
    let share = (with - without) / (expected - without);
    assert!((share - 1.0).abs().max_element() < 0.06, "{share} of the light that is not direct");
    assert!(f.refusal(&format!("{BAKE} --volume 0.001 -o fine")).contains("--volume 0.001"));
    std::fs::remove_file(f.at("volume/volume.exr")).unwrap();
    assert!(f.refusal(&format!("{RENDER} --probes volume -o again")).contains("volume.exr"));
}

#[test]
fn shards_and_threads_make_the_same_files_and_finished_ones_are_kept() {
    let f = folder();
    const BAKE: &str = "bake-transport scene.xml --probes probes.json --texel 0.15 --rays 128 --relight-rays 1000 --volume 0.5";
    f.success(&format!("{BAKE} --threads 1 -o whole"));
    assert!(f.success(&format!("{BAKE} --shard 1/2 -o parts")).contains("still missing"));
    assert!(f.refusal(&format!("{RENDER} --probes parts -o frames")).contains("run bake-transport"));
    f.success(&format!("{BAKE} --shard 0/2 -o parts"));
    assert!(files(&f, "whole") == files(&f, "parts"));
    assert!(f.success(&format!("{BAKE} -o whole")).contains("up to date"));
    std::fs::remove_file(f.at("whole/0001.exr")).unwrap();
    assert!(f.success(&format!("{BAKE} -o whole")).contains("1 groups baked"));
    assert!(files(&f, "whole") == files(&f, "parts"));
}

#[test]
fn light_maps_of_frames_serve_other_methods() {
    let f = folder();
    f.success(&format!("{BAKE} -o transport"));
    f.success("relight scene.xml --probes transport --lights lights.json --frames 1,2 -o maps");
    assert!(!f.at("maps/0000.exr").exists());
    f.success("relight scene.xml --probes transport -o own --set map_samples=32");
    f.success(
        "render-path scene.xml --path path.json --method lightmap-rt --samples 1 --lightmap own/0000.exr --device cpu -o frames",
    );
    f.success(&format!("{RENDER} --probes transport --set direct_samples=64 --set map_samples=32 -o direct"));
    let [looked_up, traced] = ["frames", "direct"].map(|folder| squares(&layer(&f, &format!("{folder}/0000.exr"), "diffuse")));
    let mean = |p: &[Rgb]| p.iter().map(|c| c.y).sum::<f32>() / 36.0;
    assert!((mean(&looked_up) / mean(&traced) - 1.0).abs() < 0.05, "{} {}", mean(&looked_up), mean(&traced));
    // Without direct light there is less of it, everywhere.
    f.success("relight scene.xml --probes transport --indirect -o indirect --set map_samples=32");
    let [all, part] = ["own", "indirect"].map(|folder| layer(&f, &format!("{folder}/0000.exr"), "irradiance"));
    assert!(all.iter().zip(&part).all(|(a, p)| p.y <= a.y * 1.001 + 1e-3));
    assert!(part.iter().map(|c| c.y).sum::<f32>() < 0.7 * all.iter().map(|c| c.y).sum::<f32>());
}

/// Order 1 is enough for the irradiance of a wall, and shows the block a light that comes from the lamp's side.
#[test]
fn receivers_of_first_order_have_the_same_diffuse_light_and_some_gloss() {
    let f = folder();
    f.success(&format!("{BAKE} -o transport"));
    f.success(&format!("{BAKE} --receiver sh1 -o sh1"));
    for folder in ["transport", "sh1"] {
        f.success(&format!("{RENDER} --probes {folder} --set direct_samples=0 --set map_samples=16 -o frames-{folder}"));
    }
    let [plain, first] = ["transport", "sh1"].map(|folder| squares(&layer(&f, &format!("frames-{folder}/0000.exr"), "diffuse")));
    for (a, b) in plain.iter().zip(&first) {
        assert!((a.y - b.y).abs() < 0.15 * a.y + 0.01, "{plain:?} {first:?}");
    }
    let gloss = |folder: &str| layer(&f, &format!("frames-{folder}/0000.exr"), "glossy").iter().map(|c| c.y).sum::<f32>();
    assert_eq!(gloss("transport"), 0.0);
    assert!(gloss("sh1") > 0.0);
    assert!(f.refusal("relight scene.xml --probes sh1 -o maps").contains("--receiver irradiance"));
}

#[test]
fn damaged_and_foreign_files_are_refused() {
    let f = folder();
    f.success(&format!("{BAKE} -o transport"));
    std::fs::write(f.at("other.xml"), SCENE.replace("value=\"6\"", "value=\"7\"")).unwrap();
    let other = f.refusal("render-path other.xml --method radiance-probes --probes transport -o frames");
    assert!(other.contains("transport") && other.contains("scene"), "{other}");
    assert!(f.refusal(&format!("{RENDER} --probes probes.json -o frames")).contains("probes.json"));
    assert!(f.refusal(&format!("{RENDER} --probes transport --set bounces=65 -o frames")).contains("bounces"));
    assert!(f.refusal("bake-transport scene.xml --probes probes.json --sh-order 10 -o out").contains("--sh-order"));
    assert!(f.refusal("bake-transport scene.xml --probes probes.json --texel 1 --texels 9 -o out").contains("--texel"));
    let file = f.at("transport/0000.exr");
    let mut bytes = std::fs::read(&file).unwrap();
    let last = bytes.len() - 9;
    bytes[last] ^= 4;
    std::fs::write(&file, &bytes).unwrap();
    assert!(f.refusal(&format!("{RENDER} --probes transport -o frames")).contains("0000.exr"));
}
