// Twin of src/method/glossy_probes/coverage.rs: covered_pixels.
// Antialiasing by coverage: more rays where an edge runs across a pixel.

// #include "shared/camera_ray.wgsl"
// #include "shared/factors.wgsl"
// #include "shared/lights.wgsl"
// #include "shared/mirror.wgsl"
// #include "shared/layer_pixel.wgsl"

struct CoverageParams {
    // At the frame's size.
    camera: Camera,
    // Sub-pixels of the view along a pixel's side, and rays.
    sub_pixels: u32,
    rays: u32,
    // Whether the colours lack what perfect mirrors show: see mirror_light.wgsl.
    mirrors: u32,
    padding: u32,
}

const MIN_NORMAL_COS: f32 = 0.9;
const DEPTH_TOLERANCE: f32 = 0.02;
const SHARP_ALPHA: f32 = 0.05;
const REFLECTED_TOLERANCE: f32 = 0.05;
// Twin: view::mirror_light::PERFECT.
const PERFECT_RAYS: u32 = 16u;
const GOLDEN_RATIO: f32 = 0.618034;

// The kernel begins with a copy: see scene.wgsl.
@group(0) @binding(0) var<uniform> coverage_params: CoverageParams;
var<private> coverage: CoverageParams;
@group(0) @binding(1) var<storage, read> view: array<Pixel>;
// The filtered colours.
@group(0) @binding(2) var<storage, read> view_glossy: array<vec4<f32>>;
// The frame's layers.
@group(0) @binding(3) var<storage, read_write> frame: array<LayerPixel>;

// What decides whether two rays see the same.
struct Shown {
    p: vec3<f32>,
    normal: vec3<f32>,
    depth: f32,
    // Negative without a glossy lobe.
    alpha: f32,
    // NONE where nothing is seen.
    material: u32,
}

fn seen_at(i: u32) -> Shown {
    let triangle = view[i].triangle;
    var material = NONE;
    if triangle != NO_TRIANGLE {
        material = facets[7u * triangle + 6u].y;
    }
    return Shown(view[i].p, view[i].n, view[i].depth, view[i].alpha, material);
}

fn same_surface(a: Shown, b: Shown) -> bool {
    return a.material == b.material && dot(a.normal, b.normal) > MIN_NORMAL_COS
        && abs(dot(a.normal, b.p - a.p)) < DEPTH_TOLERANCE * a.depth;
}

fn same_reflected(at: Shown, a: Reflected, b: Reflected) -> bool {
    let reach = select(distance(a.point, at.p) + at.depth, 1.0, a.material == SKY);
    return a.material == b.material && distance(a.point, b.point) < REFLECTED_TOLERANCE * reach;
}

fn is_sharp(s: Shown) -> bool {
    return s.alpha >= 0.0 && s.alpha <= SHARP_ALPHA;
}

// First and last sub-pixel, each way, of a pixel and those around it.
fn window(pixel: vec2<u32>) -> vec4<u32> {
    let n = coverage.sub_pixels;
    let size = vec2(coverage.camera.width, coverage.camera.height) * n;
    let low = max(pixel * n, vec2(1u)) - 1u;
    return vec4(low, min((pixel + 1u) * n, size - 1u));
}

fn has_edge(w: vec4<u32>, width: u32) -> bool {
    let first = w.y * width + w.x;
    let a = seen_at(first);
    let sharp = is_sharp(a);
    for (var y = w.y; y <= w.w; y++) {
        for (var x = w.x; x <= w.z; x++) {
            let i = y * width + x;
            let b = seen_at(i);
            let both_see_nothing = a.material == NONE && b.material == NONE;
            let same = i == first || both_see_nothing
                || (same_surface(a, b) && (!sharp || same_reflected(a, view[first].reflected, view[i].reflected)));
            if !same {
                return true;
            }
        }
    }
    return false;
}

