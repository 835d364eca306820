//! Light by way of probes against what is known of it, and against path tracing.

use super::bake::Bake;
use super::interpolate::Interpolation;
use super::light::{Lighting, direct};
use super::operator::Transport;
use super::params::{RadianceProbeParams, TransportParams};
use super::round_trip::norms;
use super::transport::sample;
use super::volume::irradiance;
use crate::base::clock::Clock;
use crate::base::math::{Rgb, hash_words};
use crate::base::progress::Silent;
use crate::base::ray::Ray;
use crate::exchange::{LoadOptions, load};
use crate::lightmap::AtlasParams;
use crate::transport::path::{PathParams, transmitted_irradiance};
use crate::transport::{Sampler, World};
use glam::Vec3;
use std::f32::consts::PI;

fn world(body: &str) -> World {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.xml");
    std::fs::write(&path, format!("<scene version='3.0.0'>{body}</scene>")).unwrap();
    World::new(load(&path, &LoadOptions::default()).unwrap())
}

/// A room of 4 x 4 x 4 m whose walls differ, with a box in it and a lamp under the ceiling.
const ROOM: &str = "<shape type='cube'><transform name='to_world'><scale value='2'/></transform>
    <bsdf type='twosided'><bsdf type='diffuse'><rgb name='reflectance' value='0.6, 0.5, 0.4'/></bsdf></bsdf></shape>
    <shape type='rectangle'><transform name='to_world'><rotate y='1' angle='90'/><scale value='1.9'/><translate x='-1.95'/></transform>
    <bsdf type='diffuse'><rgb name='reflectance' value='0.8, 0.1, 0.1'/></bsdf></shape>
    <shape type='cube'><transform name='to_world'><scale x='0.5' y='0.9' z='0.5'/><rotate y='1' angle='25'/>
    <translate x='-0.6' y='-1.1' z='-0.5'/></transform><bsdf type='diffuse'><rgb name='reflectance' value='0.5'/></bsdf></shape>
    <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/><scale value='0.5'/><translate y='1.9'/></transform>
    <bsdf type='diffuse'><rgb name='reflectance' value='0'/></bsdf>
    <emitter type='area'><rgb name='radiance' value='10'/></emitter></shape>";

/// Probes on a grid of n x n x n in the room.
fn grid(n: u32) -> Vec<Vec3> {
    let at = |i: u32| (i as f32 + 0.5) / n as f32 * 3.6 - 1.8;
    let all = (0..n * n * n).map(|i| Vec3::new(at(i % n), at(i / n % n), at(i / n / n)));
    // The box stands there.
    all.filter(|p| !(p.y < -0.1 && (p.x + 0.6).abs() < 0.8 && (p.z + 0.5).abs() < 0.8)).collect()
}

fn params(order: u32, interpolation: Interpolation) -> TransportParams {
    let atlas = AtlasParams { texel: Some(0.25), budget: 1 };
    TransportParams { sh_order: order, interpolation, atlas, rays: 128, relight_rays: 1000, ..TransportParams::default() }
}

fn bake(world: &World, probes: Vec<Vec3>, params: &TransportParams) -> Transport {
    Bake::new(world, probes, params, &Silent).unwrap().all()
}

#[test]
fn surfaces_that_all_send_out_the_same_light_give_pi_times_that() {
    let world = world(ROOM);
    for interpolation in [Interpolation::Visible, Interpolation::Spatial, Interpolation::Decomposed] {
        let transport = bake(&world, grid(2), &params(3, interpolation));
        let light = transport
            .receive(&transport.probe_radiance(&transport.hits, &vec![Rgb::new(1.0, 2.0, 0.5); transport.receivers.len()]));
        let mean: Rgb = light.iter().sum::<Rgb>() / light.len() as f32;
        assert!((mean.y - 2.0 * mean.x).abs() < 1e-3 && (mean.z - 0.5 * mean.x).abs() < 1e-3, "{mean}");
        let mut sorted: Vec<f32> = light.iter().map(|l| l.x).collect();
        sorted.sort_by(f32::total_cmp);
        let median = sorted[sorted.len() / 2];
        assert!((median - PI).abs() < 0.02 * PI, "{interpolation}: {median}");
        // What no probe sees, beside the lamp and behind the box, sends none: some light is lost, and none is made.
        let lost = 1.0 - mean.x / PI;
        let most = if interpolation == Interpolation::Spatial { 0.005 } else { 0.06 };
        assert!((-0.005..most).contains(&lost), "{interpolation}: {lost}");
    }
}

