//! Renders the diffuse layer from a light map and by path tracing, side by side, to see and measure where they differ.
//! `cargo run --example lightmap_view SCENE lightmap.exr OUT.exr WIDTHxHEIGHT SPP`

use glam::Vec2;
use rayon::prelude::*;
use reprobe::base::math::{Rgb, hash_words};
use reprobe::exchange::LoadOptions;
use reprobe::io::ExrImage;
use reprobe::lightmap::LightMap;
use reprobe::material::bsdf::{Lobes, Query};
use reprobe::transport::path::{PathParams, scattered};
use reprobe::transport::{Sampler, World};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [scene, map, out, size, spp] = args.as_slice() else { return Err("SCENE MAP OUT WxH SPP".into()) };
    let (w, h) = size.split_once('x').ok_or("WxH")?;
    let size = [w.parse()?, h.parse()?];
    let spp: u32 = spp.parse()?;
    let began = std::time::Instant::now();
    let (world, _) = World::opaque(reprobe::exchange::load(Path::new(scene), &LoadOptions::default())?);
    eprintln!("scene {:.1} s", began.elapsed().as_secs_f32());
    let began = std::time::Instant::now();
    let map = LightMap::load(Path::new(map), &world.scene)?;
    eprintln!("map {:.1} s", began.elapsed().as_secs_f32());
    let mut camera = world.scene.sensor.clone().ok_or("the scene has no sensor")?;
    camera.size = size;
    let pixels: Vec<[Rgb; 3]> = (0..size[0] * size[1])
        .into_par_iter()
        .map(|i| {
            let mut sum = [Rgb::ZERO; 3];
            for s in 0..spp {
                let mut sampler = Sampler::new(hash_words(&[5, i]), s);
                let at = Vec2::new((i % size[0]) as f32, (i / size[0]) as f32) + sampler.next_2d();
                let ray = camera.ray(at, sampler.next_2d());
                let Some(surface) = world.intersect(&ray) else { continue };
                let bsdf = &world.scene.materials[surface.material as usize].bsdf;
                if !bsdf.lobes().contains(Lobes::DIFFUSE) {
                    continue;
                }
                let wo = surface.frame.to_local(-ray.d);
                let back = wo.z < 0.0;
                let e = map.lookup(surface.triangle, surface.barycentric, back);
                sum[0] += bsdf.diffuse_out(&surface, wo) * e / std::f32::consts::PI;
                let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
                sum[1] += scattered(&world, &surface, -ray.d, query, None, &PathParams::default(), &mut sampler);
                sum[2] += e / std::f32::consts::PI;
            }
            sum.map(|c| c / spp as f32)
        })
        .collect();
    let layer = |k: usize| pixels.iter().map(|p| p[k]).collect::<Vec<_>>();
    ExrImage::new(size[0] as usize, size[1] as usize)
        .with_rgb("map", &layer(0))
        .with_rgb("traced", &layer(1))
        .with_rgb("irradiance", &layer(2))
        .write(Path::new(out))?;
    Ok(())
}
