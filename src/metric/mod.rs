//! How far an image is from its reference: RMSE, SSIM, FLIP, and the report that shows them.
//!
//! The display metrics work on what a screen would show: linear radiance times 2^exposure, clamped to [0, 1] and sRGB-encoded
//! ([`display`]). The linear ones work on radiance as it is.

pub mod evaluation;
pub mod flip;
pub mod report;
pub mod rmse;
pub mod ssim;
pub mod temporal;
pub mod values;
mod view;
pub mod without_noise;

pub use view::page_provenance;

use crate::base::math::Rgb;
use rayon::prelude::*;
use serde::Serialize;

/// Pixels in rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// `size[0] * size[1]` colours.
    pub pixels: Vec<Rgb>,
}

/// The numbers of one frame, or their mean over frames. Field names are those of `metrics.json`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Metrics {
    /// Root mean square error of display values over pixels and channels.
    pub rmse_rgb: f64,
    /// The same of the display values' Rec.709 luminance.
    pub rmse_lum: f64,
    /// (1 - SSIM) / 2, mean of the channels.
    pub dssim_rgb: f64,
    /// (1 - SSIM) / 2 of the luminance.
    pub dssim_lum: f64,
    /// Mean FLIP error.
    pub flip: f64,
    /// Root mean square error of linear radiance.
    pub rmse_linear: f64,
    /// Mean of squared errors of linear radiance relative to the reference's square.
    pub relmse_linear: f64,
}

/// Errors a pixel, rows from the top, each in [0, 1].
#[derive(Debug, Clone)]
pub struct ErrorMaps {
    /// Mean over channels of the absolute difference of display values.
    pub difference: Vec<f32>,
    /// (1 - SSIM) / 2, mean of the channels.
    pub dssim: Vec<f32>,
    /// FLIP.
    pub flip: Vec<f32>,
}

/// One frame against its reference.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// The numbers.
    pub metrics: Metrics,
    /// Where the error sits.
    pub maps: ErrorMaps,
    /// Display values of the image and of the reference.
    pub display: [Raster; 2],
}

/// Display values in [0, 1]: linear radiance times 2^`exposure`, clamped, sRGB-encoded.
pub fn display(image: &Raster, exposure: f32) -> Raster {
    let encode = |x: f32| {
        let x = x.clamp(0.0, 1.0);
        if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
    };
    let scale = exposure.exp2();
    Raster { size: image.size, pixels: image.pixels.iter().map(|&p| (p * scale).map(encode)).collect() }
}

/// The channels of an image, and its luminance.
fn planes(r: &Raster) -> [Vec<f32>; 4] {
    let channel = |i: usize| r.pixels.iter().map(|p| p[i]).collect();
    [channel(0), channel(1), channel(2), r.pixels.iter().map(|&p| crate::base::math::luminance(p)).collect()]
}

/// All metrics of `image` against `reference`, at 2^`exposure`. Both hold linear radiance, are of one size, and at least
/// [`ssim::WINDOW`] pixels a side.
pub fn compare(image: &Raster, reference: &Raster, exposure: f32) -> Comparison {
    assert_eq!(image.size, reference.size, "compare takes images of one size");
    let [a, b] = [display(image, exposure), display(reference, exposure)];
    let (pa, pb) = (planes(&a), planes(&b));
    let similar: Vec<ssim::Ssim> = pa.par_iter().zip(&pb).map(|(x, y)| ssim::ssim(x, y, a.size)).collect();
    let dssim = |s: f64| (1.0 - s) / 2.0;
    let flip = flip::flip(&a, &b);
    let metrics = Metrics {
        rmse_rgb: rmse::rmse(&a.pixels, &b.pixels),
        rmse_lum: rmse::rmse_scalar(&pa[3], &pb[3]),
        dssim_rgb: dssim(similar[..3].iter().map(|s| s.mean).sum::<f64>() / 3.0),
        dssim_lum: dssim(similar[3].mean),
        flip: flip.iter().map(|&x| f64::from(x)).sum::<f64>() / flip.len() as f64,
        rmse_linear: rmse::rmse(&image.pixels, &reference.pixels),
        relmse_linear: rmse::rel_mse(&image.pixels, &reference.pixels),
    };
    let maps = ErrorMaps {
        difference: a.pixels.iter().zip(&b.pixels).map(|(&x, &y)| (x - y).abs().element_sum() / 3.0).collect(),
        dssim: (0..flip.len())
            .map(|i| dssim(similar[..3].iter().map(|s| f64::from(s.map[i])).sum::<f64>() / 3.0) as f32)
            .collect(),
        flip,
    };
    Comparison { metrics, maps, display: [a, b] }
}

impl Metrics {
    /// Mean of each number over frames.
    pub fn mean(frames: &[Metrics]) -> Metrics {
        let mean = |of: fn(&Metrics) -> f64| frames.iter().map(of).sum::<f64>() / frames.len() as f64;
        Metrics {
            rmse_rgb: mean(|m| m.rmse_rgb),
            rmse_lum: mean(|m| m.rmse_lum),
            dssim_rgb: mean(|m| m.dssim_rgb),
            dssim_lum: mean(|m| m.dssim_lum),
            flip: mean(|m| m.flip),
            rmse_linear: mean(|m| m.rmse_linear),
            relmse_linear: mean(|m| m.relmse_linear),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(scale: f32) -> Raster {
        let pixels = (0..16 * 12).map(|i| Rgb::new(0.02, 0.01, 0.03) * (scale * (i % 37) as f32)).collect();
        Raster { size: [16, 12], pixels }
    }

    #[test]
    fn an_image_is_no_distance_from_itself() {
        let c = compare(&ramp(1.0), &ramp(1.0), 0.0);
        for (what, x) in [("rmse", c.metrics.rmse_rgb), ("dssim", c.metrics.dssim_rgb), ("relmse", c.metrics.relmse_linear)] {
            assert!(x.abs() < 1e-9, "{what} {x}");
        }
        assert!(c.metrics.flip.abs() < 1e-6);
    }

    #[test]
    fn a_stop_of_exposure_doubles_radiance_before_the_display_clamps_it() {
        let [twice, once] = [compare(&ramp(2.0), &ramp(1.0), 0.0), compare(&ramp(1.0), &ramp(0.5), 1.0)];
        assert_eq!(twice.display, once.display);
        assert_eq!(twice.metrics.rmse_rgb, once.metrics.rmse_rgb);
        assert!((twice.metrics.rmse_linear - 2.0 * once.metrics.rmse_linear).abs() < 1e-9, "linear metrics know no exposure");
    }

    #[test]
    fn display_values_are_srgb() {
        let pixels = vec![Rgb::new(0.002, 0.18, 1.0), Rgb::new(-1.0, 0.5, 7.0)];
        let shown = display(&Raster { size: [2, 1], pixels }, 0.0).pixels;
        let expected = [Rgb::new(0.025_84, 0.461_356, 1.0), Rgb::new(0.0, 0.735_357, 1.0)];
        assert!(shown.iter().zip(expected).all(|(&a, b)| (a - b).abs().max_element() < 1e-5), "{shown:?}");
    }
}
