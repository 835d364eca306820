// A ray through one probe's map. Twin: src/method/light_field_probes/march.rs.

// #include "light_field_probes/params.wgsl"
// #include "light_field_probes/octahedral.wgsl"

// The maps of all probes, one after the other. Of a texel the distance to its surface (FAR where there is none) and its packed normal.
@group(0) @binding(2) var<storage, read> surfels: array<vec2<u32>>;
// Least distances of squares, the finest level first.
@group(0) @binding(3) var<storage, read> bounds: array<f32>;

const COARSE: u32 = 4u;
const SECOND_TOP: u32 = 2u;
const LEAST_COS: f32 = 0.02;

const TWO_SCALE: u32 = 0u;
const HI_Z: u32 = 1u;

// What becomes of a ray, by what one probe knows.
const FREE: u32 = 0u; // Own.
const HIT: u32 = 1u; // Own.
const HIDDEN: u32 = 2u; // Own.

struct March {
    kind: u32,
    // Distance along the ray.
    t: f32,
}

// A ray relative to a probe, and the probe's maps.
struct LocalRay {
    o: vec3<f32>,
    slot: u32,
    d: vec3<f32>,
}

// A piece of a ray within an octant: a straight line on the map.
struct Line {
    t: vec2<f32>,
    // Its ends, texels.
    start: vec2<f32>,
    along: vec2<f32>,
    // |p|₁ at the ends.
    weight: vec2<f32>,
}

// The square of a level in which a line is, and the share at which it leaves it.
struct Leave {
    square: vec2<u32>,
    exit: f32,
}

fn level_count() -> u32 {
    return firstTrailingBit(params.field.size);
}

// Texels of all finer levels of an n x n map than the one of `edge` x `edge`.
fn texels_before(edge: u32) -> u32 {
    return 4u * (params.field.size * params.field.size - edge * edge) / 3u;
}

fn least_distance(slot: u32, level: u32, square: vec2<u32>) -> f32 {
    let n = params.field.size;
    let edge = n >> level;
    return bounds[slot * (texels_before(1u) + 1u) + texels_before(edge) + square.y * edge + square.x];
}

fn ray_at(ray: LocalRay, t: f32) -> vec3<f32> {
    return ray.o + ray.d * t;
}

// Greatest distance from the probe between two places.
fn farthest(ray: LocalRay, t: vec2<f32>) -> f32 {
    let a = ray_at(ray, t.x);
    let b = ray_at(ray, t.y);
    return sqrt(max(dot(a, a), dot(b, b)));
}

fn line_t(line: Line, share: f32) -> f32 {
    let a = share * line.weight.x;
    let b = (1.0 - share) * line.weight.y;
    return line.t.x + (line.t.y - line.t.x) * clamp(a / (a + b), 0.0, 1.0);
}

fn leave(line: Line, share: f32, level: u32) -> Leave {
    let side = f32(1u << level);
    let last = f32((params.field.size >> level) - 1u);
    let towards = vec2(sign_of(line.along.x), sign_of(line.along.y));
    // Just past a border it is in the square that it goes to.
    let at = line.start + line.along * share + towards * 1e-4;
    let square = clamp(floor(at / side), vec2(0.0), vec2(last));
    let border = (square + select(vec2(0.0), vec2(1.0), line.along > vec2(0.0))) * side;
    var exit = 1.0;
    for (var axis = 0u; axis < 2u; axis++) {
        if line.along[axis] != 0.0 {
            exit = min(exit, (border[axis] - line.start[axis]) / line.along[axis]);
        }
    }
    let least = share + 1e-5 / max(max(abs(line.along.x), abs(line.along.y)), 1e-3);
    return Leave(vec2<u32>(square), min(max(exit, least), 1.0));
}

