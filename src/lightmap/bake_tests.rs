//! The bake against closed forms, and the three ways in which light maps leak.

use super::adaptive::DIM;
use super::bake::{LightMapParams, Pass, Plan};
use super::parts::{Memory, Store};
use super::{AtlasParams, DenoiseParams, LightMap, testing};
use crate::base::math::Rgb;
use crate::base::progress::Silent;
use crate::base::ray::Ray;
use crate::io::jobs::Done;
use crate::material::bsdf::{Bsdf, Conductor, Diffuse, TwoSided};
use crate::material::{Material, Surface, Texture};
use crate::scene::{Camera, Emitter, Geometry, Scene};
use crate::transport::path::{PathParams, transmitted_irradiance};
use crate::transport::{Sampler, World};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

fn diffuse(albedo: f32) -> Material {
    let bsdf = Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::splat(albedo)) });
    Material { name: "diffuse".into(), bsdf, opacity: None }
}

fn two_sided(albedo: f32) -> Material {
    let bsdf = TwoSided::new(diffuse(albedo).bsdf, diffuse(albedo).bsdf).unwrap();
    Material { name: "two-sided".into(), bsdf: Bsdf::TwoSided(bsdf), opacity: None }
}

fn sky(radiance: f32) -> Emitter {
    Emitter::Constant { radiance: Rgb::splat(radiance) }
}

fn scene(geometry: Geometry, material: Material, emitters: Vec<Emitter>) -> Scene {
    Scene { geometry: geometry.into(), materials: vec![material], emitters, ..Default::default() }
}

fn params(texel: f32, spp: u32) -> LightMapParams {
    LightMapParams { spp, atlas: AtlasParams { texel: Some(texel), ..Default::default() }, ..Default::default() }
}

fn bake(world: &World, params: &LightMapParams) -> LightMap {
    let plan = Plan::new(world, params, 1).unwrap();
    let run = |pass: &Pass| {
        let store = Memory::default();
        plan.run(pass, &store, None, &Silent, || Ok(())).unwrap();
        store
    };
    let first = plan.first_pass().map(|pass| plan.first(&pass, &run(&pass), &Silent).unwrap());
    let pass = plan.second_pass(first.as_ref());
    plan.map(&pass, &run(&pass), &Silent).unwrap()
}

/// What the map says at the surface below (or above) `p`.
fn map_at(world: &World, map: &LightMap, p: Vec3, d: Vec3, back: bool) -> f32 {
    let hit = world.closest(&Ray::new(p, d)).unwrap();
    map.lookup(hit.triangle, Vec2::new(hit.u, hit.v), back).x
}

/// The same by path tracing at the very point.
fn traced_at(world: &World, p: Vec3, d: Vec3, back: bool) -> f32 {
    let surface = world.intersect(&Ray::new(p, d)).unwrap();
    let n = 2048;
    (0..n)
        .map(|i| transmitted_irradiance(world, &surface, back, None, &PathParams::default(), &mut Sampler::new(9, i)).x)
        .sum::<f32>()
        / n as f32
}

#[test]
fn under_a_uniform_sky_a_convex_body_gets_pi_everywhere() {
    let mut g = Geometry::default();
    // Fine enough that shading normals and facets agree about the horizon.
    testing::sphere(&mut g, Vec3::ZERO, 1.0, 32);
    testing::cuboid(&mut g, Vec3::new(40.0, 0.0, 0.0), Vec3::new(41.0, 1.0, 1.0));
    let world = World::new(scene(g, two_sided(0.5), vec![sky(1.0)]));
    let map = bake(&world, &params(0.1, 64));
    assert!(map.back.is_none(), "nobody sees the inside of closed bodies");
    let (mut mean, mut count) = (0.0, 0);
    for t in 0..world.scene.geometry.triangles.len() as u32 {
        for b in [Vec2::new(0.1, 0.1), Vec2::new(0.9, 0.05), Vec2::new(0.3, 0.4)] {
            let error = map.lookup(t, b, false).x / PI - 1.0;
            // 64 samples of one emitter and one cosine direction each: a standard deviation of some 1 %.
            assert!(error.abs() < 0.05, "triangle {t}: {error}");
            mean += error;
            count += 1;
        }
    }
    mean /= count as f32;
    assert!(mean.abs() < 1e-3, "{mean}");
}

