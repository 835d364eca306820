// Small geometry that every kernel shares. Twin: src/base/math.rs.

const PI: f32 = 3.14159265358979;
const TAU: f32 = 6.28318530717959;
const FRAC_1_PI: f32 = 0.318309886183791;
// Stands for infinity, which a shader may not count on: the largest number.
const FAR: f32 = 3.4028235e38;
// Half an ulp of 1.
const EPSILON: f32 = 5.9604645e-8;
const MIN_POSITIVE: f32 = 1.17549435e-38;

struct Frame {
    s: vec3<f32>,
    t: vec3<f32>,
    n: vec3<f32>,
}

fn luminance(c: vec3<f32>) -> f32 {
    return dot(c, vec3(0.212639, 0.715169, 0.072192));
}

// Shaders may take it for granted that no number is infinite, so the bits are asked.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn all_finite(v: vec3<f32>) -> bool {
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

fn normalize_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let inverse = 1.0 / length(v);
    return select(other, v * inverse, is_finite(inverse) && inverse > 0.0);
}

// 1 with the sign of `x`.
fn sign_of(x: f32) -> f32 {
    return select(1.0, -1.0, (bitcast<u32>(x) & 0x80000000u) != 0u);
}

fn max3(v: vec3<f32>) -> f32 {
    return max(v.x, max(v.y, v.z));
}

fn frame_from_normal(n: vec3<f32>) -> Frame {
    let s = sign_of(n.z);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return Frame(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

fn frame_from_normal_and_tangent(n: vec3<f32>, tangent: vec3<f32>) -> Frame {
    let across = tangent - n * dot(n, tangent);
    let inverse = 1.0 / length(across);
    if is_finite(inverse) && inverse > 0.0 {
        let s = across * inverse;
        return Frame(s, cross(n, s), n);
    }
    return frame_from_normal(n);
}

fn to_local(f: Frame, v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(f.s, v), dot(f.t, v), dot(f.n, v));
}

fn to_world(f: Frame, v: vec3<f32>) -> vec3<f32> {
    return f.s * v.x + f.t * v.y + f.n * v.z;
}

// Mirror direction of `w` about the unit normal `n`, both pointing away from the surface.
fn mirror(w: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    return n * (2.0 * dot(n, w)) - w;
}

fn direction_from_lat_long(uv: vec2<f32>) -> vec3<f32> {
    let phi = uv.x * TAU;
    let theta = uv.y * PI;
    return vec3(sin(phi) * sin(theta), cos(theta), -cos(phi) * sin(theta));
}

// atan2 to 2e-7, where a driver's may be off by 4096 ulp: a tenth of a texel of a probe. A polynomial of least relative error up to
// tan(pi / 8), beyond it by the addition theorem.
fn angle_of(y: f32, x: f32) -> f32 {
    let a = abs(x);
    let b = abs(y);
    let ratio = min(a, b) / max(max(a, b), MIN_POSITIVE);
    let turned = ratio > 0.41421356;
    let t = select(ratio, (ratio - 1.0) / (ratio + 1.0), turned);
    let z = t * t;
    let series = t + t * z * (-0.33332955 + z * (0.19977926 + z * (-0.13879849 + z * 0.08060305)));
    var angle = series + select(0.0, 0.25 * PI, turned);
    angle = select(angle, 0.5 * PI - angle, b > a);
    angle = select(angle, PI - angle, sign_of(x) < 0.0);
    return sign_of(y) * angle;
}

fn lat_long_from_direction(d: vec3<f32>) -> vec2<f32> {
    var u = angle_of(d.x, -d.z) / TAU;
    u = select(u, u + 1.0, u < 0.0);
    let y = clamp(d.y, -1.0, 1.0);
    return vec2(select(u, 0.0, u >= 1.0), angle_of(sqrt((1.0 - y) * (1.0 + y)), y) / PI);
}

// Unit direction of the larger eigenvalue of [[x, y], [y, z]], and both.
struct Eigen {
    axis: vec2<f32>,
    major: f32,
    minor: f32,
}

fn eigen(c: vec3<f32>) -> Eigen {
    let mean = 0.5 * (c.x + c.z);
    let v = vec2(0.5 * (c.x - c.z), c.y);
    let most = max(abs(v.x), abs(v.y));
    if most == 0.0 {
        return Eigen(vec2(1.0, 0.0), mean, mean);
    }
    // Half of the angle of v, without its sine and cosine.
    let size = length(v / most);
    let d = v / most / size;
    let larger = sqrt(0.5 * (1.0 + abs(d.x)));
    let smaller = 0.5 * abs(d.y) / larger;
    let side = sign_of(d.y);
    let axis = select(vec2(smaller, side * larger), vec2(larger, side * smaller), d.x >= 0.0);
    return Eigen(axis, mean + most * size, mean - most * size);
}
