//! Burley's principled model (2012, 2015), as Mitsuba's `principled` has it.
//!
//! Diffuse: Burley's diffuse with its retro-reflection, the Hanrahan-Krueger flattening, and the sheen.
//! Non-diffuse: a GGX lobe between dielectric and metal, its rough refraction, and the GTR1 clearcoat.

use super::albedo::lobe_albedo;
use super::microfacet::{ALPHA_MIN, Distribution, Microfacets};
use super::roughdielectric::facet;
use super::warp::{cosine_hemisphere, cosine_hemisphere_pdf, direction};
use super::{At, BsdfSample, Lobes, Model, Query, Scatter, Surface, fresnel, positive_ratio, scalar};
use crate::Result;
use crate::base::math::{Rgb, luminance, reflect};
use crate::material::Texture;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, PI};

/// Smallest alpha of the main lobe before [`Query::roughness_scale`] (Mitsuba's floor).
pub(crate) const SPECULAR_ALPHA_MIN: f32 = 1e-3;
/// Share of the clearcoat that reflects.
pub(crate) const CLEARCOAT_STRENGTH: f32 = 0.25;
/// Fixed alpha of the clearcoat's shadowing.
pub(crate) const CLEARCOAT_SHADOWING_ALPHA: f32 = 0.25;
/// Reflectance of the clearcoat at normal incidence.
pub(crate) const CLEARCOAT_F0: f32 = 0.04;

/// Parameters as in a scene file; all but `eta` and `base_color` lie in [0, 1].
#[derive(Debug, Clone, serde::Serialize)]
pub struct PrincipledParams {
    /// Colour. Mitsuba: 0.5.
    pub base_color: Texture,
    /// Burley's roughness, the square root of alpha. Mitsuba: 0.5.
    pub roughness: Texture,
    /// Stretch of the specular lobe. Mitsuba: 0.
    pub anisotropic: Texture,
    /// From dielectric to metal. Mitsuba: 0.
    pub metallic: Texture,
    /// From opaque to glass. Mitsuba: 0.
    pub spec_trans: Texture,
    /// Index of refraction, inside over outside; at `specular` = 0.5 it is 1.5. Mitsuba: 1.5.
    pub eta: f32,
    /// From white to coloured dielectric reflection. Mitsuba: 0.
    pub spec_tint: Texture,
    /// Grazing cloth-like light. Mitsuba: 0.
    pub sheen: Texture,
    /// From white to coloured sheen. Mitsuba: 0.
    pub sheen_tint: Texture,
    /// From diffuse to fake subsurface scattering. Mitsuba: 0.
    pub flatness: Texture,
    /// Strength of the second specular lobe. Mitsuba: 0.
    pub clearcoat: Texture,
    /// Gloss of the second specular lobe, 1 is sharp. Mitsuba: 0.
    pub clearcoat_gloss: Texture,
}

impl Default for PrincipledParams {
    fn default() -> Self {
        let constant = |v: f32| Texture::Constant(Rgb::splat(v));
        Self {
            base_color: constant(0.5),
            roughness: constant(0.5),
            anisotropic: constant(0.0),
            metallic: constant(0.0),
            spec_trans: constant(0.0),
            eta: 1.5,
            spec_tint: constant(0.0),
            sheen: constant(0.0),
            sheen_tint: constant(0.0),
            flatness: constant(0.0),
            clearcoat: constant(0.0),
            clearcoat_gloss: constant(0.0),
        }
    }
}

/// The model.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Principled {
    /// Parameters as given, `eta` kept off 1 where light passes through.
    pub params: PrincipledParams,
}

/// The parameters at a point, and what follows from them.
#[derive(Clone, Copy)]
struct Point {
    base: Rgb,
    roughness: f32,
    metallic: f32,
    /// Weight of the opaque dielectric.
    opaque: f32,
    /// Weight of the glass.
    glass: f32,
    spec_tint: f32,
    clearcoat: f32,
    coat_alpha: f32,
    /// Base colour at unit luminance.
    tint: Rgb,
    facets: Microfacets,
}

impl Principled {
    /// Refuses an `eta` that is not positive and finite.
    pub fn new(mut params: PrincipledParams) -> Result<Self> {
        positive_ratio("principled", params.eta, 1.0)?;
        if params.eta == 1.0 && !is_zero(&params.spec_trans) {
            params.eta = 1.001;
        }
        Ok(Self { params })
    }

