// Light straight from emitters that a pixel's glossy lobes send to the camera. Twin: src/view/direct.rs.

// #include "shared/camera_ray.wgsl"
// #include "shared/direct_at.wgsl"
// #include "shared/pixel_run.wgsl"

// Of a pixel's random stream: that of the glossy layer.
const GLOSSY_BRANCH: u32 = 1u;

// The mean of the run's samples.
fn glossy_direct(hit: Hit, wo: vec3<f32>, pixel: u32) -> vec3<f32> {
    let stream = hash3(params.seed, params.frame, pixel);
    let branch = hash_end(hash_next(hash_next(hash_start(), stream), GLOSSY_BRANCH));
    return direct_at(hit, wo, Query(NON_DIFFUSE, 1.0), params.samples, branch);
}
