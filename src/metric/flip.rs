//! FLIP: the difference that a viewer flipping between two images sees.
//!
//! Paper: Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images". The authors' own code does the work, at
//! its default of 67 pixels a degree (a 0.7 m wide 4K screen seen from 0.7 m).
//! Ours: display values are rounded to 8 bits, as on a screen.

use super::Raster;

/// FLIP error of each pixel, in [0, 1]; both hold display values and are of one size.
pub fn flip(image: &Raster, reference: &Raster) -> Vec<f32> {
    let [width, height] = reference.size.map(|n| n as u32);
    let picture = |r: &Raster| nv_flip::FlipImageRgb8::with_data(width, height, &to_rgb8(r));
    nv_flip::flip(picture(reference), picture(image), nv_flip::DEFAULT_PIXELS_PER_DEGREE).to_vec()
}

/// Display values as bytes, three a pixel.
pub fn to_rgb8(r: &Raster) -> Vec<u8> {
    r.pixels.iter().flat_map(|p| p.to_array().map(|x| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)).collect()
}

/// Errors in [0, 1] through the magma colour map, as bytes, three a pixel.
pub fn magma(errors: &[f32]) -> Vec<u8> {
    let lut = nv_flip::magma_lut().to_vec();
    let last = lut.len() / 3 - 1;
    let colour = |&x: &f32| {
        let i = (x.clamp(0.0, 1.0) * last as f32 + 0.5) as usize;
        [lut[3 * i], lut[3 * i + 1], lut[3 * i + 2]]
    };
    errors.iter().flat_map(colour).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;

    #[test]
    fn black_against_white_is_the_largest_error() {
        let flat = |x: f32| Raster { size: [16, 16], pixels: vec![Rgb::splat(x); 256] };
        let errors = flip(&flat(0.0), &flat(1.0));
        assert!(errors.iter().all(|&e| (0.95..=1.0).contains(&e)), "{errors:?}");
        let small = flip(&flat(0.5), &flat(0.52));
        assert!(small.iter().all(|&e| e > 0.0 && e < 0.2), "{small:?}");
    }

    #[test]
    fn magma_runs_from_black_to_cream() {
        let colours = magma(&[0.0, 1.0, 7.0]);
        assert!(colours[..3].iter().all(|&c| c < 5) && colours[3..6].iter().all(|&c| c > 180));
        assert_eq!(colours[3..6], colours[6..9]);
    }
}
