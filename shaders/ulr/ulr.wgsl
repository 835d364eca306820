// What both kernels of unstructured lumigraph rendering (Buehler et al. 2001) share. Twin: src/method/ulr/mod.rs.
//
// ulr_look.wgsl asks one probe at every pixel and keeps the pixel's samples of least penalty, ulr_blend.wgsl weighs them.

// #include "shared/view.wgsl"

struct UlrParams {
    eye: vec3<f32>,
    width: u32,
    height: u32,
    // Samples that a pixel keeps, k.
    blend: u32,
    angle: f32,
    resolution: f32,
    hidden: f32,
    plane_tolerance: f32,
    padding0: u32,
    padding1: u32,
}

const MIN_PENALTY: f32 = 1e-3;

// Kernels begin with a copy: see scene.wgsl.
@group(0) @binding(0) var<uniform> ulr_params: UlrParams;
var<private> ulr: UlrParams;
