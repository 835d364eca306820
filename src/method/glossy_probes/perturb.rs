//! Where a reflector shows a point to another eye: specular path perturbation.
//!
//! *Paper* (§5.1): Δx = J Δp + [Δp]ᵀ H [Δp], after Chen and Arvo 2000. *Reading*: their H is the second derivative, so the series needs
//! the factor 1/2, which lives in [`super::perturb_lanes`] (`second * half`).
//!
//! Derivation. Near x the reflector is s(u) = x + T u - n uᵀKu / 2 with T = (d1, d2) and K = diag(k1, k2). Of all paths p-s-q the light takes
//! the one of stationary length (Fermat): F(u, p) = ∂/∂u (|s - p| + |s - q|) = 0, and u is a function of p where ∂F/∂u is regular
//! (implicit function theorem). With r = |s - a|, e = (a - s) / r and P = (I - e eᵀ) / r for either end a, the distance's derivatives along s are
//!   D r [v]       = -e·v
//!   D²r [v, w]    = v·P w
//!   D³r [v, w, w] = (2 (v·P w)(e·w) + (e·v)(w·P w)) / r.
//! At a mirror path the tangential parts of e_p + e_q cancel and both have the normal part cos θ, so
//!   G = ∂F/∂u = Tᵀ(P_p + P_q) T + 2 cos θ K,
//!   u̇ = J ṗ = G⁻¹ Tᵀ P_p ṗ,
//!   ü = [ṗ]ᵀ H [ṗ] = -G⁻¹ (D³r_p[T, δ, δ] + D³r_q[T, ṡ, ṡ] - 2 K u̇ n·(P_p δ + P_q ṡ) - (u̇·K u̇) Tᵀ(P_p + P_q) n),
//! where ṡ = T u̇ and δ = ṡ - ṗ. A reflected point at infinity has P_q = 0.
//!
//! G⁻¹ and the P are made once a pixel; each probe then costs one contraction of H with its Δp, less than H's own entries would.
//!
//! *Ours*: from the series' estimate, a few steps of Newton's method on the paraboloid itself, F(u, p') = 0, with
//!   ∂F/∂u = ∂sᵀ(P_p + P_q) ∂s + n·(e_p + e_q) K,   ∂s = T - n (Ku)ᵀ,
//! of whose points the one that comes nearest to F = 0 is taken: the series alone is off by several texels where probes are
//! farther from the eye than the reflector's radius.
//!
//! *Ours*: the plane's share of the series is summed in closed form (it is geometric: dividing by 1 + ε, ε the eye's rise against
//! the heights of both ends), so that flat reflectors are exact for any Δp; x' lies on the paraboloid; a series that does not settle
//! (the second-order part longer than the first) is cut there; where a concave reflector focuses the eye onto q
//! (G singular), and for broken input, the reflector counts as a plane.

use crate::Result;
use crate::base::math::{Basis, reflect};
use crate::base::named::within;
use crate::surface::Curvature;
use glam::{Mat2, Vec2, Vec3};

/// How far the series goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Every reflector is its tangent plane.
    Plane,
    /// Δx = J Δp on the paraboloid.
    First,
    /// With H.
    Second,
}

/// How the reflection point is predicted.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerturbParams {
    /// Order of the series. *Paper*: second.
    pub order: Order,
    /// Sum the plane's share of the series in closed form. *Paper*: no.
    pub exact_plane: bool,
    /// Longest second-order part of the curvature's share, as a multiple of the first-order step. *Paper*: no limit.
    pub second_order_limit: f32,
    /// |det G| as a fraction of the plane's below which the reflector focuses too well and counts as a plane.
    pub min_focus: f32,
    /// Newton steps from there, on curved reflectors. *Paper*: none. *Ours*: 3.
    #[serde(default)]
    pub newton: u32,
}

impl Default for PerturbParams {
    fn default() -> Self {
        Self { order: Order::Second, exact_plane: true, second_order_limit: 1.0, min_focus: 0.05, newton: 3 }
    }
}

impl PerturbParams {
    /// The paper's text. (The limit is not infinite, which JSON could not say.)
    pub fn paper() -> Self {
        Self { exact_plane: false, second_order_limit: f32::MAX, min_focus: 1e-4, newton: 0, ..Self::default() }
    }

