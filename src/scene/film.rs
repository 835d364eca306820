//! Reconstruction filters of a film: how samples around a pixel's centre add up to it.
//!
//! Each is a product of the same function along x and along y. Mitsuba splats every sample on all pixels that it reaches and divides by
//! the weights' sum; *ours*: each pixel draws its own samples in proportion to the filter's magnitude (Ernst, Stamminger and Greiner
//! 2006), which has the same mean and leaves pixels independent. Near the film's edges only what lies on the film counts, as there.

/// A reconstruction filter; distances in pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// The pixel's own square.
    #[default]
    Box,
    /// A linear fall to zero at this distance.
    Tent(f64),
    /// A Gaussian of this standard deviation, cut at four of them and lowered to zero there.
    Gaussian(f64),
    /// Mitchell and Netravali's cubics of parameters B and C, two pixels wide to either side.
    Mitchell(f64, f64),
    /// A windowed sinc of so many lobes.
    Lanczos(f64),
}

/// Steps in which a filter's function is tabulated, to either side of the centre.
const STEPS: usize = 512;

impl Filter {
    /// Distance past which it is zero.
    pub fn radius(self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Tent(radius) => radius,
            Self::Gaussian(deviation) => 4.0 * deviation,
            Self::Mitchell(..) => 2.0,
            Self::Lanczos(lobes) => lobes,
        }
    }

    /// Its value, not normalised, at a distance.
    pub fn eval(self, x: f64) -> f64 {
        let x = x.abs();
        if x > self.radius() {
            return 0.0;
        }
        match self {
            Self::Box => 1.0,
            Self::Tent(radius) => 1.0 - x / radius,
            Self::Gaussian(deviation) => {
                let bell = |x: f64| (-0.5 * (x / deviation).powi(2)).exp();
                (bell(x) - bell(self.radius())).max(0.0)
            }
            Self::Mitchell(b, c) if x < 1.0 => {
                ((12.0 - 9.0 * b - 6.0 * c) * x.powi(3) + (12.0 * b + 6.0 * c - 18.0) * x * x + 6.0 - 2.0 * b) / 6.0
            }
            Self::Mitchell(b, c) => {
                let cubic = -(b + 6.0 * c) * x.powi(3) + (6.0 * b + 30.0 * c) * x * x;
                (cubic - (12.0 * b + 48.0 * c) * x + 8.0 * b + 24.0 * c) / 6.0
            }
            Self::Lanczos(lobes) => {
                let sinc = |x: f64| if x < 1e-9 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) };
                sinc(x) * sinc(x / lobes)
            }
        }
    }
}

/// A filter along one axis of an image, ready to be sampled.
#[derive(Debug, Clone)]
pub struct FilterSamples {
    filter: Filter,
    /// Side of the image along the axis, pixels.
    side: f64,
    /// Integrals from -radius of the filter and of its magnitude, in even steps.
    sums: Vec<[f64; 2]>,
}

impl FilterSamples {
    /// Tabulates `filter` for an image of `side` pixels.
    pub fn new(filter: Filter, side: u32) -> Self {
        let step = filter.radius() / STEPS as f64;
        let mut sums = vec![[0.0; 2]];
        let mut sum = [0.0; 2];
        for k in 0..2 * STEPS {
            let value = filter.eval((k as f64 + 0.5 - STEPS as f64) * step) * step;
            sum = [sum[0] + value, sum[1] + value.abs()];
            sums.push(sum);
        }
        Self { filter, side: f64::from(side), sums }
    }

    /// Where along the axis the sample `u` in [0, 1) of pixel `i` lies, and its weight, which is 1 in the mean.
    pub fn sample(&self, i: u32, u: f32) -> (f32, f32) {
        let (centre, radius) = (f64::from(i) + 0.5, self.filter.radius());
        let (low, high) = ((-radius).max(-centre), radius.min(self.side - centre));
        let (from, to) = (self.integral(low), self.integral(high));
        let target = from[1] + f64::from(u) * (to[1] - from[1]);
        let k = self.sums.partition_point(|s| s[1] <= target).clamp(1, 2 * STEPS) - 1;
        let (a, b) = (self.sums[k], self.sums[k + 1]);
        let rest = if b[1] > a[1] { (target - a[1]) / (b[1] - a[1]) } else { 0.5 };
        let x = ((k as f64 + rest) / STEPS as f64 - 1.0) * radius;
        let weight = (b[0] - a[0]).signum() * (to[1] - from[1]) / (to[0] - from[0]);
        ((centre + x.clamp(low, high)) as f32, weight as f32)
    }

