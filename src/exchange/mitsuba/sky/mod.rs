//! The clear sky and its sun after Hosek and Wilkie ("An Analytic Model for Full Spectral Sky-Dome Radiance", 2012; "Adding a
//! Solar-Radiance Function to the Hosek-Wilkie Skylight Model", 2013), as Mitsuba's `sunsky` shows them in its RGB variants.
//!
//! Directions are in Mitsuba's own space of a sky: Z up.

mod model;
mod solar_position;

pub use model::{Sky, sun_irradiance};
pub use solar_position::Moment;

use crate::base::math::{Rgb, direction_from_lat_long};
use crate::material::image::Image;
use glam::{DVec3, Vec2};
use rayon::prelude::*;

/// Pixels of a sky's image, a third of a degree each. The height is even, so that the horizon lies in the middle between two rows, the
/// upper of them bright and the lower black: what bilinear lookup adds to the light from below the horizon it takes from above.
const IMAGE: [usize; 2] = [1024, 512];

/// A lat-long image of the sky for a sun in the unit direction `sun`. The image's own space is Y up: its (x, y, z) is (x, -z, y) here.
pub fn image(sky: &Sky, sun: DVec3) -> Image {
    let [width, height] = IMAGE;
    let row = |y: usize| {
        // The rows' directions are at their edges, the columns' at their centres (`transport::envmap`).
        let direction = move |x: usize| {
            let uv = Vec2::new((x as f32 + 0.5) / width as f32, y as f32 / (height - 1) as f32);
            let d = direction_from_lat_long(uv).as_dvec3();
            DVec3::new(d.x, -d.z, d.y)
        };
        let cos_theta = direction(0).z;
        let ring = sky.ring(cos_theta);
        (0..width).map(move |x| match cos_theta > 0.0 {
            true => ring.radiance(direction(x).angle_between(sun)),
            false => Rgb::ZERO,
        })
    };
    let pixels = (0..height).into_par_iter().flat_map_iter(row).collect();
    Image::new(width, height, pixels)
}