    /// An error where a parameter is out of its range.
    pub fn validate(&self) -> Result<()> {
        within("gather.perturb.second_order_limit", self.second_order_limit, 0.0..=f32::MAX)?;
        within("gather.perturb.min_focus", self.min_focus, 0.0..=1.0)?;
        within("gather.perturb.newton", self.newton, 0..=64)
    }
}

/// Smallest cosine of incidence that is told from grazing.
pub(crate) const MIN_COS: f32 = 1e-3;
/// Longest Newton step, as a multiple of the reflector's smallest radius; half the way from x comes on top.
pub(crate) const MAX_STEP: f32 = 0.5;
/// Shortest distance to the eye or the reflected point, m.
pub(crate) const MIN_DISTANCE: f32 = 1e-4;

/// G = ∂F/∂u of the module's text: the second derivative of the path's length along the principal directions of the reflector,
/// for the local unit direction `e` to the eye, `c` = 1/r_p + 1/r_q and the principal curvatures `k`.
pub fn path_hessian(e: Vec3, c: f32, k: Vec2) -> Mat2 {
    let bend = 2.0 * e.z * k;
    Mat2::from_cols(
        Vec2::new(c * (1.0 - e.x * e.x) + bend.x, -c * e.x * e.y),
        Vec2::new(-c * e.x * e.y, c * (1.0 - e.y * e.y) + bend.y),
    )
}

/// A mirror path p-x-q, ready to be moved to other eyes.
#[derive(Debug, Clone, Copy)]
pub struct Perturbation {
    /// (d1, d2, n) at x: what follows is in these coordinates.
    pub(super) frame: Basis,
    pub(super) x: Vec3,
    pub(super) p: Vec3,
    /// Direction from x to the eye; that to q is (-e.x, -e.y, e.z).
    pub(super) e: Vec3,
    pub(super) inv_rp: f32,
    pub(super) inv_rq: f32,
    /// Principal curvatures.
    pub(super) k: Vec2,
    pub(super) g_inverse: Mat2,
    pub(super) params: PerturbParams,
}

impl Perturbation {
    /// The path from the eye `p` over `x`, whose unit normal `n` faces the eye, to what the mirror ray of that normal meets at
    /// `reflected_distance` from x (infinite for a ray that leaves the scene). `curvature` is relative to `n`.
    pub fn new(p: Vec3, x: Vec3, n: Vec3, reflected_distance: f32, curvature: &Curvature, params: &PerturbParams) -> Self {
        let frame = Basis::from_normal_and_tangent(n, curvature.d1);
        let mut e = frame.to_local((p - x).try_normalize().unwrap_or(n));
        if e.z.is_nan() || e.z < MIN_COS {
            e = Vec3::new(e.x, e.y, MIN_COS).normalize_or(Vec3::Z);
        }
        let inv_rp = 1.0 / p.distance(x).max(MIN_DISTANCE);
        let inv_rq = if reflected_distance.is_nan() { 0.0 } else { 1.0 / reflected_distance.max(MIN_DISTANCE) };
        let mut k = if params.order == Order::Plane { Vec2::ZERO } else { Vec2::new(curvature.k1, curvature.k2) };
        let c = inv_rp + inv_rq;
        let mut g = path_hessian(e, c, k);
        let g_plane = path_hessian(e, c, Vec2::ZERO);
        let focus = g.determinant().abs() / g_plane.determinant();
        if !(focus >= params.min_focus && focus.is_finite()) {
            (k, g) = (Vec2::ZERO, g_plane);
        }
        Self { frame, x, p, e, inv_rp, inv_rq, k, g_inverse: g.inverse(), params: *params }
    }

