//! Scene text and the places of its files.

use super::Folder;
use glam::{Vec2, Vec3};
use reprobe::exchange::{LoadOptions, load};
use reprobe::material::bsdf::Bsdf;
use reprobe::scene::{Emitter, Scene};

const CUBE: &str = "<shape type='cube'/>";

fn reflectance(scene: &Scene) -> Vec3 {
    match &scene.materials[0].bsdf {
        Bsdf::Diffuse(d) => d.reflectance.eval(Vec2::ZERO),
        other => panic!("{other:?}"),
    }
}

fn radiance(scene: &Scene) -> Vec3 {
    match scene.emitters[0] {
        Emitter::Constant { radiance } => radiance,
        ref other => panic!("{other:?}"),
    }
}

/// Values: Mitsuba 3.9.1, scalar_rgb, which knows the first five; the rest as it reduces the same lists of wavelengths, and the black
/// body after its spectral variant's radiance.
#[test]
fn spectrum_plugins_are_their_colours() {
    let list = "<string name='values' value='0.1, 0.2, 0.6, 0.5'/>";
    let (grey, reduced, emitted) = ([0.4; 3], [0.66958, 0.36814, 0.12], [0.77313, 0.3536, 0.10355]);
    let regular =
        format!("type='regular'><float name='wavelength_min' value='400'/><float name='wavelength_max' value='700'/>{list}");
    let irregular = format!("type='irregular'><string name='wavelengths' value='400 500 600 700'/>{list}");
    for (spectrum, surface, light) in [
        ("type='uniform'><float name='value' value='0.4'/>", grey, grey),
        ("type='d65'><float name='scale' value='0.5'/>", [0.5; 3], [0.5; 3]),
        ("type='d65'><rgb name='color' value='0.2 0.4 0.6'/>", [0.2, 0.4, 0.6], [0.2, 0.4, 0.6]),
        ("type='srgb'><rgb name='color' value='0.2 0.4 0.6'/>", [0.2, 0.4, 0.6], [0.2, 0.4, 0.6]),
        ("type='rawconstant'><float name='value' value='0.4'/>", grey, grey),
        (regular.as_str(), reduced, emitted),
        (irregular.as_str(), reduced, emitted),
    ] {
        for tag in ["spectrum", "texture"] {
            let plugin = |name: &str| format!("<{tag} name='{name}' {spectrum}</{tag}>");
            let scene = Folder::new().load(&format!(
                "<shape type='cube'><bsdf type='diffuse'>{}</bsdf></shape><emitter type='constant'>{}</emitter>",
                plugin("reflectance"),
                plugin("radiance")
            ));
            assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
            for (found, expected) in [(reflectance(&scene), surface), (radiance(&scene), light)] {
                let error = (found - Vec3::from(expected)).abs().max_element();
                assert!(error < 3e-3 * Vec3::from(expected).max_element(), "{spectrum}: {found}, expected {expected:?}");
            }
        }
    }
}

#[test]
fn spectra_are_referred_to_and_told_when_wrong() {
    let scene = Folder::new().load(
        "<spectrum type='uniform' id='u'><float name='value' value='0.25'/></spectrum>
         <shape type='cube'><bsdf type='diffuse'><ref name='reflectance' id='u'/></bsdf></shape><emitter type='constant'/>",
    );
    assert_eq!(reflectance(&scene), Vec3::splat(0.25));
    let error = |spectrum: &str| Folder::new().error(&format!("{CUBE}<emitter type='constant'>\n{spectrum}</emitter>"));
    let message = error("<spectrum name='radiance' type='rainbow'/>");
    assert!(message.contains("s.xml:2: constant: radiance is the plugin \"rainbow\", expected a colour"), "{message}");
    let message = error(
        "<spectrum name='radiance' type='irregular'><string name='wavelengths' value='1 2 3'/><string name='values' value='1 2'/></spectrum>",
    );
    assert!(message.contains("3 wavelengths and 2 values"), "{message}");
}