#[test]
fn a_first_pass_finds_the_light_of_a_glowing_box_with_less_noise() {
    // A closed box that sends out a radiance of 1 and scatters half of what comes in: E = π (1 + 1/2 + 1/4 + ...).
    let mut g = Geometry::default();
    testing::cuboid(&mut g, Vec3::ONE, Vec3::NEG_ONE);
    g.objects[0].emitter = Some(0);
    let emitter = Emitter::Area { object: 0, radiance: Texture::Constant(Rgb::ONE) };
    let sensor = Some(Camera::look_at(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0, [4, 4]));
    let world = World::new(Scene { sensor, ..scene(g, diffuse(0.5), vec![emitter]) });
    let errors = |first_spp: u32| {
        let map = bake(&world, &LightMapParams { first_spp, ..params(0.25, 16) });
        let places = (0..12).flat_map(|t| [Vec2::splat(0.3), Vec2::new(0.7, 0.2), Vec2::new(0.1, 0.8)].map(|b| (t, b)));
        let errors: Vec<f32> = places.map(|(t, b)| map.lookup(t, b, false).x / (2.0 * PI) - 1.0).collect();
        let n = errors.len() as f32;
        (errors.iter().sum::<f32>() / n, errors.iter().map(|e| e * e).sum::<f32>() / n)
    };
    let ((full_mean, full), (mean, square)) = (errors(0), errors(8));
    assert!(square < 0.5 * full, "{square} against {full} with full paths");
    for (mean, square) in [(full_mean, full), (mean, square)] {
        assert!(mean.abs() < 4.0 * (square / 36.0).sqrt(), "mean {mean}, root mean square {}", square.sqrt());
    }
}

/// Irradiance at `p` with normal `n` from a Lambertian polygon of unit radiance (Lambert 1760); no horizon clipping.
fn lambert(p: Vec3, n: Vec3, polygon: &[Vec3]) -> f32 {
    let v: Vec<Vec3> = polygon.iter().map(|q| (*q - p).normalize()).collect();
    let edges = (0..v.len()).map(|i| {
        let (a, b) = (v[i], v[(i + 1) % v.len()]);
        a.angle_between(b) * n.dot(a.cross(b).normalize())
    });
    (0.5 * edges.sum::<f32>()).abs()
}

