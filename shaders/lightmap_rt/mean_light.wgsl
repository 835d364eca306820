// Twin of src/method/lightmap_rt/mod.rs: light_along.
// The mean of what the rays of follow.wgsl have found.

// #include "shared/pixel_run.wgsl"

@group(0) @binding(1) var<storage, read> sums: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> glossy: array<vec4<f32>>;

@compute @workgroup_size(64)
fn mean_light(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.pixels {
        glossy[params.first_pixel + id.x] = vec4(sums[id.x].rgb / f32(max(params.samples, 1u)), 0.0);
    }
}
