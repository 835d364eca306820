//! Images of linear RGB pixels, and how they are read from files ([`read`]).

mod file;

use crate::base::math::Rgb;

pub use file::{ReadOptions, read};

/// Linear RGB pixels, row 0 at the top of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    pub(crate) pixels: Pixels,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Pixels {
    Float(Vec<Rgb>),
    /// Three bytes a pixel, a quarter of the floats' memory and cache misses, and the linear value of each byte.
    Bytes {
        rgb: Vec<u8>,
        linear: Box<[f32; 256]>,
    },
}

/// As the hash of its content, which is what a scene's hash asks for.
impl serde::Serialize for Image {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut hasher = blake3::Hasher::new();
        match &self.pixels {
            Pixels::Float(pixels) => hasher.update(bytemuck::cast_slice(pixels)),
            Pixels::Bytes { rgb, linear } => hasher.update(rgb).update(bytemuck::cast_slice(&linear[..])),
        };
        (self.width as u64, self.height as u64, hasher.finalize().as_bytes()).serialize(serializer)
    }
}

impl Image {
    /// An image of width x height pixels, rows from the top.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn new(width: usize, height: usize, pixels: Vec<Rgb>) -> Self {
        assert_eq!(pixels.len(), width * height);
        Self { width, height, pixels: Pixels::Float(pixels) }
    }

    /// An image of 8-bit RGB pixels, three bytes each, and the linear value that each byte stands for.
    fn from_bytes(width: usize, height: usize, rgb: Vec<u8>, linear: [f32; 256]) -> Self {
        assert_eq!(rgb.len(), 3 * width * height);
        Self { width, height, pixels: Pixels::Bytes { rgb, linear: Box::new(linear) } }
    }

    /// Mean of all pixels.
    pub fn mean(&self) -> Rgb {
        let sum: glam::DVec3 = (0..self.width * self.height).map(|i| self.at(i).as_dvec3()).sum();
        (sum / (self.width * self.height) as f64).as_vec3()
    }

    /// The pixel in column `x` and row `y`.
    #[inline]
    pub fn pixel(&self, x: usize, y: usize) -> Rgb {
        self.at(y * self.width + x)
    }

    #[inline]
    fn at(&self, i: usize) -> Rgb {
        match &self.pixels {
            Pixels::Float(pixels) => pixels[i],
            Pixels::Bytes { rgb, linear } => {
                let [r, g, b] = [rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]].map(|byte| linear[byte as usize]);
                Rgb::new(r, g, b)
            }
        }
    }
}
