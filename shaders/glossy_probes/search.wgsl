// The search for what a probe saw of what a pixel reflects (§5.2). Twin: src/method/glossy_probes/window.rs, for one pixel and one texel at a time.

// #include "glossy_probes/perturb.wgsl"
// #include "shared/view.wgsl"
// #include "shared/probe.wgsl"

struct Params {
    eye: vec3<f32>,
    width: u32,
    perturb: PerturbParams,
    height: u32,
    // Pixels from one anchor to the next.
    anchors: u32,
    levels: u32,
    bilinear: u32,
    material_penalty: f32,
    falloff: f32,
    albedo_ratio: u32,
    roughness_penalty: f32,
    // Radius and step of each level.
    search: array<vec4<f32>, 8>,
}

// Struct: candidates::ReflectedTexel.
struct ReflectedTexel {
    reflected_point: vec3<f32>,
    // Of the reflected hit in the lower half, of the reflector in the upper one.
    materials: u32,
}

// Struct: candidates::Directions, without the alignment of vec3.
struct Directions {
    normal: array<f32, 3>,
    reflected: array<f32, 3>,
    alpha: f32,
}

// Where an anchor's search ended.
struct Anchor {
    texel: vec2<f32>,
    // From where it began.
    end: vec2<f32>,
    // FAR where it found nothing.
    energy: f32,
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

struct Sample {
    // E; FAR where there is none.
    energy: f32,
    texel: vec2<f32>,
}

// What a search looks for: what the energy compares, at the view.
struct Target {
    normal: vec3<f32>,
    direction: vec3<f32>,
    reflected: Reflected,
    material: u32,
    alpha: f32,
}

const TILE: u32 = 16u;
const ANCHOR_TOLERANCE: vec2<f32> = vec2(3.0, 0.1);
const DERIVATIVE_MIN: f32 = 1.0 / 64.0;

// Kernels begin with copies of both uniforms: see scene.wgsl. Levels are read from the uniform itself, since their number varies.
@group(0) @binding(0) var<uniform> gather_params: Params;
var<private> params: Params;
@group(0) @binding(2) var<storage, read> view: array<Pixel>;
@group(0) @binding(3) var<storage, read> shading: array<Shading>;
// The vertices of the lat-long mesh in the probe, a pair of numbers each, then from `probe.second` on the parameterisation's derivatives:
// two halves a pixel at half resolution, two pixels an entry.
@group(0) @binding(4) var<storage, read> map: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> seen: array<ReflectedTexel>;
@group(0) @binding(6) var<storage, read> directions: array<Directions>;

fn mesh_vertex(i: i32) -> vec2<f32> {
    return bitcast<vec2<f32>>(map[i]);
}

fn index_at(texel: vec2<f32>) -> u32 {
    let corner = vec2<i32>(floor(texel));
    return texel_index(corner.x, corner.y);
}

// Twin: probe::qhmap::ParameterMap::search_scale.
fn search_scale(texel: vec2<f32>) -> vec2<f32> {
    let half = (probe.size + 1) / 2;
    let p = min(vec2<i32>(max(texel * 0.5, vec2(0.0))), half - 1);
    let at = u32(p.y * half.x + p.x);
    return 1.0 / max(unpack2x16float(map[probe.second + at / 2u][at % 2u]), vec2(DERIVATIVE_MIN));
}

// s_b: distance of the reflected hits, at most 1.
fn reflected_distance(target_point: Reflected, point: vec3<f32>, material: u32) -> f32 {
    let same_end = (target_point.material == SKY) == (material == SKY);
    return select(1.0, min(distance(target_point.point, point), 1.0), same_end);
}

// E of Eq. 1 where it is below `limit` and the reflectors are of one material; FAR elsewhere.
fn energy_below(limit: f32, i: u32, wanted: Target) -> f32 {
    let s = seen[i];
    let reflected_material = s.materials & 0xffffu;
    let s_a = select(params.material_penalty, 1.0, reflected_material == wanted.reflected.material);
    let s_b = reflected_distance(wanted.reflected, s.reflected_point, reflected_material);
    // The reflected hit alone rules most texels out.
    if (s.materials >> 16u) != wanted.material || s_a * s_b >= limit {
        return FAR;
    }
    let d = directions[i];
    let s_c = 1.0 - dot(wanted.normal, vec3(d.normal[0], d.normal[1], d.normal[2]));
    let s_d = 1.0 - dot(wanted.direction, vec3(d.reflected[0], d.reflected[1], d.reflected[2]));
    let both = wanted.alpha + d.alpha;
    let s_e = select(0.0, params.roughness_penalty * abs(wanted.alpha - d.alpha) / both, both > 0.0);
    let energy = s_a * (s_b + clamp(s_c, 0.0, 1.0) + clamp(s_d, 0.0, 1.0) + s_e);
    return select(FAR, energy, energy < limit);
}

// The sample of least energy around `known`, by the levels from `first` on, coarse to fine.
fn search(known: Sample, first: u32, wanted: Target) -> Sample {
    var found = known;
    for (var level = first; level < params.levels; level++) {
        let centre = found.texel;
        let step = search_scale(centre) * gather_params.search[level].y;
        let radius = i32(gather_params.search[level].x);
        for (var j = -radius; j <= radius; j++) {
            let y = centre.y + step.y * f32(j);
            for (var i = -radius; i <= radius; i++) {
                let texel = vec2(centre.x + step.x * f32(i), y);
                let energy = energy_below(found.energy, index_at(texel), wanted);
                if energy < found.energy {
                    found = Sample(energy, texel);
                }
            }
        }
        if found.energy >= FAR {
            break;
        }
    }
    return found;
}

fn anchors_a_side() -> u32 {
    return (TILE + params.anchors - 1u) / params.anchors;
}

// Index of the anchor at a pixel's place, both given by tile and place within it.
fn anchor_index(tile: vec2<u32>, place: vec2<u32>) -> u32 {
    let side = anchors_a_side();
    let at = tile * side + place / params.anchors;
    return at.y * ((params.width + TILE - 1u) / TILE) * side + at.x;
}

fn wanted_at(i: u32) -> Target {
    let r = view[i].reflected;
    return Target(view[i].n, direction_from(r, view[i].p), r, view[i].material, view[i].alpha);
}

// The texel coordinate at which the probe should see what pixel i reflects.
fn predicted(i: u32) -> vec2<f32> {
    let x = view[i].p;
    let n = view[i].n;
    let d_r = distance_from(view[i].reflected, x);
    let path = perturbation(params.eye, x, n, d_r, curvature_of(n, shading[i].curvature), params.perturb);
    let towards = reflection_point(path, probe.position, params.perturb) - probe.position;
    return texel_from_direction(normalize_or(towards, vec3(0.0, 1.0, 0.0)));
}

fn reflects(i: u32) -> bool {
    return view[i].material != NOT_GLOSSY && view[i].reflected.material != NOTHING;
}

