// A hierarchy of emitters, descended at random by how much each child can send to a point. Twin: src/transport/light_tree.rs.

// #include "shared/math.wgsl"
// #include "shared/scene.wgsl"

const BACK: f32 = 0.05;
const EVEN: f32 = 0.25;
const WIDTH: u32 = 8u;
// Marks a child that is an emitter.
const LEAF: u32 = 0x80000000u;

// Where light arrives; the normal is zero where it counts on both sides.
struct Receiver {
    p: vec3<f32>,
    n: vec3<f32>,
}

// An entry of `near` and the probability of its choice, which is 0 where no light can arrive.
struct Choice {
    index: u32,
    probability: f32,
}

fn light_tree_sample(r: Receiver, choice: f32) -> Choice {
    var u = choice;
    var node = 0u;
    var probability = 1.0;
    loop {
        var shares = light_shares(node, r);
        var last = WIDTH;
        for (var k = 0u; k < WIDTH; k++) {
            last = select(last, k, shares[k] > 0.0);
        }
        if last == WIDTH {
            return Choice(0u, 0.0);
        }
        var slot = 0u;
        while slot < last && u >= shares[slot] {
            u -= shares[slot];
            slot++;
        }
        u = clamp(u / shares[slot], 0.0, 1.0 - EPSILON);
        probability *= shares[slot];
        let child = light_node_u32(node, LIGHT_NODE_CHILDREN + slot);
        if (child & LEAF) != 0u {
            return Choice(child & ~LEAF, probability);
        }
        node = child;
    }
    return Choice(0u, 0.0);
}

// Probability with which `light_tree_sample` chooses that entry.
fn light_tree_probability(r: Receiver, entry: u32) -> f32 {
    let place = near_at(entry).place;
    var node = place / WIDTH;
    var slot = place % WIDTH;
    var probability = 1.0;
    loop {
        var shares = light_shares(node, r);
        probability *= shares[slot];
        if node == 0u || probability == 0.0 {
            return probability;
        }
        let child = node;
        node = light_node_u32(child, LIGHT_NODE_PARENT);
        slot = light_node_u32(child, LIGHT_NODE_PARENT + 1u);
    }
    return probability;
}

// Probability with which each child is chosen; all zero where no light can arrive, unless there is one child alone.
fn light_shares(node: u32, r: Receiver) -> array<f32, 8> {
    var shares: array<f32, 8>;
    if light_node_f32(node, LIGHT_NODE_POWER + 1u) == 0.0 {
        shares[0] = 1.0;
        return shares;
    }
    var total = 0.0;
    var count = 0.0;
    for (var k = 0u; k < WIDTH; k++) {
        let x = light_importance(node, k, r);
        shares[k] = x;
        total += x;
        count += select(0.0, 1.0, x > 0.0);
    }
    let scale = select(0.0, (1.0 - EVEN) / total, total > 0.0 && is_finite(total));
    for (var k = 0u; k < WIDTH; k++) {
        shares[k] = select(0.0, shares[k] * scale + EVEN / count, scale > 0.0 && shares[k] > 0.0);
    }
    return shares;
}

// A bound on the light of one child at the receiver, but for its visibility.
fn light_importance(node: u32, k: u32, r: Receiver) -> f32 {
    let power = light_node_f32(node, LIGHT_NODE_POWER + k);
    if power == 0.0 {
        return 0.0;
    }
    let both = select(0.0, 2.0, all(r.n == vec3(0.0)));
    let centre = light_node_vec3(node, LIGHT_NODE_CENTRE, k);
    let axis = light_node_vec3(node, LIGHT_NODE_AXIS, k);
    let radius_sq = light_node_f32(node, LIGHT_NODE_RADIUS_SQ + k);
    let d = centre - r.p;
    let distance_sq = max(dot(d, d), MIN_POSITIVE);
    let inv = 1.0 / sqrt(distance_sq);
    let sin_size_sq = min(radius_sq / distance_sq, 1.0);
    let inside = distance_sq <= radius_sq;
    let size = select(vec2(sqrt(1.0 - sin_size_sq), sqrt(sin_size_sq)), vec2(-1.0, 0.0), inside);

    let cos_out = -dot(axis, d) * inv;
    let spread = vec2(light_node_f32(node, LIGHT_NODE_COS_SPREAD + k), light_node_f32(node, LIGHT_NODE_SIN_SPREAD + k));
    let x = less(vec2(cos_out, sqrt(max(1.0 - cos_out * cos_out, 0.0))), spread);
    let cos_emitter = less(x, size).x;
    let cos_in = dot(r.n, d) * inv;
    let facing = max(less(vec2(cos_in + both, sqrt(max(1.0 - cos_in * cos_in, 0.0))), size).x, BACK);
    let value = power * max(cos_emitter, BACK) * facing / max(distance_sq, radius_sq);
    return select(0.0, value, cos_emitter > light_node_f32(node, LIGHT_NODE_COS_REACH + k));
}

// Cosine and sine of the angle a - b, of 0 where that is negative.
fn less(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return select(vec2(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y), vec2(1.0, 0.0), a.x > b.x);
}

fn light_node_u32(node: u32, member: u32) -> u32 {
    return record_u32(scene.light_nodes + LIGHT_NODE_ROWS * node, member);
}

fn light_node_f32(node: u32, member: u32) -> f32 {
    return bitcast<f32>(light_node_u32(node, member));
}

// A vector of the child `k`, whose members lie one list after the other.
fn light_node_vec3(node: u32, member: u32, k: u32) -> vec3<f32> {
    let x = member + k;
    return vec3(light_node_f32(node, x), light_node_f32(node, x + WIDTH), light_node_f32(node, x + 2u * WIDTH));
}
