// Light that leaves a point or a cluster: diffuse radiance, and the lobe that stands for many. Twin: src/method/many_light/lobe.rs.

// #include "shared/math.wgsl"

// A spherical Gaussian in place of a power of the cosine.
override GAUSSIAN: bool = false;

// Diffuse radiance, and what is known of lobes taken together: sums, which add up in any grouping.
struct Emission {
    diffuse: vec3<f32>,
    // How many have light.
    count: f32,
    // Sum of their centres, each weighted by its luminance.
    directions: vec3<f32>,
    exponents: f32,
    magnitudes: vec3<f32>,
    // Sum of the magnitudes' luminance.
    weight: f32,
}

struct Lobe {
    // Unit; zero for a lobe without light.
    direction: vec3<f32>,
    exponent: f32,
    magnitude: vec3<f32>,
}

fn dark() -> Emission {
    return Emission(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0.0);
}

// How much it is. Twin: method::many_light::emit::Emission::weight.
fn emission_weight(emission: Emission) -> f32 {
    return luminance(emission.diffuse) + emission.weight * FRAC_1_PI;
}

// Density of a normalised lobe at the cosine from its centre, per steradian.
fn density(exponent: f32, cosine: f32) -> f32 {
    if GAUSSIAN {
        let sharpness = max(exponent, 1e-3);
        return sharpness / (TAU * (1.0 - exp(-2.0 * sharpness))) * exp(sharpness * (cosine - 1.0));
    }
    if cosine <= 0.0 {
        return 0.0;
    }
    return (exponent + 1.0) / TAU * pow(cosine, exponent);
}

// With another's, `scale` times their magnitudes.
fn merged(a: Emission, b: Emission, scale: f32) -> Emission {
    return Emission(
        a.diffuse + b.diffuse * scale,
        a.count + b.count,
        a.directions + b.directions * scale,
        a.exponents + b.exponents,
        a.magnitudes + b.magnitudes * scale,
        a.weight + b.weight * scale,
    );
}

// With one more lobe, `share` times its magnitude.
fn with_lobe(sum: Emission, lobe: Lobe, share: f32) -> Emission {
    let weight = luminance(lobe.magnitude) * share;
    if !(weight > 0.0) {
        return sum;
    }
    return merged(sum, Emission(vec3(0.0), 1.0, lobe.direction * weight, lobe.exponent, lobe.magnitude * share, weight), 1.0);
}

// The lobe that stands for all (Eq. 3, 4).
fn filtered(sum: Emission) -> Lobe {
    if sum.weight <= 0.0 {
        return Lobe(vec3(0.0), 0.0, vec3(0.0));
    }
    let mean = sum.directions / sum.weight;
    let far = clamp(length(mean), MIN_POSITIVE, 1.0);
    let exponent = sum.exponents / sum.count;
    let toksvig = far / (far + exponent * (1.0 - far));
    return Lobe(normalize_or(mean, vec3(0.0)), exponent * toksvig, sum.magnitudes);
}
