// Closest and any hits in a compressed eight-wide BVH (Ylitie, Karras and Laine 2017) of 80-byte nodes, and the watertight triangle test
// (Woop, Benthin and Wald 2013) in the same steps as on the CPU. Twin: src/transport/bvh/.
//
// A group is what is left to visit of one node: x is the index of its first child node or primitive; y has a bit a child that
// was hit, nearest child highest: inner children in the upper 8 bits, with the mask of all inner children in the lower 8, or
// primitives in the lower 24.

// #include "shared/random.wgsl"
// #include "shared/texture.wgsl"
// #include "shared/surface.wgsl"

// Twin: gpu::scene::STACK.
const STACK: u32 = 32u;
// Twin: transport::bvh::SHEET.
const SHEET: f32 = 16.0 * 1500.0 * EPSILON;

// Whether any material lets rays through: scenes without masks do not pay for them.
override HAS_MASKS: bool = true;

struct Shear {
    axes: vec3<u32>,
    origin: vec3<f32>,
    shear: vec3<f32>,
}

// Twin: transport::bvh::triangle::Shear.
fn shear_of(ray: Ray) -> Shear {
    let d = abs(ray.direction);
    var z = 2u;
    if d.x > d.y && d.x > d.z {
        z = 0u;
    } else if d.y > d.z {
        z = 1u;
    }
    let axes = vec3((z + 1u) % 3u, (z + 2u) % 3u, z);
    let inv = 1.0 / ray.direction[z];
    let origin = vec3(ray.origin[axes.x], ray.origin[axes.y], ray.origin[axes.z]);
    return Shear(axes, origin, vec3(ray.direction[axes.x] * inv, ray.direction[axes.y] * inv, inv));
}

fn sheared(s: Shear, corner: vec3<f32>) -> vec3<f32> {
    let p = vec3(corner[s.axes.x], corner[s.axes.y], corner[s.axes.z]) - s.origin;
    return vec3(p.x - s.shear.x * p.z, p.y - s.shear.y * p.z, p.z);
}

