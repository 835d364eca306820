//! Scattering models and textures within others, and odd numbers.

use super::{Folder, pattern_png};
use glam::{Vec2, Vec3};
use reprobe::base::ray::Ray;
use reprobe::material::bsdf::Bsdf;
use reprobe::scene::Scene;
use reprobe::transport::World;

/// A square in z = 0 with a material, under a constant light so that nothing else warns.
fn square(bsdf: &str) -> Scene {
    Folder::new().with("t.png", pattern_png()).load(&format!("<shape type='rectangle'>{bsdf}</shape><emitter type='constant'/>"))
}

/// The share of rays along z that the square stops, and its deviation by noise.
fn stopped(world: &World, from: f32) -> (f64, f64) {
    const RAYS: u32 = 20_000;
    let at = |i: u32| Vec3::new((i % 141) as f32 / 71.0 - 0.99, (i / 141) as f32 / 71.0 - 0.99, from);
    let hits = (0..RAYS).filter(|&i| world.occluded(&Ray::new(at(i), Vec3::NEG_Z * from.signum()))).count();
    let share = hits as f64 / f64::from(RAYS);
    (share, (share.max(0.01) * (1.0 - share).max(0.01) / f64::from(RAYS)).sqrt())
}

#[test]
fn masks_stand_anywhere() {
    let mask =
        |opacity: &str| format!("<bsdf type='mask'><float name='opacity' value='{opacity}'/><bsdf type='diffuse'/></bsdf>");
    let texture = "<texture type='bitmap' name='opacity'><string name='filename' value='t.png'/><boolean name='raw' value='true'/>\
        <string name='filter_type' value='nearest'/></texture>";
    let textured = format!("<bsdf type='mask'>{texture}<bsdf type='diffuse'/></bsdf>");
    let blend = |a: &str, b: &str| format!("<bsdf type='blendbsdf'><float name='weight' value='0.25'/>{a}{b}</bsdf>");
    // The mean luminance of the pattern: red and green 128 / 255, blue 120 / 255.
    let mean = (0.212671 + 0.715160) * 128.0 / 255.0 + 0.072169 * 120.0 / 255.0;
    let diffuse = "<bsdf type='diffuse'/>";
    for (bsdf, front, back) in [
        ("<bsdf type='null'/>".to_owned(), 0.0, 0.0),
        (blend(&mask("0.5"), diffuse), 0.75 * 0.5 + 0.25, 0.75 * 0.5 + 0.25),
        (blend("<bsdf type='null'/>", diffuse), 0.25, 0.25),
        (blend(&textured, diffuse), 0.75 * mean + 0.25, 0.75 * mean + 0.25),
        (format!("<bsdf type='twosided'>{}{diffuse}</bsdf>", mask("0.5")), 0.5, 1.0),
        (format!("<bsdf type='twosided'>{diffuse}<bsdf type='null'/></bsdf>"), 1.0, 0.0),
        (format!("<bsdf type='mask'><float name='opacity' value='0.5'/>{textured}</bsdf>"), 0.5 * mean, 0.5 * mean),
        (format!("<bsdf type='mask'>{texture}{}</bsdf>", mask("0.5")), 0.5 * mean, 0.5 * mean),
    ] {
        let scene = square(&bsdf);
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let world = World::new(scene);
        for (from, expected) in [(1.0, front), (-1.0, back)] {
            let (share, deviation) = stopped(&world, from);
            assert!((share - expected).abs() < 4.0 * deviation, "{bsdf}: {share} from {from}, expected {expected}");
        }
    }
}

/// What is left of a blend behind its masks: a quarter of the whole square is b, which is all there.
#[test]
fn a_blend_of_masks_mixes_what_is_there() {
    let dark = "<bsdf type='diffuse'><rgb name='reflectance' value='0'/></bsdf>";
    let white = "<bsdf type='diffuse'><rgb name='reflectance' value='1'/></bsdf>";
    let scene = square(&format!(
        "<bsdf type='blendbsdf'><float name='weight' value='0.25'/><bsdf type='mask'><float name='opacity' value='0.5'/>{dark}</bsdf>{white}</bsdf>"
    ));
    let world = World::new(scene);
    let s = (0..50).find_map(|i| world.intersect(&Ray::new(Vec3::new(0.01 * i as f32, 0.0, 1.0), Vec3::NEG_Z))).unwrap();
    let albedo = world.scene.materials[0].bsdf.diffuse_albedo(&s, Vec3::Z);
    assert!((albedo - Vec3::splat(0.25 / 0.625)).length() < 1e-5, "{albedo}");
}

