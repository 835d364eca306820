//! How wide the run-time filter must be: the image-space footprint of the GGX lobe, and what the probes have not blurred yet.
//!
//! *Paper* (§6.1): a camera looks along the normal of a plane at distance d_c; the reflected point lies on that line at distance d_r. The GGX lobe that
//! each image point sees of it is fitted by a Gaussian; 32³ fits over alpha 0..0.5 and both distances 0.01..10 m make a table. The filter's
//! covariance is the table's at alpha less that at the probes' alpha (Eq. 3).
//!
//! The table holds standard deviations at focal length 1 (tangents of angles), so that a frame's own focal length in pixels converts them, and so
//! that interpolation is of a nearly linear function. Distances past its ends are clamped to them.
//!
//! *Ours*: probes of full roughness lack nothing of the lobe, but have noise, texels, and edges sharpened by parallax. A filter that counts
//! them as baked at 0.95 takes these away, by a third of the lobe's own width, for a lobe that is wider by a twentieth.
//!
//! Foreshortening, derived. With the notation of [`crate::method::glossy_probes::perturb`], moving by u on the reflector tilts the half vector by G u / (2 cos θ), since G is
//! the derivative of the tangential part of e_p + e_q, whose normal part is 2 cos θ. On a plane G = c (I - e eᵀ), c = 1/d_c + 1/d_r: along the plane of
//! incidence the tilt is c cos θ / 2, across it c / (2 cos θ). The image shows a step along as cos θ / d_c, a step across as 1 / d_c. So
//! a given tilt is as wide in the image as at normal incidence along the projected normal, and narrower by cos θ *across* it: the
//! streaks of wet roads. That is [`Foreshortening::Derived`]; the paper's text scales the variance *along* the projected normal by cos θ
//! ([`Foreshortening::Paper`]). The same G with the reflector's curvature narrows the footprint on convex reflectors.

use super::perturb::path_hessian;
use crate::Result;
use crate::base::math::Basis;
use crate::base::named::within;
use crate::scene::Camera;
use crate::surface::Curvature;
use crate::view::gbuffer::Pixel;
use crate::view::mirror::Reflected;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Cells of the table along each axis. *Paper*: 32.
pub(crate) const BINS: usize = 32;
/// Largest alpha of the table. *Paper*: 0.5.
pub(crate) const MAX_ALPHA: f32 = 0.5;
/// Nearest and farthest distance of the table, m. *Paper*: 0.01 to 10.
pub(crate) const DISTANCES: [f32; 2] = [0.01, 10.0];
/// Smallest cosine of incidence that is told from grazing.
pub(crate) const MIN_SLANT: f32 = 0.02;
/// |det G| against the plane's below which a concave reflector counts as a plane.
pub(crate) const MIN_FOCUS: f32 = 0.25;

/// How a Gaussian is made of the footprint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// Least squares on a scan line through the centre, as Fig. 9c shows.
    Slice,
    /// Least squares over the image.
    Area,
    /// The covariance of the samples over the field of view, as the text says. The lobe's tails make it as wide as the view lets them.
    Moment,
}

/// What a slanted or curved reflector does to the footprint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Foreshortening {
    /// Nothing.
    None,
    /// Variance along the projected normal times the facing cosine, as the text says.
    Paper,
    /// Narrower by the cosine across the projected normal, as derived above.
    Derived,
    /// [`Foreshortening::Derived`], and narrower on convex reflectors.
    Curved,
}

/// How the footprint is estimated.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FootprintParams {
    /// Fit of the table.
    pub fit: Fit,
    /// Alpha of the probes' first vertex over the material's own: the most that the filter takes them to have, whatever they were
    /// baked at ([`Self::for_probes`]), in [0, 1]. *Paper*: 1, as baked. *Ours*: 0.95.
    pub roughness_scale: f32,
    /// Below this d_r, the variance is scaled by d_r over it; 0: never, m. *Paper*: 0.5, without saying how.
    pub small_d_r: f32,
    /// Slanted reflectors.
    pub foreshortening: Foreshortening,
    /// Full field of view over which the lobe is fitted, degrees. The paper's is not given.
    pub fov_degrees: f32,
}

