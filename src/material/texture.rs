//! Textures: constants, bitmaps and checkerboards.
//!
//! Lookups are Mitsuba 3's: texel (i, j) of a bitmap has its centre at ((i + 0.5) / width, (j + 0.5) / height), and
//! row 0 of the file lies at v = 0 (OBJ files have v upwards: their loader turns it).

use super::image::Image;
use crate::base::math::{Rgb, floor};
use glam::{Affine2, Vec2};
use std::sync::Arc;

/// A spatially varying colour.
#[derive(Debug, Clone)]
pub enum Texture {
    /// The same everywhere.
    Constant(Rgb),
    /// An image over uv space.
    Bitmap(Bitmap),
    /// Mitsuba's `checkerboard`.
    Checkerboard {
        /// Colour where both or neither coordinate's fraction exceeds one half.
        color0: Rgb,
        /// The other colour.
        color1: Rgb,
        /// From the surface's uv to the texture's.
        to_uv: Affine2,
    },
}

/// An image with its lookup rules.
#[derive(Debug, Clone)]
pub struct Bitmap {
    /// Linear pixels.
    pub image: Arc<Image>,
    /// From the surface's uv to the texture's.
    pub to_uv: Affine2,
    /// Nearest in place of bilinear.
    pub nearest: bool,
    /// What lies outside [0, 1]².
    pub wrap: Wrap,
    /// Multiplies every pixel.
    pub scale: f32,
}

/// Extension of a bitmap outside [0, 1]².
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrap {
    /// Tiled.
    Repeat,
    /// Tiled, every other tile mirrored.
    Mirror,
    /// The border pixel goes on.
    Clamp,
}

impl Texture {
    /// Value at a surface's uv.
    pub fn eval(&self, uv: Vec2) -> Rgb {
        match self {
            Self::Constant(c) => *c,
            Self::Bitmap(bitmap) => bitmap.eval(uv),
            Self::Checkerboard { color0, color1, to_uv } => {
                let uv = to_uv.transform_point2(uv);
                let upper = (uv - uv.floor()).cmpgt(Vec2::splat(0.5));
                if upper.x == upper.y { *color0 } else { *color1 }
            }
        }
    }

    /// Mean over the texture's own square.
    pub fn mean(&self) -> Rgb {
        match self {
            Self::Constant(c) => *c,
            Self::Bitmap(bitmap) => bitmap.image.mean() * bitmap.scale,
            Self::Checkerboard { color0, color1, .. } => (*color0 + *color1) * 0.5,
        }
    }

    /// The texture times a factor.
    pub fn scaled(self, factor: f32) -> Self {
        match self {
            Self::Constant(c) => Self::Constant(c * factor),
            Self::Bitmap(b) => Self::Bitmap(Bitmap { scale: b.scale * factor, ..b }),
            Self::Checkerboard { color0, color1, to_uv } => {
                Self::Checkerboard { color0: color0 * factor, color1: color1 * factor, to_uv }
            }
        }
    }
}

impl Bitmap {
    /// Value at a surface's uv.
    pub fn eval(&self, uv: Vec2) -> Rgb {
        let uv = self.to_uv.transform_point2(uv);
        if !uv.is_finite() {
            return Rgb::ZERO;
        }
        let [width, height] = [self.image.width as i64, self.image.height as i64];
        let column = |x: i64| self.wrap.index(x, width);
        let row = |y: i64| self.wrap.index(y, height);
        let p = uv * Vec2::new(width as f32, height as f32);
        if self.nearest {
            return self.image.pixel(column(floor(p.x)), row(floor(p.y))) * self.scale;
        }
        let p = p - 0.5;
        let (x, y) = (floor(p.x), floor(p.y));
        let t = p - Vec2::new(x as f32, y as f32);
        let (x, y) = ([column(x), column(x.saturating_add(1))], [row(y), row(y.saturating_add(1))]);
        let across = |y: usize| self.image.pixel(x[0], y) * (1.0 - t.x) + self.image.pixel(x[1], y) * t.x;
        (across(y[0]) * (1.0 - t.y) + across(y[1]) * t.y) * self.scale
    }

