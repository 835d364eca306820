// What lights send out of the light that they get. Twin: method::many_light::emit::Site.

// #include "many_light/exponent.wgsl"
// #include "many_light/lobe.wgsl"
// #include "many_light/params.wgsl"
// #include "many_light/site.wgsl"
// #include "shared/albedo.wgsl"

// Directions over which a diffuse lobe's share towards viewers is averaged.
const VIEWS: u32 = 4u;

// The surface of the invocation's light, and its normal on the light's side.
var<private> here: Surface;
var<private> here_n: vec3<f32>;
var<private> here_side: f32;
// What of E_T it sends out as diffuse radiance.
var<private> here_reflectance: vec3<f32>;
// Exponent of its lobe; negative without one.
var<private> here_exponent: f32;

// Twin: method::many_light::emit::Site::new.
fn stand_at(site: Site) {
    here = surface_at(hit_of(site.triangle, site.u, site.v));
    here_side = site.side;
    here_n = here.frame.n * site.side;
    var sum = vec3(0.0);
    for (var k = 0u; k < VIEWS; k++) {
        let d = cosine_hemisphere(vec2((f32(k) + 0.5) / f32(VIEWS), fract(0.618 * f32(k) + 0.3)));
        sum += bsdf_diffuse_out(here, vec3(d.xy, d.z * site.side));
    }
    here_reflectance = sum * (FRAC_1_PI / f32(VIEWS));
    here_exponent = -1.0;
    if params.lobes != 0u && (material_u32(here.material, MATERIAL_LOBES) & NON_DIFFUSE) != 0u {
        let alpha = bsdf_alpha(here);
        if alpha >= 0.0 {
            here_exponent = exponent_of(alpha);
        }
    }
}

// What it sends out of irradiance across the unit direction `w` that light comes from.
fn reflected(w: vec3<f32>, across: vec3<f32>) -> Emission {
    let local = to_local(here.frame, w);
    let cosine = local.z * here_side;
    var sum = dark();
    if cosine <= 0.0 {
        return sum;
    }
    sum.diffuse = across * (cosine * bsdf_diffuse_in(here, local)) * here_reflectance;
    if here_exponent >= 0.0 {
        let magnitude = across * bsdf_glossy_albedo(here, local);
        sum = with_lobe(sum, Lobe(mirror(w, here_n), here_exponent, magnitude), 1.0);
    }
    return sum;
}
