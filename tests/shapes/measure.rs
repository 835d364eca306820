//! Renders a scene, and holds what it shows against Mitsuba's.

use glam::DVec3;
use reprobe::base::progress::Silent;
use reprobe::exchange::{LoadOptions, load};
use reprobe::method::path_trace::{PathTraceParams, path_trace, path_trace_full};
use reprobe::scene::Scene;
use reprobe::scene::film::Filter;
use reprobe::transport::World;
use reprobe::transport::path::PathParams;
use std::path::Path;

/// Renders of different seeds, from whose spread the error of their mean follows.
const SEEDS: u32 = 12;

/// Standard errors by which the mean of [`SEEDS`] renders may miss: Student's t of 11 degrees of freedom passes 6 once in 11,000.
const ERRORS: f64 = 6.0;

/// The scene's integrator, sensor and film as most cases have them.
pub const PATH: &str = "<integrator type='path'/>";

/// A sensor of 48 x 36 pixels with a box filter, with more parameters of it and of its film.
pub fn sensor(kind: &str, parameters: &str, to_world: &str, film: &str) -> String {
    format!(
        "<sensor type='{kind}'>{parameters}<transform name='to_world'>{to_world}</transform>
         <film type='hdrfilm'><integer name='width' value='48'/><integer name='height' value='36'/>{film}<rfilter type='box'/></film></sensor>"
    )
}

/// The view of most cases.
pub const LOOK_AT: &str = "<lookat origin='0.3,0.5,4' target='0,0,0' up='0,1,0'/>";

/// The usual sensor.
pub fn usual_sensor() -> String {
    sensor("perspective", "<float name='fov' value='40'/>", LOOK_AT, "")
}

/// A checkered square of two sides and a ball before it, under a pale sky.
pub const STAGE: &str = "
    <emitter type='constant'><rgb name='radiance' value='.3,.35,.5'/></emitter>
    <shape type='rectangle'><transform name='to_world'><scale value='1.2'/></transform><bsdf type='twosided'><bsdf type='diffuse'>
        <texture type='checkerboard' name='reflectance'><rgb name='color0' value='.8,.3,.1'/><rgb name='color1' value='.1,.4,.7'/>
            <transform name='to_uv'><scale value='3'/></transform></texture></bsdf></bsdf></shape>
    <shape type='sphere'><float name='radius' value='.5'/><point name='center' x='.3' y='.2' z='.6'/>
        <bsdf type='diffuse'><rgb name='reflectance' value='.6,.7,.5'/></bsdf></shape>";

/// A ball that shines.
pub const LAMP: &str = "<shape type='sphere'><float name='radius' value='.3'/><point name='center' x='-.5' y='.3' z='1.2'/>
    <emitter type='area'><rgb name='radiance' value='3,2,1'/></emitter></shape>";

/// Loads what stands between the scene's tags.
pub fn scene(inside: &str) -> Scene {
    let dir = tempfile::tempdir().unwrap();
    // What textures of emitters show.
    image::RgbImage::from_fn(8, 4, |x, y| image::Rgb([(10 + y * 40) as u8, (10 + x * 25) as u8, 60]))
        .save(dir.path().join("tex.png"))
        .unwrap();
    load_in(dir.path(), inside).unwrap_or_else(|e| panic!("{e}"))
}

/// Loads it, or says what is wrong.
pub fn load_in(dir: &Path, inside: &str) -> reprobe::Result<Scene> {
    let path = dir.join("scene.xml");
    std::fs::write(&path, format!("<scene version='3.0.0'>\n{inside}\n</scene>")).unwrap();
    load(&path, &LoadOptions::default())
}

/// Renders, `spp` samples a pixel in all, and compares the means of the image's quarters (upper left, upper right, lower left, lower
/// right) with Mitsuba's, whose standard error is at most `error`.
pub fn expect_quarters(inside: &str, spp: u32, filter: Filter, mitsuba: [[f64; 3]; 4], error: f64) {
    let world = World::new(scene(inside));
    let camera = world.scene.sensor.clone().unwrap();
    let [width, height] = camera.size.map(|s| s as usize);
    let params =
        PathTraceParams { spp: spp.div_ceil(SEEDS), path: PathParams::of(&world.scene), filter, ..PathTraceParams::default() };
    let quarters = |pixels: &[glam::Vec3]| {
        let mut sums = [(DVec3::ZERO, 0.0); 4];
        for (i, p) in pixels.iter().enumerate() {
            let quarter = usize::from(i / width >= height / 2) * 2 + usize::from(i % width >= width / 2);
            sums[quarter] = (sums[quarter].0 + p.as_dvec3(), sums[quarter].1 + 1.0);
        }
        sums.map(|(sum, count)| sum / count)
    };
    let renders: Vec<_> = (0..SEEDS).map(|seed| quarters(&path_trace_full(&world, &camera, &params, seed, 0, &Silent))).collect();
    for (quarter, expected) in mitsuba.into_iter().enumerate() {
        for (channel, expected) in expected.into_iter().enumerate() {
            let values: Vec<f64> = renders.iter().map(|r| r[quarter][channel]).collect();
            expect_mean(&values, expected, error, &format!("quarter {quarter}, channel {channel}"));
        }
    }
    layers_add_up(&world, filter, &renders);
}

/// The layers' sum has the mean of the full image: both ways of rendering see the scene alike.
fn layers_add_up(world: &World, filter: Filter, renders: &[[DVec3; 4]]) {
    let camera = world.scene.sensor.clone().unwrap();
    let params = PathTraceParams { spp: 16, path: PathParams::of(&world.scene), filter, ..PathTraceParams::default() };
    let full: Vec<f64> = renders.iter().map(|r| r.iter().sum::<DVec3>().element_sum()).collect();
    let sums: Vec<f64> = (0..SEEDS)
        .map(|seed| {
            let pixels = path_trace(world, &camera, &params, seed + 100, 0, &Silent).full();
            let sum: DVec3 = pixels.iter().map(|p| p.as_dvec3()).sum();
            4.0 * sum.element_sum() / pixels.len() as f64
        })
        .collect();
    let (mean, error) = mean_and_error(&full);
    expect_mean(&sums, mean, error, "the layers together");
}

fn expect_mean(values: &[f64], expected: f64, error: f64, what: &str) {
    let (mean, own) = mean_and_error(values);
    // The last digit of what is stored.
    let tolerance = ERRORS * own.hypot(error) + 1e-5;
    assert!((mean - expected).abs() <= tolerance, "{what}: {mean:.5} +- {own:.5}, Mitsuba {expected:.5} +- {error:.5}");
}

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
