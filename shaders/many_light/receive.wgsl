// Indirect light at a surface that is seen. Twin: src/method/many_light/shade.rs.

// #include "many_light/exponent.wgsl"
// #include "many_light/gather.wgsl"
// #include "many_light/lit_pixel.wgsl"
// #include "shared/bsdf.wgsl"

// Part of a lobe's greatest density that ends it.
const LOBE_END: f32 = 0.1;

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
    return light_weight(light.irradiance, light.glossy);
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

// Light at a surface that is seen from the unit direction `wo`; the alpha of its glossy lobe is negative where nothing is gathered for one.
fn gathered(surface: Surface, wo: vec3<f32>, alpha: f32, stream: u32) -> Gathered {
    here = surface;
    here_n = here.frame.n * sign_of(to_local(here.frame, wo).z);
    takes_diffuse = (material_u32(here.material, MATERIAL_LOBES) & DIFFUSE) != 0u;
    mirror_way = mirror(wo, here_n);
    here_exponent = -1.0;
    var cone = NO_CONE;
    if alpha >= 0.0 {
        here_exponent = exponent_of(alpha);
        if params.fill > 0.0 {
            let cosine = pow(LOBE_END, 1.0 / max(here_exponent, 1.0));
            cone = Cone(mirror_way, cosine, sqrt(1.0 - cosine * cosine), params.fill * TAU / (here_exponent + 1.0));
        }
    }
    return gather(cone, stream);
}
