// Twin of src/transport/path.rs: trace_layers.
// What the camera rays of a run of pixels meet: starts of paths, and the emission seen.

// #include "shared/path.wgsl"
// #include "shared/start.wgsl"
// #include "shared/camera_ray.wgsl"

struct Params {
    camera: Camera,
    seed: u32,
    frame: u32,
    first_pixel: u32,
    pixels: u32,
    first_sample: u32,
    samples: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// All pixels of the first sample, then of the next.
@group(0) @binding(1) var<storage, read_write> starts: array<PathStart>;
@group(0) @binding(2) var<storage, read_write> emission: array<vec4<f32>>;

@compute @workgroup_size(64)
fn camera_hits(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let i = id.x;
    if i >= params.pixels * params.samples {
        return;
    }
    let pixel = params.first_pixel + i % params.pixels;
    let index = params.first_sample + i / params.pixels;
    let width = params.camera.width;
    let stream = hash3(params.seed, params.frame, pixel);
    var s = sampler_new(stream, index);
    let p = next_4d(&s);
    let ray = camera_ray(params.camera, vec2(f32(pixel % width), f32(pixel / width)) + p.xy, p.zw);
    let hit = traverse(ray, false);
    var seen = vec3(0.0);
    if hit.triangle == NO_TRIANGLE {
        seen = environment(ray.direction);
    } else {
        let surface = surface_at(hit);
        if surface.emitter != NONE && dot(surface.frame.n, ray.direction) < 0.0 {
            seen = emitted(surface);
        }
    }
    starts[i] = PathStart(hit.triangle, hit.u, hit.v, stream, -ray.direction, index, index + 1u);
    emission[i] = vec4(keep_finite(seen), 0.0);
}
