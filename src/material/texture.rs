//! Textures: constants, bitmaps, checkerboards and what a mesh says of its vertices and faces.
//!
//! Lookups are Mitsuba 3's: texel (i, j) of a bitmap has its centre at ((i + 0.5) / width, (j + 0.5) / height), and
//! row 0 of the file lies at v = 0 (OBJ files have v upwards: their loader turns it).

use super::Surface;
use super::image::Image;
use crate::base::math::{Rgb, floor};
use glam::{Affine2, Vec2};
use std::sync::Arc;

/// A spatially varying colour.
#[derive(Debug, Clone, serde::Serialize)]
pub enum Texture {
    /// The same everywhere.
    Constant(Rgb),
    /// An image over uv space.
    Bitmap(Bitmap),
    /// Mitsuba's `checkerboard`.
    Checkerboard {
        /// Colour where both or neither coordinate's fraction exceeds one half, then the other.
        colors: Box<[Texture; 2]>,
        /// From the surface's uv to the texture's.
        to_uv: Affine2,
    },
    /// Mitsuba's `mesh_attribute`.
    Attribute(Arc<Attribute>),
}

/// Colours of an object's vertices or faces.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Attribute {
    /// The object's first triangle in the scene.
    pub first_triangle: u32,
    /// One value a vertex, which `corners` tell of each triangle, or one a triangle where that is empty.
    pub values: Vec<Rgb>,
    /// Each triangle's vertices.
    pub corners: Vec<[u32; 3]>,
}

impl Attribute {
    /// Value at the barycentric weights of a triangle's second and third corner.
    #[inline(never)]
    fn eval(&self, triangle: u32, barycentric: Vec2) -> Rgb {
        let Some(local) = triangle.checked_sub(self.first_triangle) else { return Rgb::ZERO };
        let value = |i: u32| self.values.get(i as usize).copied().unwrap_or(Rgb::ZERO);
        match self.corners.get(local as usize) {
            Some(&[a, b, c]) => {
                value(a) * (1.0 - barycentric.x - barycentric.y) + value(b) * barycentric.x + value(c) * barycentric.y
            }
            None => value(local),
        }
    }

    fn mean(&self) -> Rgb {
        self.values.iter().sum::<Rgb>() / self.values.len().max(1) as f32
    }
}

/// An image with its lookup rules.
#[derive(Debug, Clone, serde::Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub enum Wrap {
    /// Tiled.
    Repeat,
    /// Tiled, every other tile mirrored.
    Mirror,
    /// The border pixel goes on.
    Clamp,
}

impl Texture {
    /// Value at a point of a surface.
    pub fn at(&self, s: &Surface) -> Rgb {
        match self {
            Self::Constant(c) => *c,
            Self::Bitmap(bitmap) => bitmap.eval(s.uv),
            Self::Checkerboard { colors, to_uv } => within(colors, to_uv, s),
            Self::Attribute(attribute) => attribute.eval(s.triangle, s.barycentric),
        }
    }

    /// Value at a surface's uv; a mesh's own values, which uv does not tell, are taken for their mean.
    pub fn eval(&self, uv: Vec2) -> Rgb {
        match self {
            Self::Constant(c) => *c,
            Self::Bitmap(bitmap) => bitmap.eval(uv),
            Self::Checkerboard { colors, to_uv } => colors[field(to_uv, uv)].eval(uv),
            Self::Attribute(attribute) => attribute.mean(),
        }
    }

    /// Tells the caches what [`Texture::at`] will read.
    #[inline]
    pub fn prefetch(&self, s: &Surface) {
        if let Self::Bitmap(bitmap) = self {
            bitmap.prefetch(s.uv);
        }
    }

    /// Mean over the texture's own square.
    pub fn mean(&self) -> Rgb {
        match self {
            Self::Constant(c) => *c,
            Self::Bitmap(bitmap) => bitmap.image.mean() * bitmap.scale,
            Self::Checkerboard { colors, .. } => (colors[0].mean() + colors[1].mean()) * 0.5,
            Self::Attribute(attribute) => attribute.mean(),
        }
    }

