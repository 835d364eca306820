// What of the sky is drawn from where. Twins: src/transport/outlook.rs, src/transport/shares.rs, src/transport/places.rs.

// #include "shared/envmap.wgsl"
// #include "shared/light_tree.wgsl"

const SIDE = 16u;
const SIDES = 7u;
const BOTH = 6u;
const WHOLE: f32 = 65536.0;
// Words before the cells: the grid's corner, cells a metre and size, and where the shares begin.
const HEADER = 8u;
// Words of an environment's shares for one side of a cell.
const SHARES = 136u;

// Two numbers and their density.
struct Drawn {
    v: vec2<f32>,
    density: f32,
}

// Where in `words` the shares of an environment for a receiver begin; NONE where nothing is known.
fn outlook_shares(e: u32, r: Receiver) -> u32 {
    let at = scene.outlook;
    if at == NONE {
        return NONE;
    }
    let corner = vec3(word_f32(at), word_f32(at + 1u), word_f32(at + 2u));
    let size = vec3(words[at + 4u], words[at + 5u], words[at + 6u]);
    let cell = min(vec3<u32>(max((r.p - corner) * word_f32(at + 3u), vec3(0.0))), size - vec3(1u));
    let n = abs(r.n);
    let axis = select(1u + u32(n.z > n.y), 0u, n.x >= n.y && n.x >= n.z);
    let side = select(2u * axis + u32(r.n[axis] > 0.0), BOTH, all(r.n == vec3(0.0)));
    let which = words[at + HEADER + ((cell.z * size.y + cell.y) * size.x + cell.x) * SIDES + side];
    return select(words[at + 7u] + (which + e) * SHARES, NONE, which == NONE);
}

// Where a step of the rows, 0, or along the columns of one, begins.
fn outlook_edge(shares: u32, row: u32, step: u32) -> f32 {
    if step == SIDE {
        return WHOLE;
    }
    let i = row * SIDE + step;
    return f32((words[shares + i / 2u] >> (16u * (i % 2u))) & 0xffffu);
}

fn outlook_share(shares: u32, row: u32, step: u32) -> f32 {
    return (outlook_edge(shares, row, step + 1u) - outlook_edge(shares, row, step)) / WHOLE;
}

// The step that `u` falls on, where in it, and its share.
fn outlook_pick(shares: u32, row: u32, u: f32) -> vec3<f32> {
    var step = 0u;
    for (var i = 1u; i < SIDE; i++) {
        step += u32(outlook_edge(shares, row, i) <= u * WHOLE);
    }
    let begin = outlook_edge(shares, row, step);
    let height = outlook_edge(shares, row, step + 1u) - begin;
    return vec3(f32(step), clamp((u * WHOLE - begin) / height, 0.0, 1.0 - 2.0 * EPSILON), height / WHOLE);
}

// What becomes of two uniform numbers for an environment.
fn outlook_draw(e: u32, r: Receiver, v: vec2<f32>) -> Drawn {
    let shares = outlook_shares(e, r);
    if shares == NONE {
        return Drawn(v, 1.0);
    }
    let row = outlook_pick(shares, 0u, v.y);
    let column = outlook_pick(shares, 1u + u32(row.x), v.x);
    let drawn = vec2(column.x + column.y, row.x + row.y) / f32(SIDE);
    return Drawn(drawn, row.z * column.z * f32(SIDE * SIDE));
}

// Density of the numbers with which an environment is found in direction `d`.
fn outlook_density(e: u32, r: Receiver, d: vec3<f32>) -> f32 {
    let shares = outlook_shares(e, r);
    if shares == NONE {
        return 1.0;
    }
    let part = min(vec2<u32>(environment_numbers(e, d) * f32(SIDE)), vec2(SIDE - 1u));
    return outlook_share(shares, 0u, part.y) * outlook_share(shares, 1u + part.y, part.x) * f32(SIDE * SIDE);
}
