// Twin of src/method/glossy_probes/blend.rs: Gathered.
// What the gather leaves of a pixel, in two vectors: each is read and written at once.

struct Gathered {
    // Colour times weight, and the weight; 0 as long as no probe had a sample.
    sum: vec4<f32>,
    // The best sample: its energy and texel as bits, and its probe.
    best: vec4<u32>,
}