// The primitive's hit where it comes before `best`: nearer, or at the same distance and of lower index.
fn nearer(s: Shear, ray: Ray, primitive: u32, best: Hit) -> Hit {
    let at = scene.corners + 3u * primitive;
    let first = tree[at];
    let second = tree[at + 1u];
    let third = tree[at + 2u];
    let triangle = first.w;
    let a = sheared(s, bitcast<vec3<f32>>(first.xyz));
    let b = sheared(s, bitcast<vec3<f32>>(second.xyz));
    let c = sheared(s, bitcast<vec3<f32>>(third.xyz));
    let e = vec3(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    let det = e.x + e.y + e.z;
    if !(all(e >= vec3(0.0)) || all(e <= vec3(0.0))) || det == 0.0 {
        return best;
    }
    let w = e * (1.0 / det);
    let t = (w.x * a.z + w.y * b.z + w.z * c.z) * s.shear.z;
    if t < ray.t_min || !(t < best.t || (t == best.t && triangle < best.triangle)) {
        return best;
    }
    let hit = Hit(t, triangle, w.y, w.z);
    if HAS_MASKS {
        if second.w != NONE && passes(ray, hit, material_u32(second.w, MATERIAL_OPACITY), third.w) {
            return best;
        }
    }
    return hit;
}

// Whether `ray` goes through a triangle of partly opaque material. Twin: transport::bvh::passes.
fn passes(ray: Ray, hit: Hit, opacity: u32, object: u32) -> bool {
    let o = bitcast<vec3<u32>>(ray.origin);
    let d = bitcast<vec3<u32>>(ray.direction);
    var h = hash_next(hash_next(hash_next(hash_start(), o.x), o.y), o.z);
    h = hash_next(hash_next(hash_next(h, d.x), d.y), d.z);
    let of_ray = hash_end(h);
    let interval = floor(hit.t / (SHEET * (1.0 + max3(abs(ray.origin)))) + unit(of_ray));
    h = hash_next(hash_next(hash_next(hash_start(), of_ray), object), bitcast<u32>(interval));
    return unit(hash_end(h)) >= texture_scalar(opacity, facet_uv(facet(hit.triangle), hit.u, hit.v));
}

fn byte(words: vec2<u32>, i: u32) -> u32 {
    return (words[i >> 2u] >> ((i & 3u) * 8u)) & 0xffu;
}

// Bits of the node's children whose boxes the ray meets before `t_max`.
fn children_hit(node: u32, ray: Ray, inverse: vec3<f32>, octant: u32, t_max: f32) -> u32 {
    let head = tree[node];
    let metas = tree[node + 1u].zw;
    let q0 = tree[node + 2u];
    let q1 = tree[node + 3u];
    let q2 = tree[node + 4u];
    let exponents = vec3(head.w & 0xffu, (head.w >> 8u) & 0xffu, (head.w >> 16u) & 0xffu);
    let scale = bitcast<vec3<f32>>(exponents << vec3(23u)) * inverse;
    let offset = (bitcast<vec3<f32>>(head.xyz) - ray.origin) * inverse;
    var hits = 0u;
    for (var i = 0u; i < 8u; i++) {
        let m = byte(metas, i);
        let low = vec3<f32>(vec3(byte(q0.xy, i), byte(q1.xy, i), byte(q2.xy, i))) * scale + offset;
        let high = vec3<f32>(vec3(byte(q0.zw, i), byte(q1.zw, i), byte(q2.zw, i))) * scale + offset;
        let lower = min(low, high);
        let upper = max(low, high);
        let enter = max(max(lower.x, lower.y), max(lower.z, ray.t_min));
        let leave = min(min(upper.x, upper.y), min(upper.z, t_max));
        if enter <= leave {
            // Empty slots have no bits.
            let is_inner = (m & 0x18u) == 0x18u;
            let place = select(m & 31u, (m ^ octant) & 31u, is_inner);
            hits |= (m >> 5u) << place;
        }
    }
    return hits;
}

// The closest hit; with `any`, the first that is found. Empty where t_max is below t_min.
fn traverse(ray: Ray, any: bool) -> Hit {
    return traverse_both(ray, any, scene.added);
}

// The same in the scene's own tree and in the one whose root is `added`, if that is not NONE.
fn traverse_both(ray: Ray, any: bool, added: u32) -> Hit {
    var best = Hit(ray.t_max, NO_TRIANGLE, 0.0, 0.0);
    let s = shear_of(ray);
    // Small enough to be no direction at all, large enough that its inverse times a scene stays a number.
    let least = vec3(1e-20);
    let d = select(ray.direction, select(least, -least, ray.direction < vec3(0.0)), abs(ray.direction) < least);
    let inverse = 1.0 / d;
    let octant = 7u - (select(0u, 4u, d.x < 0.0) | select(0u, 2u, d.y < 0.0) | select(0u, 1u, d.z < 0.0));
    var stack: array<vec2<u32>, STACK>;
    var height = 0u;
    if added != NONE {
        // Lowest in the stack: its turn is when the scene's own tree is done.
        stack[0] = vec2(added, 0x80000000u);
        height = 1u;
    }
    var inner = vec2(0u, 0x80000000u);
    loop {
        var primitives = vec2(0u, 0u);
        if inner.y > 0x00ffffffu {
            let bit = firstLeadingBit(inner.y);
            let group = inner;
            inner.y &= ~(1u << bit);
            if inner.y > 0x00ffffffu && height < STACK {
                stack[height] = inner;
                height++;
            }
            let slot = (bit - 24u) ^ octant;
            let child = group.x + countOneBits(group.y & ~(0xffffffffu << slot));
            let node = 5u * child;
            let hits = children_hit(node, ray, inverse, octant, best.t);
            let bases = tree[node + 1u].xy;
            inner = vec2(bases.x, (hits & 0xff000000u) | (tree[node].w >> 24u));
            primitives = vec2(bases.y, hits & 0x00ffffffu);
        }
        while primitives.y != 0u {
            let bit = firstTrailingBit(primitives.y);
            primitives.y &= primitives.y - 1u;
            best = nearer(s, ray, primitives.x + bit, best);
        }
        if any && best.triangle != NO_TRIANGLE {
            break;
        }
        if inner.y <= 0x00ffffffu {
            if height == 0u {
                break;
            }
            height--;
            inner = stack[height];
        }
    }
    return best;
}
