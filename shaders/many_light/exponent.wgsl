// The Phong exponent that a roughness has. Twin: method::many_light::emit::exponent.

// #include "many_light/params.wgsl"
// #include "shared/math.wgsl"

fn exponent_of(alpha: f32) -> f32 {
    let exponent = max(0.5 / max(alpha * alpha, MIN_POSITIVE) - 1.0, 0.0);
    return clamp(exponent, params.min_exponent, params.max_exponent);
}
