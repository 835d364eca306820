// Environments: lat-long images, looked up and sampled, constant ones, and suns. Twins: src/transport/envmap.rs, src/transport/sun.rs.

// #include "shared/texture.wgsl"
// #include "shared/microfacet.wgsl"

// A cell of the pixel grid and where in it.
struct Place {
    x: vec2<u32>,
    y: vec2<u32>,
    at: vec2<f32>,
}

// A direction, its density and the radiance from there.
struct Sky {
    d: vec3<f32>,
    pdf: f32,
    radiance: vec3<f32>,
}

fn is_constant(e: u32) -> bool {
    return environment_image(e).width == 0u && environment_f32(e, ENVIRONMENT_SCALE) == 0.0;
}

fn is_sun(e: u32) -> bool {
    return environment_image(e).width == 0u && environment_f32(e, ENVIRONMENT_SCALE) > 0.0;
}

fn environment_eval(e: u32, d: vec3<f32>) -> vec3<f32> {
    if is_constant(e) {
        return environment_vec3(e, ENVIRONMENT_COLOR);
    }
    if is_sun(e) {
        return select(vec3(0.0), sun_radiance(e, d), sun_holds(e, d));
    }
    return envmap_radiance(e, envmap_place(e, envmap_lat_long(e, d)));
}

fn environment_pdf(e: u32, d: vec3<f32>) -> f32 {
    if is_constant(e) {
        return 0.25 * FRAC_1_PI;
    }
    if is_sun(e) {
        return select(0.0, sun_density(e), sun_holds(e, d));
    }
    let uv = envmap_lat_long(e, d);
    return envmap_density(e, envmap_place(e, uv)) / lat_long_jacobian(uv.y);
}

fn environment_sample(e: u32, v: vec2<f32>) -> Sky {
    if is_constant(e) {
        return Sky(direction(1.0 - 2.0 * v.y, v.x), 0.25 * FRAC_1_PI, environment_vec3(e, ENVIRONMENT_COLOR));
    }
    if is_sun(e) {
        return sun_sample(e, v);
    }
    let cells = envmap_cells(e);
    let row = pick(environment_u32(e, ENVIRONMENT_ROW_SUMS), cells.y, v.y);
    let y = u32(row.x);
    let column = pick(environment_u32(e, ENVIRONMENT_COLUMN_SUMS) + y * (cells.x + 1u), cells.x, v.x);
    let x = u32(column.x);
    let below = min(y + 1u, environment_image(e).height - 1u);
    var place = Place(vec2(x, (x + 1u) % cells.x), vec2(y, below), vec2(0.0));
    let c = envmap_corners(e, place);
    let ty = sample_linear(row.y, c.x + c.y, c.z + c.w);
    place.at = vec2(sample_linear(column.y, mix(c.x, c.z, ty), mix(c.y, c.w, ty)), ty);
    let uv = (vec2(f32(x), f32(y)) + place.at + vec2(0.5, 0.0)) / vec2<f32>(cells);
    let local = direction_from_lat_long(uv);
    let d = normalize_or(environment_rotation(e, ENVIRONMENT_WORLD_FROM_LOCAL) * local, vec3(0.0, 1.0, 0.0));
    return Sky(d, envmap_density(e, place) / lat_long_jacobian(uv.y), envmap_radiance(e, place));
}

// The numbers with which `environment_sample` finds a direction; of a sun, any.
fn environment_numbers(e: u32, d: vec3<f32>) -> vec2<f32> {
    if is_constant(e) {
        return vec2(fract(atan2(d.y, d.x) / TAU), 0.5 * (1.0 - d.z));
    }
    if is_sun(e) {
        return vec2(0.5);
    }
    let p = envmap_place(e, envmap_lat_long(e, d));
    let c = envmap_corners(e, p);
    let t = p.at;
    let columns = environment_u32(e, ENVIRONMENT_COLUMN_SUMS) + p.y.x * (envmap_cells(e).x + 1u);
    let x = linear_share(t.x, mix(c.x, c.z, t.y), mix(c.y, c.w, t.y));
    let y = linear_share(t.y, c.x + c.y, c.z + c.w);
    return vec2(number_at(columns, p.x.x, x), number_at(environment_u32(e, ENVIRONMENT_ROW_SUMS), p.y.x, y));
}

fn sun_sample(e: u32, v: vec2<f32>) -> Sky {
    let below_tip = v.y * environment_f32(e, ENVIRONMENT_SCALE);
    let r = sqrt(max(below_tip * (2.0 - below_tip), 0.0));
    let local = vec3(r * cos(v.x * TAU), r * sin(v.x * TAU), 1.0 - below_tip);
    let d = to_world(frame_from_normal(sun_middle(e)), local);
    return Sky(d, sun_density(e), sun_radiance(e, d));
}

