// Twin of src/view/denoise.rs: guides.
// Guides of the denoiser, one camera ray of each pixel at a time.

// #include "shared/camera_ray.wgsl"
// #include "shared/albedo.wgsl"
// #include "shared/mirror.wgsl"
// #include "path_trace/guide.wgsl"

struct GuideParams {
    camera: Camera,
    seed: u32,
    frame: u32,
    // Which of a pixel's rays, and how many.
    index: u32,
    count: u32,
    mirror_alpha: f32,
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

const ENVIRONMENT_DEPTH: f32 = 1e4;

@group(0) @binding(0) var<uniform> guide_params: GuideParams;
// Sums; after the last ray the means.
@group(0) @binding(1) var<storage, read_write> diffuse_guides: array<Guide>;
@group(0) @binding(2) var<storage, read_write> glossy_guides: array<Guide>;

fn guide_of(normal: vec3<f32>, depth: f32, albedo: vec3<f32>) -> Guide {
    return Guide(normal, depth, albedo, 0u, albedo, 0u);
}

fn added(sum: Guide, more: Guide) -> Guide {
    var total = more;
    if guide_params.index > 0u {
        total = Guide(sum.normal + more.normal, sum.depth + more.depth, sum.albedo + more.albedo, 0u, sum.factor + more.factor, 0u);
    }
    if guide_params.index + 1u == guide_params.count {
        let f = 1.0 / f32(guide_params.count);
        total = Guide(total.normal * f, total.depth * f, total.albedo * f, 0u, total.factor * f, 0u);
    }
    return total;
}

struct Albedos {
    diffuse: vec3<f32>,
    glossy: vec3<f32>,
}

// Directional albedos towards `wi`, at the material's own roughness.
fn albedos_of(s: Surface, wi: vec3<f32>) -> Albedos {
    let root = material_u32(s.material, MATERIAL_MODEL);
    var sum = Albedos(vec3(0.0), vec3(0.0));
    var u = 0.0;
    for (var k = 0u; k < model_u32(root, MODEL_LEAVES); k++) {
        var leaf = leaf_at(root, s, wi, k, &u, ALL_LOBES);
        if leaf.share > 0.0 {
            // The albedo, whether the lobe is a product or not.
            leaf.factors = false;
            sum.diffuse += leaf.share * leaf_diffuse_out(leaf);
            sum.glossy += leaf.share * leaf_glossy_albedo(leaf.model, leaf.wi, Query(NON_DIFFUSE, 1.0));
        }
    }
    return sum;
}

// Whether the glossy layer shows a mirror image there.
fn is_mirror(s: Surface) -> bool {
    if (material_u32(s.material, MATERIAL_LOBES) & NON_DIFFUSE) == 0u || (material_u32(s.material, MATERIAL_FLAGS) & TRANSMISSIVE) != 0u {
        return false;
    }
    let alpha = bsdf_alpha(s);
    return alpha >= 0.0 && alpha <= guide_params.mirror_alpha;
}

@compute @workgroup_size(8, 8)
fn add_guides(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let camera = guide_params.camera;
    if id.x >= camera.width || id.y >= camera.height {
        return;
    }
    let i = id.y * camera.width + id.x;
    let stream = hash3(guide_params.seed, guide_params.frame, i);
    var s = sampler_new(stream, guide_params.index);
    let p = next_4d(&s);
    var ray = camera_ray(camera, vec2<f32>(id.xy) + p.xy, p.zw);
    var diffuse = guide_of(vec3(0.0), ENVIRONMENT_DEPTH, vec3(0.0));
    var glossy = diffuse;
    // The surface seen, then what it shows as a mirror.
    for (var k = 0u; k < 2u; k++) {
        let hit = traverse(ray, false);
        if hit.triangle == NO_TRIANGLE {
            glossy = guide_of(vec3(0.0), ENVIRONMENT_DEPTH, glossy.albedo);
            break;
        }
        let surface = surface_at(hit);
        let wo = -ray.direction;
        let albedos = albedos_of(surface, to_local(surface.frame, wo));
        let normal = facing_normal(surface, wo);
        if k == 1u {
            glossy = guide_of(normal, glossy.depth + surface.t, (albedos.diffuse + albedos.glossy) * glossy.albedo);
            break;
        }
        diffuse = guide_of(normal, surface.t, albedos.diffuse);
        glossy = guide_of(normal, surface.t, albedos.glossy);
        if !is_mirror(surface) {
            break;
        }
        ray = spawn(surface, mirror_direction(surface, wo));
    }
    diffuse_guides[i] = added(diffuse_guides[i], diffuse);
    glossy_guides[i] = added(glossy_guides[i], glossy);
}
