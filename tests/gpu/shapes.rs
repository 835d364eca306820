//! Shapes that frames add to the scene's, and shapes of the scene that frames make emit.

use crate::Device;
use crate::paths::difference;
use crate::radiance_probes::{lighting, small};
use crate::rays::{check, rays, tracer};
use reprobe::base::clock::Clock;
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::gpu::GpuScene;
use reprobe::method::path_trace::gpu::PathTracer;
use reprobe::method::path_trace::{PathTraceParams, path_trace};
use reprobe::method::radiance_probes::gpu::RadianceProbesOnGpu;
use reprobe::method::radiance_probes::params::{RadianceProbeParams, TransportParams};
use reprobe::scene::{Animation, Camera};
use reprobe::transport::World;
use std::path::Path;
use std::sync::Arc;

/// A ball, a box that turns, a single triangle, a lamp beside that of the scene, and a block that glows.
pub const SHAPES: &str = r#"{"fps": 1, "emission": [{"shape": "short", "radiance": [2.0, 3.0, 5.0]}],
    "lights": [{"type": "area", "position": [0.6, 1.7, 0.2], "target": [0, 0.5, 0], "size": [0.3, 0.2], "radiance": [9, 8, 6]}],
    "objects": [
        {"type": "sphere", "radius": 0.22, "albedo": [0.7, 0.7, 0.7],
         "keyframes": [{"time": 0, "position": [-0.5, 1.5, 0.3]}, {"time": 1, "position": [0.4, 1.2, 0.3]}]},
        {"type": "box", "size": [0.3, 0.4, 0.2], "position": [0.1, 0.9, -0.4], "albedo": [0.2, 0.6, 0.3],
         "keyframes": [{"time": 0, "rotation": [0, 0, 0]}, {"time": 1, "rotation": [30, 60, 10]}]},
        {"type": "mesh", "filename": "one.obj", "position": [0, 0.02, 0]}]}"#;

pub fn cornell() -> World {
    let scene = reprobe::exchange::load(Path::new("scenes/cornell/scene.xml"), &Default::default()).unwrap();
    World::opaque(scene).0
}

/// What a text says of a world, and a triangle for meshes.
pub fn animation(world: &World, text: &str) -> Animation {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("one.obj"), "v -0.8 0 0.9\nv 0.9 0 0.8\nv -0.7 0 -0.2\nf 1 2 3\n").unwrap();
    std::fs::write(at("lights.json"), text).unwrap();
    Animation::load(&at("lights.json"), &world.scene).unwrap()
}

/// The world with a copy of its tall block in the very same place.
fn doubled(world: &World) -> World {
    let geometry = &world.scene.geometry;
    let tall = geometry.objects.iter().find(|o| o.name == "tall").unwrap();
    let corners = tall.triangles.clone().flat_map(|t| geometry.corners(t));
    let mut obj: String = corners.map(|p| format!("v {:?} {:?} {:?}\n", p.x, p.y, p.z)).collect();
    obj.extend((0..tall.triangles.len()).map(|t| format!("f {} {} {}\n", 3 * t + 1, 3 * t + 2, 3 * t + 3)));
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("tall.obj"), obj).unwrap();
    let text = r#"{"objects": [{"type": "mesh", "filename": "tall.obj", "position": [0, 0, 0]}]}"#;
    std::fs::write(at("lights.json"), text).unwrap();
    world.at(&Animation::load(&at("lights.json"), &world.scene).unwrap(), 0)
}

fn of_scenes(name: &str) -> String {
    std::fs::read_to_string(Path::new("scenes/cornell").join(name)).unwrap()
}

pub fn rays_meet_what_frames_add(device: &Device) {
    let gpu = device.gpu();
    let world = cornell();
    let own = world.scene.geometry.triangles.len() as u32;
    let animation = animation(&world, SHAPES);
    for frame in 0..2 {
        let world = world.at(&animation, frame);
        let rays = rays(&world, 40_000);
        let cpu: Vec<_> = rays.iter().map(|ray| world.closest(ray)).collect();
        let added = cpu.iter().flatten().filter(|hit| hit.triangle >= own).count();
        assert!(added > 1_000 && world.has_added(), "{added} rays meet what is added");
        check(&world.scene, &rays, &tracer(gpu.clone(), &world).closest(&rays).unwrap(), &cpu);
    }
}

