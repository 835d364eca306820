//! Kernels against their CPU twins, on whatever adapter there is: a software one will do. Skipped, saying so, where there is none.

mod bakes;
mod filter;
mod paths;
mod rays;

use reprobe::gpu::{Choice, Gpu, adapters};
use reprobe::transport::World;
use std::path::Path;
use std::sync::Arc;

/// A real GPU before a software adapter.
fn gpu() -> Option<Arc<Gpu>> {
    let list = adapters();
    let Some(first) = list.first() else {
        eprintln!("skipped: no adapter; on Debian, mesa-vulkan-drivers has a software one");
        return None;
    };
    let name = Choice::Named(first.name.to_lowercase());
    Some(Arc::new(Gpu::open(&name).unwrap().unwrap()))
}

fn room() -> World {
    let scene = reprobe::scene::load(Path::new("scenes/room/scene.xml"), &Default::default()).unwrap();
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
