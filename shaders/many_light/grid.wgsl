// Grids of a view's pixels. Twin: src/method/many_light/adaptive.rs: grid.

// #include "many_light/lit_pixel.wgsl"
// #include "many_light/params.wgsl"
// #include "shared/surface.wgsl"
// #include "shared/view.wgsl"

// What passes over grids find.
struct Grids {
    // What light is multiplied with for it to count.
    exposure: f32,
    // Pixels to be lit, of each grid.
    counts: array<atomic<u32>, 5>,
}

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read_write> lit: array<LitPixel>;
@group(0) @binding(3) var<storage, read_write> grids: Grids;

// The grid's `k`th pixel.
fn grid_pixel(k: u32) -> vec2<u32> {
    let across = (params.camera.width + params.step - 1u) / params.step;
    return params.step * vec2(k % across, k / across);
}

fn index_of(at: vec2<u32>) -> u32 {
    return at.y * params.camera.width + at.x;
}

fn is_surface(i: u32) -> bool {
    return view[i].triangle != NO_TRIANGLE;
}

// How much light a pixel has.
fn weight_at(i: u32) -> f32 {
    return light_weight(lit[i].irradiance, lit[i].glossy);
}
