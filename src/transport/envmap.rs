//! Lat-long environment images: lookup, and importance sampling by luminance times the sine of the polar angle.
//!
//! Mitsuba's `envmap`: columns are sampled at their centres and wrap around; rows are sampled at their edges, so the first
//! is the zenith and the last the nadir. Between pixels radiance is bilinear, and so is the density per lat-long area, whose
//! corner values are luminance times sine at the pixels.

use super::steps::Steps;
use crate::base::math::{Rgb, direction_from_lat_long, lat_long_from_direction, luminance};
use crate::material::image::Image;
use glam::{Affine3A, Mat3, Vec2, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// An environment image that can be sampled.
#[derive(Debug)]
pub struct Envmap {
    pub(crate) image: Arc<Image>,
    pub(crate) scale: f32,
    pub(crate) world_from_local: Mat3,
    pub(crate) local_from_world: Mat3,
    /// Distribution over rows of cells.
    pub(crate) rows: Steps,
    /// Distribution along each row of cells.
    pub(crate) columns: Vec<Steps>,
    /// Sine of the polar angle of each row of pixels. (An image of one or two rows is nothing but poles: 1 there.)
    pub(crate) sines: Vec<f32>,
    /// Mean corner value over all cells: what turns a corner value into a density.
    pub(crate) mean: f32,
}

/// A cell of the pixel grid and where in it.
struct Place {
    x: [usize; 2],
    y: [usize; 2],
    at: Vec2,
}

impl Envmap {
    /// Prepares an image; `None` where it is black or has no pixels.
    pub fn new(image: &Arc<Image>, scale: f32, to_world: &Affine3A) -> Option<Self> {
        let world_from_local = Mat3::from(to_world.matrix3);
        if image.width == 0 || image.height == 0 || scale <= 0.0 || world_from_local.determinant() == 0.0 {
            return None;
        }
        let mut map = Self {
            image: image.clone(),
            scale,
            world_from_local,
            local_from_world: world_from_local.inverse(),
            rows: Steps::new([1.0]).0,
            columns: Vec::new(),
            sines: (0..image.height)
                .map(|y| if image.height < 3 { 1.0 } else { (PI * y as f32 / (image.height - 1) as f32).sin() })
                .collect(),
            mean: 0.0,
        };
        let (width, height) = map.cells();
        let mut rows = Vec::with_capacity(height);
        for y in 0..height {
            let corner = |x, y| f64::from(map.corner(x, y));
            let y1 = (y + 1).min(image.height - 1);
            let cells = (0..width).map(|x| {
                let x1 = (x + 1) % width;
                0.25 * (corner(x, y) + corner(x1, y) + corner(x, y1) + corner(x1, y1))
            });
            let (steps, total) = Steps::new(cells);
            map.columns.push(steps);
            rows.push(total);
        }
        let (steps, total) = Steps::new(rows);
        map.rows = steps;
        map.mean = (total / (width * height) as f64) as f32;
        (map.mean > 0.0 && map.mean.is_finite()).then_some(map)
    }

    /// Radiance from the unit direction `d` (world, pointing away from the scene).
    pub fn eval(&self, d: Vec3) -> Rgb {
        self.radiance(&self.place(self.lat_long(d)))
    }

    /// Density of [`Envmap::sample`] in direction `d`, per solid angle.
    pub fn pdf(&self, d: Vec3) -> f32 {
        let uv = self.lat_long(d);
        self.density(&self.place(uv)) / lat_long_jacobian(uv.y)
    }

    /// A direction, its pdf (solid angle) and the radiance from there.
    pub fn sample(&self, v: Vec2) -> (Vec3, f32, Rgb) {
        let (width, height) = self.cells();
        let (y, vy) = self.rows.pick(v.y);
        let (x, vx) = self.columns[y].pick(v.x);
        let mut place = Place { x: [x, (x + 1) % width], y: [y, (y + 1).min(self.image.height - 1)], at: Vec2::ZERO };
        let [[a, b], [c, d]] = self.corners(&place);
        place.at.y = sample_linear(vy, a + b, c + d);
        let ty = place.at.y;
        place.at.x = sample_linear(vx, a + (c - a) * ty, b + (d - b) * ty);
        let uv = Vec2::new((x as f32 + place.at.x + 0.5) / width as f32, (y as f32 + ty) / height as f32);
        let pdf = self.density(&place) / lat_long_jacobian(uv.y);
        ((self.world_from_local * direction_from_lat_long(uv)).normalize_or(Vec3::Y), pdf, self.radiance(&place))
    }

    /// The numbers with which [`Envmap::sample`] finds the direction `d`.
    pub fn numbers(&self, d: Vec3) -> Vec2 {
        let place = self.place(self.lat_long(d));
        let [[a, b], [c, d]] = self.corners(&place);
        let Vec2 { x: tx, y: ty } = place.at;
        let x = self.columns[place.y[0]].at(place.x[0], linear_share(tx, a + (c - a) * ty, b + (d - b) * ty));
        Vec2::new(x, self.rows.at(place.y[0], linear_share(ty, a + b, c + d)))
    }

    /// Tells the caches what [`Envmap::sample`] will read of its distribution.
    pub fn prefetch(&self, v: Vec2) {
        let (y, _) = self.rows.pick(v.y);
        self.columns[y].prefetch(v.x);
    }

    /// Tells the caches what [`Envmap::sample`] will read of its image, which the distribution says.
    pub fn prefetch_radiance(&self, v: Vec2) {
        let (y, _) = self.rows.pick(v.y);
        let (x, _) = self.columns[y].pick(v.x);
        self.image.prefetch(x, y);
        self.image.prefetch(x, (y + 1).min(self.image.height - 1));
    }

    /// Cells of the bilinear grid: one a column, and one between each two rows.
    fn cells(&self) -> (usize, usize) {
        (self.image.width, (self.image.height - 1).max(1))
    }

    fn lat_long(&self, d: Vec3) -> Vec2 {
        lat_long_from_direction((self.local_from_world * d).normalize_or(Vec3::Y))
    }

    fn place(&self, uv: Vec2) -> Place {
        let (width, height) = self.cells();
        let x = (uv.x * width as f32 - 0.5).rem_euclid(width as f32);
        let y = uv.y.clamp(0.0, 1.0) * height as f32;
        let (x0, y0) = ((x as usize).min(width - 1), (y as usize).min(height - 1));
        Place {
            x: [x0, (x0 + 1) % width],
            y: [y0, (y0 + 1).min(self.image.height - 1)],
            at: Vec2::new(x - x0 as f32, y - y0 as f32),
        }
    }

    fn radiance(&self, place: &Place) -> Rgb {
        let pixel = |x: usize, y: usize| self.image.pixel(x, y);
        let row = |y: usize| pixel(place.x[0], y).lerp(pixel(place.x[1], y), place.at.x);
        row(place.y[0]).lerp(row(place.y[1]), place.at.y) * self.scale
    }

    /// Luminance times sine at a pixel.
    fn corner(&self, x: usize, y: usize) -> f32 {
        (luminance(self.image.pixel(x, y)) * self.sines[y]).max(0.0)
    }

    fn corners(&self, place: &Place) -> [[f32; 2]; 2] {
        place.y.map(|y| place.x.map(|x| self.corner(x, y)))
    }

    /// Density per lat-long unit square.
    fn density(&self, place: &Place) -> f32 {
        let [top, bottom] = self.corners(place).map(|[a, b]| a + (b - a) * place.at.x);
        (top + (bottom - top) * place.at.y) / self.mean
    }
}

/// Solid angle of a unit of lat-long area: 2 π² sin θ.
fn lat_long_jacobian(v: f32) -> f32 {
    2.0 * PI * PI * (v * PI).sin().max(1e-5)
}

/// Draws from a density on [0, 1] that goes linearly from `a` to `b`.
fn sample_linear(u: f32, a: f32, b: f32) -> f32 {
    if a + b <= 0.0 {
        return u;
    }
    let root = (a * a + (b * b - a * a) * u).max(0.0).sqrt();
    (u * (a + b) / (a + root).max(f32::MIN_POSITIVE)).min(1.0)
}

/// The number with which [`sample_linear`] finds `t`.
fn linear_share(t: f32, a: f32, b: f32) -> f32 {
    if a + b <= 0.0 { t } else { t * (2.0 * a + (b - a) * t) / (a + b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Sampler;

    fn test_map() -> Envmap {
        test_map_turned(&Affine3A::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.7))
    }

    /// A map with a soft gradient, a sun of one pixel and a black quarter.
    fn test_map_turned(turn: &Affine3A) -> Envmap {
        let (width, height) = (16, 8);
        let pixel = |i: usize| match (i % width, i / width) {
            (5, 3) => Rgb::new(90.0, 80.0, 60.0),
            (x, y) if x >= 12 => Rgb::ZERO * y as f32,
            (x, y) => Rgb::new(0.2 + 0.1 * x as f32, 0.5, 0.1 * y as f32),
        };
        let image = Image::new(width, height, (0..width * height).map(pixel).collect());
        Envmap::new(&Arc::new(image), 2.0, turn).unwrap()
    }

    /// Sums `f` over a fine lat-long grid, cell by cell: (index of the coarse bin, value, solid angle).
    fn for_each_cell(fine: usize, mut f: impl FnMut(usize, Vec3, f32)) {
        for y in 0..fine {
            for x in 0..2 * fine {
                let uv = Vec2::new((x as f32 + 0.5) / (2 * fine) as f32, (y as f32 + 0.5) / fine as f32);
                let sr = 2.0 * PI * PI * (uv.y * PI).sin() / (2 * fine * fine) as f32;
                f((uv.y * 6.0) as usize * 12 + (uv.x * 12.0) as usize, direction_from_lat_long(uv), sr);
            }
        }
    }

    /// Against Mitsuba 3.9.1 (`scalar_rgb`): the same image, scale 2, to_world = rotate y by 40 after x by 20 degrees.
    #[test]
    fn radiance_and_density_are_those_of_mitsuba() {
        let turn = Affine3A::from_rotation_y(40f32.to_radians()) * Affine3A::from_rotation_x(20f32.to_radians());
        let map = test_map_turned(&turn);
        let mitsuba = [
            ([0.3, 0.5, -0.2], [0.918_048, 1.0, 0.298_319], 0.024_218_6),
            ([1.0, 0.0, 0.0], [143.402_66, 127.383_32, 95.507_93], 3.415_523_5),
            ([-0.4, -0.8, 0.1], [2.560_707_6, 1.0, 1.203_011_6], 0.035_774_6),
            ([0.05, 0.1, 0.9], [2.255_529_2, 1.0, 0.528_344_75], 0.032_071_4),
            ([0.6, 0.2, -0.4], [1.104_313_9, 1.0, 0.570_108_5], 0.026_049_8),
        ];
        for (d, radiance, pdf) in mitsuba {
            let d = Vec3::from(d).normalize();
            let error = (map.eval(d) / Rgb::from(radiance) - 1.0).abs().max_element();
            assert!(error < 1e-4, "{d}: {} where Mitsuba has {radiance:?}", map.eval(d));
            assert!((map.pdf(d) / pdf - 1.0).abs() < 1e-3, "{d}: pdf {} where Mitsuba has {pdf}", map.pdf(d));
        }
    }

    #[test]
    fn the_density_integrates_to_one() {
        let map = test_map();
        let mut sum = 0.0;
        for_each_cell(512, |_, d, sr| sum += f64::from(map.pdf(d) * sr));
        assert!((sum - 1.0).abs() < 2e-3, "{sum}");
    }

    #[test]
    fn samples_follow_the_density() {
        const N: u32 = 1 << 16;
        let map = test_map();
        let mut expected = [0f64; 72];
        for_each_cell(768, |bin, d, sr| expected[bin] += f64::from(map.pdf(d) * sr));
        let mut found = [0f64; 72];
        for i in 0..N {
            let (d, pdf, radiance) = map.sample(Sampler::new(3, i).next_2d());
            let again = map.pdf(d);
            assert!((pdf - again).abs() < 2e-2 * pdf.max(0.05), "{d}: {pdf} and {again}");
            let seen = map.eval(d);
            assert!((radiance - seen).abs().max_element() < 2e-2 * seen.max_element().max(0.05), "{d}: {radiance} and {seen}");
            let uv = lat_long_from_direction(d);
            found[((uv.y * 6.0) as usize).min(5) * 12 + (uv.x * 12.0) as usize] += 1.0 / f64::from(N);
        }
        for (bin, (&e, &f)) in expected.iter().zip(&found).enumerate() {
            let sigma = (e * (1.0 - e) / f64::from(N)).sqrt();
            assert!((e - f).abs() < 4.0 * sigma + 1e-3 * e + 1e-5, "bin {bin}: expected {e}, found {f}");
        }
    }

    #[test]
    fn directions_are_found_by_their_numbers() {
        let map = test_map();
        for i in 0..4096 {
            let v = Sampler::new(4, i).next_2d();
            let (d, pdf, _) = map.sample(v);
            let back = map.numbers(d);
            // Where little is drawn, a number is a large step of direction.
            let (again, _, _) = map.sample(back);
            assert!(back.distance(v) < 2e-3 || again.distance(d) < 1e-3, "{v} gives {d} (density {pdf}), which has {back}");
        }
    }

    #[test]
    fn sampled_radiance_adds_up_to_the_integral() {
        let map = test_map();
        let mut expected = Rgb::ZERO;
        for_each_cell(512, |_, d, sr| expected += map.eval(d) * sr);
        const N: u32 = 4096;
        let mut found = Rgb::ZERO;
        for i in 0..N {
            let (_, pdf, radiance) = map.sample(Sampler::new(9, i).next_2d());
            found += radiance / pdf / N as f32;
        }
        assert!(((found - expected) / expected).abs().max_element() < 0.01, "{found}, expected {expected}");
    }

    #[test]
    fn a_black_or_empty_image_is_no_light() {
        let image = |width, height, c| Arc::new(Image::new(width, height, vec![c; width * height]));
        assert!(Envmap::new(&image(4, 2, Rgb::ZERO), 1.0, &Affine3A::IDENTITY).is_none());
        assert!(Envmap::new(&image(0, 0, Rgb::ONE), 1.0, &Affine3A::IDENTITY).is_none());
        let one = Envmap::new(&image(1, 1, Rgb::ONE), 3.0, &Affine3A::IDENTITY).unwrap();
        assert_eq!(one.eval(Vec3::Z), Rgb::splat(3.0));
    }
}