impl Default for FootprintParams {
    fn default() -> Self {
        Self { fit: Fit::Slice, roughness_scale: 0.95, small_d_r: 0.0, foreshortening: Foreshortening::Curved, fov_degrees: 70.0 }
    }
}

impl FootprintParams {
    /// The paper's text.
    pub fn paper() -> Self {
        Self { fit: Fit::Moment, roughness_scale: 1.0, small_d_r: 0.5, foreshortening: Foreshortening::Paper, ..Self::default() }
    }

    /// An error where a parameter is out of its range.
    pub fn validate(&self) -> Result<()> {
        within("footprint.roughness_scale", self.roughness_scale, 0.0..=1.0)?;
        within("footprint.small_d_r", self.small_d_r, 0.0..=1e9)?;
        within("footprint.fov_degrees", self.fov_degrees, 1.0..=179.0)
    }

    /// The parameters for probes that were baked at `roughness_scale`.
    pub fn for_probes(self, roughness_scale: f32) -> Self {
        Self { roughness_scale: self.roughness_scale.min(roughness_scale), ..self }
    }
}

/// A glossy pixel.
#[derive(Debug, Clone, Copy)]
pub struct GlossyPoint<'a> {
    /// Where the pixel's ray meets the reflector.
    pub x: Vec3,
    /// Unit shading normal there, facing the camera.
    pub n: Vec3,
    /// Distance from x to what the mirror ray meets; infinite for one that leaves the scene, m.
    pub reflected_distance: f32,
    /// The material's alpha; 0 for a mirror.
    pub alpha: f32,
    /// Curvature relative to `n`.
    pub curvature: &'a Curvature,
}

/// The tabulated footprint.
#[derive(Debug, Clone)]
pub struct Footprint {
    /// Standard deviations at focal length 1; alpha outermost, then d_c, then d_r.
    pub(crate) table: Vec<f32>,
    pub(crate) params: FootprintParams,
}

impl Footprint {
    /// Fits all cells of the table.
    pub fn new(params: &FootprintParams) -> Self {
        let axis = |i: usize| i as f32 / (BINS - 1) as f32;
        let distance = |i: usize| DISTANCES[0] + (DISTANCES[1] - DISTANCES[0]) * axis(i).powi(3);
        let table = (0..BINS * BINS * BINS)
            .into_par_iter()
            .map(|i| {
                let alpha = MAX_ALPHA * axis(i / (BINS * BINS)).powi(2);
                fit_cell(alpha, distance(i / BINS % BINS), distance(i % BINS), params)
            })
            .collect();
        Self { table, params: *params }
    }

    /// Standard deviation of the footprint of a plane seen along its normal, at focal length 1.
    pub fn sigma(&self, alpha: f32, d_c: f32, d_r: f32) -> f32 {
        self.sigma_at(alpha, [d_c, d_r].map(distance_place))
    }

    /// The same, of distances whose places in the table are known.
    fn sigma_at(&self, alpha: f32, [(c, fc), (r, fr)]: [(usize, f32); 2]) -> f32 {
        let (a, fa) = place((alpha.max(0.0) / MAX_ALPHA).sqrt());
        let line = |a: usize, c: usize| {
            let row = &self.table[(a * BINS + c) * BINS + r..];
            row[0] + (row[1] - row[0]) * fr
        };
        let face = |a: usize| line(a, c) + (line(a, c + 1) - line(a, c)) * fc;
        face(a) + (face(a + 1) - face(a)) * fa
    }

    /// [`Footprint::covariance`] of what a pixel shows; zero where that is not glossy.
    #[inline]
    pub(crate) fn of_pixel(&self, camera: &Camera, pixel: &Option<Pixel>, reflected: &Reflected) -> [f32; 3] {
        let Some((p, alpha)) = pixel.as_ref().and_then(|p| Some((p, p.alpha?))) else { return [0.0; 3] };
        let (x, n) = (p.surface.p, p.normal);
        let reflected_distance = reflected.distance_from(x);
        self.covariance(camera, &GlossyPoint { x, n, reflected_distance, alpha, curvature: &p.curvature })
    }

