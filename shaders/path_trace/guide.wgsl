// What the denoiser is guided by at a pixel. Twin: method::path_trace::denoise::Guide.

struct Guide {
    // Mean normal; zero for the environment.
    normal: vec3<f32>,
    // Mean distance.
    depth: f32,
    // Mean albedo of the lobe that makes the layer.
    albedo: vec3<f32>,
    padding0: u32,
    // Mean albedo that divides the layer.
    factor: vec3<f32>,
    padding1: u32,
}
