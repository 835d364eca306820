//! An attribute over time.

use crate::base::math::Rgb;
use crate::scene::spline::Spline;
use glam::DVec3;
use std::ops::RangeInclusive;

/// A number or three, the same at all times or between keyframes; a number stands in all three places.
#[derive(Debug, Clone)]
pub struct Track {
    spline: Spline,
    /// One a key.
    values: Vec<DVec3>,
    range: RangeInclusive<f64>,
}

impl Track {
    /// What does not change.
    pub fn still(value: DVec3) -> Self {
        Self { spline: Spline::still(), values: vec![value], range: f64::MIN..=f64::MAX }
    }

    /// A value a key of the spline. What the spline's swing takes out of `range` is cut off.
    pub fn new(spline: Spline, values: Vec<DVec3>, range: RangeInclusive<f64>) -> Self {
        assert_eq!(spline.times().len(), values.len());
        Self { spline, values, range }
    }

    /// The value at a time, seconds.
    pub fn at(&self, time: f64) -> DVec3 {
        self.spline.at(&self.values, time).clamp(DVec3::splat(*self.range.start()), DVec3::splat(*self.range.end()))
    }

    /// The same of a number.
    pub fn number(&self, time: f64) -> f64 {
        self.at(time).x
    }

    /// The same of a colour.
    pub fn color(&self, time: f64) -> Rgb {
        self.at(time).as_vec3()
    }

    /// Whether it has more than one key.
    pub fn moves(&self) -> bool {
        self.values.len() > 1
    }

    /// Times of its keys.
    pub fn times(&self) -> &[f64] {
        self.spline.times()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spline_that_swings_out_of_the_range_is_cut_off() {
        let spline = Spline::new(vec![0.0, 1.0, 2.0, 3.0]).unwrap();
        let values = [0.0, 1.0, 1.0, 0.0].map(DVec3::splat).to_vec();
        let free = Track::new(spline.clone(), values.clone(), f64::MIN..=f64::MAX);
        let cut = Track::new(spline, values, 0.0..=1.0);
        assert!(free.number(1.5) > 1.1 && cut.number(1.5) == 1.0);
        assert!((free.number(0.4) - cut.number(0.4)).abs() < 1e-15);
        assert_eq!((cut.number(-1.0), cut.number(9.0)), (0.0, 0.0));
    }
}
