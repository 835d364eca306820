//! Seconds that a probe's resolution map and parameterisation take on one core: `cargo bench --bench maps`.
//! The aim: 252 probes in 30 s on 2 cores, i.e. 0.24 s of one core a probe, files included.

mod timing;

use glam::Vec3;
use reprobe::method::glossy_probes::qhmap::QhmapParams;
use reprobe::method::glossy_probes::quasi_harmonic::Solver;
use reprobe::method::glossy_probes::resmap::{ResmapParams, resolution_map};
use reprobe::method::glossy_probes::seen::{Seen, SeenBuffers};
use reprobe::probe::parameter_map::ParameterMap;
use timing::time;

/// A bumpy ball of glossy stuff below, diffuse stuff above.
fn see(d: Vec3) -> Option<Seen> {
    let normal = (-d + 0.3 * Vec3::new((40.0 * d.x).sin(), (30.0 * d.y).sin(), (50.0 * d.z).sin())).normalize();
    Some(Seen { alpha: (d.y < 0.0).then_some(0.1), depth: 2.0 + d.x, normal, facing: -normal.dot(d) })
}

fn main() {
    let (resmap, qhmap) = (ResmapParams::default(), QhmapParams::default());
    let seen = SeenBuffers::from_fn(resmap.size, see);
    let map = time("resolution map, 256x128", 5, || resolution_map(&resmap, &seen));
    let mut solver = time("analysis (once a thread)", 3, || Solver::new(resmap.size).unwrap());
    let forward = time("quasi-harmonic map, 257x129", 5, || solver.forward_map(&map.m, qhmap.epsilon).unwrap());
    let probe = time("inverse, 1024x512", 5, || ParameterMap::from_forward(resmap.size, forward.vertices.clone(), qhmap.size));
    let folder = tempfile::tempdir().unwrap();
    let provenance = reprobe::io::Provenance::new("qhmap", "", 0, &qhmap);
    time("files of the parameterisation", 3, || probe.save(folder.path(), 0, &provenance).unwrap());
    time("reading them", 3, || ParameterMap::load(folder.path(), 0).unwrap());
}
