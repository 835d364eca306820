// Textures: constants, bitmaps and checkerboards. Twin: src/material/texture.rs.

// #include "shared/math.wgsl"
// #include "shared/scene.wgsl"

fn image_pixel(image: Image, x: u32, y: u32) -> vec3<f32> {
    let i = y * image.width + x;
    if image.bytes == NONE {
        let at = image.offset + 3u * i;
        return vec3(word_f32(at), word_f32(at + 1u), word_f32(at + 2u));
    }
    let rgb = words[image.offset + i];
    let b = image.bytes;
    return vec3(word_f32(b + (rgb & 0xffu)), word_f32(b + ((rgb >> 8u) & 0xffu)), word_f32(b + ((rgb >> 16u) & 0xffu)));
}

// The pixel that stands for the pixel `i` of an endless row, of `n` that there are.
fn wrapped(wrap: u32, i: i32, n: i32) -> u32 {
    if wrap == CLAMP {
        return u32(clamp(i, 0, n - 1));
    }
    let period = select(n, 2 * n, wrap == MIRROR);
    let j = i - period * i32(floor(f32(i) / f32(period)));
    // The quotient may be rounded up or down by one.
    let k = select(select(j, j - period, j >= period), j + period, j < 0);
    return u32(select(k, 2 * n - 1 - k, k >= n));
}

fn texture_uv(t: u32, uv: vec2<f32>) -> vec2<f32> {
    let p = vec3(uv, 1.0);
    return vec2(dot(texture_vec3(t, TEXTURE_TO_U), p), dot(texture_vec3(t, TEXTURE_TO_V), p));
}

// The bitmap's pixel at whole coordinates, which may lie outside; the scale is not in it.
fn bitmap_texel(t: u32, x: i32, y: i32) -> vec3<f32> {
    let image = texture_image(t);
    let wrap = texture_u32(t, TEXTURE_WRAP);
    return image_pixel(image, wrapped(wrap, x, i32(image.width)), wrapped(wrap, y, i32(image.height)));
}

fn texture_eval(texture: u32, uv: vec2<f32>) -> vec3<f32> {
    var t = texture;
    while texture_u32(t, TEXTURE_KIND) == CHECKERED {
        let at = texture_uv(t, uv);
        let upper = (at - floor(at)) > vec2(0.5);
        let colors = texture_image(t);
        t = select(colors.width, colors.offset, upper.x == upper.y);
    }
    let kind = texture_u32(t, TEXTURE_KIND);
    if kind == CONSTANT {
        return texture_vec3(t, TEXTURE_COLOR0);
    }
    let at = texture_uv(t, uv);
    if !(is_finite(at.x) && is_finite(at.y)) {
        return select(vec3(0.0), texture_vec3(t, TEXTURE_COLOR0), kind == CHECKERBOARD);
    }
    if kind == CHECKERBOARD {
        let upper = (at - floor(at)) > vec2(0.5);
        return select(texture_vec3(t, TEXTURE_COLOR1), texture_vec3(t, TEXTURE_COLOR0), upper.x == upper.y);
    }
    let size = vec2(f32(texture_image(t).width), f32(texture_image(t).height));
    // Far out, the coordinates must stay integers.
    let p = clamp(at * size, vec2(-1e9), vec2(1e9));
    let scale = texture_f32(t, TEXTURE_SCALE);
    if texture_u32(t, TEXTURE_NEAREST) != 0u {
        let i = vec2<i32>(floor(p));
        return bitmap_texel(t, i.x, i.y) * scale;
    }
    let low = floor(p - 0.5);
    let f = p - 0.5 - low;
    var sum = vec3(0.0);
    for (var k = 0; k < 4; k++) {
        let weight = select(1.0 - f, f, vec2((k & 1) != 0, (k >> 1) != 0));
        sum += bitmap_texel(t, i32(low.x) + (k & 1), i32(low.y) + (k >> 1)) * (weight.x * weight.y);
    }
    return sum * scale;
}

// A number stored as a texture: its luminance.
fn texture_scalar(t: u32, uv: vec2<f32>) -> f32 {
    return luminance(texture_eval(t, uv));
}
