// Twin of src/method/many_light/adaptive.rs: fill.
// Interpolates a grid's pixels from the next coarser one, and lists those that are to be lit.

// #include "many_light/grid.wgsl"

// Power of the cosine between normals.
const NORMAL_POWER: f32 = 32.0;
// Distance from a parent's tangent plane at which it weighs half, as a fraction of depth.
const PLANE: f32 = 0.01;
// Sum of weights below which no parent fits.
const LEAST_WEIGHT: f32 = 0.02;

struct Parents {
    pixels: array<u32, 4>,
    // Bilinear; 0 where the pixel lies on the cell's edge.
    weights: array<f32, 4>,
}

// Light, and whether it serves.
struct Interpolated {
    irradiance: vec3<f32>,
    glossy: vec3<f32>,
    fits: bool,
}

fn parents_of(at: vec2<u32>) -> Parents {
    let coarse = 2u * params.step;
    let low = at / coarse * coarse;
    let part = vec2<f32>(at - low) / f32(coarse);
    var parents: Parents;
    for (var k = 0u; k < 4u; k++) {
        let corner = vec2(k & 1u, k >> 1u);
        let place = low + coarse * corner;
        let weights = select(1.0 - part, part, corner == vec2(1u));
        let is_inside = place.x < params.camera.width && place.y < params.camera.height;
        parents.pixels[k] = select(0u, index_of(place), is_inside);
        parents.weights[k] = select(0.0, weights.x * weights.y, is_inside);
    }
    return parents;
}

fn material_of(i: u32) -> u32 {
    return facet(view[i].triangle).material;
}

// How well two pixels lie on one surface, 0 to 1.
fn likeness(a: Pixel, material: u32, other: u32) -> f32 {
    let b = view[other];
    if material_of(other) != material {
        return 0.0;
    }
    let off = abs(dot(b.p - a.p, a.n)) / max(a.depth, MIN_POSITIVE);
    return pow(max(dot(a.n, b.n), 0.0), NORMAL_POWER) * PLANE / (PLANE + off);
}

fn interpolated(i: u32, parents: Parents) -> Interpolated {
    let at = view[i];
    let material = material_of(i);
    var sum = Interpolated(vec3(0.0), vec3(0.0), true);
    var plain = sum;
    var total = 0.0;
    var all = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let parent = parents.pixels[k];
        let bilinear = parents.weights[k];
        if bilinear > 0.0 && is_surface(parent) {
            let weight = bilinear * likeness(at, material, parent);
            sum.irradiance += lit[parent].irradiance * weight;
            sum.glossy += lit[parent].glossy * weight;
            total += weight;
            plain.irradiance += lit[parent].irradiance * bilinear;
            plain.glossy += lit[parent].glossy * bilinear;
            all += bilinear;
        }
    }
    if total > LEAST_WEIGHT {
        return Interpolated(sum.irradiance / total, sum.glossy / total, true);
    }
    let is_bilateral = params.bilateral != 0u;
    if is_bilateral && all > 0.0 {
        return Interpolated(plain.irradiance / all, plain.glossy / all, true);
    }
    return Interpolated(vec3(0.0), vec3(0.0), is_bilateral);
}

// How much a neighbour differs in place and normal.
fn differs(i: u32, other: u32) -> f32 {
    if !is_surface(other) {
        return FAR;
    }
    let away = distance(view[other].p, view[i].p) / (0.5 * params.diagonal);
    return away + sqrt(max(2.0 - 2.0 * dot(view[other].n, view[i].n), 0.0));
}

// The test of section 2.3.
fn is_coherent(at: vec2<u32>, i: u32, parents: Parents) -> bool {
    if params.bilateral != 0u {
        return true;
    }
    let step = params.step;
    let width = params.camera.width;
    var geometry = 0.0;
    if at.x >= step {
        geometry = max(geometry, differs(i, i - step));
    }
    if at.x + step < width {
        geometry = max(geometry, differs(i, i + step));
    }
    if at.y >= step {
        geometry = max(geometry, differs(i, i - step * width));
    }
    if at.y + step < params.camera.height {
        geometry = max(geometry, differs(i, i + step * width));
    }
    if geometry > params.threshold {
        return false;
    }
    var light = 0.0;
    for (var j = 0u; j < 4u; j++) {
        for (var k = 0u; k < j; k++) {
            if parents.weights[j] > 0.0 && parents.weights[k] > 0.0 {
                light += abs(weight_at(parents.pixels[j]) - weight_at(parents.pixels[k])) * grids.exposure;
            }
        }
    }
    return geometry + params.lambda * light <= params.threshold;
}

@compute @workgroup_size(64)
fn choose_pixels(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    if id.x >= params.count {
        return;
    }
    let at = grid_pixel(params.first + id.x);
    let is_first = params.level == 0u;
    if !is_first && all(at % (2u * params.step) == vec2(0u)) {
        return;
    }
    let i = index_of(at);
    lit[i].visited = 0u;
    if !is_surface(i) {
        return;
    }
    if !is_first {
        let parents = parents_of(at);
        let found = interpolated(i, parents);
        if found.fits && is_coherent(at, i, parents) {
            lit[i].irradiance = found.irradiance;
            lit[i].glossy = found.glossy;
            return;
        }
    }
    lit[atomicAdd(&grids.counts[params.level], 1u)].listed = i + 1u;
}