#[test]
fn texels_under_a_rectangle_light_hold_its_form_factor() {
    let mut g = Geometry::default();
    testing::quad(&mut g, Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    let corner = Vec3::new(-0.3, 0.8, -0.2);
    testing::quad(&mut g, corner, Vec3::X * 0.5, Vec3::Z * 0.7);
    g.objects[1].emitter = Some(0);
    let light = Emitter::Area { object: 1, radiance: Texture::Constant(Rgb::splat(3.0)) };
    let world = World::new(scene(g, diffuse(0.0), vec![light]));
    let map = bake(&world, &params(0.1, 256));
    let polygon = [corner, corner + Vec3::X * 0.5, corner + Vec3::new(0.5, 0.0, 0.7), corner + Vec3::Z * 0.7];
    let (mut mean, mut worst, mut count) = (0.0, 0f32, 0);
    for i in 0..20 {
        for j in 0..20 {
            let p = Vec3::new(-0.95 + 0.1 * i as f32, 0.0, -0.95 + 0.1 * j as f32);
            let exact = 3.0 * lambert(p, Vec3::Y, &polygon);
            let error = map_at(&world, &map, p + Vec3::Y * 0.1, Vec3::NEG_Y, false) / exact - 1.0;
            mean += error;
            worst = worst.max(error.abs());
            count += 1;
        }
    }
    mean /= count as f32;
    // The mean over a texel is not the value at its centre: curvature of E adds some 0.1 %.
    assert!(mean.abs() < 3e-3, "mean relative error {mean}");
    assert!(worst < 0.03, "worst relative error {worst}");
}

#[test]
fn texels_take_the_samples_that_their_error_asks_for() {
    // A wide lamp that stands on the floor's border: much noise before it, little in the distance.
    let mut g = Geometry::default();
    testing::quad(&mut g, Vec3::ZERO, Vec3::Z * 2.0, Vec3::X * 2.0);
    testing::quad(&mut g, Vec3::new(-0.01, 0.02, 0.0), Vec3::Y, Vec3::Z * 2.0);
    g.objects[1].emitter = Some(0);
    let light = Emitter::Area { object: 1, radiance: Texture::Constant(Rgb::splat(3.0)) };
    let world = World::new(scene(g, diffuse(0.0), vec![light]));
    let bake = |error: Option<f32>, spp| {
        let params = LightMapParams { error, ..params(0.1, spp) };
        let (plan, store) = (Plan::new(&world, &params, 1).unwrap(), Memory::default());
        let pass = plan.second_pass(None);
        plan.run(&pass, &store, None, &Silent, || Ok(())).unwrap();
        (plan.map(&pass, &store, &Silent).unwrap(), plan.assemble(&pass, &store, &Silent).unwrap().samples)
    };
    let (reference, _) = bake(None, 8192);
    // Root mean square, over texels, of what is off beside what is allowed.
    let off = |map: &LightMap| {
        let at = |i: usize| Vec3::new(0.05 + 0.1 * (i % 20) as f32, 0.1, 0.05 + 0.1 * (i / 20) as f32);
        let both = (0..400).map(|i| [map, &reference].map(|map| map_at(&world, map, at(i), Vec3::NEG_Y, false)));
        (both.map(|[x, r]| ((x - r) / (r + DIM)).powi(2)).sum::<f32>() / 400.0).sqrt()
    };
    let (map, coarse) = bake(Some(0.04), 4096);
    assert!(off(&map) < 0.04, "{}", off(&map));
    let (map, fine) = bake(Some(0.02), 4096);
    assert!(off(&map) < 0.02, "{}", off(&map));
    assert!(
        (3.0..4.05).contains(&(fine / coarse)),
        "{coarse} and {fine} samples: an error of a half asks for four times as many"
    );
    let (_, few) = bake(Some(0.02), 32);
    assert!((16.0..=32.0).contains(&few), "{few} samples of at most 32");
}

/// A floor of one chart with a black box on it, whose sides cross texels at 0.3 of their width.
fn box_on_floor(bottom: f32) -> World {
    let mut g = Geometry::default();
    testing::quad(&mut g, Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    testing::cuboid(&mut g, Vec3::new(-0.37, bottom, -0.37), Vec3::new(0.43, 3.0, 0.43));
    World::new(scene(g, diffuse(0.0), vec![sky(1.0)]))
}

#[test]
fn no_darkness_leaks_from_under_a_box() {
    // Sunk into the floor, flush with it, and just above.
    for bottom in [-0.05, 0.0, 0.002] {
        let world = box_on_floor(bottom);
        let map = bake(&world, &params(0.1, 1024));
        for i in 0..6 {
            let z = -0.2 + 0.08 * i as f32;
            for x in [-0.375, -0.39, 0.435, 0.45] {
                let p = Vec3::new(x, 0.02, z);
                let (found, exact) = (map_at(&world, &map, p, Vec3::NEG_Y, false), traced_at(&world, p, Vec3::NEG_Y, false));
                // E is some π/2 here and grows away from the box by half that a texel: interpolation blurs up, leaks pull down.
                assert!((0.97..1.12).contains(&(found / exact)), "bottom {bottom}, {p}: {found}, expected {exact}");
            }
        }
    }
}

#[test]
fn without_the_visibility_tests_the_box_would_leak() {
    // What the plain mean over the texel that the box's side crosses would be: 0.3 of it is lit.
    let world = box_on_floor(-0.05);
    let surface = |x: f32| world.intersect(&Ray::new(Vec3::new(x, 0.02, 0.1), Vec3::NEG_Y)).unwrap();
    let light = |s: &Surface| {
        (0..256)
            .map(|i| transmitted_irradiance(&world, s, false, None, &PathParams::default(), &mut Sampler::new(3, i)).x)
            .sum::<f32>()
            / 256.0
    };
    let plain = (0..10).map(|i| light(&surface(0.405 + 0.01 * i as f32))).sum::<f32>() / 10.0;
    let map = bake(&world, &params(0.1, 256));
    assert!(map_at(&world, &map, Vec3::new(0.45, 0.02, 0.1), Vec3::NEG_Y, false) > 1.2 * plain);
}

/// A lit room of single sheets whose floor goes on beyond the wall at x = 1.03; `outside` is the light there.
fn room_with_a_floor_that_goes_on(outside: Option<f32>) -> World {
    let mut g = Geometry::default();
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    testing::quad(&mut g, Vec3::new(-1.0, 0.0, -1.0), z * 2.0, x * 4.0);
    testing::quad(&mut g, Vec3::new(1.03, 0.0, -1.0), z * 2.0, y * 2.0);
    testing::quad(&mut g, Vec3::new(-1.0, 0.0, -1.0), y * 2.0, z * 2.0);
    testing::quad(&mut g, Vec3::new(-1.0, 0.0, -1.0), x * 4.0, y * 2.0);
    testing::quad(&mut g, Vec3::new(-1.0, 0.0, 1.0), y * 2.0, x * 4.0);
    testing::quad(&mut g, Vec3::new(-1.0, 2.0, -1.0), x * 2.03, z * 2.0);
    let mut emitters = vec![];
    let mut lamp = |g: &mut Geometry, x0: f32, radiance: f32, height: f32| {
        testing::quad(g, Vec3::new(x0, height, -0.3), x * 0.6, z * 0.6);
        let object = g.objects.len() as u32 - 1;
        g.objects[object as usize].emitter = Some(emitters.len() as u32);
        emitters.push(Emitter::Area { object, radiance: Texture::Constant(Rgb::splat(radiance)) });
    };
    lamp(&mut g, -0.3, 5.0, 1.9);
    match outside {
        Some(radiance) => lamp(&mut g, 1.7, radiance, 1.0),
        // Dark: shut off from the lamp's light by the wall and a lid.
        None => testing::quad(&mut g, Vec3::new(1.03, 2.0, -1.0), x * 2.0, z * 2.0),
    }
    let sensor = Some(Camera::look_at(Vec3::new(-0.8, 1.0, 0.0), x, y, 1.0, [4, 4]));
    World::new(Scene { sensor, ..scene(g, two_sided(0.2), emitters) })
}

#[test]
fn neither_a_dark_void_nor_a_bright_yard_leaks_under_a_wall() {
    for outside in [None, Some(100.0)] {
        let world = room_with_a_floor_that_goes_on(outside);
        // Texel borders lie at multiples of 0.1: the texel of the wall is lit for three tenths.
        let map = bake(&world, &params(0.1, 256));
        let (mut found, mut exact) = (0.0, 0.0);
        for i in 0..10 {
            let p = Vec3::new(1.005, 0.1, -0.9 + 0.2 * i as f32);
            let here = (map_at(&world, &map, p, Vec3::NEG_Y, false), traced_at(&world, p, Vec3::NEG_Y, false));
            // Most emitter samples go to the brighter lamp in the yard, so a single texel is noisy.
            assert!((here.0 / here.1 - 1.0).abs() < 0.25, "outside {outside:?}, {p}: {}, expected {}", here.0, here.1);
            (found, exact) = (found + here.0, exact + here.1);
        }
        assert!((found / exact - 1.0).abs() < 0.06, "outside {outside:?}: {found}, expected {exact}");
    }
}

#[test]
fn both_sides_of_a_sheet_keep_their_own_light() {
    let mut g = Geometry::default();
    testing::quad(&mut g, Vec3::ZERO, Vec3::Z, Vec3::X);
    let sun = |y: f32, irradiance: f32| Emitter::Directional { direction: Vec3::Y * y, irradiance: Rgb::splat(irradiance) };
    let world = World::new(scene(g.clone(), two_sided(0.5), vec![sun(-1.0, 2.0), sun(1.0, 0.5)]));
    let map = bake(&world, &params(0.2, 16));
    assert!((map_at(&world, &map, Vec3::new(0.3, 1.0, 0.6), Vec3::NEG_Y, false) - 2.0).abs() < 1e-3);
    assert!((map_at(&world, &map, Vec3::new(0.3, -1.0, 0.6), Vec3::Y, true) - 0.5).abs() < 1e-3);
    // Without light behind, or with a one-sided material, there is no back at all.
    assert!(bake(&World::new(scene(g.clone(), two_sided(0.5), vec![sun(-1.0, 2.0)])), &params(0.2, 16)).back.is_none());
    assert!(bake(&World::new(scene(g, diffuse(0.5), vec![sun(1.0, 2.0)])), &params(0.2, 16)).back.is_none());
}

#[test]
fn mirrors_get_no_texels() {
    let mut g = Geometry::default();
    testing::quad(&mut g, Vec3::ZERO, Vec3::Z, Vec3::X);
    let (eta, k) = (Rgb::ZERO, Rgb::ONE);
    let bsdf = Bsdf::Conductor(Conductor { eta, k, specular_reflectance: Texture::Constant(Rgb::ONE) });
    let mirror = Material { name: "mirror".into(), bsdf, opacity: None };
    let world = World::new(scene(g, mirror, vec![sky(1.0)]));
    let plan = Plan::new(&world, &params(0.1, 4), 0).unwrap();
    assert!(plan.is_empty());
    assert_eq!(bake(&world, &params(0.1, 4)).lookup(0, Vec2::ZERO, false), Rgb::ZERO);
}

#[test]
fn a_scene_without_surfaces_or_light_gives_an_empty_or_black_map() {
    let empty = World::new(scene(Geometry::default(), diffuse(0.5), vec![]));
    assert_eq!(bake(&empty, &params(0.1, 4)).lookup(0, Vec2::ZERO, false), Rgb::ZERO);
    let mut g = Geometry::default();
    testing::quad(&mut g, Vec3::ZERO, Vec3::Z, Vec3::X);
    // A zero-area object beside it.
    testing::quad(&mut g, Vec3::ONE, Vec3::ZERO, Vec3::ZERO);
    let dark = World::new(scene(g, diffuse(0.5), vec![]));
    assert_eq!(bake(&dark, &params(0.1, 4)).lookup(0, Vec2::splat(0.3), false), Rgb::ZERO);
    assert!(Plan::new(&dark, &params(0.1, 0), 0).is_err());
}

#[test]
fn shards_and_threads_and_taking_up_a_killed_bake_change_no_bit() {
    let world = box_on_floor(0.0);
    for (spp, error, denoise) in [(2, None, None), (2, None, Some(DenoiseParams::default())), (64, Some(0.05), None)] {
        let params = LightMapParams { error, denoise, ..params(0.02, spp) };
        let plan = Plan::new(&world, &params, 7).unwrap();
        assert!(plan.blocks() >= 3, "{} blocks", plan.blocks());
        let assemble = |plan: &Plan, store: &Memory| plan.assemble(&plan.second_pass(None), store, &Silent);
        let whole = Memory::default();
        plan.run(&plan.second_pass(None), &whole, None, &Silent, || Ok(())).unwrap();
        let expected = assemble(&plan, &whole).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let parts = Memory::default();
        pool.install(|| {
            let plan = Plan::new(&world, &params, 7).unwrap();
            assert!(assemble(&plan, &parts).is_err(), "blocks are missing");
            let run = |shard: Option<&str>| {
                let shard = shard.map(|s| s.parse().unwrap());
                plan.run(&plan.second_pass(None), &parts, shard, &Silent, || Ok(())).unwrap()
            };
            let (half, rest) = (plan.blocks() as usize / 2, plan.blocks().div_ceil(2) as usize);
            assert_eq!(run(Some("1/2")), Done { made: half, kept: 0, missing: rest });
            assert_eq!(run(None), Done { made: rest, kept: half, missing: 0 }, "finished blocks are kept");
            assert_eq!(assemble(&plan, &parts).unwrap(), expected);
        });
        assert!(parts.get(0, 1).is_none());
        let other = Plan::new(&world, &params, 8).unwrap();
        let store = Memory::default();
        other.run(&other.second_pass(None), &store, None, &Silent, || Ok(())).unwrap();
        assert_ne!(assemble(&other, &store).unwrap(), expected, "the seed counts");
    }
}

#[test]
fn the_denoiser_lowers_the_error_of_a_bake_and_keeps_its_mean() {
    // As many paths and more in the mean: error against a bake of 256 paths, over points of the floor beside a box and of the box.
    let world = box_on_floor(0.0);
    let of = |spp, denoise| bake(&world, &LightMapParams { denoise, ..params(0.02, spp) });
    let reference = of(256, None);
    let errors = |map: &LightMap| {
        let count = world.scene.geometry.triangles.len() as u32;
        let places = (0..count).flat_map(|t| (0..400).map(move |i| (t, Sampler::new(t, i).next_2d())));
        let (mut square, mut sum, mut all) = (0.0, 0.0, 0.0);
        for (t, u) in places {
            let at = if u.x + u.y > 1.0 { Vec2::ONE - u } else { u };
            let r = reference.lookup(t, at, false).x;
            let d = map.lookup(t, at, false).x - r;
            (square, sum, all) = (square + d * d, sum + d, all + r);
        }
        (square, sum / all)
    };
    let (noisy, clean) = (errors(&of(4, None)), errors(&of(4, Some(DenoiseParams::default()))));
    assert!(clean.0 < 0.25 * noisy.0, "{clean:?} in place of {noisy:?}");
    assert!(clean.1.abs() < 0.01, "{clean:?}");
    assert!(Plan::new(&world, &LightMapParams { denoise: Some(DenoiseParams::default()), ..params(0.1, 1) }, 0).is_err());
}