    /// Unit direction from x in which the path goes on.
    pub fn reflected_direction(&self) -> Vec3 {
        reflect(self.frame.to_world(self.e), self.frame.n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat2, DVec2, DVec3, Quat};

    /// Height over the tangent plane at the origin, and its slope.
    type Surface = fn(DVec2) -> (f64, DVec2);

    fn sphere(u: DVec2) -> (f64, DVec2) {
        let h = (1.0 - u.length_squared()).sqrt();
        (h - 1.0, -u / h)
    }
    fn bowl(u: DVec2) -> (f64, DVec2) {
        let h = (64.0 - u.length_squared()).sqrt();
        (8.0 - h, u / h)
    }
    fn cylinder(u: DVec2) -> (f64, DVec2) {
        let h = (1.0 - u.x * u.x).sqrt();
        (h - 1.0, DVec2::new(-u.x / h, 0.0))
    }
    fn saddle(u: DVec2) -> (f64, DVec2) {
        (-0.5 * (0.9 * u.x * u.x - 0.2 * u.y * u.y), DVec2::new(-0.9 * u.x, 0.2 * u.y))
    }

    const CURVED: [(&str, Surface, f32, f32); 4] = [
        ("sphere", sphere, 1.0, 1.0),
        ("bowl", bowl, -0.125, -0.125),
        ("cylinder", cylinder, 1.0, 0.0),
        ("saddle", saddle, 0.9, -0.2),
    ];

    /// Newton's method on the true surface (the plane z = 0 for None): the slope of the path's length vanishes.
    /// `q` None: the direction `d` at infinity.
    fn reference(surface: Option<Surface>, p: DVec3, q: Option<DVec3>, d: DVec3) -> DVec3 {
        let Some(surface) = surface else {
            // Towards q's mirror image.
            let t = q.map_or(p.z / d.z, |q| p.z / (p.z + q.z));
            return q.map_or(p - DVec3::new(-d.x, -d.y, d.z) * t, |q| p.lerp(DVec3::new(q.x, q.y, -q.z), t));
        };
        let slope = |u: DVec2| {
            let (h, g) = surface(u);
            let s = u.extend(h);
            let e = (p - s).normalize() + q.map_or(d, |q| (q - s).normalize());
            DVec2::new(e.x + g.x * e.z, e.y + g.y * e.z)
        };
        let mut u = DVec2::ZERO;
        for _ in 0..60 {
            let h = 1e-6;
            let dx = (slope(u + DVec2::X * h) - slope(u - DVec2::X * h)) / (2.0 * h);
            let dy = (slope(u + DVec2::Y * h) - slope(u - DVec2::Y * h)) / (2.0 * h);
            u -= DMat2::from_cols(dx, dy).inverse() * slope(u);
        }
        assert!(slope(u).length() < 1e-9);
        u.extend(surface(u).0)
    }

    /// The error of x' for the eye moved by `step`, everything seen in a turned and shifted world.
    fn error(surface: Option<Surface>, k: [f32; 2], distance: f32, step: Vec3, params: &PerturbParams) -> f32 {
        let e = Vec3::new(0.5, -0.3, 0.9).normalize();
        let (p, to_q) = (e * 1.7, Vec3::new(-e.x, -e.y, e.z));
        let q = distance.is_finite().then(|| (to_q * distance).as_dvec3());
        let expected = reference(surface, (p + step).as_dvec3(), q, to_q.as_dvec3()).as_vec3();
        let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 2.0);
        let world = |v: Vec3| turn * v + Vec3::new(0.3, -0.2, 0.1);
        let curvature = Curvature { k1: k[0], k2: k[1], d1: turn * Vec3::X, d2: turn * Vec3::Y };
        let path = Perturbation::new(world(p), world(Vec3::ZERO), turn * Vec3::Z, distance, &curvature, params);
        path.reflection_point(world(p + step)).distance(world(expected))
    }

    const STEPS: [Vec3; 4] =
        [Vec3::new(0.6, 0.2, 0.1), Vec3::new(-0.3, 0.5, 0.4), Vec3::new(0.1, -0.1, -0.6), Vec3::new(-0.5, -0.4, 0.0)];

    #[test]
    fn a_plane_is_exact_however_far_the_eye_goes() {
        for order in [Order::Plane, Order::First, Order::Second] {
            let params = PerturbParams { order, ..PerturbParams::default() };
            for distance in [0.05, 2.5, 40.0, f32::INFINITY] {
                for step in STEPS.into_iter().chain([Vec3::new(3.0, -2.0, 5.0), Vec3::new(-4.0, 1.0, -1.0)]) {
                    let e = error(None, [0.0, 0.0], distance, step, &params);
                    assert!(e < 5e-6, "{order:?} {distance} {step}: {e}");
                }
            }
        }
    }