// From a direction within the disc; black below the plane that it stands on.
fn sun_radiance(e: u32, d: vec3<f32>) -> vec3<f32> {
    let up = environment_vec3(e, ENVIRONMENT_WORLD_FROM_LOCAL + 4u);
    return select(vec3(0.0), environment_vec3(e, ENVIRONMENT_COLOR), dot(d, up) >= 0.0);
}

fn sun_holds(e: u32, d: vec3<f32>) -> bool {
    let off = d - sun_middle(e);
    return dot(off, off) <= 2.0 * environment_f32(e, ENVIRONMENT_SCALE);
}

fn sun_middle(e: u32) -> vec3<f32> {
    return environment_vec3(e, ENVIRONMENT_WORLD_FROM_LOCAL + 8u);
}

fn sun_density(e: u32) -> f32 {
    return 0.5 * FRAC_1_PI / environment_f32(e, ENVIRONMENT_SCALE);
}

// Columns of cells, and rows: one between each two of pixels.
fn envmap_cells(e: u32) -> vec2<u32> {
    let image = environment_image(e);
    return vec2(image.width, max(image.height - 1u, 1u));
}

fn envmap_lat_long(e: u32, d: vec3<f32>) -> vec2<f32> {
    return lat_long_from_direction(normalize_or(environment_rotation(e, ENVIRONMENT_LOCAL_FROM_WORLD) * d, vec3(0.0, 1.0, 0.0)));
}

fn envmap_place(e: u32, uv: vec2<f32>) -> Place {
    let cells = envmap_cells(e);
    let width = f32(cells.x);
    let turned = uv.x * width - 0.5;
    let x = turned - width * floor(turned / width);
    let y = clamp(uv.y, 0.0, 1.0) * f32(cells.y);
    let x0 = min(u32(x), cells.x - 1u);
    let y0 = min(u32(y), cells.y - 1u);
    let below = min(y0 + 1u, environment_image(e).height - 1u);
    return Place(vec2(x0, (x0 + 1u) % cells.x), vec2(y0, below), vec2(x - f32(x0), y - f32(y0)));
}

fn envmap_radiance(e: u32, p: Place) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = 0u; k < 4u; k++) {
        let weight = select(1.0 - p.at, p.at, vec2((k & 1u) != 0u, (k >> 1u) != 0u));
        sum += image_pixel(environment_image(e), p.x[k & 1u], p.y[k >> 1u]) * (weight.x * weight.y);
    }
    return sum * environment_f32(e, ENVIRONMENT_SCALE);
}

// Luminance times sine at the pixels: upper left, upper right, lower left, lower right.
fn envmap_corners(e: u32, p: Place) -> vec4<f32> {
    var corners: vec4<f32>;
    for (var k = 0u; k < 4u; k++) {
        let y = p.y[k >> 1u];
        let pixel = image_pixel(environment_image(e), p.x[k & 1u], y);
        corners[k] = max(luminance(pixel) * word_f32(environment_u32(e, ENVIRONMENT_SINES) + y), 0.0);
    }
    return corners;
}

// Density per lat-long unit square.
fn envmap_density(e: u32, p: Place) -> f32 {
    let c = envmap_corners(e, p);
    return mix(mix(c.x, c.y, p.at.x), mix(c.z, c.w, p.at.x), p.at.y) / environment_f32(e, ENVIRONMENT_MEAN);
}

fn lat_long_jacobian(v: f32) -> f32 {
    return 2.0 * PI * PI * max(sin(v * PI), 1e-5);
}

fn sample_linear(u: f32, a: f32, b: f32) -> f32 {
    if a + b <= 0.0 {
        return u;
    }
    let root = sqrt(max(a * a + (b * b - a * a) * u, 0.0));
    return min(u * (a + b) / max(a + root, MIN_POSITIVE), 1.0);
}

// The number with which `sample_linear` finds `t`.
fn linear_share(t: f32, a: f32, b: f32) -> f32 {
    return select(t, t * (2.0 * a + (b - a) * t) / (a + b), a + b > 0.0);
}

// The number that `pick` takes for a step and where in it. Twin: transport::steps::Steps::at.
fn number_at(at: u32, step: u32, rest: f32) -> f32 {
    return mix(word_f32(at + step), word_f32(at + step + 1u), rest);
}

// The step of `count` that `u` falls on and where in it; their running sums begin at `at` in `tables`. Twin: transport::steps::Steps::pick.
fn pick(at: u32, count: u32, u: f32) -> vec2<f32> {
    // The last step whose sum is not above u.
    var low = 0u;
    var high = count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if word_f32(at + middle) <= u {
            low = middle;
        } else {
            high = middle;
        }
    }
    let base = word_f32(at + low);
    let height = word_f32(at + low + 1u) - base;
    let rest = select(0.0, (u - base) / height, height > 0.0);
    return vec2(f32(low), clamp(rest, 0.0, 1.0 - 2.0 * EPSILON));
}
