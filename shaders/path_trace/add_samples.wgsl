// Twin of src/method/path_trace/mod.rs: means.
// Adds a quantity's samples to the sums of a run of pixels, and clears them.

struct Params {
    // Quantities a pixel, and which one this is.
    quantities: u32,
    quantity: u32,
    first_pixel: u32,
    pixels: u32,
    samples: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> values: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> frame: array<vec4<f32>>;

@compute @workgroup_size(64)
fn add_samples(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.pixels {
        return;
    }
    var sum = vec4(0.0);
    for (var k = 0u; k < params.samples; k++) {
        sum += values[k * params.pixels + id.x];
        values[k * params.pixels + id.x] = vec4(0.0);
    }
    frame[(params.first_pixel + id.x) * params.quantities + params.quantity] += sum;
}
