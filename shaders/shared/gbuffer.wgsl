// Twin of src/view/gbuffer.rs: gbuffer.
// The G-buffer of a novel view: one ray through each pixel's centre (§5).

// #include "shared/camera_ray.wgsl"
// #include "shared/factors.wgsl"
// #include "shared/lights.wgsl"
// #include "shared/mirror.wgsl"

struct Params {
    camera: Camera,
    // Of the probes; negative where nobody asks for the view's albedo.
    roughness_scale: f32,
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

// The curvature of a vertex, without the alignment of vec3.
struct VertexCurvature {
    k1: f32,
    k2: f32,
    d1: array<f32, 3>,
}

@group(0) @binding(0) var<uniform> params: Params;
// Three a triangle; NONE for those that are planes to a mirror ray.
@group(0) @binding(1) var<storage, read> curved_vertices: array<u32>;
@group(0) @binding(2) var<storage, read> curvatures: array<VertexCurvature>;
@group(0) @binding(3) var<storage, read_write> view: array<Pixel>;
@group(0) @binding(4) var<storage, read_write> shading: array<Shading>;

// [xx, xy, yy] of a vertex' curvature in the tangents of `frame`. Twin: surface::paraboloid::Curvature::tensor.
fn curvature_tensor(c: VertexCurvature, frame: Frame) -> vec3<f32> {
    let d1 = vec3(c.d1[0], c.d1[1], c.d1[2]);
    let along = normalize_or(vec3(dot(d1, frame.s), dot(d1, frame.t), 0.0), vec3(1.0, 0.0, 0.0)).xy;
    let squares = along * along;
    return vec3(
        c.k1 * squares.x + c.k2 * squares.y,
        (c.k1 - c.k2) * along.x * along.y,
        c.k1 * squares.y + c.k2 * squares.x,
    );
}

// A plane's entry at a point of a triangle, relative to the unit normal `n` there. Twin: surface::CurvatureMap::at.
fn curvature_at(s: Surface, n: vec3<f32>) -> vec4<f32> {
    if is_added(s.triangle) || curved_vertices[3u * s.triangle] == NONE {
        return vec4(0.0, 0.0, 1.0, 0.0);
    }
    let frame = frame_from_normal(n);
    let f = facet(s.triangle);
    let weights = vec3(1.0 - s.barycentric.x - s.barycentric.y, s.barycentric);
    var sum = vec3(0.0);
    var side = 0.0;
    for (var i = 0u; i < 3u; i++) {
        sum += curvature_tensor(curvatures[curved_vertices[3u * s.triangle + i]], frame) * weights[i];
        side += dot(f.normals[i], n) * weights[i];
    }
    let e = eigen(select(sum, -sum, side < 0.0));
    return vec4(e.major, e.minor, e.axis);
}

@compute @workgroup_size(8, 8)
fn gbuffer(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let camera = params.camera;
    if id.x >= camera.width || id.y >= camera.height {
        return;
    }
    let i = id.y * camera.width + id.x;
    let ray = camera_ray(camera, vec2<f32>(id.xy) + 0.5, vec2(0.5));
    let hit = traverse(ray, false);
    let nothing = Reflected(vec3(0.0), NOTHING);
    if hit.triangle == NO_TRIANGLE {
        view[i] = Pixel(vec3(0.0), 0.0, vec3(0.0), 0.0, nothing, NOT_GLOSSY, NO_TRIANGLE, 0.0, 0.0);
        shading[i].curvature = vec4(0.0);
        shading[i].emission = environment(ray.direction);
        return;
    }
    let s = surface_at(hit);
    let wo = -ray.direction;
    let is_front = dot(s.frame.n, wo) > 0.0;
    let n = facing_normal(s, wo);
    let alpha = view_alpha(s, is_front);
    let material = select(s.material, NOT_GLOSSY, alpha < 0.0);
    view[i] = Pixel(s.p, alpha, n, s.t, nothing, material, hit.triangle, hit.u, hit.v);
    shading[i].curvature = curvature_at(s, n);
    var emission = vec3(0.0);
    if s.emitter != NONE && is_front {
        emission = emitted(s);
    }
    shading[i].emission = emission;
}