    /// `eta` of a scene file's `specular` in [0, 1].
    pub fn eta_from_specular(specular: f32) -> f32 {
        2.0 / (1.0 - (0.08 * specular.clamp(0.0, 1.0)).sqrt()) - 1.0
    }

    fn point(&self, s: &Surface, query: Query) -> Point {
        let p = &self.params;
        let base = p.base_color.at(s);
        let (roughness, metallic) = (scalar(&p.roughness, s), scalar(&p.metallic, s));
        let spec_trans = scalar(&p.spec_trans, s);
        let aspect = (1.0 - 0.9 * scalar(&p.anisotropic, s)).max(0.0).sqrt();
        let alpha = Vec2::new(roughness * roughness / aspect, roughness * roughness * aspect);
        let alpha = alpha.max(Vec2::splat(SPECULAR_ALPHA_MIN)) * query.roughness_scale;
        let gloss = scalar(&p.clearcoat_gloss, s);
        let brightness = luminance(base);
        Point {
            base,
            roughness,
            metallic,
            opaque: (1.0 - metallic) * (1.0 - spec_trans),
            glass: (1.0 - metallic) * spec_trans,
            spec_tint: scalar(&p.spec_tint, s),
            clearcoat: scalar(&p.clearcoat, s),
            coat_alpha: ((0.1 + (0.001 - 0.1) * gloss) * query.roughness_scale).clamp(ALPHA_MIN, 0.99),
            tint: if brightness > 0.0 { base / brightness } else { Rgb::ONE },
            facets: Microfacets::new(Distribution::Ggx, alpha),
        }
    }

    /// f · |cos wo| of the diffuse lobes, for directions on the front side. `m` is the half vector.
    fn diffuse(&self, s: &Surface, p: &Point, wi: Vec3, wo: Vec3, m: Vec3) -> Rgb {
        let (f_i, f_o) = (schlick(wi.z), schlick(wo.z));
        let cos_d = m.dot(wo);
        let retro_90 = 2.0 * p.roughness * cos_d * cos_d;
        let base = (1.0 - 0.5 * f_i) * (1.0 - 0.5 * f_o);
        let retro = retro_90 * (f_o + f_i + f_o * f_i * (retro_90 - 1.0));
        let mut shape = base + retro;
        let flatness = scalar(&self.params.flatness, s);
        if flatness > 0.0 {
            let fade = |f: f32| 1.0 + (0.5 * retro_90 - 1.0) * f;
            let flat = 1.25 * (fade(f_i) * fade(f_o) * (1.0 / (wi.z + wo.z) - 0.5) + 0.5);
            shape += (flat - shape) * flatness;
        }
        let mut value = p.base * (p.opaque * FRAC_1_PI * shape);
        let sheen = scalar(&self.params.sheen, s) * (1.0 - p.metallic);
        if sheen > 0.0 {
            let colour = Rgb::ONE.lerp(p.tint, scalar(&self.params.sheen_tint, s));
            value += colour * (sheen * schlick(cos_d.abs()));
        }
        value * wo.z
    }

    /// Fresnel term of the main lobe, seen from the front: dielectric, tinted dielectric and metal mixed.
    fn fresnel(&self, p: &Point, dielectric: f32, cos: f32) -> Rgb {
        let mut f = Rgb::splat((1.0 - p.metallic) * (1.0 - p.spec_tint) * dielectric);
        if p.metallic > 0.0 {
            f += p.metallic * self.schlick_from(p.base, cos);
        }
        if p.spec_tint > 0.0 {
            let f0 = ((self.params.eta - 1.0) / (self.params.eta + 1.0)).powi(2);
            f += (1.0 - p.metallic) * p.spec_tint * self.schlick_from(p.tint * f0, cos);
        }
        f
    }

    /// Schlick's Fresnel term for a ray that comes from outside; at the transmitted cosine into a thinner medium.
    fn schlick_from(&self, f0: Rgb, cos: f32) -> Rgb {
        let cos = if self.params.eta > 1.0 { cos } else { fresnel::dielectric(cos, self.params.eta).cos_t.abs() };
        f0 + (Rgb::ONE - f0) * schlick(cos)
    }

