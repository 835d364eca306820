// Twin of src/method/ulr/mod.rs: weights.

// #include "ulr/ulr.wgsl"

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read> kept: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> counts: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> glossy: array<vec4<f32>>;
// Pixels that no probe serves.
@group(0) @binding(5) var<storage, read_write> unserved: atomic<u32>;

@compute @workgroup_size(8, 8)
fn ulr_blend(@builtin(global_invocation_id) id: vec3<u32>) {
    ulr = ulr_params;
    if id.x >= ulr.width || id.y >= ulr.height {
        return;
    }
    let i = id.y * ulr.width + id.x;
    let count = counts[i].x;
    var sum = vec4(0.0);
    if count > 0u {
        let first = i * ulr.blend;
        let last = kept[first + count - 1u].w * (1.0 + 1e-5) + MIN_PENALTY;
        for (var j = first; j < first + count; j++) {
            let q = kept[j].w + MIN_PENALTY;
            sum += vec4(kept[j].rgb, 1.0) * (max(1.0 - q / last, 1e-6) / q);
        }
        sum /= sum.w;
    } else if view[i].material != NOT_GLOSSY {
        atomicAdd(&unserved, 1u);
    }
    glossy[i] = vec4(sum.rgb, 0.0);
}
