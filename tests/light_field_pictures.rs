//! `inspect-lightfield`, and `place-probes --coverage-picture`: pictures for people who look for a fault.

mod folder;

use folder::Folder;
use image::RgbImage;
use reprobe::io::picture::heat;
use reprobe::method::light_field_probes::hits::Verdict;
use reprobe::method::light_field_probes::inspect::COLOURS;
use reprobe::method::light_field_probes::inspect::hits::colour;
use reprobe::probe::coverage::UNSEEN;
use serde_json::Value;

/// A room of 4 m with a floor of 3 m that is glossy, 1 m below the middle, and a ball above it; outside of it, nothing.
const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="70"/>
      <transform name="to_world"><lookat origin="0, 0, 1.7" target="0, -0.5, 0" up="0, 1, 0"/></transform></sensor>
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.5, 0.3"/></bsdf></bsdf>
    <shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="1.5"/><translate y="-1"/></transform>
      <bsdf type="roughplastic"><float name="alpha" value="0.15"/><rgb name="diffuse_reflectance" value="0.3"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="0" y="-0.6" z="0"/><float name="radius" value="0.35"/><ref id="wall"/></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.8"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="4"/></emitter></shape>
    </scene>"#;
/// Frame 1 looks out of the room from its outside.
const PATH: &str = r#"{"fov": 70, "size": [48, 32], "frames": [
    {"origin": [0, 0, 1.7], "target": [0, -0.5, 0]}, {"origin": [0, 0, 5], "target": [0, 0, 9]}]}"#;

const PLACE: &str = "place-probes scene.xml --path path.json --grid 2x2x2 --margin 1 -o probes.json";
/// The same with a box, in which none is blocked.
const IN_BOX: &str = "place-probes scene.xml --grid 2x2x2 --bounds=-1.6,-0.8,-1.6,1.6,1.6,1.6 -o probes.json";
const BAKE: &str = "bake-lightfield scene.xml --probes probes.json --size 128 --spp 1 --bounces 1 -o lightfield";
const INSPECT: &str = "inspect-lightfield scene.xml --probes lightfield";

fn baked() -> Folder {
    let f = Folder::with(SCENE, PATH);
    f.success(IN_BOX);
    f.success(BAKE);
    f
}

fn png(f: &Folder, name: &str) -> RgbImage {
    image::open(f.at(name)).unwrap().to_rgb8()
}

fn count(picture: &RgbImage, colour: [u8; 3]) -> usize {
    picture.pixels().filter(|p| p.0 == colour).count()
}

fn figures(f: &Folder, args: &str) -> Value {
    serde_json::from_str(&f.success(&format!("{args} --json"))).unwrap()
}

/// Eight probes in a room with a ball: nearly all rays meet what they meet in the scene, and the picture says the same as the words.
#[test]
fn all_rays_of_a_view_are_held_against_the_scene() {
    let f = baked();
    let figures = figures(&f, &format!("{INSPECT} --path path.json --hits -o hits.png"));
    let share = |name: &str| figures["shares"][name].as_f64().unwrap();
    let sum: f64 = ["right", "wrong", "missed", "false", "lost"].into_iter().map(share).sum();
    assert!((sum - 1.0).abs() < 1e-9 && share("right") > 0.9 && figures["rays"].as_u64().unwrap() > 1000, "{figures}");
    assert_eq!((figures["differ"].as_f64(), figures["probes"].as_u64()), (Some(0.0), Some(8)), "{figures}");
    // Pixels all of whose rays are right are many of the glossy ones.
    let right = count(&png(&f, "hits.png"), colour(Verdict::Right));
    assert!(right > 20_000, "{right}");
    let two = f.success(&format!("{INSPECT} --path path.json --hits --trace two-scale -o hits.png"));
    assert!(two.contains("two-scale") && two.contains("0.000 % differ from hi-z"), "{two}");
    assert!(f.refusal(&format!("{INSPECT} --hits --exposure 1 -o x.png")).contains("--exposure"));
    assert!(f.refusal(&format!("{INSPECT} --path path.json --frame 1 --hits -o x.png")).contains("no glossy surface"));
}

