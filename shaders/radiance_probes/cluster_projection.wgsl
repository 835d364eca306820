// Twin of src/method/radiance_probes/clusters.rs: project.
// The light of clusters' spaces: a workgroup a row of a cluster's projection.

struct Params {
    // Of a probe.
    terms: u32,
}

struct Row {
    // Its first word, of two halves each; an odd row ends with a zero.
    first: u32,
    // The first of its cluster's probes in the list.
    probes: u32,
    // How many numbers it has.
    width: u32,
    // Where its product goes.
    space: u32,
}

const LANES: u32 = 64u; // Own.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rows: array<Row>;
@group(0) @binding(2) var<storage, read> probes: array<u32>;
@group(0) @binding(3) var<storage, read> projection: array<u32>;
@group(0) @binding(4) var<storage, read> lambda: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> spaces: array<vec4<f32>>;

var<workgroup> sums: array<vec4<f32>, LANES>;

fn of_probe(row: Row, v: u32) -> vec4<f32> {
    let slot = v / params.terms;
    return lambda[probes[row.probes + slot] * params.terms + v - slot * params.terms];
}

@compute @workgroup_size(64)
fn cluster_projection(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) i: u32
) {
    let number = group.y * groups.x + group.x;
    let row = rows[min(number, arrayLength(&rows) - 1u)];
    var sum = vec4(0.0);
    for (var v = 2u * i; v < row.width; v += 2u * LANES) {
        let halves = unpack2x16float(projection[row.first + v / 2u]);
        sum += halves.x * of_probe(row, v) + halves.y * of_probe(row, min(v + 1u, row.width - 1u));
    }
    sums[i] = sum;
    workgroupBarrier();
    for (var n = LANES / 2u; n > 0u; n /= 2u) {
        if i < n {
            sums[i] += sums[i + n];
        }
        workgroupBarrier();
    }
    if i == 0u && number < arrayLength(&rows) {
        spaces[row.space] = sums[0];
    }
}
