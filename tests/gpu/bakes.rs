//! Baked probes and light maps: the same paths as on the CPU.

use crate::{Device, room};
use glam::Vec3;
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::gpu::{GpuScene, Paths};
use reprobe::lightmap::parts::Memory;
use reprobe::lightmap::{AtlasParams, LightMap, LightMapParams as LightParams, Plan};
use reprobe::method::glossy_probes::bake::{Bake, ProbeBakeParams as BakeParams, bake_glossy, probe_geometry};
use reprobe::probe::parameter_map::ParameterMap;
use reprobe::transport::World;
use reprobe::transport::follow::Follow;
use reprobe::transport::path::PathParams;
use std::sync::Arc;

/// Share of the values that differ by more than a half float's rounding.
fn apart(a: &[Rgb], b: &[Rgb]) -> f32 {
    assert_eq!(a.len(), b.len());
    assert!(b.iter().filter(|c| **c != Rgb::ZERO).count() * 12 > b.len(), "next to nothing is lit");
    let differ = |(a, b): &(&Rgb, &Rgb)| (**a - **b).abs().max_element() > 2e-3 * (0.01 + b.max_element());
    a.iter().zip(b).filter(differ).count() as f32 / a.len() as f32
}

pub fn lightmap(world: &World, params: &LightParams, gpu: Option<(&GpuScene, &Paths)>) -> LightMap {
    let plan = Plan::new(world, params, 7).unwrap();
    let run = |pass: &reprobe::lightmap::bake::Pass| {
        let store = Memory::default();
        plan.run(pass, &store, None, &Silent, || Ok(())).unwrap();
        store
    };
    let first = plan.first_pass().map(|pass| {
        let pass = pass.on(gpu.map(|(_, paths)| paths as &dyn Follow));
        plan.first(&pass, &run(&pass), &Silent).unwrap()
    });
    let second = gpu
        .zip(first.as_ref())
        .map(|((scene, _), first)| Paths::irradiance(Arc::new(scene.with_lightmap(&first.map).unwrap()), &params.path).unwrap());
    let gpu = second.as_ref().or(gpu.map(|(_, paths)| paths));
    let pass = plan.second_pass(first.as_ref()).on(gpu.map(|paths| paths as &dyn Follow));
    plan.map(&pass, &run(&pass), &Silent).unwrap()
}

pub fn light_maps_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let scene = GpuScene::new(gpu, &world).unwrap();
    let atlas = AtlasParams { texel: Some(0.4), ..AtlasParams::default() };
    let params = LightParams { spp: 8, first_spp: 4, atlas, ..LightParams::default() };
    let paths = Paths::irradiance(Arc::new(scene.clone()), &params.path).unwrap();
    let (a, b) = (lightmap(&world, &params, Some((&scene, &paths))), lightmap(&world, &params, None));
    let share = apart(&a.front, &b.front);
    assert!(share < 0.02, "{share} of the texels differ");
    assert_eq!(a.back.is_some(), b.back.is_some());
}

pub fn probes_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let params =
        LightParams { spp: 4, atlas: AtlasParams { texel: Some(0.3), ..AtlasParams::default() }, ..LightParams::default() };
    let map = lightmap(&world, &params, None);
    let scene = GpuScene::new(gpu, &world).unwrap();
    let (plain, lit) = (Arc::new(scene.clone()), Arc::new(scene.with_lightmap(&map).unwrap()));
    for (scene, lightmap) in [(plain, None), (lit, Some(&map))] {
        let paths = Paths::scattering(scene, BakeParams::default().query(), &PathParams::default()).unwrap();
        for error in [None, Some(0.2)] {
            let params = BakeParams { spp: 24, error, ..BakeParams::default() };
            let bake = |device| {
                let mut probe = probe_geometry(&world, Vec3::new(0.3, 1.4, 0.2), ParameterMap::identity([48, 24]));
                let bake = Bake { world: &world, params: &params, seed: 2, lightmap, device };
                let traced = bake_glossy(&bake, &mut probe, 1, &|i| i % 7 != 0, &Silent).unwrap();
                let glossy: Vec<Rgb> = probe.texels.iter().map(|t| t.glossy()).collect();
                (traced, glossy)
            };
            let ((gpu, a), (cpu, b)) = (bake(Some(&paths)), bake(None));
            assert_eq!(gpu.texels, cpu.texels);
            assert!(gpu.paths.abs_diff(cpu.paths) * 50 < cpu.paths, "{gpu:?}, on the CPU {cpu:?}");
            let share = apart(&a, &b);
            assert!(share < 0.02, "light map {}, error {error:?}: {share} of the texels differ", lightmap.is_some());
        }
    }
}