#[test]
fn a_probe_s_maps_show_what_it_sees() {
    let f = baked();
    let figures = figures(&f, &format!("{INSPECT} --probe 0 -o probe.png"));
    let position: Vec<f64> = serde_json::from_value(figures["position"].clone()).unwrap();
    assert!(position.iter().zip([-0.8, -0.2, -0.8]).all(|(a, b)| (a - b).abs() < 1e-6), "{figures}");
    let layers: Vec<&String> = figures["maps"].as_object().unwrap().keys().collect();
    assert_eq!(layers, ["radiance", "distance", "normal", "irradiance", "moment.1"]);
    let picture = png(&f, "probe.png");
    // Maps of 256 pixels with 8 between them, below two lines of words.
    let at = |map: u32, x: u32, y: u32| picture.get_pixel(8 + map * 264 + x, 36 + y).0;
    // Straight up is the ceiling, which looks down: no green. At the left, the wall at -X, which looks to +X: all red.
    let near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 2);
    assert!(near(at(2, 128, 128), [127, 0, 127]), "{:?}", at(2, 128, 128));
    assert!(near(at(2, 3, 128), [255, 127, 127]), "{:?}", at(2, 3, 128));
    // The wall at -X is 1.2 m away, the lamp and the ceiling 2.1 and 2.2 m: between what is nearest and farthest, as the legend says.
    let legend = figures["maps"]["distance"].as_str().unwrap();
    let range: Vec<f32> = legend.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let shade = |metres: f32| heat((metres - range[0]) / (range[1] - range[0]));
    let alike = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 12);
    assert!(alike(at(1, 3, 128), shade(1.2)) && alike(at(1, 128, 128), shade(2.15)), "{legend}");
    let brightness = |c: [u8; 3]| c.iter().map(|&c| u32::from(c)).sum::<u32>();
    // Radiance is the wall's colour: more red than blue.
    let wall = at(0, 3, 128);
    assert!(wall[0] > wall[2], "{wall:?}");
    // Brighter by some stops.
    f.success(&format!("{INSPECT} --probe 0 --exposure 3 -o brighter.png"));
    assert!(brightness(png(&f, "brighter.png").get_pixel(11, 164).0) > brightness(wall));
    // A picture of ours may be written again, but nobody else's.
    f.success(&format!("{INSPECT} --probe 1 -o probe.png"));
    std::fs::write(f.at("photograph.png"), b"\x89PNG").unwrap();
    assert!(f.refusal(&format!("{INSPECT} --probe 0 -o photograph.png")).contains("not written by reprobe"));
    assert!(f.refusal(&format!("{INSPECT} --probe 0 -o probe.jpg")).contains("ends in .png"));
}

#[test]
fn a_ray_s_way_is_told_and_drawn() {
    let f = baked();
    // The floor before the ball mirrors the ball, 0.274 m on.
    let straight = figures(&f, &format!("{INSPECT} --path path.json --frame 0 --pixel 24,30 -o way.png"));
    assert_eq!(straight["ray"]["kind"], "mirror ray");
    let truth = straight["bvh"].as_f64().unwrap();
    assert!((truth - 0.274).abs() < 0.005, "{truth}");
    let mut asked = 0;
    for x in [4, 12, 24, 33, 44] {
        for search in ["hi-z", "two-scale"] {
            let figures = figures(&f, &format!("{INSPECT} --path path.json --pixel {x},30 --trace {search} -o way.png"));
            let picture = png(&f, "way.png");
            let steps = figures["steps"].as_array().unwrap();
            assert!(!steps.is_empty() && steps.len() <= 8, "{figures}");
            asked = asked.max(steps.len());
            // Each goes on where the one before has lost the ray; the last one says what is found.
            for pair in steps.windows(2) {
                assert!(pair[0]["said"] == "lost" && pair[1]["from"].as_f64() >= pair[0]["to"].as_f64(), "{figures}");
            }
            assert_eq!(steps[steps.len() - 1]["said"], figures["found"]["said"], "{figures}");
            if figures["found"]["said"] == "hit" {
                let [t, truth] = [&figures["found"]["t"], &figures["bvh"]].map(|t| t.as_f64().unwrap());
                assert!((t - truth).abs() < 0.1, "{figures}");
            }
            // Everybody who was asked has a dot of ten pixels in both views, and a title in its colour.
            for colour in COLOURS.iter().take(steps.len()) {
                assert!(count(&picture, *colour) > 100, "{x} {colour:?} {figures}");
            }
            assert!(COLOURS.iter().skip(steps.len()).all(|colour| count(&picture, *colour) == 0), "{figures}");
            // Ring and start of the ray in both views and on the map.
            assert!(count(&picture, [255; 3]) > 150);
        }
    }
    assert!(asked > 1, "no ray was handed on");
    // A wall is no mirror: the view's own ray.
    let text = f.success(&format!("{INSPECT} --pixel 2,2 --size 48x32 -o wall.png"));
    assert!(text.contains("view ray from [0.000, 0.000, 1.700]"), "{text}");
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[2].starts_with("step  probe") && lines[3].starts_with("   1  "), "{text}");
    assert!(lines[lines.len() - 1].contains("BVH: hit at "), "{text}");
}

