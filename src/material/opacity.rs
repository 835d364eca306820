//! How much of a surface is there: what `mask` and `null` make of a material.

use super::Texture;
use crate::base::math::{Rgb, luminance};
use glam::Vec2;

/// A share of coverage over a surface, nominally in [0, 1].
#[derive(Debug, Clone, serde::Serialize)]
pub enum Opacity {
    /// The luminance of a texture.
    Texture(Texture),
    /// A mask within a mask.
    Product(Box<[Opacity; 2]>),
    /// Masks within a `blendbsdf`.
    Blend {
        /// Share of the second; clamped to [0, 1].
        weight: Texture,
        /// Where the weight is 0, and where it is 1.
        parts: Box<[Opacity; 2]>,
    },
    /// The two sides of a `twosided`, the front first.
    Sides(Box<[Opacity; 2]>),
}

impl Opacity {
    /// The same everywhere.
    pub fn constant(share: f32) -> Self {
        Self::Texture(Texture::Constant(Rgb::splat(share)))
    }

    /// One behind another.
    pub fn product(a: Self, b: Self) -> Self {
        match (a, b) {
            (Self::Texture(Texture::Constant(c)), Self::Texture(t)) | (Self::Texture(t), Self::Texture(Texture::Constant(c))) => {
                Self::Texture(t.scaled(luminance(c)))
            }
            (a, b) => Self::Product(Box::new([a, b])),
        }
    }

    /// A mix of two.
    pub fn blend(weight: Texture, a: Self, b: Self) -> Self {
        match (&weight, &a, &b) {
            (Texture::Constant(w), Self::Texture(Texture::Constant(a)), Self::Texture(Texture::Constant(b))) => {
                Self::Texture(Texture::Constant(a.lerp(*b, luminance(*w).clamp(0.0, 1.0))))
            }
            _ => Self::Blend { weight, parts: Box::new([a, b]) },
        }
    }

    /// The share at a surface's uv, as seen from the front or from behind.
    pub fn eval(&self, uv: Vec2, from_front: bool) -> f32 {
        match self {
            Self::Texture(t) => luminance(t.eval(uv)),
            Self::Product(parts) => parts[0].eval(uv, from_front) * parts[1].eval(uv, from_front),
            Self::Blend { weight, parts } => {
                let w = luminance(weight.eval(uv)).clamp(0.0, 1.0);
                parts[0].eval(uv, from_front) * (1.0 - w) + parts[1].eval(uv, from_front) * w
            }
            Self::Sides(sides) => sides[usize::from(!from_front)].eval(uv, from_front),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_fold_and_sides_differ() {
        let c = Opacity::constant;
        let folded = |o: &Opacity| matches!(o, Opacity::Texture(Texture::Constant(_)));
        let product = Opacity::product(c(0.5), c(0.25));
        let blend = Opacity::blend(Texture::Constant(Rgb::splat(0.25)), c(1.0), c(0.2));
        assert!(folded(&product) && folded(&blend));
        assert_eq!(product.eval(Vec2::ZERO, true), 0.125);
        assert!((blend.eval(Vec2::ZERO, true) - 0.8).abs() < 1e-6);
        let sides = Opacity::product(Opacity::Sides(Box::new([c(0.5), c(1.0)])), c(0.5));
        assert_eq!([true, false].map(|front| sides.eval(Vec2::ZERO, front)), [0.25, 0.5]);
    }
}
