// What comes before and after the rays of follow.wgsl: where they leave a view's pixels, and the mean of what they find. Twin:
// render::baseline::lightmap_rt. Follows camera_ray.wgsl, view.wgsl and start.wgsl.

// Struct: gpu::render::lightmap_rt::Params.
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

@group(0) @binding(0) var<storage, read> params: Params;

// What `view_starts` reads and writes.
@group(0) @binding(1) var<storage, read> view_hits: array<Hit>;
@group(0) @binding(2) var<storage, read> view_materials: array<u32>;
@group(0) @binding(3) var<storage, read_write> starts: array<PathStart>;

// What `mean_light` reads and writes.
@group(0) @binding(1) var<storage, read> sums: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> glossy: array<vec4<f32>>;

@compute @workgroup_size(64)
fn view_starts(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.pixels {
        return;
    }
    let pixel = params.first_pixel + id.x;
    let width = params.camera.width;
    let hit = view_hits[pixel];
    let ray = camera_ray(params.camera, vec2(f32(pixel % width), f32(pixel / width)) + 0.5, vec2(0.5));
    let triangle = select(hit.triangle, NO_TRIANGLE, view_materials[pixel] == NOT_GLOSSY);
    let stream = hash_end(hash_next(hash_next(hash_next(hash_start(), params.seed), params.frame), pixel));
    starts[id.x] = PathStart(triangle, hit.u, hit.v, stream, -ray.direction, 0u, params.samples);
}

@compute @workgroup_size(64)
fn mean_light(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.pixels {
        glossy[params.first_pixel + id.x] = vec4(sums[id.x].rgb / f32(max(params.samples, 1u)), 0.0);
    }
}
