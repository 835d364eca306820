//! The methods that glossy probes are compared with, where what they should show is known in closed form.

use glam::Vec3;
use reprobe::base::math::{Rgb, hash_words, luminance, unit};
use reprobe::exchange::{LoadOptions, load};
use reprobe::lightmap::lookup::sides;
use reprobe::lightmap::{Atlas, AtlasParams, LightMap};
use reprobe::method::glossy_probes::bake::probe_geometry;
use reprobe::method::image_space_gather::{ImageSpaceGatherParams, gather_image, mirror_image};
use reprobe::method::lightmap_rt::{LightmapRtParams, lightmap_rt};
use reprobe::method::ulr::{UlrParams, ulr};
use reprobe::probe::file::{NO_TRIANGLE, Probe};
use reprobe::probe::parameter_map::ParameterMap;
use reprobe::scene::{Camera, Scene};
use reprobe::surface::CurvatureMap;
use reprobe::transport::World;
use reprobe::view::denoise::{DenoiseParams, Guide};
use reprobe::view::denoiser::Denoiser;
use reprobe::view::gbuffer::{GBuffer, gbuffer};
use reprobe::view::layers::LayerImages;
use std::f32::consts::PI;
use std::sync::Arc;

/// Radiance that each wall emits; by the light map it sends 0.5 more.
const GLOW: [[f32; 3]; 6] = [[1., 0., 0.], [0., 2., 0.], [0., 0., 3.], [4., 4., 0.], [0., 5., 5.], [6., 0., 6.]];
const MIRROR: &str = r#"<bsdf type="twosided"><bsdf type="conductor"><string name="material" value="none"/></bsdf></bsdf>"#;

fn rough(alpha: f32) -> String {
    format!(
        r#"<bsdf type="twosided"><bsdf type="roughconductor"><string name="material" value="none"/>
           <string name="distribution" value="ggx"/><float name="alpha" value="{alpha}"/></bsdf></bsdf>"#
    )
}

