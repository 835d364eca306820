// Twin of src/method/radiance_probes/shade.rs: of_added.
// What a run of pixels sends to the camera of light that came by way of the probes, where they show a shape that the frame adds.

// #include "radiance_probes/volume.wgsl"
// #include "radiance_probes/volume_light.wgsl"
// #include "shared/camera_ray.wgsl"
// #include "shared/pixel_run.wgsl"
// #include "shared/view.wgsl"

@group(0) @binding(3) var<storage, read> view: array<Pixel>;
@group(0) @binding(4) var<storage, read> volume_light: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> shading: array<Shading>;

@compute @workgroup_size(64)
fn added_light(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let pixel = params.first_pixel + id.x;
    if id.x >= params.pixels || view[pixel].triangle == NO_TRIANGLE || !is_added(view[pixel].triangle) {
        return;
    }
    let s = surface_at(hit_of(view[pixel].triangle, view[pixel].u, view[pixel].v));
    let wo = towards_camera(params.camera, pixel);
    var light = bsdf_diffuse_out(s, to_local(s.frame, wo));
    if any(light != vec3(0.0)) {
        light *= irradiance_of(taps_of(s, wo)) * FRAC_1_PI;
    }
    shading[pixel].diffuse = light;
}
