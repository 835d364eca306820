// Twin of src/method/many_light/gather.rs: new.
// What a run of clusters sends out, from what their children do, which came before.

// #include "many_light/lobe.wgsl"
// #include "many_light/params.wgsl"

struct Cluster {
    // Both children; of a single light its place twice.
    children: vec2<u32>,
    area: f32,
}

@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> emissions: array<Emission>;
// What each cluster's lights send out together, by area.
@group(0) @binding(3) var<storage, read_write> sums: array<Emission>;

@compute @workgroup_size(64)
fn add_up(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.count {
        return;
    }
    let i = params.first + id.x;
    let cluster = clusters[i];
    if cluster.children.x != cluster.children.y {
        sums[i] = merged(sums[cluster.children.x], sums[cluster.children.y], 1.0);
        return;
    }
    let emission = emissions[params.lights + cluster.children.x];
    var sum = with_lobe(dark(), filtered(emission), cluster.area);
    sum.diffuse = emission.diffuse * cluster.area;
    sums[i] = sum;
}