    /// Covariance `[xx, xy, yy]` of the image filter at a pixel of `camera`, pixels² (Eq. 3). Zero for mirrors.
    pub fn covariance(&self, camera: &Camera, point: &GlossyPoint) -> [f32; 3] {
        let p = &self.params;
        if point.alpha <= 0.0 {
            return [0.0; 3];
        }
        let d_c = camera.position().distance(point.x);
        let places = [d_c, point.reflected_distance].map(distance_place);
        let full = self.sigma_at(point.alpha, places);
        let baked = self.sigma_at(point.alpha * p.roughness_scale, places);
        let mut variance = full * full - baked * baked;
        if p.small_d_r > 0.0 {
            variance *= (point.reflected_distance / p.small_d_r).min(1.0);
        }
        if !(variance > 0.0 && variance.is_finite()) {
            return [0.0; 3];
        }
        let focal = camera.focal_px();
        let local = camera.to_world.matrix3.transpose();
        let cos = (camera.position() - point.x).dot(point.n) / d_c;
        let columns = match p.foreshortening {
            Foreshortening::None => [Vec2::X * focal, Vec2::Y * focal],
            Foreshortening::Paper => {
                let n = local * glam::Vec3A::from(point.n);
                let along = (-Vec2::new(n.x, n.y)).try_normalize().unwrap_or(Vec2::X);
                [along * (focal * cos.clamp(0.0, 1.0).sqrt()), along.perp() * focal]
            }
            Foreshortening::Derived | Foreshortening::Curved => {
                let at = local * glam::Vec3A::from(point.x - camera.position());
                let pixels = |v: Vec3| {
                    let v = local * glam::Vec3A::from(v);
                    (Vec2::new(at.x, at.y) * v.z / at.z - Vec2::new(v.x, v.y)) * (focal / at.z)
                };
                // Undo the table's geometry (image offset = tilt * 2 / (c d_c)) at the distances it was read at.
                let [lo, hi] = DISTANCES;
                let unit = 0.5 * (1.0 + d_c.clamp(lo, hi) / point.reflected_distance.clamp(lo, hi));
                self.tilt_to_pixels(camera, point, pixels).map(|column| column * unit)
            }
        };
        let sum = |i: usize, j: usize| variance * (columns[0][i] * columns[0][j] + columns[1][i] * columns[1][j]);
        let out = [sum(0, 0), sum(0, 1), sum(1, 1)];
        if out.iter().all(|c| c.is_finite()) { out } else { [0.0; 3] }
    }

    /// Image of a unit tilt of the half vector along each principal direction, pixels.
    fn tilt_to_pixels(&self, camera: &Camera, point: &GlossyPoint, pixels: impl Fn(Vec3) -> Vec2) -> [Vec2; 2] {
        let frame = Basis::from_normal_and_tangent(point.n, point.curvature.d1);
        let to_eye = camera.position() - point.x;
        let mut e = frame.to_local(to_eye.try_normalize().unwrap_or(point.n));
        if e.z < MIN_SLANT {
            e = Vec3::new(e.x, e.y, MIN_SLANT).normalize_or(Vec3::Z);
        }
        let c = 1.0 / to_eye.length().max(DISTANCES[0]) + 1.0 / point.reflected_distance.max(DISTANCES[0]);
        let plane = path_hessian(e, c, Vec2::ZERO);
        let mut g = plane;
        if self.params.foreshortening == Foreshortening::Curved {
            let curved = path_hessian(e, c, Vec2::new(point.curvature.k1, point.curvature.k2));
            let focus = curved.determinant() / plane.determinant();
            if focus.abs() > MIN_FOCUS && focus.is_finite() {
                g = curved;
            }
        }
        let step = g.inverse() * (2.0 * e.z);
        [step.x_axis, step.y_axis].map(|u| pixels(frame.to_world(u.extend(0.0))))
    }
}

/// Cell of the table along an axis, and place in it, for `t` in [0, 1].
fn place(t: f32) -> (usize, f32) {
    let f = t.clamp(0.0, 1.0) * (BINS - 1) as f32;
    let i = (f as usize).min(BINS - 2);
    (i, f - i as f32)
}

/// The same of a distance, m.
fn distance_place(d: f32) -> (usize, f32) {
    place(((d.max(DISTANCES[0]) - DISTANCES[0]) / (DISTANCES[1] - DISTANCES[0])).min(1.0).cbrt())
}