pub fn of_two_hits_at_one_distance_the_scene_has_its_own(device: &Device) {
    let gpu = device.gpu();
    let world = cornell();
    let doubled = doubled(&world);
    let rays = rays(&world, 20_000);
    let plain = tracer(gpu.clone(), &world).closest(&rays).unwrap();
    let tall = world.scene.geometry.objects.iter().find(|o| o.name == "tall").unwrap().triangles.clone();
    let there = plain.iter().flatten().filter(|hit| tall.contains(&hit.triangle)).count();
    assert!(there > 1_000, "{there} rays meet the block");
    assert_eq!(tracer(gpu, &doubled).closest(&rays).unwrap(), plain);
    assert!(rays.iter().all(|ray| doubled.closest(ray) == world.closest(ray)));
}

/// One path tracer for all, so that each frame finds what the one before has left.
pub fn traced_frames_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = cornell();
    let camera = Camera { size: [40, 40], ..world.scene.sensor.clone().unwrap() };
    let params = PathTraceParams { spp: 8, ..PathTraceParams::default() };
    let scene = Arc::new(GpuScene::new(gpu, &world).unwrap());
    let mut tracer = PathTracer::new(scene, &params.path, true).unwrap();
    let mut before: Option<Vec<Rgb>> = None;
    for (name, text, frames) in [
        ("objects", of_scenes("objects.json"), 2),
        ("shapes", SHAPES.into(), 2),
        ("emission", of_scenes("emission.json"), 1),
        ("nothing", "{}".into(), 1),
    ] {
        let animation = animation(&world, &text);
        for frame in 0..frames {
            let world = world.at(&animation, frame);
            tracer.relight(&world).unwrap();
            let found = tracer.layers(&camera, params.spp, 3, frame, &Silent).unwrap();
            let cpu = path_trace(&world, &camera, &params, 3, frame, &Silent);
            for (layer, a, b) in [("emission", &found.emission, &cpu.emission), ("diffuse", &found.diffuse, &cpu.diffuse)] {
                let (apart, mean) = difference(a, b);
                eprintln!("{name}, frame {frame}, {layer}: {apart} of the pixels, means by {mean}");
                assert!(apart <= 0.01 && mean < 2e-3, "{name}, frame {frame}, {layer}: {apart} of the pixels, means by {mean}");
            }
            if let Some(before) = before.replace(cpu.diffuse.clone()) {
                assert!(difference(&before, &cpu.diffuse).0 > 0.05, "{name}, frame {frame}: is like the one before");
            }
        }
    }
}

/// Light by way of the probes: straight from lamps of a frame, past its shapes, and from them; on receivers, and in free space. The CPU goes on
/// from its own light, the GPU from its own.
pub fn probe_lit_frames_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = cornell();
    let animation = animation(&world, SHAPES);
    let camera = Camera { size: [16, 16], ..world.scene.sensor.clone().unwrap() };
    for volume in [None, Some(0.4)] {
        let lighting = lighting(&world, TransportParams { volume, ..small(4, 300) });
        let params = RadianceProbeParams { bounces: 2, map_samples: 3, feedback: true, ..RadianceProbeParams::default() };
        let mut on_gpu = RadianceProbesOnGpu::new(gpu.clone(), &world, &lighting, &params, u64::MAX).unwrap();
        let mut before = None;
        for frame in 0..3 {
            // Without anything added in the end: what was blocked is seen again.
            let of_frame = if frame < 2 { world.at(&animation, frame) } else { world.at(&none(&world), frame) };
            let blocked = lighting.transport.hits_in(&of_frame).1.len();
            assert_eq!(blocked > 100, frame < 2, "{blocked} relight rays are blocked");
            on_gpu.relight(&of_frame, &lighting).unwrap();
            on_gpu.frame(&camera, [3, frame], frame > 0).unwrap();
            let found = on_gpu.passes().unwrap();
            let cpu = lighting.light(&of_frame, &params, (before, 3), &mut Clock::start());
            for (what, a, b) in [
                ("direct", &found.direct, &cpu.direct),
                ("indirect", &found.indirect, &cpu.indirect),
                ("volume", &found.volume, &cpu.volume),
            ] {
                if what == "volume" && volume.is_none() {
                    assert!(a.is_empty() && b.is_empty());
                    continue;
                }
                let (apart, mean) = difference(a, b);
                eprintln!("volume {volume:?}, frame {frame}, {what}: {apart} apart, means by {mean}");
                assert!(apart < 0.02 && mean < 1e-3, "volume {volume:?}, frame {frame}, {what}: {apart} apart, means by {mean}");
            }
            before = Some(cpu);
        }
    }
}

fn none(world: &World) -> Animation {
    animation(world, "{}")
}