/// By Planck's law at 6504 K the colour is near that of daylight, and its luminance the spectral variant's.
#[test]
fn a_black_body_is_as_bright_as_its_temperature() {
    let at = |kelvin: u32| {
        let body = format!("<spectrum name='radiance' type='blackbody'><float name='temperature' value='{kelvin}'/></spectrum>");
        radiance(&Folder::new().load(&format!("{CUBE}<emitter type='constant'>{body}</emitter>")))
    };
    for (kelvin, expected) in BLACK_BODIES {
        let found = at(kelvin);
        let error = (found - Vec3::from(expected)).abs().max_element() / Vec3::from(expected).max_element();
        assert!(error < 5e-3, "{kelvin} K: {found}, expected {expected:?}");
    }
}

/// Mitsuba 3.9.1, scalar_spectral: a `blackbody` emitter's radiance, integrated with the colour matching functions of Mitsuba.
const BLACK_BODIES: [(u32, [f32; 3]); 2] = [(3000, [733.11, 349.57, 112.71]), (6504, [44015.0, 41512.0, 43718.0])];

#[test]
fn a_defined_parameter_that_the_scene_lacks_is_an_error() {
    let options = |name: &str| LoadOptions { defines: vec![(name.into(), "3".into())], ..LoadOptions::default() };
    let body = format!("<default name='size' value='2'/>{CUBE}<emitter type='constant'/>");
    let folder = Folder::new();
    let message = folder.load_with(&body, &options("nosuch")).unwrap_err().to_string();
    assert!(message.contains("s.xml: --define nosuch=3") && message.contains("size"), "{message}");
    assert!(folder.load_with(&body, &options("size")).is_ok());
    std::fs::write(folder.path("s.json"), r#"{"type":"scene","c":{"type":"cube"},"e":{"type":"constant"}}"#).unwrap();
    let warnings = load(&folder.path("s.json"), &options("nosuch")).unwrap().warnings;
    assert!(warnings.len() == 1 && warnings[0].contains("--define nosuch=3 is ignored"), "{warnings:?}");
}

#[test]
fn json_has_what_xml_has() {
    let folder = Folder::new();
    let text = "\u{feff}{\"type\":\"scene\",\"c\":{\"type\":\"cube\",\"bsdf\":{\"type\":\"diffuse\",\"reflectance\":{\"type\":\"irregular\",
        \"wavelengths\":[400,500,600,700],\"values\":[0.1,0.2,0.6,0.5]}}},
        \"e\":{\"type\":\"constant\",\"radiance\":{\"type\":\"d65\",\"scale\":2}}}";
    std::fs::write(folder.path("s.json"), text).unwrap();
    let scene = load(&folder.path("s.json"), &LoadOptions::default()).unwrap();
    assert!((reflectance(&scene) - Vec3::new(0.66958, 0.36814, 0.12)).length() < 3e-3);
    assert_eq!(radiance(&scene), Vec3::splat(2.0));
}

#[test]
fn files_are_sought_in_the_working_folder_last() {
    // The tests' working folder is the repository's root.
    let scene = Folder::new()
        .load("<shape type='cube'/><emitter type='envmap'><string name='filename' value='docs/images/room.jpg'/></emitter>");
    assert!(matches!(scene.emitters[0], Emitter::Envmap { .. }));
    let message = Folder::new().error("<shape type='obj'><string name='filename' value='nowhere.obj'/></shape>");
    assert!(message.contains("looked for") && message.contains(", nowhere.obj)"), "{message}");
}

#[test]
fn long_attribute_lists_take_linear_time() {
    let many: String = (0..50_000).map(|i| format!(" a{i}='{i}'")).collect();
    let start = std::time::Instant::now();
    Folder::new().load(&format!("<shape type='cube'{many}/><emitter type='constant'/>"));
    assert!(start.elapsed().as_secs() < 10, "{:?}", start.elapsed());
}