// The glossy radiance of what a ray at `at` (sub-pixels) sees: that of the sub-pixels that show the same, the nearest most.
fn glossy_of(w: vec4<u32>, width: u32, seen: Shown, mirrored: Reflected, at: vec2<f32>) -> vec3<f32> {
    // Same surface and reflection; same surface; whatever is nearest.
    var all: array<vec4<f32>, 3>;
    for (var y = w.y; y <= w.w; y++) {
        for (var x = w.x; x <= w.z; x++) {
            let i = y * width + x;
            let other = seen_at(i);
            if other.material == NONE || other.alpha < 0.0 {
                continue;
            }
            let d = vec2(f32(x), f32(y)) + 0.5 - at;
            let weighted = vec4(view_glossy[i].rgb, 1.0) * (1.0 / (dot(d, d) + 0.1));
            let surface = same_surface(seen, other);
            let reflection = surface && (!is_sharp(seen) || same_reflected(seen, mirrored, view[i].reflected));
            all[0] += select(vec4(0.0), weighted, reflection);
            all[1] += select(vec4(0.0), weighted, surface);
            all[2] += weighted;
        }
    }
    var best = select(all[1], all[0], all[0].w > 0.0);
    best = select(all[2], best, best.w > 0.0);
    return select(vec3(0.0), best.rgb / best.w, best.w > 0.0);
}

// Point k of n in the unit square.
fn lattice_point(k: u32, n: u32) -> vec2<f32> {
    return vec2((f32(k) + 0.5) / f32(n), fract(f32(k) * GOLDEN_RATIO + 0.5));
}

@compute @workgroup_size(8, 8)
fn cover(@builtin(global_invocation_id) id: vec3<u32>) {
    coverage = coverage_params;
    scene = scene_params;
    let camera = coverage.camera;
    if id.x >= camera.width || id.y >= camera.height {
        return;
    }
    let width = camera.width * coverage.sub_pixels;
    let w = window(id.xy);
    if !has_edge(w, width) {
        return;
    }
    var emission = vec3(0.0);
    var diffuse = vec3(0.0);
    var glossy = vec3(0.0);
    let rays = coverage.rays;
    for (var k = 0u; k < rays * rays; k++) {
        let at = vec2<f32>(id.xy) + lattice_point(k, rays * rays);
        var ray = camera_ray(camera, at, vec2(0.5));
        var seen: Shown;
        var is_glossy = false;
        var is_lit_mirror = false;
        var mirrored = Reflected(vec3(0.0), NOTHING);
        var throughput = vec3(1.0);
        // The camera's ray, and what follows from mirror to mirror.
        for (var bounce = 0u; bounce <= PERFECT_RAYS; bounce++) {
            let hit = traverse(ray, false);
            if hit.triangle == NO_TRIANGLE {
                let light = throughput * environment(ray.direction);
                emission += select(vec3(0.0), light, bounce == 0u);
                glossy += select(vec3(0.0), light, bounce > 0u && is_lit_mirror);
                if bounce == 1u {
                    mirrored = Reflected(ray.direction, SKY);
                }
                break;
            }
            if bounce == 1u {
                mirrored = reflected_at(hit);
            }
            if bounce > 0u && !is_lit_mirror {
                break;
            }
            let s = surface_at(hit);
            let wo = -ray.direction;
            let wi = to_local(s.frame, wo);
            let alpha = view_alpha(s, wi.z > 0.0);
            let is_perfect = coverage.mirrors != 0u && alpha == 0.0;
            let factors = factors_of(s, wi, select(-1.0, 1.0, is_perfect));
            var light = factors.diffuse;
            if s.emitter != NONE && wi.z > 0.0 {
                let own = emitted(s);
                emission += select(vec3(0.0), own, bounce == 0u);
                light += select(own, vec3(0.0), bounce == 0u);
            }
            if bounce == 0u {
                diffuse += light;
                seen = Shown(s.p, facing_normal(s, wo), s.t, alpha, s.material);
                is_glossy = alpha >= 0.0;
                is_lit_mirror = is_perfect;
            } else {
                glossy += throughput * light;
            }
            if !select(is_perfect, is_sharp(seen), bounce == 0u) {
                break;
            }
            throughput *= factors.albedo;
            ray = spawn(s, mirror_direction(s, wo));
        }
        if is_glossy {
            glossy += glossy_of(w, width, seen, mirrored, at * f32(coverage.sub_pixels));
        }
    }
    let scale = 1.0 / f32(rays * rays);
    let out = id.y * camera.width + id.x;
    let shown = max(glossy * scale, vec3(0.0));
    frame[out] = LayerPixel(vec4(emission * scale, 0.0), vec4(diffuse * scale, 0.0), vec4(shown, 0.0));
}
