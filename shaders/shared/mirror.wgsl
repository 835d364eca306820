// Perfect mirror rays: what a surface would reflect if it were a mirror (§4.1, §5). Twin: src/view/mirror.rs.

// #include "shared/traverse.wgsl"
// #include "shared/view.wgsl"

// The shading normal of a surface, turned to the side of the viewer at direction `wo`; the geometric one where that turns away from the
// viewer all the same. Twin: material::Surface::facing_normal.
fn facing_normal(s: Surface, wo: vec3<f32>) -> vec3<f32> {
    let ng = select(s.ng, -s.ng, dot(s.ng, wo) < 0.0);
    let n = select(s.frame.n, -s.frame.n, dot(s.frame.n, ng) < 0.0);
    return select(ng, n, dot(n, wo) > 0.0);
}

// Unit direction in which a surface, as a mirror, sends the view from direction `wo` on. Twin: view::mirror::mirror_direction.
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

