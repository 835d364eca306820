//! Radiance of the sky and irradiance of the sun.
//!
//! The terms are the paper's, with θ from the zenith and γ from the sun:
//!
//!   L(θ, γ) = (1 + A exp(B / (cos θ + 0.01))) (C + D exp(E γ) + F cos² γ + G χ(H, γ) + I √cos θ),
//!   χ(h, γ) = (1 + cos² γ) / (1 + h² - 2 h cos γ)^(3/2).
//!
//! *Ours*: the exponents B, E and H are fixed, several of each, so that radiance is a sum of products u_i(θ) v_j(γ) and linear in
//! all that was fitted. `scripts/fit_sky.py` fitted it to the radiance that Mitsuba 3.9.1 shows, and wrote `table.bin`. Over the dome
//! its RMS error is 0.5 % for suns 10 degrees or more above the horizon (1.2 % at worst over turbidities and albedos), 0.7 % for lower
//! ones (1.3 %), and 0.9 % below 1 degree (3 %); that of the sun's irradiance is 0.1 %.

use crate::base::math::Rgb;
use glam::DVec3;
use half::f16;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

/// Exponents of exp(-b / (cos θ + 0.01)).
const B: [f64; 4] = [0.02, 0.1, 0.3, 1.0];
/// Exponents of exp(-e γ).
const E: [f64; 4] = [0.7, 2.0, 5.0, 12.0];
/// Anisotropies of χ.
const H: [f64; 3] = [0.3, 0.6, 0.8];
/// Functions of θ: 1, √cos θ and those of `B`.
const U: usize = 2 + B.len();
/// Functions of γ: 1, cos² γ and those of `E` and `H`.
const V: usize = 2 + E.len() + H.len();

/// Skies of the basis: each a weight for every product u_i v_j.
const BASIS: usize = 24;
/// Coefficients along the sun's elevation: of the sky's weights, and of the sun.
const SKY_DEGREES: usize = 9;
const SUN_DEGREES: usize = 8;
/// The table has the turbidities 1, 1.5, 2, ... 10 and albedos 0, 0.5, 1 of skies, and turbidities 1, 2, ... 10 of suns.
const SKY_TURBIDITIES: usize = 19;
const ALBEDOS: usize = 3;
const SUN_TURBIDITIES: usize = 10;

/// What `scripts/fit_sky.py` describes.
static TABLE: [u8; SUNS + 4 * SUN_TURBIDITIES * 3 * SUN_DEGREES] = *include_bytes!("table.bin");
/// Where the skies' weights begin, and where the suns.
const WEIGHTS: usize = 4 * BASIS * U * V;
const SUNS: usize = WEIGHTS + 2 * SKY_TURBIDITIES * ALBEDOS * 3 * BASIS * SKY_DEGREES;

/// A sky without its sun.
#[derive(Debug, Clone)]
pub struct Sky {
    /// Of each product u_i v_j; RGB.
    weights: [[DVec3; V]; U],
}

/// All of a sky at one height over the horizon.
#[derive(Debug, Clone)]
pub struct Ring([DVec3; V]);

impl Sky {
    /// A sky of a turbidity from 1 to 10, over ground of an albedo from 0 to 1, with a sun at `elevation`, 0 to π/2 radians.
    pub fn new(turbidity: f64, albedo: Rgb, elevation: f64) -> Self {
        let turbidity = turbidity.clamp(1.0, 10.0);
        let along = chebyshev::<SKY_DEGREES>(elevation);
        // Parabolas through three entries of each list, as radiance between them is not linear.
        let low = (turbidity as usize).min(9);
        let of_turbidity = parabola(turbidity - low as f64);
        let of_albedo = albedo.clamp(Rgb::ZERO, Rgb::ONE).as_dvec3().to_array().map(parabola);
        let weight = |channel: usize, k: usize| {
            let mut sum = 0.0;
            for (t, of_turbidity) in of_turbidity.iter().enumerate() {
                for (a, of_albedo) in of_albedo[channel].iter().enumerate() {
                    let entry = ((2 * (low - 1) + t) * ALBEDOS + a) * 3 + channel;
                    let start = WEIGHTS + 2 * (entry * BASIS + k) * SKY_DEGREES;
                    let value: f64 = (0..SKY_DEGREES).map(|p| along[p] * read_f16(start + 2 * p)).sum();
                    sum += of_turbidity * of_albedo * value;
                }
            }
            sum
        };
        let mut weights = [[DVec3::ZERO; V]; U];
        for k in 0..BASIS {
            let of_basis = DVec3::new(weight(0, k), weight(1, k), weight(2, k));
            for (i, row) in weights.iter_mut().enumerate() {
                for (j, w) in row.iter_mut().enumerate() {
                    *w += of_basis * read_f32(4 * ((k * U + i) * V + j));
                }
            }
        }
        Self { weights }
    }

