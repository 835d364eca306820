//! Milliseconds of each pass of a frame by glossy probes, on all cores: `cargo bench --bench passes -- SCENE PROBES CURVATURE.exr [WxH]`.
//!
//! The view is that of the scene's own sensor, with the probes around it: use a set that was baked for all views. The best of a few
//! runs of each. Without arguments it says so and ends.

mod timing;

use reprobe::method::glossy_probes::candidates::NearCandidates;
use reprobe::method::glossy_probes::filter::FilterParams;
use reprobe::method::glossy_probes::gather::{GatherParams, gather};
use reprobe::method::glossy_probes::whole::filter_pass;
use reprobe::probe::store::ProbeStore;
use reprobe::scene::Camera;
use reprobe::surface::curvature_file;
use reprobe::transport::World;
use reprobe::view::gbuffer::gbuffer;
use reprobe::view::mirror::mirror_pass;
use serde::de::IgnoredAny;
use std::path::Path;
use timing::time;

const RUNS: u32 = 3;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let [scene, probes, curvature, rest @ ..] = args.as_slice() else {
        println!("passes: SCENE, PROBES and CURVATURE.exr are not given, nothing measured");
        return;
    };
    let size =
        rest.first().and_then(|s| s.split_once('x')).map_or([1920, 1080], |(w, h)| [w, h].map(|n| n.parse().expect("WxH")));
    let scene = reprobe::exchange::load(Path::new(scene), &Default::default()).expect("a scene");
    let (world, _) = World::opaque(scene);
    let curvature = curvature_file::read(Path::new(curvature), world.scene.geometry.positions.len(), &world.scene.hash);
    let curvature = curvature.expect("curvatures of this scene");
    let camera = Camera { size, ..world.scene.sensor.clone().expect("a sensor") };
    let mut store = ProbeStore::<IgnoredAny>::open(Path::new(probes), &world.scene, usize::MAX).expect("probes of this scene");
    let near: Vec<_> = store
        .set
        .places
        .nearest(camera.position(), 8)
        .into_iter()
        .map(|(i, t)| (i, store.probe(i).expect("a probe"), GatherParams::default().probe_weight(t)))
        .collect();
    let near: Vec<_> = near.iter().map(|(i, probe, weight)| (*i, &**probe, *weight)).collect();
    let mut candidates = NearCandidates::default();
    let weighted = candidates.of(&world, &near, Some(store.set.roughness_scale), false);

    let view = time("G-buffer", RUNS, || gbuffer(&world, &curvature, &camera));
    let reflected = time("mirror", RUNS, || mirror_pass(&world, &view));
    let params = GatherParams::default();
    let gather_with = |params: &GatherParams| gather(&world, &view, &reflected, &weighted, store.set.roughness_scale, params);
    let gathered = time("gather", RUNS, || gather_with(&params));
    time("gather, every pixel in full", RUNS, || gather_with(&GatherParams { anchors: 1, ..params.clone() }));

    for sigma in [1.0, 4.0, 16.0] {
        let covariance = vec![[sigma * sigma, 0.0, sigma * sigma]; gathered.len()];
        let pass = || filter_pass(&view, &gathered, &covariance, &FilterParams::default());
        time(&format!("filter of {sigma} pixels"), RUNS, pass);
    }
}
