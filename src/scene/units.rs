//! Scenes in other units than metres.
//!
//! What was chosen by measurement in rooms is a length in metres: the 1 m at which two reflected points are as different as can be
//! (Eq. 1), the filter's depth threshold of .15 m, the footprint's table from .01 to 10 m, the .1 mm that an eye keeps from a reflector, the
//! .5 m around a camera path; and a probe's half floats hold reflected points from .1 mm to 65 km well. All of it fits a scene of .1 m to 10 km. A scene
//! of another size cannot be in metres, or is none that a bake was made for: it is multiplied by a power of ten when it is loaded, as by
//! `--unit-scale`, so that a room in any unit is baked and shown as the room in metres is.

use super::Geometry;
use serde::Serialize;

/// Sizes that scenes in metres have, m.
pub const METRES: std::ops::RangeInclusive<f32> = 0.1..=10_000.0;
/// Share of the vertices at either end of each axis that may be a horizon around a scene of ordinary size.
const HORIZON: f32 = 0.05;

/// What a scene's lengths were multiplied by when it was loaded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UnitScale(pub f32);

impl Default for UnitScale {
    fn default() -> Self {
        Self(1.0)
    }
}

/// The power of ten that makes a room, 1 to 10 m across, of a scene all of which is too small for one in metres, or most of which is too
/// large. `None` for scenes in metres, and for those without a size.
pub fn metric(geometry: &Geometry) -> Option<UnitScale> {
    let (low, high) = geometry.bounds();
    // Squares of such lengths may be too much or too little for f32.
    let whole = low.as_dvec3().distance(high.as_dvec3());
    let (least, greatest) = (f64::from(*METRES.start()), f64::from(*METRES.end()));
    let across = if whole > greatest && whole.is_finite() { most(geometry) } else { whole };
    let odd = (across > 0.0 && whole < least) || (across > greatest && across.is_finite());
    let scale = 10f64.powf(1.0 - across.log10().ceil()) as f32;
    (odd && scale.is_normal()).then_some(UnitScale(scale))
}

/// Diagonal of the box that holds the vertices without those at the ends of each axis.
fn most(geometry: &Geometry) -> f64 {
    let cut = (geometry.positions.len() as f32 * HORIZON) as usize;
    let extent = |axis: usize| {
        let mut along: Vec<f32> = geometry.positions.iter().map(|p| p[axis]).collect();
        along.sort_unstable_by(f32::total_cmp);
        along[along.len() - 1 - cut] - along[cut]
    };
    glam::Vec3::from_array(std::array::from_fn(extent)).as_dvec3().length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn box_of(size: Vec3, others: usize) -> Geometry {
        let corner = |i: usize| size * Vec3::from_array([i & 1, i >> 1 & 1, i >> 2].map(|b| b as f32));
        let near = (0..others).map(|i| corner(i & 7) / size * Vec3::new(5.0, 3.0, 4.0));
        Geometry { positions: (0..8).map(corner).chain(near).collect(), ..Geometry::default() }
    }

    #[test]
    fn scenes_in_metres_stay_and_others_become_rooms() {
        let room = Vec3::new(5.0, 2.8, 4.0);
        for scale in [0.02, 0.1, 1.0, 100.0, 1400.0] {
            assert_eq!(metric(&box_of(room * scale, 0)), None, "{scale}");
        }
        for exponent in [-30, -12, -6, -3, 4, 9, 20] {
            let found = metric(&box_of(room * 10f32.powi(exponent), 0)).unwrap().0;
            assert_eq!(found, format!("1e{}", -exponent).parse::<f32>().unwrap(), "{exponent}");
        }
    }

    #[test]
    fn a_horizon_does_not_shrink_the_room_in_it() {
        assert_eq!(metric(&box_of(Vec3::new(1e6, 1.0, 1e6), 1000)), None);
        let mut vase = box_of(Vec3::new(1e6, 1.0, 1e6), 1000);
        vase.positions[8..].iter_mut().for_each(|p| *p *= 1e-3);
        assert_eq!(metric(&vase), None);
        assert_eq!(metric(&box_of(Vec3::ZERO, 0)), None);
        assert_eq!(metric(&box_of(Vec3::splat(f32::INFINITY), 0)), None);
        assert_eq!(metric(&Geometry::default()), None);
    }
}
