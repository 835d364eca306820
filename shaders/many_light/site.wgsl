// Where a light is. Twin: method::many_light::gpu::lights::GpuSite.

struct Site {
    p: vec3<f32>,
    // Its own, whichever place the tree gives it.
    number: u32,
    triangle: u32,
    u: f32,
    v: f32,
    // 1 on the side of the shading normal, -1 behind.
    side: f32,
}
