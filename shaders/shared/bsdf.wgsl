// Scattering models as trees: two-sided, bump- and normal-mapped, blended. Twins: src/material/bsdf/{mod,twosided,bump,blend}.rs.
//
// A shader cannot recurse. All that a tree does to its leaves is to turn their directions and to weight their values, so each query is a sum
// over the leaves of that side, and a leaf is found by walking down from the root. At most one frame above a leaf may be tilted.

// #include "shared/surface.wgsl"
// #include "shared/principled.wgsl"

// Whether paths read diffuse light from a light map.
override HAS_LIGHTMAP: bool = false;

// A leaf as the viewer meets it; its textures are in `values`.
struct Leaf {
    model: u32,
    // Axes of its frame in the surface's shading frame.
    axes: Frame,
    // The viewer in that frame.
    wi: vec3<f32>,
    // Its weight in the blends above it, and the probability with which sampling reaches it: negative where there is no such leaf.
    share: f32,
    chance: f32,
    // Squared alpha of the shadowing over a tilted frame, negative where none is tilted; and the normal's side above it.
    steepness: f32,
    side: f32,
    // No blend above it keeps the diffuse lobe from being a product.
    factors: bool,
}

// The `number`th leaf below a model; with NONE, one that `u` chooses, of which it leaves the rest.
fn leaf_at(root: u32, s: Surface, wi: vec3<f32>, number: u32, u: ptr<function, f32>, lobes: u32) -> Leaf {
    var axes = Frame(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), UP);
    var leaf = Leaf(root, axes, wi, 1.0, 1.0, -1.0, 1.0, true);
    var left = number;
    while model_u32(leaf.model, MODEL_KIND) >= TWO_SIDED {
        let m = leaf.model;
        let kind = model_u32(m, MODEL_KIND);
        if kind == TWO_SIDED {
            if leaf.wi.z <= 0.0 {
                leaf.wi.z = -leaf.wi.z;
                leaf.axes.n = -leaf.axes.n;
                leaf.side = select(leaf.side, -leaf.side, leaf.steepness < 0.0);
                leaf.model = model_u32(m, MODEL_SECOND);
            } else {
                leaf.model = model_u32(m, MODEL_FIRST);
            }
            continue;
        }
        let value = texture_eval(model_u32(m, MODEL_TEXTURES), s.uv);
        if kind == BLEND {
            let share = clamp(luminance(value), 0.0, 1.0);
            let p = blend_probability(m, share, lobes);
            let first = model_u32(model_u32(m, MODEL_FIRST), MODEL_LEAVES);
            let in_second = select(left >= first, *u < p, number == NONE);
            *u = select(*u, select((*u - p) / (1.0 - p), *u / p, in_second), number == NONE);
            left = select(left, left - first, in_second && number != NONE);
            leaf.factors = leaf.factors && model_u32(m, MODEL_OPTION) != NONE;
            leaf.share *= select(1.0 - share, share, in_second);
            leaf.chance *= select(1.0 - p, p, in_second);
            leaf.model = select(model_u32(m, MODEL_FIRST), model_u32(m, MODEL_SECOND), in_second);
        } else {
            let tilt = tilt_of(tilted_normal(m, s, value), leaf.wi);
            leaf.steepness = steepness_of(tilt.n);
            leaf.axes = Frame(to_world(leaf.axes, tilt.s), to_world(leaf.axes, tilt.t), to_world(leaf.axes, tilt.n));
            leaf.wi = to_local(tilt, leaf.wi);
            leaf.model = model_u32(m, MODEL_FIRST);
        }
    }
    if left > 0u && number != NONE {
        leaf.share = 0.0;
        leaf.chance = -1.0;
    }
    look_up(leaf.model, s.uv);
    return leaf;
}

fn blend_probability(m: u32, share: f32, lobes: u32) -> f32 {
    let first = (model_u32(model_u32(m, MODEL_FIRST), MODEL_LOBES) & lobes) != 0u;
    let second = (model_u32(model_u32(m, MODEL_SECOND), MODEL_LOBES) & lobes) != 0u;
    return select(select(0.0, 1.0, second), share, first == second);
}