#[test]
fn free_space_receives_what_all_surfaces_send_whichever_way_a_surface_faces() {
    let world = world(ROOM);
    let transport = bake(&world, grid(2), &TransportParams { volume: Some(0.7), ..params(3, Interpolation::Visible) });
    let volume = transport.volume.as_ref().unwrap();
    assert!(volume.cells.len() > 100 && volume.cells.len() < volume.grid.count(), "{}", volume.cells.len());
    let lambda = transport.probe_radiance(&transport.hits, &vec![Rgb::new(1.0, 2.0, 0.5); transport.receivers.len()]);
    let light = volume.receive(&lambda, transport.params.terms());
    // Floor, ceiling and walls, and the block's faces.
    for d in [Vec3::NEG_Y, Vec3::X, Vec3::Z, Vec3::NEG_Z, Vec3::new(-0.6, -0.64, -0.48)] {
        let surface = world.intersect(&Ray::new(Vec3::new(0.4, 0.1, 0.3), d)).unwrap();
        let e = irradiance(&volume.taps(&world, &surface, -d), &light);
        assert!((e.x - PI).abs() < 0.06 * PI && (e.y / e.x - 2.0).abs() < 0.01, "{d}: {e}");
    }
}

/// Indirect E_T by path tracing at some receivers, and its standard error.
fn traced(world: &World, transport: &Transport, receivers: &[u32], samples: u32) -> (Vec<Rgb>, f32) {
    let mut noise = 0.0;
    let direct = direct(world, &transport.receivers, 256, 9);
    let of = |&r: &u32| {
        let receiver = &transport.receivers[r as usize];
        let (mut sum, mut squares) = (Rgb::ZERO, 0.0);
        for i in 0..samples {
            let mut sampler = Sampler::new(hash_words(&[r, 5]), i);
            let at = receiver.surface(world, i as usize);
            let light = transmitted_irradiance(world, &at, receiver.back, None, &PathParams::default(), &mut sampler);
            sum += light;
            squares += light.y * light.y;
        }
        let (n, mean) = (samples as f32, sum / samples as f32);
        noise += (squares / n - mean.y * mean.y).max(0.0) / n;
        mean - direct[r as usize]
    };
    let light = receivers.iter().map(of).collect();
    (light, (noise / receivers.len() as f32).sqrt())
}

/// RMS difference in green of what probes say of some receivers, relative to the RMS of the light itself.
fn error(world: &World, transport: Transport, receivers: &[u32], expected: &[Rgb]) -> f32 {
    let params = RadianceProbeParams { bounces: 12, map_samples: 64, ..RadianceProbeParams::default() };
    let found = Lighting::new(world, transport, None).light(world, &params, (None, 1), &mut Clock::start()).indirect;
    let wrong: f32 = receivers.iter().zip(expected).map(|(&r, e)| (found[r as usize].y - e.y).powi(2)).sum();
    (wrong / expected.iter().map(|e| e.y * e.y).sum::<f32>()).sqrt()
}

/// The paper's argument (§3.3): as order and number of probes grow, the light tends to the path-traced one; and its own interpolation is nearer
/// than those that it is compared with (Fig. 8).
#[test]
fn light_tends_to_path_tracing_and_is_nearer_than_other_interpolations() {
    let world = world(ROOM);
    let first = bake(&world, grid(3), &params(7, Interpolation::Visible));
    let receivers = sample(first.receivers.len(), 200);
    let (expected, noise) = traced(&world, &first, &receivers, 512);
    let size = (expected.iter().map(|e| e.y * e.y).sum::<f32>() / expected.len() as f32).sqrt();
    assert!(noise < 0.04 * size, "the reference is too noisy to tell: {}", noise / size);
    let list = first.receivers.clone();
    let of = |n, order, interpolation| {
        let transport = bake(&world, grid(n), &params(order, interpolation));
        assert_eq!(transport.receivers, list);
        error(&world, transport, &receivers, &expected)
    };
    let fine = error(&world, first, &receivers, &expected);
    assert!(fine < 0.1, "{fine}");
    let orders = [0, 2, 7].map(|order| of(2, order, Interpolation::Visible));
    assert!(orders[0] > orders[1] && orders[1] > 2.0 * orders[2] && orders[2] > fine, "{orders:?} {fine}");
    let [spatial, decomposed] = [Interpolation::Spatial, Interpolation::Decomposed].map(|i| of(2, 7, i));
    assert!(orders[2] < decomposed && decomposed < spatial, "{} {decomposed} {spatial}", orders[2]);
}

#[test]
fn more_is_lost_on_the_way_to_few_probes_and_back() {
    let world = world(ROOM);
    let mean = |n, order| {
        let transport = bake(&world, grid(n), &params(order, Interpolation::Visible));
        let norms = norms(&world, &transport, &sample(transport.receivers.len(), 100));
        assert!(norms.iter().all(|n| (0.0..3.0).contains(n)), "{norms:?}");
        norms.iter().sum::<f32>() / norms.len() as f32
    };
    let [one, eight, many, blurred] = [mean(1, 7), mean(2, 7), mean(3, 7), mean(2, 1)];
    assert!(one > eight && eight > many && blurred > eight, "{one} {eight} {many} {blurred}");
    assert!(many < 0.5, "most of it comes back: {many}");
}

#[test]
fn a_scene_in_which_nothing_receives_light_is_said_to_be_one() {
    let world = world("<shape type='sphere'><bsdf type='conductor'/></shape>");
    let message =
        Bake::new(&world, vec![Vec3::splat(2.0)], &params(1, Interpolation::Visible), &Silent).err().unwrap().to_string();
    assert!(message.contains("diffuse"), "{message}");
}
