// Twin of src/method/many_light/shade.rs: light.
// Indirect light at a run of the pixels that are listed.

// #include "many_light/exponent.wgsl"
// #include "many_light/gather.wgsl"
// #include "many_light/lit_pixel.wgsl"
// #include "shared/bsdf.wgsl"
// #include "shared/camera_ray.wgsl"
// #include "shared/view.wgsl"

// Marks random numbers of gathers at pixels.
const PIXEL: u32 = 0x70697865u;

@group(0) @binding(4) var<storage, read> view: array<Pixel>;
@group(0) @binding(5) var<storage, read_write> lit: array<LitPixel>;

struct Received {
    irradiance: vec3<f32>,
    glossy: vec3<f32>,
}

var<private> here: Surface;
var<private> here_n: vec3<f32>;
var<private> takes_diffuse: bool;
var<private> mirror_way: vec3<f32>;
// Negative without a glossy lobe.
var<private> here_exponent: f32;

fn nothing() -> Received {
    return Received(vec3(0.0), vec3(0.0));
}

fn added(a: Received, b: Received, scale: f32) -> Received {
    return Received(a.irradiance + b.irradiance * scale, a.glossy + b.glossy * scale);
}

fn weight_of(light: Received) -> f32 {
    return luminance(light.irradiance) * FRAC_1_PI + luminance(light.glossy);
}

fn receive(arrival: Arrival) -> Received {
    let cosine = dot(arrival.direction, here_n);
    var light = nothing();
    if cosine <= 0.0 {
        return light;
    }
    if takes_diffuse {
        let factor = bsdf_diffuse_in(here, to_local(here.frame, arrival.direction));
        light.irradiance = arrival.radiance * (factor * min(cosine * arrival.solid_angle, params.clamp * PI));
    }
    if here_exponent >= 0.0 {
        let lobe = density(here_exponent, dot(arrival.direction, mirror_way));
        light.glossy = arrival.radiance * min(arrival.solid_angle * lobe, params.clamp);
    }
    return light;
}

@compute @workgroup_size(64)
fn light_pixels(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let place = params.first + id.x;
    if id.x >= params.count || lit[place].listed == 0u {
        return;
    }
    let i = lit[place].listed - 1u;
    lit[place].listed = 0u;
    let pixel = view[i];
    here = surface_at(hit_of(pixel.triangle, pixel.u, pixel.v));
    let width = params.camera.width;
    let wo = -camera_ray(params.camera, vec2(f32(i % width), f32(i / width)) + 0.5, vec2(0.5)).direction;
    here_n = here.frame.n * sign_of(to_local(here.frame, wo).z);
    takes_diffuse = (material_u32(here.material, MATERIAL_LOBES) & DIFFUSE) != 0u;
    mirror_way = mirror(wo, here_n);
    here_exponent = -1.0;
    if pixel.material != NOT_GLOSSY {
        here_exponent = exponent_of(pixel.alpha);
    }
    let marks = hash_next(hash_next(hash_next(hash_start(), params.seed), params.frame), PIXEL);
    let found = gather(here.p, hash_end(hash_next(marks, i)));
    lit[i].irradiance = found.received.irradiance;
    lit[i].glossy = found.received.glossy;
    lit[i].visited = found.visited;
}
