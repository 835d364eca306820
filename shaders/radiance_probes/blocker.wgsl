// A surface that a frame adds in the way of a relight ray. Twin: src/method/radiance_probes/light.rs.

// #include "radiance_probes/taps.wgsl"

struct Blocker {
    // What it sends back along the ray of E_T, as diffuse radiance.
    sent: vec3<f32>,
    padding0: u32,
    // E_T straight from emitters.
    direct: vec3<f32>,
    // How it takes E_T from receivers in free space.
    taps: Taps,
}
