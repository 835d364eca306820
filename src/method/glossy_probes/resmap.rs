//! The adaptive resolution map m = m_mat (m_size + m_complexity): how much resolution each direction deserves (§4.2.1, Fig. 4).
//!
//! *Reading*: "material smoothness" m_mat is 1 for a mirror and 0 without a glossy lobe; its most direct reading is 1 − α
//! ([`Smoothness::Linear`]). *Ours*: a floor of α = 0.2 then gets four fifths of a mirror's texels, and a flat mirror shows fewer
//! than plain lat-long would. The texels that a lobe deserves fall with its solid angle, so the default is
//! 1 / (1 + (α / α½)²) ([`Smoothness::Lobe`]).
//! *Reading*: θ_long in m_size is the latitude. The lat-long map gives a texel the solid angle cos(latitude) dθ dφ, so that
//! m_size dθ dφ is a surface area, and sums to that of the room; with the longitude, as printed, it does not.
//! *Reading*: both terms are divided by their means over the texels that see a surface; texels that see none have m = 0.
//! *Ours*: the facing cosine is clamped, for the paper lets a grazing texel grow without bound. The blur crosses the seam
//! and the poles.

use super::seen::{Seen, SeenBuffers};
use super::{dct, lattice};
use crate::io::ExrImage;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::f32::consts::PI;
use std::path::Path;

/// Default of [`Smoothness::Lobe`]'s α½.
pub const ALPHA_HALF: f32 = 0.05;

/// What m_mat makes of roughness.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Smoothness {
    /// 1 − α.
    Linear,
    /// 1 / (1 + (α / α½)²).
    Lobe {
        /// The roughness that deserves half of a mirror's texels.
        alpha_half: f32,
    },
}

impl Smoothness {
    /// m_mat of a surface, 0 to 1; 0 where it has no glossy lobe.
    pub fn material_term(self, alpha: Option<f32>) -> f32 {
        alpha.map_or(0.0, |alpha| match self {
            Self::Linear => (1.0 - alpha).clamp(0.0, 1.0),
            Self::Lobe { alpha_half } => 1.0 / (1.0 + (alpha / alpha_half).powi(2)),
        })
    }
}

/// Parameters of the resolution map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResmapParams {
    /// Width and height, texels. §4.2.1: 256 x 128.
    pub size: [u32; 2],
    /// Edge N of the DCT's window, texels. §4.2.1: 16.
    pub dct_size: u32,
    /// Exponent k of the frequency weight ‖(p, q)‖ᵏ. §4.2.1: 5.
    pub frequency_exponent: f32,
    /// Sigma of the Gaussian that blurs m, texels. §4.2.1: 5.
    pub blur_sigma: f32,
    /// Smallest facing cosine that m_size divides by. *Ours*: lower lets silhouettes starve the rest of the probe,
    /// higher leaves grazing floors without texels.
    pub facing_min: f32,
    /// m_mat. §4.2.1 names it only.
    pub smoothness: Smoothness,
}

impl Default for ResmapParams {
    fn default() -> Self {
        Self { smoothness: Smoothness::Lobe { alpha_half: ALPHA_HALF }, ..Self::paper() }
    }
}

impl ResmapParams {
    /// The paper's text.
    pub fn paper() -> Self {
        let smoothness = Smoothness::Linear;
        Self { size: [256, 128], dct_size: 16, frequency_exponent: 5.0, blur_sigma: 5.0, facing_min: 0.05, smoothness }
    }

    /// Refuses what [`resolution_map`] cannot work with.
    pub fn validate(&self) -> Result<()> {
        let [w, h] = self.size;
        let bad = |message: String| Err(Error::Request(message));
        if !dct::SIZES.contains(&self.dct_size) {
            return bad(format!("DCT window of {}: expected one of {:?}", self.dct_size, dct::SIZES));
        }
        if w % 16 != 0 || w < self.dct_size || h < self.dct_size || w > 4096 || h > 4096 {
            return bad(format!(
                "{w}x{h} texels: expected a width that is a multiple of 16, and from {} to 4096 each way",
                self.dct_size
            ));
        }
        if !(0.0..=16.0).contains(&self.frequency_exponent) || !(0.0..=100.0).contains(&self.blur_sigma) {
            return bad(format!(
                "frequency exponent {}, blur sigma {}: expected 0 to 16 and 0 to 100 texels",
                self.frequency_exponent, self.blur_sigma
            ));
        }
        if !(1e-4..=1.0).contains(&self.facing_min) {
            return bad(format!("smallest facing cosine {}: expected 0.0001 to 1", self.facing_min));
        }
        if let Smoothness::Lobe { alpha_half } = self.smoothness
            && !(1e-3..=100.0).contains(&alpha_half)
        {
            return bad(format!("alpha of half resolution {alpha_half}: expected 0.001 to 100"));
        }
        Ok(())
    }
}

/// The resolution map of one probe and its terms, rows from the top; all without unit, finite and not negative.
#[derive(Debug, Clone, PartialEq)]
pub struct ResolutionMap {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Relative resolution, blurred.
    pub m: Vec<f32>,
    /// Smoothness of the material, 0 to 1.
    pub m_mat: Vec<f32>,
    /// Surface area that a texel stands for, over its mean.
    pub m_size: Vec<f32>,
    /// Local geometric complexity, over its mean.
    pub m_complexity: Vec<f32>,
}