#[test]
fn what_cannot_be_shown_is_refused() {
    let f = baked();
    let refused = |args: &str, expected: &str| {
        let message = f.refusal(args);
        assert!(message.contains(expected) && message.trim_end().lines().count() == 1, "{args}: {message}");
        assert!(!f.at("a.png").exists());
    };
    refused(&format!("{INSPECT} --probe 8 -o a.png"), "--probe 8: lightfield has probes 0 to 7");
    refused(&format!("{INSPECT} --path path.json --pixel 48,0 -o a.png"), "48 x 32 pixels: expected from 0,0 to 47,31");
    refused(&format!("{INSPECT} --path path.json --frame 2 --pixel 1,1 -o a.png"), "--frame 2: the path has frames 0 to 1");
    refused(
        &format!("{INSPECT} --path path.json --frame 1 --pixel 1,1 -o a.png"),
        "shows no surface there: choose another pixel",
    );
    f.success("resmap scene.xml --probes probes.json --size 32x16 -o resmap");
    refused("inspect-lightfield scene.xml --probes resmap --probe 0 -o a.png", "expected a folder that bake-lightfield wrote");
    std::fs::create_dir(f.at("empty")).unwrap();
    refused("inspect-lightfield scene.xml --probes empty --probe 0 -o a.png", "run bake-lightfield again");
    std::fs::write(f.at("other.xml"), SCENE.replace("0.35", "0.3")).unwrap();
    refused("inspect-lightfield other.xml --probes lightfield --probe 0 -o a.png", "another scene");
    // What the arguments alone tell.
    for (args, expected) in [
        ("-o a.png", "--probe <N>"),
        ("--probe 0 --pixel 1,1 -o a.png", "cannot be used with"),
        ("--probe 0 --frame 1 -o a.png", "cannot be used with"),
        ("--pixel 1 -o a.png", "expected 2 numbers"),
        ("--pixel 1,1 --trace all -o a.png", "expected two-scale or hi-z"),
    ] {
        assert!(f.refusal(&format!("{INSPECT} {args}")).contains(expected), "{args}");
    }
}

#[test]
fn a_blocked_probe_has_no_maps() {
    let f = Folder::with(SCENE, PATH);
    // The second layer is outside of the room.
    f.success("place-probes scene.xml --grid 1x2x1 --bounds=0,0,1,0,6,1 -o probes.json");
    f.success(BAKE);
    let message = f.refusal(&format!("{INSPECT} --probe 1 -o a.png"));
    assert!(message.contains("--probe 1: is blocked") && message.contains("the nearest one that is not is 0"), "{message}");
}

#[test]
fn coverage_is_drawn_for_any_method() {
    let f = Folder::with(SCENE, PATH);
    let one = "place-probes scene.xml --grid 1x1x1 --bounds=0,1,1,0,1,1 -o one.json --coverage-picture one.png";
    let one_sees = figures(&f, one)["coverage"].as_f64().unwrap();
    let eight_see = figures(&f, &format!("{PLACE} --coverage-picture eight.png"))["coverage"].as_f64().unwrap();
    assert!(one_sees > 0.3 && eight_see > one_sees, "{one_sees} {eight_see}");
    let [one, eight] = ["one.png", "eight.png"].map(|name| png(&f, name));
    // One probe: what it sees is as bright as can be, and the ball's far side and its shadow are magenta, in the view shaded.
    assert!(count(&one, heat(1.0)) > 10_000 && count(&one, UNSEEN) > 1000);
    assert!(count(&eight, UNSEEN) < count(&one, UNSEEN));
    let view = |picture: &RgbImage| {
        let top = picture.height() - 800 * 32 / 48;
        let is_unseen = |c: [u8; 3]| c[1] == 0 && c[0] > 100 && u32::from(c[2]) * 230 / 200 + 3 > u32::from(c[0]);
        picture.enumerate_pixels().filter(|(_, y, p)| *y >= top && is_unseen(p.0)).count()
    };
    assert!(view(&one) > 1000 && view(&eight) < view(&one), "{} {}", view(&one), view(&eight));
    f.success("place-probes scene.xml --method sdf --count 2 -o sdf.json --picture plan.png --coverage-picture sdf.png");
    let sdf = png(&f, "sdf.png");
    assert!(sdf.width() == 800 && count(&sdf, heat(1.0)) > 1000 && png(&f, "plan.png").width() > 300);
    assert!(f.refusal(&format!("{PLACE} --picture a.png --coverage-picture a.png")).contains("expected two files"));
    assert!(f.refusal(&format!("{PLACE} --coverage-picture a.jpg")).contains("ends in .png"));
}
