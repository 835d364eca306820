// Twin of src/method/radiance_probes/clusters.rs: reconstruct.
// The light of receivers from that of their clusters' spaces.

struct Member {
    receiver: u32,
    // The first word of its coefficients, of two halves each; an odd list ends with a zero.
    first: u32,
    // Where the light of its cluster's space begins.
    space: u32,
    rank: u32,
}

@group(0) @binding(0) var<storage, read> members: array<Member>;
@group(0) @binding(1) var<storage, read> reconstruction: array<u32>;
@group(0) @binding(2) var<storage, read> spaces: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> indirect: array<vec4<f32>>;

@compute @workgroup_size(64)
fn reconstruct(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&members) {
        return;
    }
    let member = members[id.x];
    var sum = vec4(0.0);
    for (var k = 0u; k < member.rank; k += 2u) {
        let halves = unpack2x16float(reconstruction[member.first + k / 2u]);
        sum += halves.x * spaces[member.space + k] + halves.y * spaces[member.space + min(k + 1u, member.rank - 1u)];
    }
    indirect[member.receiver] = sum;
}
