//! Root mean square error and its relative cousin, summed in f64.

use crate::base::math::Rgb;

/// What keeps the relative error of black reference pixels finite. Ours: a hundredth, as renderers commonly take.
pub const REL_MSE_EPSILON: f64 = 1e-2;

/// Root of the mean squared difference over pixels and channels.
pub fn rmse(a: &[Rgb], b: &[Rgb]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(x, y)| (x.as_dvec3() - y.as_dvec3()).length_squared()).sum();
    (sum / (3 * a.len()) as f64).sqrt()
}

/// Root of the mean squared difference of two planes.
pub fn rmse_scalar(a: &[f32], b: &[f32]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(&x, &y)| (f64::from(x) - f64::from(y)).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

/// Mean over pixels and channels of (a - b)² / (b² + [`REL_MSE_EPSILON`]), where `b` is the reference.
pub fn rel_mse(a: &[Rgb], b: &[Rgb]) -> f64 {
    let term = |(x, y): (&Rgb, &Rgb)| {
        let (x, y) = (x.as_dvec3(), y.as_dvec3());
        ((x - y) * (x - y) / (y * y + REL_MSE_EPSILON)).element_sum()
    };
    a.iter().zip(b).map(term).sum::<f64>() / (3 * a.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_differences_give_known_errors() {
        let a = [Rgb::new(1.0, 2.0, 3.0), Rgb::ZERO];
        let b = [Rgb::new(1.0, 1.0, 1.0), Rgb::ZERO];
        assert!((rmse(&a, &b) - (5f64 / 6.0).sqrt()).abs() < 1e-12);
        assert!((rel_mse(&a, &b) - 5.0 / 1.01 / 6.0).abs() < 1e-12);
        assert!((rmse_scalar(&[3.0, 0.0], &[0.0, 4.0]) - 12.5f64.sqrt()).abs() < 1e-12);
        assert!((rel_mse(&b, &a) - rel_mse(&a, &b)).abs() > 0.1, "relative to the second image only");
    }
}
