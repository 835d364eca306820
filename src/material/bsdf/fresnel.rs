//! Reflection at smooth interfaces: dielectric and conductor Fresnel terms, refraction, and the diffuse average.

use crate::base::math::Rgb;
use glam::Vec3;

/// Unpolarised reflection at a dielectric interface, and where the transmitted ray goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fresnel {
    /// Reflected share, in [0, 1]; 1 under total internal reflection.
    pub r: f32,
    /// Cosine of the transmitted direction, of the sign opposite to the incident one's; 0 under total internal reflection.
    pub cos_t: f32,
    /// Relative index of refraction, transmitted side over incident side.
    pub eta_it: f32,
    /// Its inverse.
    pub eta_ti: f32,
}

/// Fresnel term for an incident cosine (negative: from inside) and `eta` = inside over outside.
pub fn dielectric(cos_i: f32, eta: f32) -> Fresnel {
    let (eta_it, eta_ti) = if cos_i >= 0.0 { (eta, 1.0 / eta) } else { (1.0 / eta, eta) };
    let c_i = cos_i.abs();
    let sin2_t = eta_ti * eta_ti * (1.0 - c_i * c_i).max(0.0);
    let c_t = (1.0 - sin2_t).max(0.0).sqrt();
    let r = if eta == 1.0 {
        0.0
    } else if c_i == 0.0 {
        1.0
    } else {
        let s = (c_i - eta_it * c_t) / (c_i + eta_it * c_t);
        let p = (c_t - eta_it * c_i) / (c_t + eta_it * c_i);
        0.5 * (s * s + p * p)
    };
    Fresnel { r, cos_t: if cos_i >= 0.0 { -c_t } else { c_t }, eta_it, eta_ti }
}

/// Refraction of `w` (away from the surface) at the normal `m`, with the Fresnel term at `w · m`.
pub fn refract(w: Vec3, m: Vec3, f: &Fresnel) -> Vec3 {
    m * (w.dot(m) * f.eta_ti + f.cos_t) - w * f.eta_ti
}

/// Fresnel term of a metal with the complex index of refraction `eta` + i `k`, one wavelength a channel.
/// With both zero, the perfect mirror: 1.
pub fn conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    if eta == Rgb::ZERO {
        // A purely imaginary index reflects everything.
        return Rgb::ONE;
    }
    let c2 = cos_i * cos_i;
    let s2 = 1.0 - c2;
    // a² and b² of the textbook form: (a + ib)² = (eta + ik)² - sin².
    let d = eta * eta - k * k - Vec3::splat(s2);
    let a2_b2 = (d * d + 4.0 * eta * eta * k * k).max(Vec3::ZERO).map(f32::sqrt);
    let a = (0.5 * (a2_b2 + d)).max(Vec3::ZERO).map(f32::sqrt);
    let (sum, cross) = (a2_b2 + Vec3::splat(c2), 2.0 * cos_i * a);
    let r_s = (sum - cross) / (sum + cross);
    let (sum, cross) = (a2_b2 * c2 + Vec3::splat(s2 * s2), cross * s2);
    let r_p = r_s * (sum - cross) / (sum + cross);
    0.5 * (r_s + r_p)
}

/// Share of diffuse light that a dielectric interface reflects, for `eta` = far side over near side.
///
/// Fits, the same as Mitsuba's so that `plastic` agrees: Egan and Hilgeman 1973 below 1 (internal reflection,
/// 0.6 % off for indices up to 2), d'Eon and Irving 2011 above (0.2 %).
pub fn diffuse_reflectance(eta: f32) -> f32 {
    if eta < 1.0 {
        return eta * (eta * -1.4399 + 0.7099) + 0.6681 + 0.0636 / eta;
    }
    let x = 1.0 / eta;
    [-1.36881, 4.98554, -7.80989, 6.75335, -3.4793, 0.919317].iter().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_incidence_gives_the_textbook_values() {
        assert!((dielectric(1.0, 1.5).r - 0.04).abs() < 1e-6);
        assert!((dielectric(-1.0, 1.5).r - 0.04).abs() < 1e-6);
        let gold = conductor(1.0, Rgb::new(0.143, 0.375, 1.442), Rgb::new(3.983, 2.386, 1.603));
        let expected = |n: f32, k: f32| ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
        let expected = Rgb::new(expected(0.143, 3.983), expected(0.375, 2.386), expected(1.442, 1.603));
        assert!((gold - expected).abs().max_element() < 1e-5, "{gold}");
    }

    #[test]
    fn a_metal_without_absorption_is_a_dielectric() {
        for i in 1..50 {
            let cos = i as f32 / 50.0;
            let metal = conductor(cos, Rgb::splat(1.5), Rgb::ZERO).x;
            assert!((metal - dielectric(cos, 1.5).r).abs() < 1e-5, "{cos}");
        }
    }

    #[test]
    fn light_past_the_critical_angle_is_all_reflected() {
        let critical = (1.0f32 - 1.0 / (1.5 * 1.5)).sqrt();
        assert_eq!(dielectric(-critical * 0.99, 1.5).r, 1.0);
        assert!(dielectric(-critical * 1.01, 1.5).r < 1.0);
    }

    #[test]
    fn refraction_obeys_snell_and_is_reversible() {
        for i in 1..20 {
            let cos = i as f32 / 20.0;
            let w = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let t = refract(w, Vec3::Z, &dielectric(cos, 1.5));
            assert!((t.length() - 1.0).abs() < 1e-5 && t.z < 0.0);
            assert!((w.x + 1.5 * t.x).abs() < 1e-5);
            let back = refract(t, Vec3::Z, &dielectric(t.z, 1.5));
            assert!((back - w).length() < 1e-4);
        }
    }

    #[test]
    fn the_diffuse_average_is_the_hemispherical_integral() {
        for eta in [1.3f32, 1.5, 1.8, 1.0 / 1.3, 1.0 / 1.5] {
            let n = 4000;
            let sum: f64 = (0..n)
                .map(|i| (i as f64 + 0.5) / n as f64)
                .map(|c| 2.0 * c * f64::from(dielectric(c as f32, eta).r) / n as f64)
                .sum();
            // The fits' own errors: 0.6 %.
            assert!((f64::from(diffuse_reflectance(eta)) - sum).abs() < 0.007 * sum, "{eta}: {sum}");
        }
    }
}
