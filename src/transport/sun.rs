//! The sun: a disc at infinity of the same radiance all over, sampled uniformly by solid angle.

use crate::base::math::{Basis, Rgb};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// A disc at infinity that can be sampled.
#[derive(Debug)]
pub struct Sun {
    /// About the unit direction to its middle.
    basis: Basis,
    /// Unit; nothing shines from below the plane that it stands on.
    pub(crate) up: Vec3,
    /// 1 - cos of the angle from its middle to its rim. (The cosine itself is 1 but for its last bits.)
    pub(crate) height: f32,
    pub(crate) radiance: Rgb,
}

impl Sun {
    /// A disc of the radius `angle_rad`; `None` where it is black or has no width.
    pub fn new(direction: Vec3, up: Vec3, angle_rad: f32, radiance: Rgb) -> Option<Self> {
        let height = 2.0 * (0.5 * angle_rad).sin().powi(2);
        let shines = radiance.max_element() > 0.0 && radiance.is_finite() && height > 0.0;
        shines.then_some(Self { basis: Basis::from_normal(direction), up, height, radiance })
    }

    /// Unit direction to the middle.
    pub(crate) fn direction(&self) -> Vec3 {
        self.basis.n
    }

    /// Radiance from the unit direction `d` (pointing away from the scene).
    pub fn eval(&self, d: Vec3) -> Rgb {
        if self.holds(d) && d.dot(self.up) >= 0.0 { self.radiance } else { Rgb::ZERO }
    }

    /// Density of [`Sun::sample`] in direction `d`, per solid angle.
    pub fn pdf(&self, d: Vec3) -> f32 {
        if self.holds(d) { 1.0 / self.solid_angle() } else { 0.0 }
    }

    /// A direction, its pdf (solid angle) and the radiance from there.
    pub fn sample(&self, v: Vec2) -> (Vec3, f32, Rgb) {
        let below_tip = v.y * self.height;
        let sin = (below_tip * (2.0 - below_tip)).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (v.x * 2.0 * PI).sin_cos();
        let d = self.basis.to_world(Vec3::new(sin * cos_phi, sin * sin_phi, 1.0 - below_tip));
        let radiance = if d.dot(self.up) >= 0.0 { self.radiance } else { Rgb::ZERO };
        (d, 1.0 / self.solid_angle(), radiance)
    }

    /// Whether `d` points to the disc: by its distance to the middle, squared, as a narrow disc is lost in a cosine's rounding.
    fn holds(&self, d: Vec3) -> bool {
        d.distance_squared(self.basis.n) <= 2.0 * self.height
    }

    fn solid_angle(&self) -> f32 {
        2.0 * PI * self.height
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Sampler;

    /// Half of it below the horizon. A cosine in 32 bits would get the width wrong by 0.3 %.
    #[test]
    fn samples_fill_the_disc_and_the_rim_is_where_it_should_be() {
        let middle = Vec3::new(0.6, 0.0, -0.8);
        let angle = 0.2679f32.to_radians();
        let sun = Sun::new(middle, Vec3::Y, angle, Rgb::ONE).unwrap();
        let mut lit = 0;
        for i in 0..4096 {
            let (d, pdf, radiance) = sun.sample(Sampler::new(4, i).next_2d());
            assert!((d.length() - 1.0).abs() < 1e-6 && d.distance(middle) < 1.001 * angle);
            assert!((pdf * PI * angle * angle - 1.0).abs() < 1e-4, "{pdf}");
            lit += u32::from(radiance == Rgb::ONE);
        }
        assert!((lit as f32 / 4096.0 - 0.5).abs() < 0.03, "{lit}");
        for (share, holds) in [(0.999, true), (1.001, false)] {
            let d = middle * (share * angle).cos() + Vec3::Y * (share * angle).sin();
            assert_eq!((sun.pdf(d) > 0.0, sun.eval(d) == Rgb::ONE), (holds, holds), "{share}");
        }
        assert_eq!(sun.eval(middle - Vec3::Y * 0.5 * angle), Rgb::ZERO);
    }

    #[test]
    fn a_black_or_narrow_sun_is_no_light() {
        assert!(Sun::new(Vec3::Y, Vec3::Y, 0.1, Rgb::ZERO).is_none());
        assert!(Sun::new(Vec3::Y, Vec3::Y, 0.0, Rgb::ONE).is_none());
    }
}
