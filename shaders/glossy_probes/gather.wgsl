// Twin of src/method/glossy_probes/gather.rs: gather.
// View-dependent colour from one probe (§5.2), added to what other probes gave.

// #include "glossy_probes/search.wgsl"
// #include "glossy_probes/gathered.wgsl"

// Struct: candidates::Light.
struct Light {
    glossy: vec3<f32>,
    object: u32,
    albedo: vec3<f32>,
    reflected_material: u32,
}

const NEAREST: u32 = 0u;
const SAME_REFLECTOR: u32 = 1u;

@group(0) @binding(7) var<storage, read> anchors: array<Anchor>;
@group(0) @binding(8) var<storage, read> light: array<Light>;
@group(0) @binding(9) var<storage, read_write> sums: array<Gathered>;

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
        if anchor.energy >= FAR || view[there.y * params.width + there.x].material != wanted.material {
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
    params = gather_params;
    probe = probe_params;
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
        color *= albedo_ratio(shading[i].albedo, found.texel);
    }
    var sum = sums[i].sum;
    var least = FAR;
    if sum.w > 0.0 {
        least = bitcast<f32>(sums[i].best.x);
    }
    if found.energy < least {
        if sum.w > 0.0 {
            sum *= exp(-params.falloff * (least - found.energy));
        }
        least = found.energy;
        sums[i].best = vec4(bitcast<u32>(found.energy), bitcast<vec2<u32>>(found.texel), probe.index);
    }
    let weight = probe.weight * exp(-params.falloff * (found.energy - least));
    sums[i].sum = sum + vec4(color, 1.0) * weight;
}