    fn integral(&self, x: f64) -> [f64; 2] {
        let place = ((x / self.filter.radius() + 1.0) * STEPS as f64).clamp(0.0, 2.0 * STEPS as f64);
        let k = (place as usize).min(2 * STEPS - 1);
        let t = place - k as f64;
        [0, 1].map(|c| self.sums[k][c] * (1.0 - t) + self.sums[k + 1][c] * t)
    }
}

/// What a scene says of its film's filter.
#[derive(Debug, Clone, Default)]
pub struct FilmFilter {
    /// The filter: Mitsuba's default, a Gaussian, where the scene names none.
    pub filter: Filter,
    /// Its name and where it stands, `gaussian (scene.xml:9)`; `None` where the scene names none.
    pub named: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Filter; 6] = [
        Filter::Box,
        Filter::Tent(1.0),
        Filter::Gaussian(0.5),
        Filter::Mitchell(1.0 / 3.0, 1.0 / 3.0),
        Filter::Mitchell(0.0, 0.5),
        Filter::Lanczos(3.0),
    ];

    /// Values of Mitsuba 3.9.1's `rfilter.eval`, divided by that at 0: at 0.3, 0.45, 0.9 and 1.4 pixels. Its Gaussian is a fit.
    #[test]
    fn values_are_those_of_mitsuba() {
        let table = [
            (1, 2e-6, [0.7, 0.55, 0.1, 0.0]),
            (2, 6e-4, [0.835_677, 0.667_396, 0.197_620, 0.019_501]),
            (3, 2e-6, [0.832_938, 0.663_977, 0.134_313, -0.040_5]),
            (4, 2e-6, [0.815_5, 0.630_437, 0.068_5, -0.072]),
            (5, 2e-6, [0.844_343, 0.673_075, 0.093_816, -0.146_685]),
        ];
        for (k, tolerance, expected) in table {
            for (x, expected) in [0.3, 0.45, 0.9, 1.4].into_iter().zip(expected) {
                let found: f64 = ALL[k].eval(x) / ALL[k].eval(0.0);
                assert!((found - expected).abs() < tolerance, "{:?} at {x}: {found}, Mitsuba {expected}", ALL[k]);
            }
        }
    }

    /// Weighted samples of a polynomial have the mean that quadrature gives, in the middle of an image and at its edge.
    #[test]
    fn samples_add_up_to_the_filter() {
        for filter in ALL {
            let samples = FilterSamples::new(filter, 8);
            for i in [0, 3, 7] {
                let n = 100_000;
                let f = |x: f64| 1.0 + x + 0.3 * x * x;
                let (mut mean, mut weights) = (0.0, 0.0);
                for k in 0..n {
                    let (x, weight) = samples.sample(i, (k as f32 + 0.5) / n as f32);
                    assert!((0.0..=8.0).contains(&x), "{filter:?}: {x}");
                    mean += f64::from(weight) * f(f64::from(x)) / f64::from(n);
                    weights += f64::from(weight) / f64::from(n);
                }
                let (mut sum, mut norm) = (0.0, 0.0);
                for k in 0..80_000 {
                    let x = (f64::from(k) + 0.5) / 1e4;
                    let w = filter.eval(x - f64::from(i) - 0.5);
                    (sum, norm) = (sum + w * f(x), norm + w);
                }
                assert!((mean / (sum / norm) - 1.0).abs() < 2e-3, "{filter:?} pixel {i}: {mean}, expected {}", sum / norm);
                assert!((weights - 1.0).abs() < 1e-3, "{filter:?} pixel {i}: weights {weights}");
            }
        }
    }
}
