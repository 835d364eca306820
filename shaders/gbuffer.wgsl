// The G-buffer of a novel view: one ray through each pixel's centre (§5). Twin: src/render/gbuffer.rs. Follows mirror.wgsl.

// Struct: gpu::render::gbuffer::Params.
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

@group(0) @binding(0) var<storage, read> params: Params;
// Three a triangle; NONE for those that are planes to a mirror ray.
@group(0) @binding(1) var<storage, read> curved_vertices: array<u32>;
@group(0) @binding(2) var<storage, read> curvatures: array<VertexCurvature>;
// The planes of a view: see view.wgsl.
@group(0) @binding(3) var<storage, read_write> out_hits: array<Hit>;
@group(0) @binding(4) var<storage, read_write> out_positions: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> out_normals: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> out_curvatures: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> out_materials: array<u32>;
@group(0) @binding(8) var<storage, read_write> out_emission: array<vec4<f32>>;

// What `view_factors` reads besides, and writes: hits and glossy materials are those of mirror.wgsl.
@group(0) @binding(3) var<storage, read_write> out_diffuse: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> out_albedos: array<vec4<f32>>;

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
    if curved_vertices[3u * s.triangle] == NONE {
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

// Alpha of the glossy lobe that a view has; negative where it has none.
fn view_alpha(s: Surface, is_front: bool) -> f32 {
    let m = materials[s.material];
    if (m.lobes & NON_DIFFUSE) != 0u && (is_front || (m.flags & TWO_SIDED_FLAG) != 0u) {
        return bsdf_alpha(s);
    }
    return -1.0;
}

@compute @workgroup_size(8, 8)
fn gbuffer(@builtin(global_invocation_id) id: vec3<u32>) {
    let camera = params.camera;
    if id.x >= camera.width || id.y >= camera.height {
        return;
    }
    let i = id.y * camera.width + id.x;
    let ray = camera_ray(camera, vec2<f32>(id.xy) + 0.5, vec2(0.5));
    let hit = traverse(ray, false);
    out_hits[i] = hit;
    if hit.triangle == NO_TRIANGLE {
        out_positions[i] = vec4(0.0);
        out_normals[i] = vec4(0.0);
        out_curvatures[i] = vec4(0.0);
        out_materials[i] = NOT_GLOSSY;
        out_emission[i] = vec4(environment(ray.direction), 0.0);
        return;
    }
    let s = surface_at(hit);
    let wo = -ray.direction;
    let is_front = dot(s.frame.n, wo) > 0.0;
    let n = facing_normal(s, wo);
    let alpha = view_alpha(s, is_front);
    out_positions[i] = vec4(s.p, alpha);
    out_normals[i] = vec4(n, s.t);
    out_curvatures[i] = curvature_at(s, n);
    out_materials[i] = select(s.material, NOT_GLOSSY, alpha < 0.0);
    var emission = vec3(0.0);
    if s.emitter != NONE && is_front {
        emission = emitted(s);
    }
    out_emission[i] = vec4(emission, 0.0);
}

// What the view from direction `wi` (local) sees of both lobes.
struct Factors {
    // Radiance of the diffuse lobe, by the light map. Twin: lightmap::LightMap::diffuse_radiance.
    diffuse: vec3<f32>,
    // Directional albedo of the glossy lobes; 0 where the scale of their roughness is negative.
    albedo: vec3<f32>,
}

fn factors_of(s: Surface, wi: vec3<f32>, roughness_scale: f32) -> Factors {
    let root = materials[s.material].model;
    var sum = Factors(vec3(0.0), vec3(0.0));
    var u = 0.0;
    for (var k = 0u; k < models[root].leaves; k++) {
        let leaf = leaf_at(root, s, wi, k, &u, ALL_LOBES);
        if leaf.share > 0.0 {
            sum.diffuse += leaf.share * leaf_diffuse_out(leaf);
            if roughness_scale >= 0.0 {
                sum.albedo += leaf.share * leaf_glossy_albedo(leaf.model, leaf.wi, Query(NON_DIFFUSE, roughness_scale));
            }
        }
    }
    if scene.light_width > 0u && any(sum.diffuse != vec3(0.0)) {
        sum.diffuse *= lightmap_lookup(s.triangle, s.barycentric, wi.z < 0.0) * FRAC_1_PI;
    } else {
        sum.diffuse = vec3(0.0);
    }
    return sum;
}

// Light that the diffuse lobe sends to the camera, and the glossy lobe's directional albedo. Twin: render::gather::view_albedo.
@compute @workgroup_size(8, 8)
fn view_factors(@builtin(global_invocation_id) id: vec3<u32>) {
    let camera = params.camera;
    if id.x >= camera.width || id.y >= camera.height {
        return;
    }
    let i = id.y * camera.width + id.x;
    var factors = Factors(vec3(0.0), vec3(0.0));
    if hits[i].triangle != NO_TRIANGLE {
        let ray = camera_ray(camera, vec2<f32>(id.xy) + 0.5, vec2(0.5));
        let s = surface_at(hits[i]);
        let wants_albedo = glossy_materials[i] != NOT_GLOSSY;
        factors = factors_of(s, to_local(s.frame, -ray.direction), select(-1.0, params.roughness_scale, wants_albedo));
    }
    out_diffuse[i] = vec4(factors.diffuse, 0.0);
    out_albedos[i] = vec4(factors.albedo, 0.0);
}
