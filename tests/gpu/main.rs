//! Kernels against their CPU twins, on whatever adapter there is: a software one will do. Skipped, saying so, where there is none.

mod bakes;
mod baselines;
mod denoise;
mod filter;
mod frames;
mod paths;
mod rays;
mod ulr;

use reprobe::gpu::{Choice, Gpu, adapters};
use reprobe::transport::World;
use std::path::Path;
use std::sync::Arc;

/// The adapter's name, as `--device` takes it; a real GPU's before a software one's.
fn device() -> Option<String> {
    let list = adapters();
    if list.is_empty() {
        eprintln!("skipped: no adapter; on Debian, mesa-vulkan-drivers has a software one");
    }
    list.first().map(|a| format!("gpu:{}", a.name.to_lowercase()))
}

fn gpu() -> Option<Arc<Gpu>> {
    let choice: Choice = device()?.parse().unwrap();
    Some(Arc::new(Gpu::open(&choice).unwrap().unwrap()))
}

fn room() -> World {
    let scene = reprobe::exchange::load(Path::new("scenes/room/scene.xml"), &Default::default()).unwrap();
    World::opaque(scene).0
}

#[test]
fn a_name_that_no_adapter_has_is_an_error_that_lists_those_there_are() {
    let Err(error) = Gpu::open(&Choice::Named("no such thing".into())) else { panic!("found it") };
    let error = error.to_string();
    assert!(error.contains("no such GPU"), "{error}");
    for adapter in adapters() {
        assert!(error.contains(&adapter.name), "{error}");
    }
}
