// Twin of src/method/many_light/gather.rs: new.
// Light of a run of clusters from that of their children, which came before; and of the nodes that are such clusters.

// #include "many_light/lobe.wgsl"
// #include "many_light/node.wgsl"
// #include "many_light/params.wgsl"

const NO_NODE: u32 = 0xffffffffu;

struct Cluster {
    // Both children; of a single light its place twice.
    children: vec2<u32>,
    // Its node; NO_NODE where no traversal sees it.
    node: u32,
    area: f32,
}

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> emissions: array<Emission>;
// What each cluster's lights send out together, by area.
@group(0) @binding(3) var<storage, read_write> sums: array<Emission>;
@group(0) @binding(4) var<storage, read_write> nodes: array<Node>;

@compute @workgroup_size(64)
fn filter_lobes(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.count {
        return;
    }
    let i = params.first + id.x;
    let cluster = clusters[i];
    let area = max(cluster.area, MIN_POSITIVE);
    var sum: Emission;
    if cluster.children.x == cluster.children.y {
        let emission = emissions[params.lights + cluster.children.x];
        sum = with_lobe(dark(), filtered(emission), cluster.area);
        sum.diffuse = emission.diffuse * cluster.area;
    } else {
        sum = merged(sums[cluster.children.x], sums[cluster.children.y], 1.0);
    }
    sums[i] = sum;
    if cluster.node != NO_NODE {
        let lobe = filtered(sum);
        nodes[cluster.node].diffuse = sum.diffuse / area;
        nodes[cluster.node].direction = lobe.direction;
        nodes[cluster.node].exponent = lobe.exponent;
        nodes[cluster.node].magnitude = lobe.magnitude / area;
    }
}
