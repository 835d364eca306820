// Textures: constants, bitmaps and checkerboards. Twin: src/scene/texture.rs.

fn image_pixel(image: Image, x: u32, y: u32) -> vec3<f32> {
    let i = y * image.width + x;
    if image.bytes == NONE {
        let at = image.offset + 3u * i;
        return vec3(bitcast<f32>(pixels[at]), bitcast<f32>(pixels[at + 1u]), bitcast<f32>(pixels[at + 2u]));
    }
    let rgb = pixels[image.offset + i];
    let b = image.bytes;
    return vec3(table_f32(b + (rgb & 0xffu)), table_f32(b + ((rgb >> 8u) & 0xffu)), table_f32(b + ((rgb >> 16u) & 0xffu)));
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
    return vec2(dot(textures[t].to_u, p), dot(textures[t].to_v, p));
}

// The bitmap's pixel at whole coordinates, which may lie outside; the scale is not in it.
fn bitmap_texel(t: u32, x: i32, y: i32) -> vec3<f32> {
    let image = textures[t].image;
    let wrap = textures[t].wrap;
    return image_pixel(image, wrapped(wrap, x, i32(image.width)), wrapped(wrap, y, i32(image.height)));
}

fn texture_eval(texture: u32, uv: vec2<f32>) -> vec3<f32> {
    var t = texture;
    while textures[t].kind == CHECKERED {
        let at = texture_uv(t, uv);
        let upper = (at - floor(at)) > vec2(0.5);
        t = select(textures[t].image.width, textures[t].image.offset, upper.x == upper.y);
    }
    let kind = textures[t].kind;
    if kind == CONSTANT {
        return textures[t].color0;
    }
    let at = texture_uv(t, uv);
    if !(is_finite(at.x) && is_finite(at.y)) {
        return select(vec3(0.0), textures[t].color0, kind == CHECKERBOARD);
    }
    if kind == CHECKERBOARD {
        let upper = (at - floor(at)) > vec2(0.5);
        return select(textures[t].color1, textures[t].color0, upper.x == upper.y);
    }
    let size = vec2(f32(textures[t].image.width), f32(textures[t].image.height));
    // Far out, the coordinates must stay integers.
    let p = clamp(at * size, vec2(-1e9), vec2(1e9));
    let scale = textures[t].scale;
    if textures[t].nearest != 0u {
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
