// Twin of src/method/lightmap_rt/mod.rs: lightmap_rt.
// Where the rays of follow.wgsl leave a view's pixels.

// #include "shared/pixel_run.wgsl"
// #include "shared/random.wgsl"
// #include "shared/camera_ray.wgsl"
// #include "shared/view.wgsl"
// #include "shared/start.wgsl"

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read_write> starts: array<PathStart>;

@compute @workgroup_size(64)
fn view_starts(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.pixels {
        return;
    }
    let pixel = params.first_pixel + id.x;
    let wo = towards_camera(params.camera, pixel);
    let triangle = select(view[pixel].triangle, NO_TRIANGLE, view[pixel].material == NOT_GLOSSY);
    let stream = hash3(params.seed, params.frame, pixel);
    starts[id.x] = PathStart(triangle, view[pixel].u, view[pixel].v, stream, wo, 0u, params.samples);
}

