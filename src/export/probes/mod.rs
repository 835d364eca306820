//! Probes as engines take them: prefiltered cubes of reflections, and diffuse light as cubes, as a volume, and in harmonics.

pub mod cube;
pub mod look;
pub mod volume;

use crate::base::math::Rgb;
use crate::base::octahedral::{middle, solid_angle, taps};
use crate::method::light_field_probes::probe::Light;
use crate::method::radiance_probes::harmonics::Harmonics;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

/// What a probe sees.
pub struct Probe {
    /// Radiance by direction.
    pub light: Light,
    /// The diffuse light around it.
    pub around: Around,
}

/// Diffuse light at a place.
#[derive(Clone)]
pub struct Around {
    /// Irradiance on a surface by its normal, an octahedral map.
    pub irradiance: Vec<Rgb>,
    /// Texels along an edge of that map.
    pub size: usize,
}

impl Around {
    /// Radiance that a white diffuse surface with this normal sends out: its irradiance over π.
    pub fn diffuse(&self, normal: Vec3) -> Rgb {
        taps(normal, self.size).into_iter().map(|(i, w)| self.irradiance[i] * w).sum::<Rgb>() * FRAC_1_PI
    }

    /// The same in the first two bands of real spherical harmonics, in the order 1, y, z, x: coefficients of the irradiance over π.
    pub fn harmonics(&self) -> [Rgb; 4] {
        let basis = Harmonics::new(1);
        let n = self.size;
        let (mut sums, mut all) = ([Rgb::ZERO; 4], 0.0);
        for i in 0..n * n {
            let omega = solid_angle(i % n, i / n, n);
            for (sum, y) in sums.iter_mut().zip(basis.at(middle(i, n))) {
                *sum += self.irradiance[i] * (FRAC_1_PI * y * omega);
            }
            all += omega;
        }
        // Solid angles of few texels do not add up to the sphere's by themselves.
        sums.map(|sum| sum * (4.0 * PI / all))
    }
}
