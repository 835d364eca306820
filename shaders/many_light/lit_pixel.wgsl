// Light of a view's pixels. Twin: method::many_light::row::Sample.

// #include "shared/math.wgsl"

struct LitPixel {
    // Of the diffuse lobe without its albedo.
    irradiance: vec3<f32>,
    // Nodes; 0 where it was interpolated.
    visited: u32,
    // Radiance, averaged over the glossy lobe.
    glossy: vec3<f32>,
    // The list of pixels to be lit, an entry a pixel: which, plus 1; 0 past its end.
    listed: u32,
}

// How much light that is. Twin: method::many_light::shade::Light::weight.
fn light_weight(irradiance: vec3<f32>, glossy: vec3<f32>) -> f32 {
    return luminance(irradiance) * FRAC_1_PI + luminance(glossy);
}
