//! `sunsky` against Mitsuba 3.9.1: its emitter's radiance, and irradiance by quadrature of that and of its samples.

use super::Folder;
use glam::{Vec2, Vec3};
use reprobe::base::math::Rgb;
use reprobe::exchange::LoadOptions;
use reprobe::scene::Emitter;
use reprobe::transport::light_tree::Receiver;
use reprobe::transport::{Sampler, World};

/// Where the irradiance of plates was measured: their normals.
const PLATES: [[f32; 3]; 4] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-0.6, 0.5, 0.4]];
/// Where radiance was measured, and then at the middle of the sun.
const VIEWS: [[f32; 3]; 6] =
    [[0.0, 0.1, 1.0], [0.3, 0.5, 0.6], [-0.7, 0.2, 0.1], [0.1, 0.9, 0.2], [0.2, -0.9, 0.3], [0.4, 0.3, -0.6]];

/// What Mitsuba has for a `sunsky`.
struct Measured {
    parameters: &'static str,
    sun: [f32; 3],
    irradiance: [[f32; 3]; 4],
    radiance: [[f32; 3]; 7],
}

fn world(emitter: &str) -> World {
    let scene = Folder::new().load(&format!("<shape type='cube'/>{emitter}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    World::new(scene)
}

/// From a quarter of a million samples of the emitters.
fn irradiance(world: &World, normal: Vec3) -> Rgb {
    const N: u32 = 1 << 18;
    let receiver = Receiver { p: Vec3::ZERO, n: normal };
    let sample = |i| {
        let [u, x, y, _] = Sampler::new(7, i).next_4d();
        let sample = world.lights.sample(&world.scene, &receiver, u, Vec2::new(x, y));
        sample.map_or(Rgb::ZERO, |s| s.weight * s.wi.dot(normal).max(0.0))
    };
    let sum: glam::DVec3 = (0..N).map(|i| sample(i).as_dvec3()).sum();
    (sum / f64::from(N)).as_vec3()
}

/// Channels may miss by a share of themselves and a smaller one of the brightest.
fn near(found: Rgb, expected: [f32; 3], share: f32, what: &str) {
    let expected = Rgb::from(expected);
    let most = expected * share + Rgb::splat(0.3 * share * expected.max_element());
    assert!((found - expected).abs().cmple(most + 1e-6).all(), "{what}: {found}, Mitsuba {expected}");
}

impl Measured {
    fn hold(&self, what: &str) {
        let world = world(&format!("<emitter type='sunsky'>{}</emitter>", self.parameters));
        for (normal, expected) in PLATES.into_iter().zip(self.irradiance) {
            let found = irradiance(&world, Vec3::from(normal).normalize());
            near(found, expected, 0.01, &format!("{what}: irradiance to {normal:?}"));
        }
        for (view, expected) in VIEWS.into_iter().chain([self.sun]).zip(self.radiance) {
            let found = world.lights.environment(Vec3::from(view).normalize());
            near(found, expected, 0.03, &format!("{what}: radiance from {view:?}"));
        }
    }
}

#[test]
fn the_defaults() {
    Measured {
        parameters: "",
        sun: [0.051385, 0.69175, 0.72031],
        irradiance: [[1.2188, 1.1225, 1.0688], [1.1896, 1.0756, 0.95321], [0.1892, 0.23646, 0.3158], [1.1882, 1.0908, 1.0071]],
        radiance: [
            [0.027777, 0.046196, 0.090099],
            [0.088802, 0.11759, 0.16927],
            [0.10102, 0.15538, 0.229],
            [0.15572, 0.21449, 0.2921],
            [0.059452, 0.10306, 0.17609],
            [0.0, 0.0, 0.0],
            [21419.0, 17626.0, 13042.0],
        ],
    }
    .hold("default");
}

#[test]
fn a_sun_in_a_direction() {
    Measured {
        parameters: "<vector name='sun_direction' x='1' y='-2' z='1.5'/> \
             <float name='turbidity' value='6'/> \
             <rgb name='albedo' value='.7,.2,.1'/>",
        sun: [0.37139, -0.74278, 0.55709],
        irradiance: [
            [1.0092, 0.87686, 0.77306],
            [0.13625, 0.13449, 0.18139],
            [0.75229, 0.63698, 0.53488],
            [0.16691, 0.17361, 0.24173],
        ],
        radiance: [
            [0.031572, 0.042038, 0.06686],
            [0.03857, 0.050166, 0.07994],
            [0.14102, 0.12686, 0.15681],
            [0.11203, 0.11064, 0.14873],
            [0.50553, 0.4693, 0.40489],
            [0.0, 0.0, 0.0],
            [18129.0, 14280.0, 9921.0],
        ],
    }
    .hold("direction");
}

#[test]
fn a_place_and_a_time() {
    Measured {
        parameters: "<float name='latitude' value='-33.9'/> \
             <float name='longitude' value='151.2'/> \
             <float name='timezone' value='10'/> \
             <integer name='year' value='2024'/> \
             <integer name='month' value='1'/> \
             <integer name='day' value='15'/> \
             <float name='hour' value='8'/> \
             <float name='minute' value='20'/> \
             <float name='second' value='30'/>",
        sun: [0.0097035, -0.77209, 0.63544],
        irradiance: [
            [1.0738, 0.98688, 0.92908],
            [0.094866, 0.15322, 0.23782],
            [0.12419, 0.17924, 0.25979],
            [0.11624, 0.19029, 0.30862],
        ],
        radiance: [
            [0.019427, 0.036006, 0.074395],
            [0.023857, 0.046296, 0.092648],
            [0.091134, 0.14301, 0.20688],
            [0.082608, 0.13454, 0.20513],
            [0.16615, 0.21437, 0.27201],
            [0.0, 0.0, 0.0],
            [21065.0, 17099.0, 12250.0],
        ],
    }
    .hold("moment");
}

#[test]
fn a_sky_that_is_turned_and_scaled() {
    Measured {
        parameters: "<transform name='to_world'><rotate x='1' angle='-90'/> \
             <rotate y='1' angle='30'/> \
             </transform><vector name='sun_direction' x='.3' y='.8' z='-.4'/> \
             <float name='sky_scale' value='.5'/> \
             <float name='sun_scale' value='2'/>",
        sun: [0.3, 0.8, -0.4],
        irradiance: [
            [0.049118, 0.080003, 0.13298],
            [2.6204, 2.2531, 1.8561],
            [1.0181, 0.89525, 0.76522],
            [0.28033, 0.28692, 0.32314],
        ],
        radiance: [
            [0.060471, 0.090191, 0.1303],
            [0.016629, 0.031698, 0.063015],
            [0.032317, 0.055552, 0.095772],
            [0.014147, 0.024234, 0.049128],
            [0.0, 0.0, 0.0],
            [0.046898, 0.070632, 0.11145],
            [43651.0, 36485.0, 27980.0],
        ],
    }
    .hold("turned");
}

#[test]
fn a_wide_sun_half_below_the_horizon() {
    Measured {
        parameters: "<vector name='sun_direction' x='-1' y='0' z='.05'/> \
             <float name='sun_aperture' value='20'/> \
             <float name='turbidity' value='2.3'/>",
        sun: [-0.99875, 0.0, 0.049938],
        irradiance: [
            [0.089489, 0.080759, 0.071903],
            [0.063474, 0.05669, 0.042754],
            [0.05282, 0.05363, 0.04297],
            [0.30811, 0.15879, 0.066806],
        ],
        radiance: [
            [0.0060553, 0.0094881, 0.012583],
            [0.011788, 0.016484, 0.019785],
            [0.14112, 0.1031, 0.048896],
            [0.034604, 0.038739, 0.031384],
            [0.027562, 0.033004, 0.030745],
            [0.0, 0.0, 0.0],
            [5.094, 1.8721, 0.13746],
        ],
    }
    .hold("low");
}

#[test]
fn a_sky_without_its_sun() {
    Measured {
        parameters: "<float name='sun_scale' value='0'/> \
             <float name='turbidity' value='9'/> \
             <float name='hour' value='17.5'/>",
        sun: [-0.26843, 0.9232, 0.27506],
        irradiance: [
            [0.27551, 0.26822, 0.26138],
            [0.55419, 0.44172, 0.30123],
            [0.10526, 0.10951, 0.11752],
            [0.54202, 0.44744, 0.32974],
        ],
        radiance: [
            [0.022626, 0.029602, 0.044277],
            [0.068649, 0.071503, 0.07815],
            [0.1457, 0.12114, 0.10523],
            [0.64389, 0.50439, 0.31303],
            [0.057299, 0.068417, 0.085564],
            [0.0, 0.0, 0.0],
            [1.4898, 1.1553, 0.64503],
        ],
    }
    .hold("sky");
}

#[test]
fn a_sun_without_its_sky() {
    Measured {
        parameters: "<float name='sky_scale' value='0'/>",
        sun: [0.051385, 0.69175, 0.72031],
        irradiance: [
            [1.0573, 0.87013, 0.64381],
            [1.0154, 0.83563, 0.61828],
            [0.075429, 0.062073, 0.045928],
            [1.009, 0.83034, 0.61437],
        ],
        radiance: [
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [21419.0, 17626.0, 13042.0],
        ],
    }
    .hold("sun");
}

#[test]
fn what_is_given_twice_or_out_of_range_is_an_error_with_its_line() {
    let vector = |v: &str| format!("<vector name='sun_direction' value='{v}'/>");
    for (parameters, expected) in [
        ("<float name='turbidity' value='11'/>".to_owned(), "turbidity = 11: expected 1 to 10"),
        ("<float name='turbidity' value='0.5'/>".into(), "turbidity = 0.5"),
        ("<rgb name='albedo' value='1.5,0,0'/>".into(), "albedo ="),
        ("<float name='sun_scale' value='-1'/>".into(), "sun_scale = -1"),
        ("<float name='sky_scale' value='-1'/>".into(), "sky_scale = -1"),
        ("<float name='sun_aperture' value='180'/>".into(), "sun_aperture = 180"),
        (vector("0,0,0"), "no length"),
        (format!("{}<float name='hour' value='3'/>", vector("0,0,1")), "hour beside sun_direction"),
        ("<integer name='month' value='14'/>".into(), "month = 14: expected 1 to 12"),
        ("<float name='year' value='2010.5'/>".into(), "year is a number, expected an integer"),
        ("<transform name='to_world'><scale value='0'/></transform>".into(), "can be inverted"),
    ] {
        let message = Folder::new().error(&format!("\n<emitter type='sunsky'>\n{parameters}</emitter>"));
        assert!(message.contains("s.xml:3: ") && message.contains(expected), "{expected} in {message}");
    }
}

#[test]
fn a_sun_below_the_horizon_is_dark_with_a_warning() {
    let scene = Folder::new().load("<shape type='cube'/>\n<emitter type='sunsky'><float name='hour' value='22'/></emitter>");
    assert!(scene.emitters.is_empty());
    assert!(scene.warnings[0].contains("s.xml:2: ") && scene.warnings[0].contains("below the horizon"), "{:?}", scene.warnings);
}

#[test]
fn a_second_environment_beside_a_sunsky_is_an_error() {
    let message = Folder::new().error("<emitter type='sunsky'/>\n<emitter type='constant'/>");
    assert!(message.contains("s.xml:2: a second environment"), "{message}");
}

#[test]
fn half_a_sunsky_has_its_old_name() {
    let emitters = |plugin: &str| {
        let scene = Folder::new().load(&format!(
            "<shape type='cube'/>\n<emitter type='{plugin}'><float name='scale' value='2'/><vector name='sunDirection' value='1,0,1'/></emitter>"
        ));
        assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("s.xml:2: "), "{:?}", scene.warnings);
        scene.emitters
    };
    assert!(matches!(emitters("sky")[..], [Emitter::Envmap { scale: 2.0, .. }]));
    assert!(matches!(emitters("sun")[..], [Emitter::Sun { .. }]));
}

#[test]
fn a_moving_sun_is_told_and_can_be_left_out() {
    let body = "<shape type='cube'/>\n<emitter type='timed_sunsky'/>";
    let message = Folder::new().error(body);
    assert!(message.contains("s.xml:2: timed_sunsky") && message.contains("--skip-unsupported"), "{message}");
    let options = LoadOptions { skip_unsupported: true, ..LoadOptions::default() };
    assert!(Folder::new().load_with(body, &options).unwrap().emitters.is_empty());
}
