// Twin of src/method/radiance_probes/light.rs: radiance.
// What each receiver sends on, as diffuse radiance, of the light that comes to it.

@group(0) @binding(0) var<storage, read> direct: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> indirect: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> reflectance: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4<f32>>;

@compute @workgroup_size(64)
fn receiver_radiance(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if i < arrayLength(&radiance) {
        radiance[i] = (direct[i] + max(indirect[i], vec4(0.0))) * reflectance[i];
    }
}