/// A closed room from -2 to 2, glowing grey walls in the order of [`GLOW`], with `things` in it.
fn room(things: &str) -> Setup {
    let turns = [(0, 1, 0), (0, 1, 180), (0, 1, 90), (0, 1, -90), (1, 0, -90), (1, 0, 90)];
    let places = ["0,0,-2", "0,0,2", "-2,0,0", "2,0,0", "0,-2,0", "0,2,0"];
    let wall = |i: usize| {
        let ((x, y, angle), place, [r, g, b]) = (turns[i], places[i], GLOW[i]);
        format!(
            r#"<shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="{x}" y="{y}" angle="{angle}"/>
            <translate value="{place}"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
            <emitter type="area"><rgb name="radiance" value="{r},{g},{b}"/></emitter></shape>"#
        )
    };
    let walls: String = (0..6).map(wall).collect();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("room.xml");
    std::fs::write(&path, format!(r#"<scene version="3.0.0">{walls}{things}</scene>"#)).unwrap();
    Setup::new(load(&path, &LoadOptions::default()).unwrap())
}

struct Setup {
    world: World,
    lightmap: LightMap,
}

impl Setup {
    fn new(scene: Scene) -> Self {
        let atlas = Atlas::build(&scene.geometry, &|_| true, &AtlasParams { texel: Some(0.5), ..Default::default() }).unwrap();
        let texels = (atlas.size[0] * atlas.size[1]) as usize;
        let lightmap = sides(&scene.geometry, &atlas, vec![Rgb::splat(PI); texels], None);
        Self { world: World::opaque(scene).0, lightmap }
    }

    fn view(&self, origin: Vec3, target: Vec3, size: [u32; 2]) -> GBuffer {
        let camera = Camera::look_at(origin, target, Vec3::Y, 1.0, size);
        gbuffer(&self.world, &CurvatureMap::flat(self.world.scene.geometry.positions.len()), &camera)
    }

    /// Which wall a ray meets, and what it sends back.
    fn wall_along(&self, pixel: &reprobe::view::gbuffer::Pixel) -> Rgb {
        let d = reprobe::base::math::reflect(pixel.wo, pixel.normal);
        let hit = self.world.intersect(&pixel.surface.spawn(d)).unwrap();
        Rgb::from(GLOW[hit.object as usize]) + 0.5
    }
}

fn mirror_at(z: f32, bsdf: &str) -> String {
    format!(r#"<shape type="rectangle"><transform name="to_world"><translate value="0,0,{z}"/></transform>{bsdf}</shape>"#)
}

#[test]
fn mirrors_show_the_emission_and_the_light_map_of_what_they_reflect() {
    let setup = room(&mirror_at(-1.5, MIRROR));
    let view = setup.view(Vec3::new(0.3, 0.1, 1.5), Vec3::new(0.0, 0.0, -1.5), [48, 32]);
    let params = ImageSpaceGatherParams::default();
    let mirror = mirror_image(&setup.world, &setup.lightmap, &view, &params);
    let gathered = gather_image(&setup.world, &view, &mirror, &params);
    let traced = lightmap_rt(&setup.world, &setup.lightmap, &view, &LightmapRtParams::default(), 0, 0);
    let mut count = 0;
    for (i, pixel) in view.pixels.iter().enumerate() {
        let p = pixel.as_ref().unwrap();
        if p.alpha.is_none() {
            assert_eq!((gathered[i], traced[i]), (Rgb::ZERO, Rgb::ZERO));
            continue;
        }
        count += 1;
        let expected = setup.wall_along(p);
        assert!((gathered[i] - expected).length() < 1e-3, "{} for {expected}", gathered[i]);
        assert!((traced[i] - expected).length() < 1e-3, "{} for {expected}", traced[i]);
    }
    assert!(count > 300, "{count} mirror pixels");
}

#[test]
fn mirrors_in_mirrors_are_followed_to_the_depth_that_is_asked_for() {
    const MIDDLE: usize = 16 * 33 + 16;
    // Two mirrors face each other: rays from the eye go back and forth.
    let setup = room(&(mirror_at(-1.5, MIRROR) + &mirror_at(1.9, MIRROR)));
    let view = setup.view(Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, 0.0, -1.5), [33, 33]);
    let p = view.pixels[MIDDLE].as_ref().unwrap();
    assert_eq!(p.alpha, Some(0.0), "the middle looks at the mirror");
    let shallow = ImageSpaceGatherParams { mirror_depth: 1, ..Default::default() };
    let light = |params: &ImageSpaceGatherParams| mirror_image(&setup.world, &setup.lightmap, &view, params)[MIDDLE].unwrap();
    assert_eq!(light(&shallow).light, Rgb::ZERO, "a mirror has no light of its own");
    assert!((light(&shallow).distance - 3.4).abs() < 1e-4);
    let no_mirrors = ImageSpaceGatherParams { max_mirror_alpha: -1.0, ..Default::default() };
    assert_eq!(light(&no_mirrors).light, Rgb::ZERO);
    let rays =
        |bounces| lightmap_rt(&setup.world, &setup.lightmap, &view, &LightmapRtParams { bounces, ..Default::default() }, 0, 0);
    // Near the rim the way leads past the other mirror after some bounces.
    let lit = |image: &[Rgb]| image.iter().filter(|c| c.max_element() > 0.0).count();
    let counts = [1, 3, 12].map(|n| lit(&rays(n)));
    assert!(counts[0] < counts[1] && counts[1] < counts[2], "{counts:?}");
}

#[test]
fn brdf_sampled_rays_and_next_event_estimation_have_one_mean() {
    let setup = room(&mirror_at(-1.0, &rough(0.3)));
    let view = setup.view(Vec3::new(0.2, 0.1, 1.2), Vec3::new(0.0, 0.0, -1.0), [6, 4]);
    const RUNS: u32 = 64;
    // One bounce on the rough plane; the walls have no glossy lobe to go on with.
    let estimates = |next_event: bool| -> Vec<f64> {
        let params = LightmapRtParams { next_event, samples: 64, ..Default::default() };
        let mean = |seed| {
            let image = lightmap_rt(&setup.world, &setup.lightmap, &view, &params, seed, u32::from(next_event));
            image.iter().map(|&c| f64::from(luminance(c))).sum::<f64>() / image.len() as f64
        };
        (0..RUNS).map(mean).collect()
    };
    let statistics = |v: &[f64]| {
        let n = v.len() as f64;
        let mean = v.iter().sum::<f64>() / n;
        (mean, v.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
    };
    let ((a, va), (b, vb)) = (statistics(&estimates(false)), statistics(&estimates(true)));
    let z = (a - b) / (va + vb).sqrt();
    assert!(z.abs() < 4.0, "{a} and {b} differ by {z} standard errors");
    assert!(a > 0.5 && (va + vb).sqrt() < 0.01 * a, "{a} +- {}", (va + vb).sqrt());
}

#[test]
fn the_gather_keeps_an_even_reflection_and_blurs_far_edges_more_than_near_ones() {
    let setup = room(&mirror_at(-1.5, &rough(0.2)));
    let view = setup.view(Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, 0.0, -1.5), [64, 64]);
    let params = ImageSpaceGatherParams { samples: 256, ..Default::default() };
    let mirror = mirror_image(&setup.world, &setup.lightmap, &view, &params);
    // The mirror takes up columns 9 to 54. Mean over the middle rows of each.
    let render = |light: fn(usize) -> f32, distance: f32| -> Vec<f32> {
        let mut mirror = mirror.clone();
        for (i, m) in mirror.iter_mut().enumerate() {
            if let Some(m) = m {
                (m.light, m.distance) = (Rgb::splat(light(i % 64)), distance);
            }
        }
        let image = gather_image(&setup.world, &view, &mirror, &params);
        (0..64).map(|x| (20..44).map(|y| image[y * 64 + x].x).sum::<f32>() / 24.0).collect()
    };
    // A perfect metal's albedo is nearly 1, and no darkness comes from beyond its edges.
    for x in render(|_| 1.0, 3.0).into_iter().skip(12).take(40) {
        assert!((0.9..1.01).contains(&x), "{x}");
    }
    // An edge in the middle: both sides of it add up, and it is as wide as the footprint, sigma = 1.22 alpha d_r / (d_c + d_r) focal.
    let edge: fn(usize) -> f32 = |x| if x < 32 { 0.0 } else { 1.0 };
    let focal = view.camera.focal_px();
    for distance in [0.3, 3.0] {
        let column = render(edge, distance);
        assert!((column[31] + column[32] - 0.97).abs() < 0.05, "{} {}", column[31], column[32]);
        assert!(column[12] < 0.1 && column[51] > 0.85, "{} {}", column[12], column[51]);
        let sigma = 1.22 * 0.2 * distance / (2.5 + distance) * focal;
        let slope = column[32] - column[31];
        // The normal distribution's density at its middle; a Gaussian cut at 2.5 sigma is a little steeper.
        let expected = 0.97 / (sigma * (2.0 * PI).sqrt());
        assert!((0.75..1.3).contains(&(slope / expected)), "slope {slope} at {distance}, expected {expected}");
    }
}

/// A probe whose colours are a picture painted on the surfaces: the same from everywhere, as no reflection is.
fn painted(world: &World, position: Vec3) -> Arc<Probe> {
    let mut probe = probe_geometry(world, position, ParameterMap::identity([256, 128]));
    for texel in &mut probe.texels {
        if texel.triangle != NO_TRIANGLE {
            let b = texel.barycentric();
            let hit = reprobe::base::ray::Hit { t: 0.0, triangle: texel.triangle, u: b.x, v: b.y };
            let s = world.surface(&hit);
            texel.set_glossy(paint(s.p, s.object));
        }
    }
    Arc::new(probe)
}

fn paint(p: Vec3, object: u32) -> Rgb {
    let stripes = (p * 3.0).map(f32::sin) * 0.3 + 0.5;
    if object == 6 { stripes } else { Rgb::new(stripes.x, 2.0 + stripes.y, stripes.z) }
}

#[test]
fn a_lumigraph_of_painted_surfaces_shows_the_paint_and_no_ghosts_of_what_is_in_front() {
    // A glossy box (object 6) before a glossy wall (7): each probe sees another part of the wall behind it.
    let things = format!(
        r#"<shape type="cube"><transform name="to_world"><scale value="0.4"/></transform>{}</shape>{}"#,
        rough(0.2),
        mirror_at(-1.5, &rough(0.2))
    );
    let setup = room(&things);
    let probes: Vec<_> =
        [[-1.0, 0.2, 1.0], [1.0, 0.4, 1.2], [0.1, -0.8, 1.5], [0.0, 1.2, 0.8], [1.2, 1.0, -0.5], [-1.2, -1.0, -0.5]]
            .map(|p| painted(&setup.world, Vec3::from(p)))
            .to_vec();
    let view = setup.view(Vec3::new(0.3, 0.2, 1.4), Vec3::ZERO, [64, 48]);
    let image = ulr(&setup.world, &view, &probes, &UlrParams::default());
    let (mut count, mut worst, mut sum) = (0, 0f32, 0.0);
    for (found, p) in image.glossy.iter().zip(&view.pixels) {
        let p = p.as_ref().filter(|p| p.alpha.is_some());
        let Some(p) = p else { continue };
        let error = (*found - paint(p.surface.p, p.surface.object)).length();
        (count, worst, sum) = (count + 1, worst.max(error), sum + error);
    }
    assert!(count > 500, "{count}");
    assert_eq!(image.unserved, 0);
    assert!(sum / (count as f32) < 0.02, "{}", sum / count as f32);
    // A ghost would be off by 2.
    assert!(worst < 0.5, "{worst}");
}

#[test]
fn a_lumigraph_seen_from_a_probe_is_that_probe() {
    let setup = room(&mirror_at(-1.5, MIRROR));
    let eye = Vec3::new(0.3, 0.1, 1.0);
    // The other probes' paint is of another colour.
    let own = painted(&setup.world, eye);
    let others = [[-1.0, 0.0, 1.0], [1.0, 0.5, 1.0], [0.0, 1.0, 1.2]].map(|p| {
        let mut other = (*painted(&setup.world, Vec3::from(p))).clone();
        other.texels.iter_mut().for_each(|t| t.set_glossy(Rgb::new(9.0, 0.1, 9.0)));
        Arc::new(other)
    });
    let view = setup.view(eye, Vec3::new(0.0, 0.0, -1.5), [32, 24]);
    let probes: Vec<_> = others.into_iter().chain([own]).collect();
    let image = ulr(&setup.world, &view, &probes, &UlrParams::default());
    for (found, p) in image.glossy.iter().zip(&view.pixels) {
        if let Some(p) = p.as_ref().filter(|p| p.alpha.is_some()) {
            let expected = paint(p.surface.p, p.surface.object);
            assert!((*found - expected).length() < 0.1, "{found} for {expected}");
        }
    }
}

/// Two faces side by side, the left half of each with dark texture: guides, clean light and layers with noise of deviation `noise`.
fn noisy(noise: f32) -> ([Vec<Guide>; 2], Vec<Rgb>, LayerImages) {
    const SIZE: usize = 64;
    let random = |i: usize, k: u32| unit(hash_words(&[i as u32, k, 5])) - 0.5;
    let (mut guides, mut clean, mut dirty) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..SIZE * SIZE {
        let (x, y) = (i % SIZE, i / SIZE);
        let upper = y < SIZE / 2;
        let albedo = Rgb::splat(if (x / 4).is_multiple_of(2) { 0.2 } else { 0.8 });
        let normal = if upper { Vec3::Z } else { Vec3::Y };
        let light = if upper { Rgb::new(1.0, 0.9, 0.8) } else { Rgb::new(0.2, 0.3, 0.4) };
        guides.push(Guide { normal, depth: 3.0 + 0.02 * y as f32, albedo, factor: albedo });
        clean.push(light * albedo);
        // Sum of twelve uniform numbers: a deviation of 1.
        let gaussian: f32 = (0..12).map(|k| random(i, k)).sum();
        dirty.push((light + Rgb::splat(gaussian * noise)) * albedo);
    }
    let layers = LayerImages { emission: clean.clone(), diffuse: dirty.clone(), glossy: dirty };
    ([guides.clone(), guides], clean, layers)
}

#[test]
fn the_denoiser_takes_noise_and_leaves_edges_and_texture() {
    let denoiser = Denoiser::Filter(DenoiseParams::default());
    let rmse = |a: &[Rgb], b: &[Rgb]| {
        (a.iter().zip(b).map(|(a, b)| (*a - *b).length_squared()).sum::<f32>() / (3 * a.len()) as f32).sqrt()
    };
    let (guides, clean, layers) = noisy(0.0);
    let same = denoiser.denoise(&layers, &guides, 64).unwrap();
    assert_eq!(same.emission, layers.emission);
    assert!(rmse(&same.diffuse, &clean) < 1e-4 && rmse(&same.glossy, &clean) < 1e-4, "{}", rmse(&same.diffuse, &clean));
    let (guides, clean, layers) = noisy(0.1);
    let better = denoiser.denoise(&layers, &guides, 64).unwrap();
    let (before, after) = (rmse(&layers.diffuse, &clean), rmse(&better.diffuse, &clean));
    assert!(after < 0.25 * before, "{before} before, {after} after");
    // One sample of a rare path is no light of its neighbours'.
    let mut spot = layers;
    spot.glossy[30 * 64 + 30] = Rgb::splat(500.0);
    let cut = denoiser.denoise(&spot, &guides, 64).unwrap();
    assert!(rmse(&cut.glossy, &clean) < 1.5 * after, "{}", rmse(&cut.glossy, &clean));
}