    #[test]
    fn the_error_falls_with_the_third_power_on_curved_surfaces() {
        for params in [PerturbParams { newton: 0, ..PerturbParams::default() }, PerturbParams::paper()] {
            for (name, surface, k1, k2) in CURVED {
                for distance in [1.2, 6.0, f32::INFINITY] {
                    let sum = |scale: f32| -> f32 {
                        STEPS.iter().map(|&s| error(Some(surface), [k1, k2], distance, s * scale, &params)).sum()
                    };
                    let (coarse, fine) = (sum(0.25), sum(0.125));
                    let slope = (coarse / fine).log2();
                    // A floor for f32: four points in a world of metres.
                    assert!(slope > 2.6 || coarse < 4e-6, "{name} {distance}: {coarse} -> {fine}, slope {slope}");
                    assert!(fine < 0.01, "{name} {distance}: {fine}");
                }
            }
        }
    }

    #[test]
    fn without_the_hessian_the_error_falls_with_the_second_power() {
        let params = PerturbParams { order: Order::First, exact_plane: false, newton: 0, ..PerturbParams::default() };
        for (name, surface, k1, k2) in CURVED {
            let sum =
                |scale: f32| -> f32 { STEPS.iter().map(|&s| error(Some(surface), [k1, k2], 1.2, s * scale, &params)).sum() };
            let slope = (sum(0.1) / sum(0.05)).log2();
            assert!((1.7..2.3).contains(&slope), "{name}: {slope}");
        }
    }

    #[test]
    fn newton_finds_the_point_of_the_paraboloid_that_the_series_misses() {
        // The paraboloid itself, of curvatures at which these steps are far.
        let surfaces: [(Surface, f32, f32); 3] = [
            (|u| (-0.75 * (u.x * u.x + u.y * u.y), u * -1.5), 1.5, 1.5),
            (|u| (-1.5 * u.x * u.x, DVec2::new(-3.0 * u.x, 0.0)), 3.0, 0.0),
            (|u| (-u.x * u.x - 0.25 * u.y * u.y, DVec2::new(-2.0 * u.x, -0.5 * u.y)), 2.0, 0.5),
        ];
        for (surface, k1, k2) in surfaces {
            for distance in [1.2, 6.0, f32::INFINITY] {
                let sum = |newton: u32| -> f32 {
                    let params = PerturbParams { newton, ..PerturbParams::default() };
                    STEPS.iter().map(|&s| error(Some(surface), [k1, k2], distance, s, &params)).sum()
                };
                let [series, one, three] = [0, 1, 3].map(sum);
                assert!(series > 5e-3 && one < 0.02 * series && three < 2e-5, "{k1} {k2} {distance}: {series} {one} {three}");
            }
        }
    }

    #[test]
    fn an_eye_that_moves_along_its_own_ray_sees_the_same_point() {
        for (_, _, k1, k2) in CURVED {
            let c = Curvature { k1, k2, d1: Vec3::X, d2: Vec3::Y };
            let p = Vec3::new(0.7, 0.4, 1.1);
            let path = Perturbation::new(p, Vec3::ZERO, Vec3::Z, 2.0, &c, &PerturbParams::default());
            assert!(path.reflection_point(p * 1.6).length() < 1e-6);
        }
    }

    #[test]
    fn bad_cases_stay_finite() {
        let eyes = [
            Vec3::new(0.0, 0.0, 1.0),
            Vec3::new(5.0, 0.0, 1e-7),
            Vec3::new(5.0, 0.0, -0.1),
            Vec3::ZERO,
            Vec3::new(1e-6, 0.0, 1e-6),
        ];
        for p in eyes {
            // -1 focuses an eye at 1 onto a point at 1.
            for k in [0.0, -1.0, -1.000_001, -0.99, 1e6, -1e6, f32::NAN, f32::INFINITY] {
                for distance in [0.0, 1.0, 1e9, f32::INFINITY, f32::NAN] {
                    for to in [Vec3::ZERO, Vec3::new(1.0, 1.0, -3.0), Vec3::splat(100.0), Vec3::new(0.0, 0.0, -1.0)] {
                        for params in [PerturbParams::default(), PerturbParams::paper()] {
                            let c = Curvature { k1: k, k2: k, d1: Vec3::X, d2: Vec3::Y };
                            let x = Perturbation::new(p, Vec3::ZERO, Vec3::Z, distance, &c, &params).reflection_point(to);
                            assert!(x.is_finite(), "{p} {k} {distance} {to}");
                        }
                    }
                }
            }
        }
    }
}
