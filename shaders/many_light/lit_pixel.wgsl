// Light of a view's pixels. Twin: method::many_light::row::Sample.

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
