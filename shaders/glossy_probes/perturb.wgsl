// Where a reflector shows a point to another eye: specular path perturbation (§5.1). Twin: method::glossy_probes::perturb, which has the derivation.
//

// #include "shared/math.wgsl"

struct PerturbParams {
    order: u32,
    exact_plane: u32,
    second_order_limit: f32,
    min_focus: f32,
    newton: u32,
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

const ORDER_PLANE: u32 = 0u;
const ORDER_FIRST: u32 = 1u;
const ORDER_SECOND: u32 = 2u;
const MIN_COS: f32 = 1e-3;
const MAX_STEP: f32 = 0.5;
const MIN_DISTANCE: f32 = 1e-4;

// Principal curvatures, and the direction of the first.
struct Curvature {
    k: vec2<f32>,
    d1: vec3<f32>,
}

// A plane's entry: principal curvatures, and the first one's direction in the tangents of frame_from_normal.
fn curvature_of(n: vec3<f32>, entry: vec4<f32>) -> Curvature {
    let frame = frame_from_normal(n);
    return Curvature(entry.xy, frame.s * entry.z + frame.t * entry.w);
}

// A mirror path p-x-q, ready to be moved to other eyes; what follows the frame is in its coordinates.
struct Perturbation {
    frame: Frame,
    x: vec3<f32>,
    p: vec3<f32>,
    e: vec3<f32>,
    inv_rp: f32,
    inv_rq: f32,
    k: vec2<f32>,
    g_inverse: mat2x2<f32>,
}

// G, the second derivative of the path's length.
fn path_hessian(e: vec3<f32>, c: f32, k: vec2<f32>) -> mat2x2<f32> {
    let bend = 2.0 * e.z * k;
    return mat2x2(c * (1.0 - e.x * e.x) + bend.x, -c * e.x * e.y, -c * e.x * e.y, c * (1.0 - e.y * e.y) + bend.y);
}

fn inverse_of(m: mat2x2<f32>) -> mat2x2<f32> {
    return mat2x2(m[1].y, -m[0].y, -m[1].x, m[0].x) * (1.0 / determinant(m));
}

fn perturbation(
    p: vec3<f32>, x: vec3<f32>, n: vec3<f32>, reflected_distance: f32, curvature: Curvature, params: PerturbParams,
) -> Perturbation {
    let frame = frame_from_normal_and_tangent(n, curvature.d1);
    var e = to_local(frame, normalize_or(p - x, n));
    if !(e.z >= MIN_COS) {
        e = normalize_or(vec3(e.xy, MIN_COS), vec3(0.0, 0.0, 1.0));
    }
    let inv_rp = 1.0 / max(distance(p, x), MIN_DISTANCE);
    let inv_rq = select(1.0 / max(reflected_distance, MIN_DISTANCE), 0.0, reflected_distance >= FAR);
    var k = select(curvature.k, vec2(0.0), params.order == ORDER_PLANE);
    let c = inv_rp + inv_rq;
    var g = path_hessian(e, c, k);
    let g_plane = path_hessian(e, c, vec2(0.0));
    let focus = abs(determinant(g)) / determinant(g_plane);
    if !(focus >= params.min_focus && is_finite(focus)) {
        k = vec2(0.0);
        g = g_plane;
    }
    return Perturbation(frame, x, p, e, inv_rp, inv_rq, k, inverse_of(g));
}

// J dp in the tangents.
fn first_order(path: Perturbation, dp: vec3<f32>) -> vec2<f32> {
    let moved = path.inv_rp * (dp - path.e * dot(path.e, dp));
    return path.g_inverse * moved.xy;
}

// One end's share of the second derivative: e and inv_r are its direction and inverse distance, v how it moves.
fn end_term(path: Perturbation, u: vec2<f32>, e: vec3<f32>, v: vec3<f32>, inv_r: f32) -> vec2<f32> {
    let bend = path.k * u;
    let along = dot(e, v);
    let pv = inv_r * (v - e * along);
    return inv_r * (2.0 * along * pv.xy + dot(v, pv) * e.xy) - 2.0 * pv.z * bend + dot(u, bend) * inv_r * e.z * e.xy;
}

// [dp]^T H [dp] in the tangents, u being J dp.
fn second_order(path: Perturbation, dp: vec3<f32>, u: vec2<f32>) -> vec2<f32> {
    let s = vec3(u, 0.0);
    let e_q = vec3(-path.e.xy, path.e.z);
    let sum = end_term(path, u, path.e, s - dp, path.inv_rp) + end_term(path, u, e_q, s, path.inv_rq);
    return -(path.g_inverse * sum);
}

// The point of least |F| among `start` and the Newton steps from it, for the eye at `p` (local).
fn newton(path: Perturbation, start: vec2<f32>, p: vec3<f32>, steps: u32) -> vec2<f32> {
    let to_q = vec3(-path.e.xy, path.e.z);
    let farthest = MAX_STEP / max(abs(path.k.x), abs(path.k.y));
    var u = start;
    var best = start;
    var least = FAR;
    for (var step = 0u; step <= steps; step++) {
        let bend = path.k * u;
        let s = vec3(u, -0.5 * dot(u, bend));
        let s1 = vec3(1.0, 0.0, -bend.x);
        let s2 = vec3(0.0, 1.0, -bend.y);
        var slope = vec2(0.0);
        // Upper triangle of the Hessian.
        var h = vec3(0.0);
        for (var end = 0; end < 2; end++) {
            let a = select(to_q - s * path.inv_rq, p - s, end == 0);
            let inv_length = 1.0 / max(length(a), MIN_DISTANCE);
            let e = a * inv_length;
            let inv_r = select(path.inv_rq, 1.0, end == 0) * inv_length;
            let along = vec2(dot(e, s1), dot(e, s2));
            slope -= along;
            h.x += (dot(s1, s1) - along.x * along.x) * inv_r + path.k.x * e.z;
            h.y += (dot(s1, s2) - along.x * along.y) * inv_r;
            h.z += (dot(s2, s2) - along.y * along.y) * inv_r + path.k.y * e.z;
        }
        let size = dot(slope, slope) / (1.0 + dot(bend, bend));
        if size < least {
            best = u;
            least = size;
        }
        let du = vec2(h.z * slope.x - h.y * slope.y, h.x * slope.y - h.y * slope.x) / (h.x * h.z - h.y * h.y);
        if step == steps || !(is_finite(du.x) && is_finite(du.y)) {
            break;
        }
        let limit = farthest + 0.5 * length(u);
        u -= du * min(1.0, limit / max(length(du), 1e-30));
    }
    return best;
}

// x': where the reflector shows q to the eye at p.
fn reflection_point(path: Perturbation, p: vec3<f32>, params: PerturbParams) -> vec3<f32> {
    let dp = to_local(path.frame, p - path.p);
    let first = first_order(path, dp);
    // The plane's J dp, and by how much the eye's way to the plane and on to q's image grows.
    let whole = path.inv_rp + path.inv_rq;
    let plane_first = (dp.xy - path.e.xy * (dp.z / path.e.z)) * (path.inv_rp / whole);
    let rise = max(dp.z / path.e.z, -(1.0 - 1e-3) / path.inv_rp) * (path.inv_rp * path.inv_rq / whole);
    let exact_plane = params.exact_plane != 0u;
    var u = select(first, first - plane_first + plane_first / (1.0 + rise), exact_plane);
    if params.order == ORDER_SECOND {
        let second = 0.5 * second_order(path, dp, first);
        let rest = select(second, second + plane_first * rise, exact_plane);
        let limit = params.second_order_limit * length(first);
        let size = length(rest);
        u += select(rest, rest * (limit / max(size, 1e-30)), size > limit);
    }
    if !(is_finite(u.x) && is_finite(u.y)) {
        u = vec2(0.0);
    }
    if params.newton > 0u && any(path.k != vec2(0.0)) {
        u = newton(path, u, to_local(path.frame, p - path.x), params.newton);
    }
    let height = -0.5 * (path.k.x * u.x * u.x + path.k.y * u.y * u.y);
    return path.x + to_world(path.frame, vec3(u, height));
}
