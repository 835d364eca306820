// Twin of src/view/direct.rs: direct.
// Adds what the diffuse lobe sends to the camera of light straight from emitters to a run of pixels.

// #include "shared/direct_at.wgsl"
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
    let wo = towards_camera(params.camera, pixel);
    let stream = hash3(params.seed, params.frame, pixel);
    shading[pixel].diffuse += direct_at(hit, wo, Query(DIFFUSE, 1.0), params.samples, stream);
}