/// Mitsuba 3.9.1 at (0.3, 0.6) of nested checkerboards: the second colour, 0.1; and at (0.3, 0.3) the inner one's first.
#[test]
fn textures_within_a_checkerboard() {
    let scene = square(
        "<bsdf type='diffuse'><texture type='checkerboard' name='reflectance'><texture type='checkerboard' name='color0'>
            <transform name='to_uv'><scale value='2'/></transform></texture><texture type='bitmap' name='color1'>
            <string name='filename' value='t.png'/><boolean name='raw' value='true'/><string name='filter_type' value='nearest'/></texture>
            </texture></bsdf>",
    );
    let Bsdf::Diffuse(d) = &scene.materials[0].bsdf else { panic!() };
    assert_eq!(d.reflectance.eval(Vec2::new(0.2, 0.2)), Vec3::splat(0.4));
    assert_eq!(d.reflectance.eval(Vec2::new(0.3, 0.2)), Vec3::splat(0.2));
    let found = d.reflectance.eval(Vec2::new(0.7, 0.3));
    assert!((found * 255.0 - Vec3::new(170.0, 86.0, 200.0)).length() < 1e-3, "{found}");
    let message = Folder::new().error("<texture type='checkerboard' id='t'><ref name='color0' id='t'/></texture>");
    assert!(message.contains("refer to themselves"), "{message}");
}

/// Mitsuba 3.9.1 takes a metal's eta and k below 0, and reflects as by their sizes: only squares count.
#[test]
fn measured_metals_below_zero_load_with_a_warning() {
    let metal = |eta: &str, k: &str| {
        format!(
            "<bsdf type='roughconductor'><float name='alpha' value='0.3'/><rgb name='eta' value='{eta}'/><rgb name='k' value='{k}'/></bsdf>"
        )
    };
    let odd = square(&metal("-0.0485 0.9 1.1", "3.9 -0.0364 2.1"));
    assert_eq!(odd.warnings.len(), 2);
    assert!(odd.warnings[0].contains("eta = [-0.0485, 0.9, 1.1]"), "{:?}", odd.warnings);
    let world = World::new(odd);
    let s = world.intersect(&Ray::new(Vec3::Z, Vec3::NEG_Z)).unwrap();
    let (wi, wo) = (Vec3::new(0.3, 0.1, 0.9486833), Vec3::new(-0.25, -0.05, 0.966954));
    let found = world.scene.materials[0].bsdf.eval(&s, wi, wo, Default::default());
    assert!((found - Vec3::new(0.90956, 0.00292, 0.46136)).abs().max_element() < 2e-4, "{found}");
}

#[test]
fn other_numbers_below_zero_are_mitsubas_choice() {
    let warned = |bsdf: &str| {
        let scene = square(bsdf);
        assert_eq!(scene.warnings.len(), 1, "{bsdf}: {:?}", scene.warnings);
    };
    warned("<bsdf type='diffuse'><float name='reflectance' value='-0.1'/></bsdf>");
    warned("<bsdf type='roughplastic'><float name='alpha' value='-0.1'/></bsdf>");
    warned("<bsdf type='principled'><float name='metallic' value='-0.5'/></bsdf>");
    let refused = |bsdf: &str, expected: &str| {
        let message = Folder::new().error(&format!("<shape type='cube'>\n{bsdf}</shape>"));
        assert!(message.contains("s.xml:2") && message.contains(expected), "{message}");
    };
    refused("<bsdf type='diffuse'><rgb name='reflectance' value='-0.1 0 0'/></bsdf>", "expected finite numbers of at least 0");
    refused("<bsdf type='dielectric'><float name='int_ior' value='-1'/></bsdf>", "int_ior = -1");
}
