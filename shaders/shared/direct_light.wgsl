// Twin of src/view/direct.rs: direct.
// Adds what the diffuse lobe sends to the camera of light straight from emitters to a run of pixels.

// #include "shared/path.wgsl"
// #include "shared/camera_ray.wgsl"
// #include "shared/pixel_run.wgsl"
// #include "shared/view.wgsl"

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read_write> shading: array<Shading>;

@compute @workgroup_size(64)
fn direct_light(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let pixel = params.first_pixel + id.x;
    if id.x >= params.pixels || view[pixel].triangle == NO_TRIANGLE {
        return;
    }
    let hit = hit_of(view[pixel].triangle, view[pixel].u, view[pixel].v);
    if (material_u32(surface_at(hit).material, MATERIAL_LOBES) & DIFFUSE) == 0u {
        return;
    }
    let width = params.camera.width;
    let wo = -camera_ray(params.camera, vec2(f32(pixel % width), f32(pixel / width)) + 0.5, vec2(0.5)).direction;
    let stream = hash_end(hash_next(hash_next(hash_next(hash_start(), params.seed), params.frame), pixel));
    var sum = vec3(0.0);
    for (var k = 0u; k < params.samples; k++) {
        var s = sampler_new(stream, k);
        sum += integrate(Start(hit, wo, Query(DIFFUSE, 1.0), 0.0, true), PathParams(1u, NONE), &s);
    }
    shading[pixel].diffuse += sum / f32(params.samples);
}