/// GGX lobe (Walter et al. 2007, without Fresnel) of a plane with normal z, D G / (4 cos cos); directions are unit.
pub fn ggx(alpha: f32, wi: Vec3, wo: Vec3) -> f32 {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return 0.0;
    }
    let h = (wi + wo).normalize();
    let a2 = alpha * alpha;
    let d = a2 / (std::f32::consts::PI * (h.z * h.z * (a2 - 1.0) + 1.0).powi(2));
    let g1 = |w: Vec3| 2.0 / (1.0 + (1.0 + a2 * (1.0 / (w.z * w.z) - 1.0)).sqrt());
    d * g1(wi) * g1(wo) / (4.0 * wi.z * wo.z)
}

/// Standard deviation of one cell.
fn fit_cell(alpha: f32, d_c: f32, d_r: f32, params: &FootprintParams) -> f32 {
    if alpha <= 0.0 {
        return 0.0;
    }
    let lobe = |y: f32| {
        let to = |d: f32| Vec3::new(-y * d_c, 0.0, d).normalize();
        let (wi, wo) = (to(d_r), to(d_c));
        // *Ours*: what a patch parallel to the reflector sends, cos (of the reflector) · cos / r² (of the patch), since the BRDF alone grows without
        // bound towards grazing light. Small lobes do not see the difference.
        let patch = if params.fit == Fit::Moment { 1.0 } else { wi.z.powi(4) };
        ggx(alpha, wi, wo) * patch
    };
    // The width of a small lobe, see the module's text.
    let width = alpha * 2.0 * d_r / (d_c + d_r);
    let edge = (0.5 * params.fov_degrees.to_radians()).tan();
    match params.fit {
        Fit::Slice => fit_gaussian(lobe, width, edge.min(8.0 * width), false),
        Fit::Area => fit_gaussian(lobe, width, edge.min(8.0 * width), true),
        Fit::Moment => {
            // Substitution y = width (eˢ - 1): as fine at the core as at the edge.
            let (samples, end) = (256, (edge / width + 1.0).ln());
            let (mut weight, mut moment) = (0.0f64, 0.0f64);
            for i in 0..samples {
                let s = (i as f32 + 0.5) / samples as f32 * end;
                let y = width * (s.exp() - 1.0);
                let w = f64::from(lobe(y) * y * s.exp());
                weight += w;
                moment += w * f64::from(y * y);
            }
            // Over the image, each axis has half of the mean squared radius.
            (0.5 * moment / weight).sqrt() as f32
        }
    }
}

/// The sigma of the Gaussian, of any height, with the least squared difference to `f` over [0, edge]; `area` weighs by the radius.
/// `guess` is within a factor of 8 of it.
pub fn fit_gaussian(f: impl Fn(f32) -> f32, guess: f32, edge: f32, area: bool) -> f32 {
    const SAMPLES: usize = 64;
    let step = edge / SAMPLES as f32;
    let samples: Vec<(f32, f32, f32)> = (0..SAMPLES)
        .map(|i| {
            let y = (i as f32 + 0.5) * step;
            (y * y, f(y), if area { y / edge } else { 1.0 })
        })
        .collect();
    // The best height is <f, g> / <g, g>; what it leaves over is |f|² - <f, g>² / <g, g>.
    let gain = |log_sigma: f32| {
        let scale = -0.5 * (-2.0 * log_sigma).exp();
        let (mut fg, mut gg) = (0.0f32, 0.0f32);
        for &(yy, f, w) in &samples {
            let g = (yy * scale).exp();
            fg += w * f * g;
            gg += w * g * g;
        }
        if gg > 0.0 { fg * fg / gg } else { 0.0 }
    };
    // Golden section.
    let ratio = 0.618_034;
    let (mut lo, mut hi) = (guess.ln() - 2.1, guess.ln() + 2.1);
    let (mut x, mut y) = (hi - ratio * (hi - lo), lo + ratio * (hi - lo));
    let (mut fx, mut fy) = (gain(x), gain(y));
    for _ in 0..16 {
        if fx < fy {
            (lo, x, fx) = (x, y, fy);
            y = lo + ratio * (hi - lo);
            fy = gain(y);
        } else {
            (hi, y, fy) = (y, x, fx);
            x = hi - ratio * (hi - lo);
            fx = gain(x);
        }
    }
    (0.5 * (lo + hi)).exp()
}

#[cfg(test)]
mod tests;