// The tilted frame about `normal`, in the frame above it, as a viewer at `wi` sees it.
fn tilt_of(normal: vec3<f32>, wi: vec3<f32>) -> Frame {
    let n = select(normal, vec3(-normal.xy, normal.z), wi.z * dot(wi, normal) <= 0.0);
    return frame_from_normal_and_tangent(normalize_or(n, UP), vec3(1.0, 0.0, 0.0));
}

// Share of the light from `wo`, in the surface's frame, that the terminator of a tilted frame lets pass. Signs of `wo` do not matter to
// it, so the frames in between do not either.
fn leaf_lit(leaf: Leaf, wo: vec3<f32>) -> f32 {
    if leaf.steepness < 0.0 {
        return 1.0;
    }
    let together = dot(leaf.axes.n, wo) * wo.z * leaf.side > 0.0;
    return select(0.0, tilt_shadowing(leaf.steepness, wo), together);
}

// Squared alpha of the shadowing over bumps as rough as the tilt is steep.
fn steepness_of(n: vec3<f32>) -> f32 {
    return min(0.125 * dot(n.xy, n.xy) / (n.z * n.z), 1.0);
}

fn tilt_shadowing(steepness: f32, wo: vec3<f32>) -> f32 {
    let cosine = abs(wo.z);
    return 2.0 * cosine / (cosine + sqrt(cosine * cosine + steepness * dot(wo.xy, wo.xy)));
}

// The normal of a bump or normal map whose texture says `value`, in the surface's shading frame, of any length.
fn tilted_normal(m: u32, s: Surface, value: vec3<f32>) -> vec3<f32> {
    if model_u32(m, MODEL_KIND) == NORMAL_MAP {
        return value * 2.0 - 1.0;
    }
    let slope = model_f32(m, MODEL_A) * height_gradient(model_u32(m, MODEL_TEXTURES), s.uv);
    let n = s.frame.n;
    let du = s.dp_du + n * (slope.x - dot(n, s.dp_du));
    let dv = s.dp_dv + n * (slope.y - dot(n, s.dp_dv));
    let tilted = cross(du, dv);
    return to_local(s.frame, select(tilted, -tilted, dot(s.ng, tilted) < 0.0));
}

// Change of a texture's luminance with u and v.
fn height_gradient(t: u32, uv: vec2<f32>) -> vec2<f32> {
    let at = texture_uv(t, uv);
    if texture_u32(t, TEXTURE_KIND) != BITMAP || texture_u32(t, TEXTURE_NEAREST) != 0u || !(is_finite(at.x) && is_finite(at.y)) {
        return vec2(0.0);
    }
    let size = vec2(f32(texture_image(t).width), f32(texture_image(t).height));
    let p = clamp(at * size - 0.5, vec2(-1e9), vec2(1e9));
    let low = floor(p);
    let f = p - low;
    var h: array<f32, 4>;
    for (var k = 0; k < 4; k++) {
        h[k] = texture_f32(t, TEXTURE_SCALE) * luminance(bitmap_texel(t, i32(low.x) + (k & 1), i32(low.y) + (k >> 1)));
    }
    let g = vec2(mix(h[1] - h[0], h[3] - h[2], f.y), mix(h[2] - h[0], h[3] - h[1], f.x));
    return (texture_vec3(t, TEXTURE_TO_U).xy * g.x + texture_vec3(t, TEXTURE_TO_V).xy * g.y) * size;
}

fn leaf_eval_pdf(m: u32, wi: vec3<f32>, wo: vec3<f32>, query: Query) -> Scatter {
    switch model_u32(m, MODEL_KIND) {
        case DIFFUSE_MODEL: { return diffuse_eval_pdf(wi, wo, query); }
        case PLASTIC, ROUGH_PLASTIC: { return plastic_eval_pdf(m, wi, wo, query); }
        case ROUGH_CONDUCTOR: { return conductor_eval_pdf(m, wi, wo, query); }
        case ROUGH_DIELECTRIC: { return dielectric_eval_pdf(m, wi, wo, query); }
        case PRINCIPLED: { return principled_eval_pdf(m, wi, wo, query); }
        default: { return NO_SCATTER; }
    }
}

