// Twin of src/view/layers.rs: LayerImages.
// A pixel of the frame in all its layers.

struct LayerPixel {
    emission: vec4<f32>,
    diffuse: vec4<f32>,
    glossy: vec4<f32>,
}

