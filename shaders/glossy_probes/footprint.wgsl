// Twin of src/method/glossy_probes/footprint/mod.rs: covariance.
// Sigma_I of every pixel (§6.1, Eq. 3): what the probes' reduced roughness lacks, pixels². The twin has the derivation.

// #include "shared/camera.wgsl"
// #include "shared/view.wgsl"
// #include "glossy_probes/perturb.wgsl"

struct Params {
    camera: Camera,
    roughness_scale: f32,
    small_d_r: f32,
    foreshortening: u32,
    padding: u32,
}

const FORESHORTENING_NONE: u32 = 0u;
const FORESHORTENING_PAPER: u32 = 1u;
const FORESHORTENING_DERIVED: u32 = 2u;
const FORESHORTENING_CURVED: u32 = 3u;

const BINS: u32 = 32u;
const MAX_ALPHA: f32 = 0.5;
const DISTANCES: vec2<f32> = vec2(0.01, 10.0);
const MIN_SLANT: f32 = 0.02;
const MIN_FOCUS: f32 = 0.25;

// The kernel begins with a copy: see scene.wgsl.
@group(0) @binding(0) var<uniform> footprint_params: Params;
var<private> params: Params;
// Standard deviations at focal length 1; alpha outermost, then d_c, then d_r.
@group(0) @binding(1) var<storage, read> table: array<f32>;
@group(0) @binding(2) var<storage, read> view: array<Pixel>;
@group(0) @binding(3) var<storage, read> shading: array<Shading>;
@group(0) @binding(4) var<storage, read_write> covariances: array<vec4<f32>>;

// A cell of one of the table's axes in x, and the place within it.
fn place(t: f32) -> vec2<f32> {
    let f = clamp(t, 0.0, 1.0) * f32(BINS - 1u);
    let i = min(floor(f), f32(BINS - 2u));
    return vec2(i, f - i);
}

fn place_of_distance(d: f32) -> vec2<f32> {
    let t = (max(d, DISTANCES.x) - DISTANCES.x) / (DISTANCES.y - DISTANCES.x);
    return place(pow(min(t, 1.0), 1.0 / 3.0));
}

// Standard deviation of the footprint of a plane seen along its normal, at focal length 1.
fn sigma(alpha: f32, d_c: f32, d_r: f32) -> f32 {
    let a = place(sqrt(max(alpha, 0.0) / MAX_ALPHA));
    let c = place_of_distance(d_c);
    let r = place_of_distance(d_r);
    let corner = (u32(a.x) * BINS + u32(c.x)) * BINS + u32(r.x);
    var faces: array<f32, 2>;
    for (var i = 0u; i < 2u; i++) {
        let row = corner + i * BINS * BINS;
        let near = table[row] + (table[row + 1u] - table[row]) * r.y;
        let far = table[row + BINS] + (table[row + BINS + 1u] - table[row + BINS]) * r.y;
        faces[i] = near + (far - near) * c.y;
    }
    return faces[0] + (faces[1] - faces[0]) * a.y;
}

// How far a step v at a point moves in the image, pixels; `at` is the point, both in the camera's axes.
fn pixels_of(at: vec3<f32>, v: vec3<f32>) -> vec2<f32> {
    return (at.xy * v.z / at.z - v.xy) * (params.camera.focal_px / at.z);
}

// Image of a unit tilt of the half vector along each principal direction, pixels.
fn tilt_to_pixels(x: vec3<f32>, n: vec3<f32>, d_r: f32, curvature: Curvature) -> mat2x2<f32> {
    let frame = frame_from_normal_and_tangent(n, curvature.d1);
    let to_eye = params.camera.position - x;
    var e = to_local(frame, normalize_or(to_eye, n));
    if e.z < MIN_SLANT {
        e = normalize_or(vec3(e.xy, MIN_SLANT), vec3(0.0, 0.0, 1.0));
    }
    let c = 1.0 / max(length(to_eye), DISTANCES.x) + 1.0 / max(d_r, DISTANCES.x);
    let plane = path_hessian(e, c, vec2(0.0));
    var g = plane;
    if params.foreshortening == FORESHORTENING_CURVED {
        let curved = path_hessian(e, c, curvature.k);
        let focus = determinant(curved) / determinant(plane);
        if abs(focus) > MIN_FOCUS && is_finite(focus) {
            g = curved;
        }
    }
    let step = inverse_of(g) * (2.0 * e.z);
    let at = camera_local(params.camera, -to_eye);
    let first = pixels_of(at, camera_local(params.camera, to_world(frame, vec3(step[0], 0.0))));
    let second = pixels_of(at, camera_local(params.camera, to_world(frame, vec3(step[1], 0.0))));
    return mat2x2(first, second);
}

fn covariance(x: vec3<f32>, n: vec3<f32>, d_r: f32, alpha: f32, curvature: Curvature) -> vec3<f32> {
    let camera = params.camera;
    let to_eye = camera.position - x;
    let d_c = length(to_eye);
    let full = sigma(alpha, d_c, d_r);
    let baked = sigma(alpha * params.roughness_scale, d_c, d_r);
    var variance = full * full - baked * baked;
    if params.small_d_r > 0.0 {
        variance *= min(d_r, params.small_d_r) / params.small_d_r;
    }
    if !(variance > 0.0 && is_finite(variance)) {
        return vec3(0.0);
    }
    var columns = mat2x2(camera.focal_px, 0.0, 0.0, camera.focal_px);
    if params.foreshortening == FORESHORTENING_PAPER {
        let facing = clamp(dot(to_eye, n) / d_c, 0.0, 1.0);
        let along = -normalize_or(vec3(camera_local(camera, n).xy, 0.0), vec3(-1.0, 0.0, 0.0)).xy;
        columns = mat2x2(along * (camera.focal_px * sqrt(facing)), vec2(-along.y, along.x) * camera.focal_px);
    } else if params.foreshortening != FORESHORTENING_NONE {
        // Undo the table's geometry at the distances it was read at.
        let unit = 0.5 * (1.0 + clamp(d_c, DISTANCES.x, DISTANCES.y) / clamp(d_r, DISTANCES.x, DISTANCES.y));
        columns = tilt_to_pixels(x, n, d_r, curvature) * unit;
    }
    let out = variance * vec3(
        columns[0].x * columns[0].x + columns[1].x * columns[1].x,
        columns[0].x * columns[0].y + columns[1].x * columns[1].y,
        columns[0].y * columns[0].y + columns[1].y * columns[1].y,
    );
    return select(vec3(0.0), out, all_finite(out));
}

@compute @workgroup_size(16, 4)
fn footprint(@builtin(global_invocation_id) id: vec3<u32>) {
    params = footprint_params;
    if id.x >= params.camera.width || id.y >= params.camera.height {
        return;
    }
    let i = id.y * params.camera.width + id.x;
    var out = vec3(0.0);
    if view[i].material != NOT_GLOSSY {
        let x = view[i].p;
        let n = view[i].n;
        let d_r = distance_from(view[i].reflected, x);
        out = covariance(x, n, d_r, view[i].alpha, curvature_of(n, shading[i].curvature));
    }
    covariances[i] = vec4(out, 0.0);
}
