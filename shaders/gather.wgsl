// View-dependent colour from one probe (§5.2), added to what other probes gave. Twin: render::gather.
// Follows math.wgsl, perturb.wgsl, view.wgsl and probe.wgsl.
//
// `find_anchors` searches for one pixel in so many in full, `gather` for those between, from where these ended.

// Struct: gpu::render::gather::Params.
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
    padding0: u32,
    padding1: u32,
    padding2: u32,
    // Radius and step of each level.
    search: array<vec2<f32>, 8>,
}

// Struct: render::candidates::Seen.
struct Seen {
    reflected_point: vec3<f32>,
    // Of the reflected hit in the lower half, of the reflector in the upper one.
    materials: u32,
}

// Struct: render::candidates::Directions, without the alignment of vec3.
struct Directions {
    normal: array<f32, 3>,
    reflected: array<f32, 3>,
    alpha: f32,
}

// Struct: render::candidates::Light.
struct Light {
    glossy: vec3<f32>,
    object: u32,
    albedo: vec3<f32>,
    reflected_material: u32,
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

const NEAREST: u32 = 0u;
const SAME_REFLECTOR: u32 = 1u;
const TILE: u32 = 16u;
const ANCHOR_TOLERANCE: vec2<f32> = vec2(3.0, 0.1);
const DERIVATIVE_MIN: f32 = 1.0 / 64.0;

@group(0) @binding(0) var<storage, read> params: Params;
@group(0) @binding(3) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> normals: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> curvatures: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> materials: array<u32>;
@group(0) @binding(7) var<storage, read> reflected: array<Reflected>;
// The parameterisation's derivatives: two halves a pixel at half resolution.
@group(0) @binding(8) var<storage, read> derivative: array<u32>;
@group(0) @binding(9) var<storage, read> seen: array<Seen>;
@group(0) @binding(10) var<storage, read> directions: array<Directions>;
@group(0) @binding(11) var<storage, read_write> anchors: array<Anchor>;
@group(0) @binding(12) var<storage, read> light: array<Light>;
// The glossy lobe's directional albedo in the view.
@group(0) @binding(13) var<storage, read> albedos: array<vec4<f32>>;
// Colour times weight, and the weight; 0 as long as no probe had a sample.
@group(0) @binding(14) var<storage, read_write> sums: array<vec4<f32>>;
// The best sample: its energy and texel as bits, and its probe.
@group(0) @binding(15) var<storage, read_write> best: array<vec4<u32>>;

fn index_at(texel: vec2<f32>) -> u32 {
    let corner = vec2<i32>(floor(texel));
    return texel_index(corner.x, corner.y);
}

// Twin: probe::qhmap::ParameterMap::search_scale.
fn search_scale(texel: vec2<f32>) -> vec2<f32> {
    let half = (probe.size + 1) / 2;
    let p = min(vec2<i32>(max(texel * 0.5, vec2(0.0))), half - 1);
    return 1.0 / max(unpack2x16float(derivative[p.y * half.x + p.x]), vec2(DERIVATIVE_MIN));
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
        let step = search_scale(centre) * params.search[level].y;
        let radius = i32(params.search[level].x);
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

// The sample that the ends of the anchors around lead to; none where it is much worse than theirs.
fn between_anchors(pixel: vec2<u32>, centre: vec2<f32>, wanted: Target) -> Sample {
    let tile = pixel / TILE;
    let corner = pixel % TILE / params.anchors * params.anchors;
    var start = Sample(FAR, centre);
    var allowed = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let place = corner + vec2(k & 1u, k >> 1u) * params.anchors;
        let there = tile * TILE + place;
        if any(place >= vec2(TILE)) || there.x >= params.width || there.y >= params.height {
            continue;
        }
        let anchor = anchors[anchor_index(tile, place)];
        if anchor.energy >= FAR || materials[there.y * params.width + there.x] != wanted.material {
            continue;
        }
        allowed = max(allowed, anchor.energy * ANCHOR_TOLERANCE.x + ANCHOR_TOLERANCE.y);
        let texel = centre + anchor.end;
        let energy = energy_below(start.energy, index_at(texel), wanted);
        if energy < start.energy {
            start = Sample(energy, texel);
        }
    }
    if start.energy >= FAR {
        return start;
    }
    let found = search(start, params.levels - 1u, wanted);
    return Sample(select(FAR, found.energy, found.energy <= allowed), found.texel);
}

fn wanted_at(i: u32) -> Target {
    let r = reflected[i];
    return Target(normals[i].xyz, direction_from(r, positions[i].xyz), r, materials[i], positions[i].w);
}

// The texel coordinate at which the probe should see what pixel i reflects.
fn predicted(i: u32) -> vec2<f32> {
    let x = positions[i].xyz;
    let n = normals[i].xyz;
    let d_r = distance_from(reflected[i], x);
    let path = perturbation(params.eye, x, n, d_r, curvature_of(n, curvatures[i]), params.perturb);
    let towards = reflection_point(path, probe.position, params.perturb) - probe.position;
    return texel_from_direction(normalize_or(towards, vec3(0.0, 1.0, 0.0)));
}

fn reflects(i: u32) -> bool {
    return materials[i] != NOT_GLOSSY && reflected[i].material != NOTHING;
}

@compute @workgroup_size(8, 8)
fn find_anchors(@builtin(global_invocation_id) id: vec3<u32>) {
    let side = anchors_a_side();
    let tiles = (vec2(params.width, params.height) + TILE - 1u) / TILE;
    if any(id.xy >= tiles * side) {
        return;
    }
    let pixel = id.xy / side * TILE + id.xy % side * params.anchors;
    var anchor = Anchor(vec2(0.0), vec2(0.0), FAR, 0u, 0u, 0u);
    let i = pixel.y * params.width + pixel.x;
    if pixel.x < params.width && pixel.y < params.height && reflects(i) {
        let centre = predicted(i);
        let found = search(Sample(FAR, centre), 0u, wanted_at(i));
        anchor = Anchor(found.texel, found.texel - centre, found.energy, 0u, 0u, 0u);
    }
    anchors[anchor_index(pixel / TILE, pixel % TILE)] = anchor;
}

// Colour at a fractional texel coordinate, bilinear over those of the four texels around it that the rule lets in.
fn fetch(at: vec2<f32>) -> vec3<f32> {
    let centre = light[index_at(at)];
    if params.bilinear == NEAREST {
        return centre.glossy;
    }
    let corner = floor(at - 0.5);
    let f = at - 0.5 - corner;
    var sum = vec3(0.0);
    var total = 0.0;
    for (var k = 0; k < 4; k++) {
        let tap = light[texel_index(i32(corner.x) + (k & 1), i32(corner.y) + (k >> 1u))];
        let same_reflected = params.bilinear == SAME_REFLECTOR || tap.reflected_material == centre.reflected_material;
        if tap.object == centre.object && same_reflected {
            let weight = select(1.0 - f.x, f.x, (k & 1) == 1) * select(1.0 - f.y, f.y, k >= 2);
            sum += tap.glossy * weight;
            total += weight;
        }
    }
    return sum / total;
}

fn albedo_ratio(view: vec3<f32>, at: vec2<f32>) -> vec3<f32> {
    return clamp(view / max(light[index_at(at)].albedo, vec3(1e-4)), vec3(0.25), vec3(4.0));
}

@compute @workgroup_size(8, 8)
fn gather(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    if !reflects(i) {
        return;
    }
    var found = Sample(FAR, vec2(0.0));
    if params.anchors > 1u && all(id.xy % TILE % params.anchors == vec2(0u)) {
        let anchor = anchors[anchor_index(id.xy / TILE, id.xy % TILE)];
        found = Sample(anchor.energy, anchor.texel);
    } else {
        let wanted = wanted_at(i);
        let centre = predicted(i);
        if params.anchors > 1u {
            found = between_anchors(id.xy, centre, wanted);
        }
        if found.energy >= FAR {
            found = search(Sample(FAR, centre), 0u, wanted);
        }
    }
    if found.energy >= FAR {
        return;
    }
    // Eq. 2, exp(-phi E_min) cancelled against Z: the sum so far is rescaled where this sample is the best.
    var color = fetch(found.texel);
    if params.albedo_ratio != 0u {
        color *= albedo_ratio(albedos[i].rgb, found.texel);
    }
    var sum = sums[i];
    var least = FAR;
    if sum.w > 0.0 {
        least = bitcast<f32>(best[i].x);
    }
    if found.energy < least {
        if sum.w > 0.0 {
            sum *= exp(-params.falloff * (least - found.energy));
        }
        least = found.energy;
        best[i] = vec4(bitcast<u32>(found.energy), bitcast<vec2<u32>>(found.texel), probe.index);
    }
    let weight = probe.weight * exp(-params.falloff * (found.energy - least));
    sums[i] = sum + vec4(color, 1.0) * weight;
}
