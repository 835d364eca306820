// Twin of src/method/radiance_probes/shade.rs: taken_in.
// What a run of pixels sends to the camera of light that came by way of the probes as radiance of first order: the diffuse layer, to which
// light straight from emitters is still to be added, and the glossy one, which has it.

// #include "shared/glossy_direct.wgsl"
// #include "shared/view.wgsl"

// Directions by which light of first order is taken in.
const DIRECTIONS: u32 = 16u;

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read_write> shading: array<Shading>;
@group(0) @binding(3) var<storage, read_write> glossy: array<vec4<f32>>;

// Harmonics up to order 1.
fn first_four(d: vec3<f32>) -> vec4<f32> {
    return vec4(sqrt(0.25 / PI), sqrt(0.75 / PI) * d.yzx);
}

// Diffuse reflection.
fn taken_in(s: Surface, wo: vec3<f32>, normal: vec3<f32>, light: array<vec3<f32>, 4>) -> vec3<f32> {
    let sent = bsdf_diffuse_out(s, to_local(s.frame, wo));
    if all(sent == vec3(0.0)) {
        return vec3(0.0);
    }
    let frame = frame_from_normal(normal);
    var sum = vec3(0.0);
    for (var i = 0u; i < DIRECTIONS; i++) {
        let u = vec2((f32(i) + 0.5) / f32(DIRECTIONS), fract(0.618034 * (f32(i) + 0.5)));
        let d = to_world(frame, cosine_hemisphere(u));
        let y = first_four(d);
        let radiance = light[0] * y.x + light[1] * y.y + light[2] * y.z + light[3] * y.w;
        sum += radiance * bsdf_diffuse_in(s, to_local(s.frame, d));
    }
    return sent * max(sum * (PI / f32(DIRECTIONS)), vec3(0.0)) * FRAC_1_PI;
}

// Glossy reflection of the linear terms as one distant light.
fn reflected(s: Surface, wo: vec3<f32>, light: array<vec3<f32>, 4>) -> vec3<f32> {
    let d = normalize_or(vec3(luminance(light[3]), luminance(light[1]), luminance(light[2])), vec3(0.0));
    if all(d == vec3(0.0)) {
        return vec3(0.0);
    }
    let y = first_four(d);
    let irradiance = (light[1] * y.y + light[2] * y.z + light[3] * y.w) / (0.75 * FRAC_1_PI);
    let query = Query(NON_DIFFUSE, 1.0);
    return scatter(s, to_local(s.frame, wo), to_local(s.frame, d), 0.0, vec2(0.5), query).light.value * max(irradiance, vec3(0.0));
}

@compute @workgroup_size(64)
fn first_order(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let pixel = params.first_pixel + id.x;
    if id.x >= params.pixels {
        return;
    }
    glossy[pixel] = vec4(0.0);
    if view[pixel].triangle == NO_TRIANGLE {
        return;
    }
    let hit = hit_of(view[pixel].triangle, view[pixel].u, view[pixel].v);
    let s = surface_at(hit);
    let wo = towards_camera(params.camera, pixel);
    let back = dot(s.frame.n, wo) < 0.0;
    var light: array<vec3<f32>, 4>;
    for (var k = 0u; k < 4u; k++) {
        light[k] = lightmap_lookup_in(k, s.triangle, s.barycentric, back);
    }
    shading[pixel].diffuse = taken_in(s, wo, view[pixel].n, light);
    if view[pixel].material != NOT_GLOSSY {
        glossy[pixel] = vec4(glossy_direct(hit, wo, pixel) + reflected(s, wo, light), 0.0);
    }
}
