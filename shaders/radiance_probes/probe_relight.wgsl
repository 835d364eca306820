// Twin of src/method/radiance_probes/relight.rs: project.
// A probe's coefficients from the radiance of the receivers that its rays meet. A workgroup has one probe and as many terms as a tile has
// columns; its invocations fetch what a tile's rays see, then each sums up a quarter of them for one term.

struct Params {
    rays: u32,
    terms: u32,
}

const NO_RECEIVER: u32 = 0xffffffffu;
// Terms of a workgroup, parts of a tile, and its rays.
const TERMS: u32 = 64u; // Own.
const PARTS: u32 = 4u; // Own.
const TILE: u32 = 256u; // Own.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> hits: array<u32>;
@group(0) @binding(2) var<storage, read> radiance: array<vec4<f32>>;
// The terms of each ray, times its share of the sphere.
@group(0) @binding(3) var<storage, read> weighted: array<f32>;
@group(0) @binding(4) var<storage, read_write> lambda: array<vec4<f32>>;

// What rays see; in the end sums over the parts.
var<workgroup> tile: array<vec4<f32>, TILE>;

@compute @workgroup_size(256)
fn probe_relight(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) i: u32) {
    let rays = params.rays;
    let terms = params.terms;
    let term = group.y * TERMS + i % TERMS;
    let column = min(term, terms - 1u);
    let part = i / TERMS * (TILE / PARTS);
    var sum = vec4(0.0);
    for (var first = 0u; first < rays; first += TILE) {
        var seen = vec4(0.0);
        if first + i < rays {
            let hit = hits[group.x * rays + first + i];
            if hit != NO_RECEIVER {
                seen = radiance[hit];
            }
        }
        tile[i] = seen;
        workgroupBarrier();
        let end = min(TILE / PARTS, max(rays, first + part) - first - part);
        for (var k = 0u; k < end; k++) {
            sum += tile[part + k] * weighted[(first + part + k) * terms + column];
        }
        workgroupBarrier();
    }
    tile[i] = sum;
    workgroupBarrier();
    if i < TERMS && term < terms {
        lambda[group.x * terms + term] = tile[i] + tile[i + TERMS] + tile[i + 2u * TERMS] + tile[i + 3u * TERMS];
    }
}