    /// The sky where the cosine to the zenith is `cos_theta`, at least 0.
    pub fn ring(&self, cos_theta: f64) -> Ring {
        let cos = cos_theta.clamp(0.0, 1.0);
        let mut u = [1.0, cos.sqrt(), 0.0, 0.0, 0.0, 0.0];
        for (u, b) in u[2..].iter_mut().zip(B) {
            *u = (-b / (cos + 0.01)).exp();
        }
        Ring(std::array::from_fn(|j| (0..U).map(|i| self.weights[i][j] * u[i]).sum()))
    }
}

impl Ring {
    /// Radiance at the angle `gamma` from the sun, W m⁻² sr⁻¹ nm⁻¹ in Mitsuba's scale. Where sunset takes blue below 0, it is 0.
    pub fn radiance(&self, gamma: f64) -> Rgb {
        let cos = gamma.cos();
        let mut v = [0.0; V];
        (v[0], v[1]) = (1.0, cos * cos);
        for (v, e) in v[2..].iter_mut().zip(E) {
            *v = (-e * gamma).exp();
        }
        for (v, h) in v[2 + E.len()..].iter_mut().zip(H) {
            *v = (1.0 + cos * cos) / (1.0 + h * h - 2.0 * h * cos).powf(1.5);
        }
        let sum: DVec3 = self.0.iter().zip(v).map(|(weight, v)| *weight * v).sum();
        sum.as_vec3().max(Rgb::ZERO)
    }
}

/// Irradiance of a surface that faces the sun, for a turbidity from 1 to 10 and a sun at `elevation`, 0 to π/2 radians. Where sunset
/// takes blue below 0, it is 0.
///
/// As Mitsuba's, it is linear between the elevations 2, 5, ... 89 degrees, the same below and above, and linear between whole turbidities.
pub fn sun_irradiance(turbidity: f64, elevation: f64) -> Rgb {
    let place = ((elevation.to_degrees() - 2.0) / 3.0).clamp(0.0, 29.0);
    let low = (place as usize).min(28);
    let at = |i: usize| smooth_sun(turbidity, (2.0 + 3.0 * i as f64).to_radians());
    at(low).lerp(at(low + 1), place - low as f64).as_vec3().max(Rgb::ZERO)
}

/// The same without corners along the elevation.
fn smooth_sun(turbidity: f64, elevation: f64) -> DVec3 {
    let turbidity = turbidity.clamp(1.0, 10.0);
    let along = chebyshev::<SUN_DEGREES>(elevation);
    let of = |turbidity: usize| {
        let [log_red, green, blue] = [0, 1, 2].map(|part| {
            let start = SUNS + 4 * ((turbidity - 1) * 3 + part) * SUN_DEGREES;
            (0..SUN_DEGREES).map(|p| along[p] * read_f32(start + 4 * p)).sum::<f64>()
        });
        DVec3::new(1.0, green, blue) * log_red.exp()
    };
    let low = (turbidity as usize).min(9);
    of(low).lerp(of(low + 1), turbidity - low as f64)
}

/// Chebyshev polynomials between horizon and zenith. The paper's cube root spreads the low suns, where the sky changes fast.
fn chebyshev<const N: usize>(elevation: f64) -> [f64; N] {
    let x = 2.0 * (elevation.clamp(0.0, FRAC_PI_2) * FRAC_2_PI).cbrt() - 1.0;
    let mut t = [1.0; N];
    t[1] = x;
    for n in 2..N {
        t[n] = 2.0 * x * t[n - 1] - t[n - 2];
    }
    t
}

/// Weights of the values at 0, 1/2 and 1 of a parabola at `x`.
fn parabola(x: f64) -> [f64; 3] {
    [(1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0)]
}

fn read_f32(at: usize) -> f64 {
    f64::from(f32::from_le_bytes(std::array::from_fn(|i| TABLE[at + i])))
}

fn read_f16(at: usize) -> f64 {
    f16::from_le_bytes(std::array::from_fn(|i| TABLE[at + i])).to_f64()
}
