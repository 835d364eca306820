//! Textures: constants, bitmaps and checkerboards.

use crate::math::Rgb;
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

/// Linear RGB pixels, row 0 at the top of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Rows from the top, each from the left.
    pub pixels: Vec<Rgb>,
}

impl Texture {
    /// Value at a surface's uv.
    pub fn eval(&self, _uv: Vec2) -> Rgb {
        match self {
            Self::Constant(c) => *c,
            _ => todo!(),
        }
    }
}