    /// Probabilities of drawing the diffuse lobe and the clearcoat; the rest draws a facet of the main lobe.
    fn probabilities(&self, p: &Point, wi: Vec3, query: Query) -> (f32, f32) {
        if query.lobes == Lobes::DIFFUSE {
            return (1.0, 0.0);
        }
        if wi.z < 0.0 {
            return (0.0, 0.0);
        }
        let diffuse = if query.lobes.contains(Lobes::DIFFUSE) { p.opaque } else { 0.0 };
        let coat = CLEARCOAT_STRENGTH * p.clearcoat;
        let total = 1.0 + diffuse + coat;
        (diffuse / total, coat / total)
    }

    /// Probability of reflection at a facet of the main lobe with the dielectric Fresnel term `f`.
    fn reflection_probability(p: &Point, wi: Vec3, f: f32) -> f32 {
        if wi.z > 0.0 { 1.0 - p.glass * (1.0 - f) } else { f }
    }
}

/// The model at a point, as one viewer sees it.
#[derive(Clone, Copy)]
pub(super) struct PrincipledAt<'a> {
    model: &'a Principled,
    s: &'a Surface,
    wi: Vec3,
    query: Query,
    point: Point,
    /// Of drawing the diffuse lobe and the clearcoat.
    probabilities: (f32, f32),
}

impl PrincipledAt<'_> {
    pub(super) fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        let Self { model, wi, query, point: p, .. } = *self;
        let reflection = wi.z * wo.z > 0.0;
        // From behind there is only the glass.
        if wi.z * wo.z == 0.0 || (wi.z < 0.0 && p.glass <= 0.0) {
            return (Rgb::ZERO, 0.0);
        }
        let (p_diffuse, p_coat) = self.probabilities;
        let (mut value, mut density) = (Rgb::ZERO, 0.0);
        if query.lobes.contains(Lobes::DIFFUSE) && reflection && wi.z > 0.0 {
            value += model.diffuse(self.s, &p, wi, wo, (wi + wo).normalize_or_zero());
            density += p_diffuse * cosine_hemisphere_pdf(wo);
        }
        if !query.lobes.contains(Lobes::NON_DIFFUSE) {
            return (value, density);
        }
        let Some((m, jacobian)) = facet(wi, wo, model.params.eta) else { return (value, density) };
        let f = fresnel::dielectric(wi.dot(m), model.params.eta);
        let (d, g_i, g_o) = (p.facets.d(m), p.facets.g1_over_cos(wi, m), p.facets.g1(wo, m));
        let visible = (1.0 - p_diffuse - p_coat) * d * g_i * wi.dot(m).abs() * jacobian;
        let p_reflect = Principled::reflection_probability(&p, wi, f.r);
        if reflection {
            density += visible * p_reflect;
            if f.r > 0.0 {
                let colour = if wi.z > 0.0 { model.fresnel(&p, f.r, wi.dot(m)) } else { Rgb::splat(p.glass * f.r) };
                value += colour * (0.25 * d * g_i * g_o);
            }
            if wi.z > 0.0 && p.clearcoat > 0.0 {
                let d = gtr1(p.coat_alpha, m);
                density += p_coat * d * m.z * jacobian;
                let shadowing = Microfacets::new(Distribution::Ggx, Vec2::splat(CLEARCOAT_SHADOWING_ALPHA));
                let g = shadowing.g1(wi, m) * shadowing.g1(wo, m);
                let f = model.schlick_from(Rgb::splat(CLEARCOAT_F0), wi.dot(m));
                value += f * (p.clearcoat * CLEARCOAT_STRENGTH * d * g * wo.z);
            }
        } else {
            density += visible * (1.0 - p_reflect);
            let transmitted = p.glass * (1.0 - f.r) * f.eta_ti * f.eta_ti;
            value += p.base.max(Rgb::ZERO).map(f32::sqrt) * (transmitted * d * g_i * g_o * wi.dot(m).abs() * jacobian);
        }
        (value, density)
    }

    pub(super) fn sample(&self, u: f32, v: Vec2) -> Option<BsdfSample> {
        let Self { model, wi, query, point: p, .. } = *self;
        if wi.z == 0.0 || (wi.z < 0.0 && (p.glass <= 0.0 || !query.lobes.contains(Lobes::NON_DIFFUSE))) {
            return None;
        }
        let (p_diffuse, p_coat) = self.probabilities;
        let mut eta = 1.0;
        let wo = if u < p_diffuse {
            cosine_hemisphere(v)
        } else if u < p_diffuse + p_coat {
            reflect(wi, sample_gtr1(p.coat_alpha, v))
        } else {
            let m = p.facets.sample(if wi.z > 0.0 { wi } else { -wi }, v);
            let f = fresnel::dielectric(wi.dot(m), model.params.eta);
            let u = (u - p_diffuse - p_coat) / (1.0 - p_diffuse - p_coat);
            let reflection = u < Principled::reflection_probability(&p, wi, f.r);
            let wo = if reflection { reflect(wi, m) } else { fresnel::refract(wi, m, &f) };
            if reflection != (wi.z * wo.z > 0.0) {
                return None;
            }
            eta = if reflection { 1.0 } else { f.eta_it };
            wo
        };
        let wo = wo.normalize_or_zero();
        let (value, pdf) = self.eval_pdf(wo);
        let sample = BsdfSample::reflected(wo, value / pdf, pdf)?;
        Some(BsdfSample { eta, ..sample })
    }
}

