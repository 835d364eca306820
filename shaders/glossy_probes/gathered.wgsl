// What the gather leaves of a pixel.

struct Gathered {
    // Sum of colour times weight, and of the weight; 0 as long as no probe had a sample.
    color: vec3<f32>,
    weight: f32,
    // The best sample: its texel, energy and probe.
    texel: vec2<f32>,
    energy: f32,
    probe: u32,
}
