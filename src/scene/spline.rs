//! The curve between keyframes.

use glam::DVec3;

/// Catmull-Rom over times that need not be even: a cubic Hermite spline whose slope at a key is that of the chord between
/// its neighbours (at the ends: of the only chord). Before the first key and after the last one their values hold.
#[derive(Debug, Clone)]
pub struct Spline {
    /// Seconds; at least one.
    times: Vec<f64>,
}

impl Spline {
    /// # Errors
    /// There is no time, one is not finite, or they do not ascend: which one.
    pub fn new(times: Vec<f64>) -> Result<Self, String> {
        if let Some(i) = times.iter().position(|t| !t.is_finite()) {
            return Err(format!("keyframes[{i}]: time {}: expected a finite number", times[i]));
        }
        match times.windows(2).position(|t| t[0] >= t[1]) {
            Some(i) => Err(format!("keyframes[{}]: time {} follows {}: expected ascending times", i + 1, times[i + 1], times[i])),
            None if times.is_empty() => Err("keyframes: found none".into()),
            None => Ok(Self { times }),
        }
    }

    /// Where nothing moves: one key.
    pub fn still() -> Self {
        Self { times: vec![0.0] }
    }

    /// The keys' times, ascending.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The value at a time, of those of the keys.
    pub fn at(&self, values: &[DVec3], time: f64) -> DVec3 {
        let n = self.times.len();
        if n == 1 {
            return values[0];
        }
        let time = time.clamp(self.times[0], self.times[n - 1]);
        let i = self.times.partition_point(|&t| t <= time).clamp(1, n - 1) - 1;
        let slope = |k: usize| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
            (values[b] - values[a]) / (self.times[b] - self.times[a])
        };
        let h = self.times[i + 1] - self.times[i];
        let s = (time - self.times[i]) / h;
        let (s2, s3) = (s * s, s * s * s);
        values[i] * (2.0 * s3 - 3.0 * s2 + 1.0)
            + values[i + 1] * (3.0 * s2 - 2.0 * s3)
            + slope(i) * (h * (s3 - 2.0 * s2 + s))
            + slope(i + 1) * (h * (s3 - s2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evenly_spaced_keys_give_the_uniform_catmull_rom_spline() {
        let spline = Spline::new(vec![0.0, 1.0, 2.0, 3.0]).unwrap();
        let p = [DVec3::ZERO, DVec3::X, DVec3::new(2.0, 3.0, 0.0), DVec3::new(1.0, 4.0, 2.0)];
        // The middle of a segment is (-p0 + 9 p1 + 9 p2 - p3) / 16.
        let expected = (-p[0] + 9.0 * p[1] + 9.0 * p[2] - p[3]) / 16.0;
        assert!((spline.at(&p, 1.5) - expected).length() < 1e-12);
        for (i, key) in p.iter().enumerate() {
            assert!((spline.at(&p, i as f64) - *key).length() < 1e-12);
        }
        assert_eq!((spline.at(&p, -5.0), spline.at(&p, 50.0)), (p[0], p[3]));
    }
}