/// m_size of one texel, before normalisation: m² per radian² of the lat-long map. `depth` in metres, `facing` the cosine of
/// incidence, `latitude` from −π/2 to π/2.
pub fn size_term(depth: f32, facing: f32, latitude: f32, facing_min: f32) -> f32 {
    depth * depth / facing.max(facing_min) * latitude.cos().max(0.0)
}

/// The resolution map of a probe that sees `seen`. `params` are valid, and `seen` is of their size.
pub fn resolution_map(params: &ResmapParams, seen: &SeenBuffers) -> ResolutionMap {
    let [w, h] = params.size;
    let texels = &seen.texels;
    let of = |f: &dyn Fn(usize, &Seen) -> f32| -> Vec<f32> {
        texels.iter().enumerate().map(|(i, t)| t.as_ref().map_or(0.0, |t| f(i, t))).collect()
    };
    let m_mat = of(&|_, t| params.smoothness.material_term(t.alpha));
    let latitude = |i: usize| PI * (0.5 - ((i / w as usize) as f32 + 0.5) / h as f32);
    let mut m_size = of(&|i, t| size_term(t.depth, t.facing, latitude(i), params.facing_min));
    let normal = [0, 1, 2].map(|axis| of(&|_, t| t.normal[axis]));
    let normal = [&normal[0][..], &normal[1][..], &normal[2][..]];
    let mut m_complexity = dct::complexity(w, h, normal, params.dct_size, params.frequency_exponent);
    // Windows of texels that see nothing reach over to those that do.
    m_complexity.iter_mut().zip(texels).filter(|(_, t)| t.is_none()).for_each(|(c, _)| *c = 0.0);
    let surfaces = texels.iter().flatten().count();
    divide_by_mean(&mut m_size, surfaces);
    divide_by_mean(&mut m_complexity, surfaces);
    let m: Vec<f32> = (0..texels.len()).map(|i| m_mat[i] * (m_size[i] + m_complexity[i])).collect();
    ResolutionMap { size: params.size, m: lattice::blur(w, h, &m, params.blur_sigma), m_mat, m_size, m_complexity }
}

/// Divides by the mean over `n` texels, where there is one.
fn divide_by_mean(values: &mut [f32], n: usize) {
    let mean = values.iter().map(|&x| f64::from(x)).sum::<f64>() / n.max(1) as f64;
    if mean > 0.0 {
        values.iter_mut().for_each(|x| *x = (f64::from(*x) / mean) as f32);
    }
}

impl ResolutionMap {
    /// The map, its terms and what they were made from, as channels `m`, `m_mat`, `m_size`, `m_complexity`, `depth`,
    /// `normal.X`, `normal.Y`, `normal.Z`, `facing`; the last five are 0 where nothing is seen.
    pub fn image(&self, seen: &SeenBuffers) -> ExrImage {
        let of = |f: &dyn Fn(&Seen) -> f32| seen.texels.iter().map(|t| t.as_ref().map_or(0.0, f)).collect();
        ExrImage::new(self.size[0] as usize, self.size[1] as usize)
            .with_f32("m", self.m.clone())
            .with_f32("m_mat", self.m_mat.clone())
            .with_f32("m_size", self.m_size.clone())
            .with_f32("m_complexity", self.m_complexity.clone())
            .with_f32("depth", of(&|t| t.depth))
            .with_f32("normal.X", of(&|t| t.normal.x))
            .with_f32("normal.Y", of(&|t| t.normal.y))
            .with_f32("normal.Z", of(&|t| t.normal.z))
            .with_f32("facing", of(&|t| t.facing))
    }
}

/// Channel `m` of a file, checked: the size of the image, and its finite values that are not negative.
pub fn read_m(path: &Path, image: &ExrImage) -> Result<([u32; 2], Vec<f32>)> {
    let m = image.f32(path, "m")?;
    if let Some(i) = m.iter().position(|&x| !(x.is_finite() && x >= 0.0)) {
        return Err(Error::input(
            path,
            format!("channel \"m\": {} at pixel {i}, expected a finite number that is not negative", m[i]),
        ));
    }
    Ok(([image.width as u32, image.height as u32], m))
}

/// Pearson's correlation of two equally long series; 0 where either is constant.
fn correlation(a: &[f32], b: &[f32]) -> f64 {
    let n = a.len() as f64;
    let mean = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / n;
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (&x, &y) in a.iter().zip(b) {
        let (x, y) = (f64::from(x) - ma, f64::from(y) - mb);
        ab += x * y;
        aa += x * x;
        bb += y * y;
    }
    if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

/// How well log-density follows log m, quad by quad. Where m is next to nothing, a thousandth of its mean counts: the
/// logarithm of 0 says nothing about resolution.
pub fn density_correlation(log_density: &[f32], m: &[f32]) -> f64 {
    let mean = (m.iter().map(|&x| f64::from(x)).sum::<f64>() / m.len() as f64) as f32;
    let log_m: Vec<f32> = m.iter().map(|x| x.max(1e-3 * mean).max(f32::MIN_POSITIVE).ln()).collect();
    correlation(log_density, &log_m)
}