    /// The pixel at the whole coordinates `p`, which may lie outside; `scale` is not in it.
    pub(crate) fn texel(&self, p: Vec2) -> Rgb {
        let x = self.wrap.index(p.x as i64, self.image.width as i64);
        let y = self.wrap.index(p.y as i64, self.image.height as i64);
        self.image.pixel(x, y)
    }
}

impl Wrap {
    /// The pixel that stands for the pixel `i` of an endless row, of `n` that there are.
    fn index(self, i: i64, n: i64) -> usize {
        if (0..n).contains(&i) {
            return i as usize;
        }
        let wrapped = match self {
            Self::Clamp => i.clamp(0, n - 1),
            Self::Repeat => i.rem_euclid(n),
            Self::Mirror => {
                let j = i.rem_euclid(2 * n);
                if j < n { j } else { 2 * n - 1 - j }
            }
        };
        wrapped as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bitmap(wrap: Wrap, nearest: bool) -> Bitmap {
        let v = |x: f32| Rgb::splat(x);
        let pixels = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0].map(v).to_vec();
        let image = Arc::new(Image::new(4, 3, pixels));
        Bitmap { image, to_uv: Affine2::IDENTITY, nearest, wrap, scale: 1.0 }
    }

    /// Mitsuba 3.9.1, `bitmap` over the same 4x3 pixels: (u, v), then repeat, mirror, clamp, each bilinear and nearest.
    #[test]
    fn lookups_are_mitsubas() {
        let table = [
            (0.3, 0.4, [4.5, 6.0, 4.5, 6.0, 4.5, 6.0]),
            (0.02, 0.03, [5.54, 1.0, 1.0, 1.0, 1.0, 1.0]),
            (1.3, -0.2, [9.3, 10.0, 3.7, 3.0, 4.0, 4.0]),
            (0.97, 0.99, [7.1, 12.0, 12.0, 12.0, 12.0, 12.0]),
            (-0.6, 2.4, [4.9, 6.0, 5.7, 7.0, 9.0, 9.0]),
            (0.0, 0.0, [6.5, 1.0, 1.0, 1.0, 1.0, 1.0]),
            (0.999, 1.9, [8.912, 12.0, 4.0, 4.0, 12.0, 12.0]),
            (-3.7, -1.1, [8.1, 10.0, 9.7, 10.0, 1.0, 1.0]),
        ];
        for (u, v, expected) in table {
            let rules = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp].into_iter().flat_map(|w| [(w, false), (w, true)]);
            for ((wrap, nearest), expected) in rules.zip(expected) {
                let found = bitmap(wrap, nearest).eval(Vec2::new(u, v)).x;
                assert!((found - expected).abs() < 2e-3, "({u}, {v}) {wrap:?} nearest {nearest}: {found}, Mitsuba {expected}");
            }
        }
    }

    #[test]
    fn scale_and_to_uv_act() {
        let mut b = bitmap(Wrap::Repeat, true);
        b.to_uv = Affine2::from_translation(Vec2::new(0.25, 0.0));
        b.scale = 2.0;
        assert_eq!(b.eval(Vec2::new(0.125, 0.1)).x, 4.0);
        assert_eq!(Texture::Bitmap(b.clone()).scaled(0.5).eval(Vec2::new(0.125, 0.1)).x, 2.0);
        assert_eq!(b.eval(Vec2::new(f32::NAN, 0.0)), Rgb::ZERO);
        assert!(b.eval(Vec2::splat(1e30)).is_finite());
    }

    /// Mitsuba 3.9.1's `checkerboard` at its default colours.
    #[test]
    fn checkerboard_boundaries_are_mitsubas() {
        let t = Texture::Checkerboard { color0: Rgb::splat(0.4), color1: Rgb::splat(0.2), to_uv: Affine2::IDENTITY };
        for (u, v, expected) in [
            (0.2, 0.2, 0.4),
            (0.7, 0.2, 0.2),
            (0.2, 0.7, 0.2),
            (0.7, 0.7, 0.4),
            (1.2, 0.2, 0.4),
            (-0.2, 0.2, 0.2),
            (0.5, 0.2, 0.4),
            (1.0, 0.2, 0.4),
        ] {
            assert_eq!(t.eval(Vec2::new(u, v)).x, expected, "({u}, {v})");
        }
    }
}
