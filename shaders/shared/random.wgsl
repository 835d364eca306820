// Hashes and sample points, bit for bit those of the CPU. Twins: src/base/math.rs and src/transport/sampler.rs.
//
// A 64-bit integer is a vec2<u32>, its lower word first.

// #include "shared/scene.wgsl"

const GOLDEN = vec2(0x7f4a7c15u, 0x9e3779b9u);

// The whole product of two words.
fn mul_wide(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    let middle = a1 * b0 + (low >> 16u);
    let other = a0 * b1 + (middle & 0xffffu);
    return vec2((other << 16u) | (low & 0xffffu), a1 * b1 + (middle >> 16u) + (other >> 16u));
}

fn mul64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let p = mul_wide(a.x, b.x);
    return vec2(p.x, p.y + a.x * b.y + a.y * b.x);
}

fn add64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2(low, a.y + b.y + select(0u, 1u, low < a.x));
}

// x ^ (x >> n), for 0 < n < 32.
fn fold(x: vec2<u32>, n: u32) -> vec2<u32> {
    return x ^ vec2((x.x >> n) | (x.y << (32u - n)), x.y >> n);
}

fn hash64(key: vec2<u32>) -> vec2<u32> {
    let x = mul64(fold(key, 30u), vec2(0x1ce4e5b9u, 0xbf58476du));
    return fold(mul64(fold(x, 27u), vec2(0x133111ebu, 0x94d049bbu)), 31u);
}

// hash_words of a sequence: start, then a call for each word, then end.
fn hash_start() -> vec2<u32> {
    return GOLDEN;
}

fn hash_next(h: vec2<u32>, word: u32) -> vec2<u32> {
    return add64(hash64(vec2(h.x ^ word, h.y)), GOLDEN);
}

fn hash_end(h: vec2<u32>) -> u32 {
    return hash64(h).y;
}

// hash_words of three words: the random stream of a seed, a frame and a pixel, among others.
fn hash3(a: u32, b: u32, c: u32) -> u32 {
    return hash_end(hash_next(hash_next(hash_next(hash_start(), a), b), c));
}

fn unit(bits: u32) -> f32 {
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}

const SOBOL_SETS: u32 = 8u;

struct Sampler {
    stream: u32,
    index: u32,
    // The set that is drawn next.
    next: u32,
}

fn sampler_new(stream: u32, index: u32) -> Sampler {
    return Sampler(stream, index, 0u);
}

fn branch(s: Sampler, k: u32) -> Sampler {
    return sampler_new(hash_end(hash_next(hash_next(hash_start(), s.stream), k)), s.index);
}

fn next_4d(s: ptr<function, Sampler>) -> vec4<f32> {
    let sets = (*s).next;
    (*s).next = sets + 1u;
    if sets < SOBOL_SETS {
        let seed = (*s).stream ^ (((*s).index >> 16u) * 0x85ebca6bu);
        return sobol_4d((*s).index & 0xffffu, seed + sets * 0x9e3779b9u);
    }
    let key = mul64(vec2((*s).index, (*s).stream), GOLDEN);
    let first = hash64(key ^ hash64(vec2(sets, 0u)));
    let second = hash64(add64(first, GOLDEN));
    return vec4(unit(first.x), unit(first.y), unit(second.x), unit(second.y));
}

// The first four dimensions of point `index` of the sequence with this seed: Owen-scrambled and shuffled by hashes (Burley 2020), in
// reversed bits throughout.
fn sobol_4d(index: u32, seed: u32) -> vec4<f32> {
    var bits = scrambled(vec4(reverseBits(index)), scatter_bits(vec4(seed ^ 0x79c68e4au))).x & 0xffff0000u;
    var x = vec4(0u);
    while bits != 0u {
        let i = countLeadingZeros(bits);
        x ^= sobol_vector(i);
        bits &= ~(0x80000000u >> i);
    }
    let scramble = vec4(seed * 0x9c8f2d3bu) ^ vec4(0x912f69bau, 0x174f18abu, 0x691e72cau, 0xb40cc1b8u);
    x = reverseBits(scrambled(x, scatter_bits(scramble)));
    return bitcast<vec4<f32>>((x >> vec4(9u)) | vec4(0x3f800000u)) - 1.0;
}

fn scrambled(reversed: vec4<u32>, scramble: vec4<u32>) -> vec4<u32> {
    var n = reversed;
    n ^= n * 0x3d20adeau;
    n += scramble;
    n *= (scramble >> vec4(16u)) | vec4(1u);
    n ^= n * 0x05526c56u;
    n ^= n * 0x53a22864u;
    return n;
}

fn scatter_bits(words: vec4<u32>) -> vec4<u32> {
    var n = words ^ vec4(0xe6fe3bebu);
    n ^= n >> vec4(16u);
    n *= 0x7feb352du;
    n ^= n >> vec4(15u);
    n *= 0x846ca68bu;
    n ^= n >> vec4(16u);
    return n;
}
