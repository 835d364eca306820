// Twin of src/method/many_light/descend.rs: new.
// Light of a run of nodes, and where a traversal goes on to their children.

// #include "many_light/lobe.wgsl"
// #include "many_light/node.wgsl"
// #include "many_light/params.wgsl"

// Which cluster a node is.
struct Origin {
    cluster: u32,
    // Whether it lies on the max cut or below.
    is_last: u32,
}

@group(0) @binding(1) var<storage, read> origins: array<Origin>;
@group(0) @binding(2) var<storage, read> sums: array<Emission>;
@group(0) @binding(3) var<storage, read_write> nodes: array<Node>;

// A cluster's radiance, about.
fn radiance(sum: Emission, area: f32) -> f32 {
    return emission_weight(sum) / max(area, MIN_POSITIVE);
}

@compute @workgroup_size(64)
fn filter_nodes(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.count {
        return;
    }
    let i = params.first + id.x;
    let sum = sums[origins[i].cluster];
    let area = nodes[i].area;
    let lobe = filtered(sum);
    nodes[i].diffuse = sum.diffuse / area;
    nodes[i].direction = lobe.direction;
    nodes[i].exponent = lobe.exponent;
    nodes[i].magnitude = lobe.magnitude / area;
    let wide = area / params.solid_angle;
    var descent = vec3(0.0);
    if nodes[i].count > 1u {
        descent.x = wide;
        if origins[i].is_last != 0u {
            let mean = max(radiance(sums[params.clusters - 1u], params.area), MIN_POSITIVE);
            let disc = radiance(sum, area) / mean * area * FRAC_1_PI;
            descent = vec3(min(wide, params.near * params.near * disc), min(wide, params.horizon * params.horizon * disc), wide);
        }
    }
    nodes[i].reach = descent.x;
    nodes[i].horizon = descent.y;
    nodes[i].in_lobe = descent.z;
}
