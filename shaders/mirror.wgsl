// Perfect mirror rays: what a surface would reflect if it were a mirror (§4.1, §5). Twin: src/render/mirror.rs.

@group(0) @binding(0) var<storage, read> camera: Camera;
@group(0) @binding(1) var<storage, read> hits: array<Hit>;
@group(0) @binding(2) var<storage, read> glossy_materials: array<u32>;
@group(0) @binding(3) var<storage, read_write> out_reflected: array<Reflected>;

// The shading normal of a surface, turned to the side of the viewer at direction `wo`; the geometric one where that turns away from the
// viewer all the same. Twin: render::mirror::facing_normal.
fn facing_normal(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    let ng = select(s.ng, -s.ng, dot(s.ng, wo) < 0.0);
    let n = select(s.frame.n, -s.frame.n, dot(s.frame.n, ng) < 0.0);
    return select(ng, n, dot(n, wo) > 0.0);
}

// Unit direction in which a surface, as a mirror, sends the view from direction `wo` on. Twin: render::mirror::mirror_direction.
fn mirror_direction(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    let ng = select(s.ng, -s.ng, dot(s.ng, wo) < 0.0);
    var d = mirror(wo, facing_normal(s, wo));
    if dot(d, ng) <= 0.0 {
        // The interpolated normal bends the ray into the surface.
        d = mirror(wo, ng);
    }
    return normalize_or(d, ng);
}

// What a mirror ray meets.
fn reflected_at(hit: Hit) -> Reflected {
    let f = facet(hit.triangle);
    let point = f.corners[0] * (1.0 - hit.u - hit.v) + f.corners[1] * hit.u + f.corners[2] * hit.v;
    return Reflected(point, f.material);
}

// Traces the mirror ray of a surface for a viewer at direction `wo`.
fn mirror_hit(s: Surface, wo: vec3<f32>) -> Reflected {
    let d = mirror_direction(s, wo);
    let hit = traverse(spawn(s, d), false);
    if hit.triangle == NO_TRIANGLE {
        return Reflected(d, SKY);
    }
    return reflected_at(hit);
}

@compute @workgroup_size(8, 8)
fn mirror_pass(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= camera.width || id.y >= camera.height {
        return;
    }
    let i = id.y * camera.width + id.x;
    var reflected = Reflected(vec3(0.0), NOTHING);
    if glossy_materials[i] != NOT_GLOSSY {
        let ray = camera_ray(camera, vec2<f32>(id.xy) + 0.5, vec2(0.5));
        reflected = mirror_hit(surface_at(hits[i]), -ray.direction);
    }
    out_reflected[i] = reflected;
}