impl Scatter for Principled {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let point = self.point(s, query);
        let probabilities = self.probabilities(&point, wi, query);
        At::of(Model::Principled(PrincipledAt { model: self, s, wi, query, point, probabilities }))
    }

    fn lobes(&self) -> Lobes {
        Lobes::ALL
    }

    fn diffuse_out(&self, s: &Surface, wi: Vec3) -> Rgb {
        self.diffuse_albedo(s, wi)
    }

    fn diffuse_in(&self, _s: &Surface, wo: Vec3) -> f32 {
        if wo.z > 0.0 { 1.0 } else { 0.0 }
    }

    /// By quadrature: 4 Gauss-Legendre nodes in cos², even in projected solid angle, by 8 azimuths.
    fn diffuse_albedo(&self, s: &Surface, wi: Vec3) -> Rgb {
        const NODES: [(f32, f32); 4] =
            [(0.069_431_84, 0.173_927_4), (0.330_009_5, 0.326_072_6), (0.669_990_5, 0.326_072_6), (0.930_568_2, 0.173_927_4)];
        const AZIMUTHS: u32 = 8;
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        let p = self.point(s, Query::default());
        let mut sum = Rgb::ZERO;
        for (cos2, weight) in NODES {
            for k in 0..AZIMUTHS {
                let wo = direction(cos2.sqrt(), (k as f32 + 0.5) / AZIMUTHS as f32);
                sum += self.diffuse(s, &p, wi, wo, (wi + wo).normalize_or_zero()) * (weight / wo.z);
            }
        }
        sum * (PI / AZIMUTHS as f32)
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, query: Query) -> Rgb {
        let p = self.point(s, query);
        if wi.z <= 0.0 {
            return if self.is_transmissive() { p.base * p.glass } else { Rgb::ZERO };
        }
        let (energy, cos) = lobe_albedo(Distribution::Ggx, p.facets.alpha_towards(wi), wi.z);
        let f = fresnel::dielectric(cos, self.params.eta).r;
        // The clearcoat's lobe integrates to about its Fresnel term times its strength.
        let coat = p.clearcoat * CLEARCOAT_STRENGTH * self.schlick_from(Rgb::splat(CLEARCOAT_F0), wi.z);
        self.fresnel(&p, f, cos) * energy + coat + p.base.max(Rgb::ZERO).map(f32::sqrt) * (p.glass * (1.0 - f))
    }

    fn alpha(&self, s: &Surface) -> Option<f32> {
        Some(self.point(s, Query::default()).facets.mean_alpha())
    }

    fn is_transmissive(&self) -> bool {
        !is_zero(&self.params.spec_trans)
    }
}

fn is_zero(texture: &Texture) -> bool {
    matches!(texture, Texture::Constant(c) if *c == Rgb::ZERO)
}

/// (1 - cos)⁵.
fn schlick(cos: f32) -> f32 {
    (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Density of the clearcoat's facets, per solid angle and projected area (Burley 2012, appendix B).
fn gtr1(alpha: f32, m: Vec3) -> f32 {
    let a2 = alpha * alpha;
    (a2 - 1.0) / (PI * a2.ln() * (m.truncate().length_squared() + a2 * m.z * m.z))
}

/// A facet of the clearcoat. pdf = [`gtr1`] · cos (solid angle).
fn sample_gtr1(alpha: f32, v: Vec2) -> Vec3 {
    let a2 = alpha * alpha;
    let cos2 = (1.0 - a2.powf(1.0 - v.y)) / (1.0 - a2);
    direction(cos2.clamp(0.0, 1.0).sqrt(), v.x)
}
