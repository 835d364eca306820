// A run of a view's pixels that a dispatch covers. Twin: src/gpu/view/pixel_run.rs.

// #include "shared/camera.wgsl"

struct Params {
    camera: Camera,
    seed: u32,
    frame: u32,
    // A run of the view's pixels.
    first_pixel: u32,
    pixels: u32,
    // Of each pixel.
    samples: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
