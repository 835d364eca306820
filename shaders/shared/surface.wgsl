// The differential geometry of a hit. Twin: src/transport/facet.rs.

// #include "shared/math.wgsl"
// #include "shared/scene.wgsl"

const NO_TRIANGLE: u32 = 0xffffffffu;

struct Ray {
    origin: vec3<f32>,
    t_min: f32,
    direction: vec3<f32>,
    t_max: f32,
}

struct Hit {
    t: f32,
    triangle: u32,
    u: f32,
    v: f32,
}

struct Surface {
    p: vec3<f32>,
    ng: vec3<f32>,
    frame: Frame,
    uv: vec2<f32>,
    dp_du: vec3<f32>,
    dp_dv: vec3<f32>,
    t: f32,
    triangle: u32,
    barycentric: vec2<f32>,
    object: u32,
    material: u32,
    // NONE where it does not shine.
    emitter: u32,
    offset: f32,
}

// What a triangle's seven vectors hold: corners, normals and texture coordinates, one after the other, then object, material, emitter
// plus 1, and the largest coordinate, which is negative where there are no texture coordinates.
struct Facet {
    corners: array<vec3<f32>, 3>,
    normals: array<vec3<f32>, 3>,
    uvs: array<vec2<f32>, 3>,
    object: u32,
    material: u32,
    emitter: u32,
    extent: f32,
}

const OFFSET_ULPS: vec2<f32> = vec2(256.0, 32.0);
const SHADOW_GAP: f32 = 3e-4;

fn facet(triangle: u32) -> Facet {
    let at = 7u * triangle;
    let a = bitcast<vec4<f32>>(facets[at]);
    let b = bitcast<vec4<f32>>(facets[at + 1u]);
    let c = bitcast<vec4<f32>>(facets[at + 2u]);
    let d = bitcast<vec4<f32>>(facets[at + 3u]);
    let e = bitcast<vec4<f32>>(facets[at + 4u]);
    let f = bitcast<vec4<f32>>(facets[at + 5u]);
    let g = facets[at + 6u];
    return Facet(
        array(a.xyz, vec3(a.w, b.xy), vec3(b.zw, c.x)),
        array(c.yzw, d.xyz, vec3(d.w, e.xy)),
        array(e.zw, f.xy, f.zw),
        g.x,
        g.y,
        g.z,
        bitcast<f32>(g.w),
    );
}

fn facet_uv(f: Facet, u: f32, v: f32) -> vec2<f32> {
    if f.extent < 0.0 {
        return vec2(u, v);
    }
    return f.uvs[0] * (1.0 - u - v) + f.uvs[1] * u + f.uvs[2] * v;
}

// Scaled first: products of tiny edges would vanish.
fn unit_normal(f: Facet) -> vec3<f32> {
    let e = f.corners[1] - f.corners[0];
    let g = f.corners[2] - f.corners[0];
    let scale = max3(max(abs(e), abs(g)));
    return normalize_or(cross(e / scale, g / scale), vec3(0.0, 0.0, 1.0));
}

// A hit at a distance that nobody asks for.
fn hit_of(triangle: u32, u: f32, v: f32) -> Hit {
    return Hit(0.0, triangle, u, v);
}

fn surface_at(hit: Hit) -> Surface {
    let f = facet(hit.triangle);
    let w = 1.0 - hit.u - hit.v;
    let p = f.corners[0] * w + f.corners[1] * hit.u + f.corners[2] * hit.v;
    let ng = unit_normal(f);
    let n = normalize_or(f.normals[0] * w + f.normals[1] * hit.u + f.normals[2] * hit.v, ng);
    let any = frame_from_normal(ng);
    var dp_du = any.s;
    var dp_dv = any.t;
    if f.extent >= 0.0 {
        let e = f.corners[1] - f.corners[0];
        let g = f.corners[2] - f.corners[0];
        let de = f.uvs[1] - f.uvs[0];
        let dg = f.uvs[2] - f.uvs[0];
        let inverse = 1.0 / (de.x * dg.y - de.y * dg.x);
        if is_finite(inverse) {
            dp_du = (e * dg.y - g * de.y) * inverse;
            dp_dv = (g * de.x - e * dg.x) * inverse;
        }
    }
    let far = max(OFFSET_ULPS.x * max3(abs(p)), OFFSET_ULPS.y * abs(f.extent));
    return Surface(
        p,
        ng,
        frame_from_normal_and_tangent(n, dp_du),
        facet_uv(f, hit.u, hit.v),
        dp_du,
        dp_dv,
        hit.t,
        hit.triangle,
        vec2(hit.u, hit.v),
        f.object,
        f.material,
        select(f.emitter - 1u, NONE, f.emitter == 0u),
        EPSILON * far,
    );
}

fn origin_towards(s: Surface, d: vec3<f32>) -> vec3<f32> {
    return s.p + s.ng * (s.offset * sign_of(dot(s.ng, d)));
}

// A ray that leaves along the unit direction `d` and does not meet its own surface again.
fn spawn(s: Surface, d: vec3<f32>) -> Ray {
    return Ray(origin_towards(s, d), 0.0, d, FAR);
}

// A ray from here to `to` that ends just before it.
fn spawn_to(s: Surface, to: vec3<f32>) -> Ray {
    let o = origin_towards(s, to - s.p);
    let far = distance(o, to);
    let gap = far * SHADOW_GAP + EPSILON * OFFSET_ULPS.x * max3(abs(to));
    return Ray(o, 0.0, (to - o) / max(far, MIN_POSITIVE), far - gap);
}