    /// The texture times a factor.
    pub fn scaled(self, factor: f32) -> Self {
        match self {
            Self::Constant(c) => Self::Constant(c * factor),
            Self::Bitmap(b) => Self::Bitmap(Bitmap { scale: b.scale * factor, ..b }),
            Self::Checkerboard { colors, to_uv } => {
                Self::Checkerboard { colors: Box::new(colors.map(|c| c.scaled(factor))), to_uv }
            }
            Self::Attribute(a) => {
                let values = a.values.iter().map(|v| v * factor).collect();
                Self::Attribute(Arc::new(Attribute { values, corners: a.corners.clone(), ..*a }))
            }
        }
    }
}

/// A checkerboard's value. A function of its own, so that [`Texture::at`] does not call itself and can be put in where it is used.
#[inline(never)]
fn within(colors: &[Texture; 2], to_uv: &Affine2, s: &Surface) -> Rgb {
    colors[field(to_uv, s.uv)].at(s)
}

/// Which colour of a checkerboard lies at `uv`.
fn field(to_uv: &Affine2, uv: Vec2) -> usize {
    let uv = to_uv.transform_point2(uv);
    let upper = (uv - uv.floor()).cmpgt(Vec2::splat(0.5));
    usize::from(upper.x != upper.y)
}

impl Bitmap {
    /// Value at a surface's uv.
    pub fn eval(&self, uv: Vec2) -> Rgb {
        let uv = self.to_uv.transform_point2(uv);
        if !uv.is_finite() {
            return Rgb::ZERO;
        }
        let [width, height] = [self.image.width as i64, self.image.height as i64];
        let p = uv * Vec2::new(width as f32, height as f32);
        if self.nearest {
            return self.image.pixel(self.wrap.index(floor(p.x), width), self.wrap.index(floor(p.y), height)) * self.scale;
        }
        let p = p - 0.5;
        let (x, y) = (floor(p.x), floor(p.y));
        let t = p - Vec2::new(x as f32, y as f32);
        let [upper, lower] = self.image.four(self.wrap.two(x, width), self.wrap.two(y, height));
        let across = |[left, right]: [Rgb; 2]| left * (1.0 - t.x) + right * t.x;
        (across(upper) * (1.0 - t.y) + across(lower) * t.y) * self.scale
    }

    /// Tells the caches what [`Bitmap::eval`] will read.
    fn prefetch(&self, uv: Vec2) {
        let p = self.to_uv.transform_point2(uv) * Vec2::new(self.image.width as f32, self.image.height as f32) - 0.5;
        let x = self.wrap.index(floor(p.x), self.image.width as i64);
        for row in self.wrap.two(floor(p.y), self.image.height as i64) {
            self.image.prefetch(x, row);
        }
    }

    /// The pixel at the whole coordinates `p`, which may lie outside; `scale` is not in it.
    pub(crate) fn texel(&self, p: Vec2) -> Rgb {
        let x = self.wrap.index(p.x as i64, self.image.width as i64);
        let y = self.wrap.index(p.y as i64, self.image.height as i64);
        self.image.pixel(x, y)
    }
}

impl Wrap {
    /// [`Wrap::index`] of a pixel and of the next.
    #[inline]
    fn two(self, i: i64, n: i64) -> [usize; 2] {
        if (0..n - 1).contains(&i) {
            return [i as usize, i as usize + 1];
        }
        [self.index(i, n), self.index(i.saturating_add(1), n)]
    }

    /// The pixel that stands for the pixel `i` of an endless row, of `n` that there are.
    #[inline]
    fn index(self, i: i64, n: i64) -> usize {
        if (0..n).contains(&i) { i as usize } else { self.wrapped(i, n) }
    }

    #[inline(never)]
    fn wrapped(self, i: i64, n: i64) -> usize {
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
        let t = Texture::Checkerboard {
            colors: Box::new([0.4, 0.2].map(|c| Texture::Constant(Rgb::splat(c)))),
            to_uv: Affine2::IDENTITY,
        };
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
