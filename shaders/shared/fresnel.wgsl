// Reflection at smooth interfaces. Twin: src/material/bsdf/fresnel.rs.

// #include "shared/math.wgsl"

struct Fresnel {
    r: f32,
    cos_t: f32,
    eta_it: f32,
    eta_ti: f32,
}

fn fresnel_dielectric(cos_i: f32, eta: f32) -> Fresnel {
    let eta_it = select(1.0 / eta, eta, cos_i >= 0.0);
    let eta_ti = select(eta, 1.0 / eta, cos_i >= 0.0);
    let c_i = abs(cos_i);
    let sin2_t = eta_ti * eta_ti * max(1.0 - c_i * c_i, 0.0);
    let c_t = sqrt(max(1.0 - sin2_t, 0.0));
    var r = 0.0;
    if eta != 1.0 {
        let s = (c_i - eta_it * c_t) / (c_i + eta_it * c_t);
        let p = (c_t - eta_it * c_i) / (c_t + eta_it * c_i);
        r = select(0.5 * (s * s + p * p), 1.0, c_i == 0.0);
    }
    return Fresnel(r, select(c_t, -c_t, cos_i >= 0.0), eta_it, eta_ti);
}

fn refracted(w: vec3<f32>, m: vec3<f32>, f: Fresnel) -> vec3<f32> {
    return m * (dot(w, m) * f.eta_ti + f.cos_t) - w * f.eta_ti;
}

fn fresnel_conductor(cos_i: f32, eta: vec3<f32>, k: vec3<f32>) -> vec3<f32> {
    if all(eta == vec3(0.0)) {
        return vec3(1.0);
    }
    let c2 = cos_i * cos_i;
    let s2 = 1.0 - c2;
    let d = eta * eta - k * k - s2;
    let a2_b2 = sqrt(max(d * d + 4.0 * eta * eta * k * k, vec3(0.0)));
    let a = sqrt(max(0.5 * (a2_b2 + d), vec3(0.0)));
    let across = 2.0 * cos_i * a;
    let r_s = (a2_b2 + c2 - across) / (a2_b2 + c2 + across);
    let sum = a2_b2 * c2 + s2 * s2;
    let r_p = r_s * (sum - across * s2) / (sum + across * s2);
    return 0.5 * (r_s + r_p);
}

// Share of diffuse light that an interface reflects.
fn fresnel_diffuse(eta: f32) -> f32 {
    if eta < 1.0 {
        return eta * (eta * -1.4399 + 0.7099) + 0.6681 + 0.0636 / eta;
    }
    let x = 1.0 / eta;
    return ((((-1.36881 * x + 4.98554) * x - 7.80989) * x + 6.75335) * x - 3.4793) * x + 0.919317;
}