// A ray within one texel, against the texel's plane.
fn meet_texel(ray: LocalRay, t: vec2<f32>, i: u32) -> March {
    let n = params.field.size;
    let texel = surfels[ray.slot * n * n + i];
    let depth = bitcast<f32>(texel.x);
    if depth >= FAR {
        return March(FREE, 0.0);
    }
    let d = texel_middle(i, n);
    var normal = unpack_direction(texel.y);
    var height = -dot(normal, d) * depth;
    if -dot(normal, d) <= LEAST_COS {
        normal = -d;
        height = depth;
    }
    let above = dot(normal, ray_at(ray, t.x)) + height;
    let then = dot(normal, ray_at(ray, t.y)) + height;
    let meets = dot(normal, ray.d) < 0.0;
    if above > 0.0 {
        if meets && then <= 0.0 {
            return March(HIT, t.x + (t.y - t.x) * min(above / (above - then), 1.0));
        }
        return March(FREE, 0.0);
    }
    let slack = params.field.thickness * (sqrt(4.0 * PI) / f32(n)) * depth;
    if above >= -slack {
        return March(select(FREE, HIT, meets && t.x >= slack), t.x);
    }
    return March(HIDDEN, t.x);
}

fn follow_line(ray: LocalRay, line: Line) -> March {
    let n = params.field.size;
    let is_hi_z = params.field.search == HI_Z;
    let top = select(min(COARSE, level_count()), max(level_count(), SECOND_TOP) - SECOND_TOP, is_hi_z);
    // Each texel and each square is entered once, and left by a step; rounding may repeat some.
    let most = 16u * n + 64u;
    var share = 0.0;
    var level = top;
    for (var turn = 0u; turn < most; turn++) {
        let out = leave(line, share, level);
        let t = vec2(line_t(line, share), line_t(line, out.exit));
        if farthest(ray, t) >= least_distance(ray.slot, level, out.square) {
            if level > 0u {
                level = select(0u, level - 1u, is_hi_z);
                continue;
            }
            let found = meet_texel(ray, t, out.square.y * n + out.square.x);
            if found.kind != FREE {
                return found;
            }
        }
        if out.exit >= 1.0 {
            return March(FREE, 0.0);
        }
        share = out.exit;
        if is_hi_z {
            level = min(level + 1u, top);
        } else if any(leave(line, share, top).square != out.square >> vec2(top - level)) {
            // Up again where the coarse square is left.
            level = top;
        }
    }
    return March(HIDDEN, line_t(line, share));
}

// Follows a ray from `t.x` to `t.y`, both finite.
fn march(ray: LocalRay, t: vec2<f32>) -> March {
    // Where it changes its octant, in order; the end stands for those that are elsewhere.
    var cut = vec3(t.y);
    for (var axis = 0u; axis < 3u; axis++) {
        let at = -ray.o[axis] / ray.d[axis];
        if ray.d[axis] != 0.0 && at > t.x && at < t.y {
            cut[axis] = at;
        }
    }
    let low = min(cut.x, min(cut.y, cut.z));
    let high = max3(cut);
    let middle = max(min(cut.x, cut.y), min(max(cut.x, cut.y), cut.z));
    let cuts = array(t.x, low, middle, high, t.y);
    let size = f32(params.field.size);
    for (var k = 0u; k < 4u; k++) {
        let ends = vec2(cuts[k], cuts[k + 1u]);
        let a = ray_at(ray, ends.x);
        let b = ray_at(ray, ends.y);
        let signs = signs_of(a + b);
        let weight = vec2(dot(a, signs), dot(b, signs));
        // No longer than rounding.
        if !(ends.y > ends.x) || weight.x <= 0.0 || weight.y <= 0.0 {
            continue;
        }
        let start = clamp((within_octant(a, signs) * 0.5 + 0.5) * size, vec2(0.0), vec2(size));
        let end = clamp((within_octant(b, signs) * 0.5 + 0.5) * size, vec2(0.0), vec2(size));
        let found = follow_line(ray, Line(ends, start, end - start, weight));
        if found.kind != FREE {
            return found;
        }
    }
    return March(FREE, 0.0);
}