fn leaf_sample(m: u32, wi: vec3<f32>, u: f32, v: vec2<f32>, query: Query) -> Sample {
    switch model_u32(m, MODEL_KIND) {
        case DIFFUSE_MODEL: { return diffuse_sample(wi, v, query); }
        case PLASTIC, ROUGH_PLASTIC: { return plastic_sample(m, wi, u, v, query); }
        case CONDUCTOR, ROUGH_CONDUCTOR: { return conductor_sample(m, wi, v, query); }
        case DIELECTRIC, THIN_DIELECTRIC, ROUGH_DIELECTRIC: { return dielectric_sample(m, wi, u, v, query); }
        default: { return principled_sample(m, wi, u, v, query); }
    }
}

// All that a vertex of a path asks of its material at once.
struct Scattered {
    // Value and density towards a light.
    light: Scatter,
    // A sampled direction, in the surface's frame; a pdf of 0 says that the path ends.
    sample: Sample,
    // The view's factor of the diffuse lobe.
    diffuse_out: vec3<f32>,
}

// For the view from `wi`: towards `wl`, and a direction drawn with `choice` and `v`.
fn scatter(s: Surface, wi: vec3<f32>, wl: vec3<f32>, choice: f32, v: vec2<f32>, query: Query) -> Scattered {
    let root = material_u32(s.material, MATERIAL_MODEL);
    let count = model_u32(root, MODEL_LEAVES);
    var sum = Scattered(NO_SCATTER, NO_SAMPLE, vec3(0.0));
    var drawn = NO_SCATTER;
    var u = choice;
    // First the leaf that is drawn from, then, where there are several, each in turn for the values.
    for (var turn = 0u; turn <= count; turn++) {
        let leaf = leaf_at(root, s, wi, turn - 1u, &u, query.lobes);
        if leaf.chance < 0.0 {
            continue;
        }
        if turn == 0u {
            var sample = leaf_sample(leaf.model, leaf.wi, u, v, query);
            sample.wo = to_world(leaf.axes, normalize_or(sample.wo, vec3(0.0)));
            if sample.delta {
                sample.weight *= leaf_lit(leaf, sample.wo) * leaf.share / leaf.chance;
                sample.pdf *= leaf.chance;
            }
            sum.sample = sample;
            if count > 1u {
                continue;
            }
        }
        for (var k = 0u; k < 2u; k++) {
            let is_light = k == 0u;
            let wo = select(sum.sample.wo, wl, is_light);
            let lit = leaf_lit(leaf, wo);
            if lit > 0.0 && (is_light || (sum.sample.pdf > 0.0 && !sum.sample.delta)) {
                let e = leaf_eval_pdf(leaf.model, leaf.wi, to_local(leaf.axes, wo), query);
                let value = e.value * (leaf.share * lit);
                let pdf = e.pdf * leaf.chance;
                sum.light = Scatter(sum.light.value + select(vec3(0.0), value, is_light), sum.light.pdf + select(0.0, pdf, is_light));
                drawn = Scatter(drawn.value + select(value, vec3(0.0), is_light), drawn.pdf + select(pdf, 0.0, is_light));
            }
        }
        if HAS_LIGHTMAP {
            sum.diffuse_out += leaf.share * leaf_diffuse_out(leaf);
        }
        if count == 1u {
            break;
        }
    }
    if !sum.sample.delta && sum.sample.pdf > 0.0 {
        sum.sample.pdf = drawn.pdf;
        sum.sample.weight = drawn.value / drawn.pdf;
    }
    if !(sum.sample.pdf > 0.0 && is_finite(sum.sample.pdf) && all_finite(sum.sample.weight)) {
        sum.sample = NO_SAMPLE;
    }
    return sum;
}

