// What a view holds of each of its pixels, in two records: what passes look for most often, and what they take from there in the end.
// Twins: view::gbuffer::Pixel and view::mirror::Reflected.

// #include "shared/math.wgsl"

const NOT_GLOSSY: u32 = 0xffffffffu;
// Among the materials of reflected hits: the mirror ray left the scene; there is no reflector.
const SKY: u32 = 0xfffeu;
const NOTHING: u32 = 0xffffu;

struct Reflected {
    // World position of the reflected hit; the unit direction towards it for SKY.
    point: vec3<f32>,
    material: u32,
}

struct Pixel {
    // The surface seen, and its alpha; negative without a glossy lobe.
    p: vec3<f32>,
    alpha: f32,
    // The shading normal on the camera's side, and the distance to the camera.
    n: vec3<f32>,
    depth: f32,
    // Mirror hit.
    reflected: Reflected,
    // NOT_GLOSSY where the pixel has no glossy lobe.
    material: u32,
    // The hit itself; NO_TRIANGLE where nothing is seen.
    triangle: u32,
    u: f32,
    v: f32,
}

struct Shading {
    // Principal curvatures, and the first one's direction in the tangents of frame_from_normal.
    curvature: vec4<f32>,
    // Radiance emitted towards the camera; the environment's where nothing is seen.
    emission: vec3<f32>,
    padding0: u32,
    // Radiance of the diffuse lobe, by the light map.
    diffuse: vec3<f32>,
    padding1: u32,
    // Directional albedo of the glossy lobe at the probes' roughness.
    albedo: vec3<f32>,
    padding2: u32,
}

// Unit direction of the reflected ray that leaves the reflector.
fn direction_from(r: Reflected, reflector: vec3<f32>) -> vec3<f32> {
    if r.material == SKY {
        return r.point;
    }
    return normalize_or(r.point - reflector, vec3(0.0, 1.0, 0.0));
}

// Distance d_r from the reflector to the reflected hit.
fn distance_from(r: Reflected, reflector: vec3<f32>) -> f32 {
    return select(distance(r.point, reflector), FAR, r.material == SKY);
}
