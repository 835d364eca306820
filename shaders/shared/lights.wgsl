// Emitter sampling for next-event estimation. Twin: src/transport/lights.rs.

// #include "shared/surface.wgsl"
// #include "shared/light_tree.wgsl"
// #include "shared/envmap.wgsl"
// #include "shared/outlook.wgsl"

// A direction towards an emitter; a pdf of 0 says that there is none.
struct LightSample {
    wi: vec3<f32>,
    // FAR for those at infinity.
    distance: f32,
    point: vec3<f32>,
    weight: vec3<f32>,
    pdf: f32,
    delta: bool,
}

const NO_LIGHT = LightSample(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), 0.0, false); // Own.

// Emitters at infinity, and one for all the others.
fn light_count() -> u32 {
    return scene.environment_count + scene.suns + scene.has_near;
}

fn light_share() -> f32 {
    return 1.0 / f32(max(light_count(), 1u));
}

// Draws an emitter and a direction to it: `u` chooses the emitter, `v` the point.
fn light_sample(r: Receiver, u: f32, v: vec2<f32>) -> LightSample {
    let count = light_count();
    if count == 0u {
        return NO_LIGHT;
    }
    let place = u * f32(count);
    let choice = min(u32(place), count - 1u);
    if choice < scene.environment_count {
        return sample_environment(choice, r, v);
    }
    if choice < scene.environment_count + scene.suns {
        var sun = sample_delta(words[scene.sun_list + choice - scene.environment_count], r.p);
        sun.weight *= f32(count);
        return sun;
    }
    let chosen = light_tree_sample(r, clamp(place - f32(choice), 0.0, 1.0 - EPSILON));
    if chosen.probability == 0.0 {
        return NO_LIGHT;
    }
    let probability = chosen.probability / f32(count);
    if near_at(chosen.index).triangle != NONE {
        return sample_triangle(near_at(chosen.index), r.p, probability, v);
    }
    var lamp = sample_delta(near_at(chosen.index).emitter, r.p);
    lamp.weight /= probability;
    return lamp;
}

fn sample_environment(index: u32, r: Receiver, v: vec2<f32>) -> LightSample {
    let drawn = outlook_draw(index, r, v);
    var sky = environment_sample(index, drawn.v);
    sky.pdf *= drawn.density;
    if scene.environment_count > 1u {
        sky.radiance = environment(sky.d);
        sky.pdf = pdf_environment(r, sky.d) / light_share();
    }
    let pdf = sky.pdf * light_share();
    if pdf <= 0.0 {
        return NO_LIGHT;
    }
    return LightSample(sky.d, FAR, vec3(0.0), sky.radiance / pdf, pdf, false);
}

fn sample_triangle(t: Near, p: vec3<f32>, probability: f32, v: vec2<f32>) -> LightSample {
    let f = facet(t.triangle);
    let root = sqrt(1.0 - v.x);
    var weights = vec3(root * (1.0 - v.y), root * v.y, 1.0 - root);
    if t.area < 0.0 {
        weights = vec3(v.x, 1.0 - v.x - v.y, v.y);
    }
    let b = weights.y;
    let c = weights.z;
    let a = 1.0 - b - c;
    let point = f.corners[0] * a + f.corners[1] * b + f.corners[2] * c;
    let to_light = point - p;
    let far = length(to_light);
    let wi = normalize_or(to_light, vec3(0.0));
    let front = f.normals[0] * a + f.normals[1] * b + f.normals[2] * c;
    let cosine = abs(dot(unit_normal(f), wi));
    if dot(front, wi) >= 0.0 || cosine == 0.0 {
        return NO_LIGHT;
    }
    let radiance = texture_eval(emitter_u32(t.emitter, EMITTER_TEXTURE), facet_uv(f, b, c));
    let pdf = probability * far * far / (abs(t.area) * cosine);
    return LightSample(wi, far, point, radiance / pdf, pdf, false);
}

// Density with which `light_sample` finds the emitting point `s`.
fn pdf_surface(r: Receiver, s: Surface) -> f32 {
    if emitter_u32(s.emitter, EMITTER_FIRST) == NONE {
        return 0.0;
    }
    let entry = emitter_u32(s.emitter, EMITTER_FIRST) + (s.triangle - emitter_u32(s.emitter, EMITTER_START));
    let to_light = s.p - r.p;
    let far = length(to_light);
    let cosine = abs(dot(s.ng, to_light)) / far;
    if !(cosine > 0.0) {
        return 0.0;
    }
    return light_share() * light_tree_probability(r, entry) * far * far / (abs(near_at(entry).area) * cosine);
}

fn pdf_environment(r: Receiver, d: vec3<f32>) -> f32 {
    var sum = 0.0;
    for (var e = 0u; e < scene.environment_count; e++) {
        sum += environment_pdf(e, d) * outlook_density(e, r, d);
    }
    return light_share() * sum;
}

// Radiance of the environment from direction `d` (pointing away from the scene).
fn environment(d: vec3<f32>) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var e = 0u; e < scene.environment_count; e++) {
        sum += environment_eval(e, d);
    }
    return sum;
}

// Radiance that an emitter's surface sends to its front.
fn emitted(s: Surface) -> vec3<f32> {
    return texture_eval(emitter_u32(s.emitter, EMITTER_TEXTURE), s.uv);
}

fn sample_delta(e: u32, p: vec3<f32>) -> LightSample {
    let kind = emitter_u32(e, EMITTER_KIND);
    if kind == DIRECTIONAL {
        return LightSample(-emitter_vec3(e, EMITTER_DIRECTION), FAR, vec3(0.0), emitter_vec3(e, EMITTER_COLOR), 1.0, true);
    }
    let point = emitter_vec3(e, EMITTER_POSITION);
    let far = distance(point, p);
    let wi = normalize_or(point - p, vec3(0.0));
    var falloff = select(0.0, 1.0, far > 0.0);
    if kind == SPOT {
        let angle = acos(clamp(dot(emitter_vec3(e, EMITTER_DIRECTION), -wi), -1.0, 1.0));
        let cutoff = emitter_f32(e, EMITTER_CUTOFF);
        let fade = (cutoff - angle) / (cutoff - emitter_f32(e, EMITTER_BEAM));
        falloff *= select(select(fade, 1.0, angle <= emitter_f32(e, EMITTER_BEAM)), 0.0, angle >= cutoff);
    }
    if falloff <= 0.0 {
        return NO_LIGHT;
    }
    return LightSample(wi, far, point, emitter_vec3(e, EMITTER_COLOR) * (falloff / (far * far)), 1.0, true);
}
