// Twin of src/method/radiance_probes/light.rs: radiance.
// What each receiver sends on, as diffuse radiance, of the light that comes to it.

// #include "shared/math.wgsl"

// Numbers that a receiver keeps: 1, irradiance, or 4, radiance to first order.
override NUMBERS: u32 = 1;

@group(0) @binding(0) var<storage, read> direct: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> indirect: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> reflectance: array<vec4<f32>>;
// Where receivers face, if they keep radiance.
@group(0) @binding(3) var<storage, read> normals: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> radiance: array<vec4<f32>>;

// Irradiance of what a receiver keeps: of radiance by the factors of Ramamoorthi and Hanrahan 2001.
fn irradiance(i: u32) -> vec4<f32> {
    let at = NUMBERS * i;
    if NUMBERS == 1u {
        return indirect[at];
    }
    let n = normals[i].xyz;
    let linear = indirect[at + 1u] * n.y + indirect[at + 2u] * n.z + indirect[at + 3u] * n.x;
    return indirect[at] * (PI * sqrt(0.25 / PI)) + linear * (2.0 * PI / 3.0 * sqrt(0.75 / PI));
}

@compute @workgroup_size(64)
fn receiver_radiance(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    // Behind them comes what stands in the way of relight rays.
    if i < arrayLength(&reflectance) {
        radiance[i] = (direct[i] + max(irradiance(i), vec4(0.0))) * reflectance[i];
    }
}
