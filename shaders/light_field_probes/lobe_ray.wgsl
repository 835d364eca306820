// Twin of src/method/light_field_probes/lobe.rs: along_lobe.
// A ray along a glossy lobe, between the kernel that draws it and the one that follows it.
struct LobeRay {
    origin: vec3<f32>,
    // Solid angle that the ray stands for, steradians; 0 for a single texel's.
    omega: f32,
    direction: vec3<f32>,
    // Whether there is a ray.
    lives: u32,
    // What scatters of the light that it meets.
    weight: vec3<f32>,
    padding0: u32,
}