// The light's factor of the diffuse lobe.
fn bsdf_diffuse_in(s: Surface, towards_light: vec3<f32>) -> f32 {
    var m = material_u32(s.material, MATERIAL_MODEL);
    var wo = towards_light;
    var factor = 1.0;
    while model_u32(m, MODEL_KIND) >= TWO_SIDED {
        let kind = model_u32(m, MODEL_KIND);
        if kind == TWO_SIDED {
            m = select(model_u32(m, MODEL_SECOND), model_u32(m, MODEL_FIRST), wo.z > 0.0);
            wo.z = abs(wo.z);
        } else if kind == BLEND {
            let only = model_u32(m, MODEL_OPTION);
            if only == NONE {
                return factor * select(0.0, 1.0, wo.z > 0.0 || model_u32(m, MODEL_DISTRIBUTION) != 0u);
            }
            m = select(model_u32(m, MODEL_SECOND), model_u32(m, MODEL_FIRST), only == 0u);
        } else {
            let value = texture_eval(model_u32(m, MODEL_TEXTURES), s.uv);
            let tilt = tilt_of(tilted_normal(m, s, value), vec3(0.0, 0.0, sign_of(wo.z)));
            let light = to_local(tilt, wo);
            if light.z * wo.z <= 0.0 {
                return 0.0;
            }
            factor *= tilt_shadowing(steepness_of(tilt.n), wo) * (light.z / wo.z);
            wo = light;
            m = model_u32(m, MODEL_FIRST);
        }
    }
    if wo.z <= 0.0 {
        return 0.0;
    }
    switch model_u32(m, MODEL_KIND) {
        case DIFFUSE_MODEL, PRINCIPLED: { return factor; }
        case PLASTIC, ROUGH_PLASTIC: { return factor * plastic_transmitted(m, wo); }
        default: { return 0.0; }
    }
}

// Directional albedo of the diffuse lobe.
fn bsdf_diffuse_albedo(s: Surface, wi: vec3<f32>) -> vec3<f32> {
    return diffuse_of_leaves(s, wi, false);
}

// The view's factor of the diffuse lobe.
fn bsdf_diffuse_out(s: Surface, wi: vec3<f32>) -> vec3<f32> {
    return diffuse_of_leaves(s, wi, true);
}

fn diffuse_of_leaves(s: Surface, wi: vec3<f32>, factors: bool) -> vec3<f32> {
    let root = material_u32(s.material, MATERIAL_MODEL);
    var sum = vec3(0.0);
    var u = 0.0;
    for (var i = 0u; i < model_u32(root, MODEL_LEAVES); i++) {
        var leaf = leaf_at(root, s, wi, i, &u, ALL_LOBES);
        if leaf.share > 0.0 {
            leaf.factors = leaf.factors && factors;
            sum += leaf.share * leaf_diffuse_out(leaf);
        }
    }
    return sum;
}

// The leaf's part of it, or where the lobe is no product the directional albedo.
fn leaf_diffuse_out(leaf: Leaf) -> vec3<f32> {
    let m = leaf.model;
    if leaf.wi.z <= 0.0 {
        return vec3(0.0);
    }
    switch model_u32(m, MODEL_KIND) {
        case DIFFUSE_MODEL: { return values[0]; }
        case PLASTIC, ROUGH_PLASTIC: {
            let out = plastic_base(m) * plastic_transmitted(m, leaf.wi);
            // The mean of the light's factor over the hemisphere.
            let rest = select(model_f32(m, MODEL_B), 1.0 - fresnel_diffuse(model_f32(m, MODEL_ETA)), model_u32(m, MODEL_KIND) == PLASTIC);
            return out * select(rest, 1.0, leaf.factors);
        }
        case PRINCIPLED: { return principled_diffuse_albedo(m, leaf.wi); }
        default: { return vec3(0.0); }
    }
}
