//! What there is not: all of it in one message, or left out.

use super::Folder;
use glam::{Vec2, Vec3};
use reprobe::exchange::{LoadOptions, load};
use reprobe::material::bsdf::Bsdf;

const BODY: &str = "
<medium type='homogeneous' id='fog'><rgb name='albedo' value='0.5'/></medium>
<bsdf type='hair' id='hair'/>
<shape type='cube'><ref id='hair'/></shape>
<shape type='sphere'><bsdf type='twosided'><bsdf type='measured'/></bsdf>
<medium type='homogeneous' name='interior'/></shape>
<shape type='bsplinecurve'/>
<shape type='rectangle'><bsdf type='blendbsdf'><bsdf type='polarizer'/>
<bsdf type='retarder'/></bsdf></shape>
<emitter type='volumelight'/>
<emitter type='constant'/>";

#[test]
fn all_that_is_not_supported_is_told_at_once() {
    let message = Folder::new().error(BODY);
    for expected in [
        "s.xml:2: unknown plugin \"homogeneous\"",
        "s.xml:3: unknown bsdf plugin \"hair\"",
        "s.xml:5: unknown bsdf plugin \"measured\"",
        "s.xml:6: unknown plugin \"homogeneous\"",
        "s.xml:7: unknown shape plugin \"bsplinecurve\"",
        "s.xml:8: unknown bsdf plugin \"polarizer\"",
        "s.xml:9: unknown bsdf plugin \"retarder\"",
        "s.xml:10: unknown emitter plugin \"volumelight\"",
        "--skip-unsupported",
    ] {
        assert_eq!(message.matches(expected).count(), 1, "{expected} in\n{message}");
    }
    assert!(message.contains("8 problems"), "{message}");
}

#[test]
fn skipping_leaves_shapes_with_a_grey_surface() {
    let options = LoadOptions { skip_unsupported: true, ..LoadOptions::default() };
    let scene = Folder::new().load_with(BODY, &options).unwrap();
    let names: Vec<&str> = scene.geometry.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["cube", "sphere", "rectangle"]);
    assert_eq!(scene.emitters.len(), 1);
    for object in &scene.geometry.objects {
        let mut bsdf = &scene.materials[object.material as usize].bsdf;
        loop {
            bsdf = match bsdf {
                Bsdf::TwoSided(b) => &b.front,
                Bsdf::Blend(b) => &b.a,
                Bsdf::Diffuse(d) => break assert_eq!(d.reflectance.eval(Vec2::ZERO), Vec3::splat(0.5)),
                other => panic!("{other:?}"),
            };
        }
    }
    for line in [2, 3, 5, 6, 7, 8, 9, 10] {
        let told = scene.warnings.iter().filter(|w| w.contains(&format!("s.xml:{line}:"))).count();
        assert_eq!(told, 1, "line {line} of {:#?}", scene.warnings);
    }
}

#[test]
fn what_is_wrong_is_not_skipped_and_files_are_told_together() {
    let options = LoadOptions { skip_unsupported: true, ..LoadOptions::default() };
    let folder = Folder::new().with("a.obj", "nothing").with("b.ply", "nothing");
    let shape = |kind: &str, file: &str| format!("<shape type='{kind}'><string name='filename' value='{file}'/></shape>");
    let message = folder.load_with(&[shape("obj", "a.obj"), shape("ply", "b.ply")].concat(), &options).unwrap_err().to_string();
    assert!(message.contains("a.obj: no faces") && message.contains("b.ply:1: not a PLY file"), "{message}");
    let wrong = "<shape type='cube'><bsdf type='conductor'>\n<string name='material' value='Un'/></bsdf></shape>";
    let message = folder.load_with(wrong, &options).unwrap_err().to_string();
    assert!(message.contains("s.xml:2: unknown metal"), "{message}");
}

#[test]
fn json_is_told_alike() {
    let folder = Folder::new();
    let text = "{\"type\": \"scene\",\n\"a\": {\"type\": \"cube\", \"bsdf\": {\"type\": \"hair\"}},\n\"m\": {\"type\": \"homogeneous\"},\n\
        \"e\": {\"type\": \"constant\"}}";
    std::fs::write(folder.path("s.json"), text).unwrap();
    let message = load(&folder.path("s.json"), &LoadOptions::default()).unwrap_err().to_string();
    assert!(
        message.contains("s.json:2: unknown bsdf plugin \"hair\"") && message.contains("s.json:3: unknown plugin"),
        "{message}"
    );
    let options = LoadOptions { skip_unsupported: true, ..LoadOptions::default() };
    assert_eq!(load(&folder.path("s.json"), &options).unwrap().geometry.objects.len(), 1);
}
