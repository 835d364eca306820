//! Images of linear RGB pixels, and how they are read from files ([`read`]).

mod file;

use crate::base::math::Rgb;
use crate::base::prefetch::prefetch_at;

pub use file::{ReadOptions, Take, decode, read};

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

    /// A function of every pixel.
    pub fn changed(&self, f: impl Fn(Rgb) -> Rgb) -> Self {
        Self::new(self.width, self.height, self.all().map(f).collect())
    }

    /// Red, green or blue (0 to 2) as grey, or white.
    pub fn channel(&self, channel: u8) -> Self {
        self.changed(|p| Rgb::splat(p.to_array().get(usize::from(channel)).copied().unwrap_or(1.0)))
    }

    /// A function of every number of every pixel; bytes stay bytes.
    pub fn map(&self, f: impl Fn(f32) -> f32) -> Self {
        let pixels = match &self.pixels {
            Pixels::Float(pixels) => Pixels::Float(pixels.iter().map(|p| p.map(&f)).collect()),
            Pixels::Bytes { rgb, linear } => Pixels::Bytes { rgb: rgb.clone(), linear: Box::new(linear.map(f)) },
        };
        Self { pixels, ..*self }
    }

    /// Pixels in order.
    fn all(&self) -> impl Iterator<Item = Rgb> {
        (0..self.width * self.height).map(|i| self.at(i))
    }

    /// Mean of all pixels.
    pub fn mean(&self) -> Rgb {
        let sum: glam::DVec3 = self.all().map(|p| p.as_dvec3()).sum();
        (sum / (self.width * self.height) as f64).as_vec3()
    }

    /// The pixel in column `x` and row `y`.
    #[inline]
    pub fn pixel(&self, x: usize, y: usize) -> Rgb {
        self.at(y * self.width + x)
    }

    /// The pixels of two columns in two rows: those of the first row, then those of the second.
    #[inline]
    pub(crate) fn four(&self, [left, right]: [usize; 2], rows: [usize; 2]) -> [[Rgb; 2]; 2] {
        let [upper, lower] = rows.map(|y| y * self.width);
        let places = [[upper + left, upper + right], [lower + left, lower + right]];
        match &self.pixels {
            Pixels::Float(pixels) => places.map(|row| row.map(|i| pixels[i])),
            Pixels::Bytes { rgb, linear } => places.map(|row| row.map(|i| of_bytes(rgb, linear, i))),
        }
    }

    /// Tells the caches that [`Image::pixel`] will be read.
    #[inline]
    pub fn prefetch(&self, x: usize, y: usize) {
        let i = y * self.width + x;
        match &self.pixels {
            Pixels::Float(pixels) => prefetch_at(pixels, i),
            Pixels::Bytes { rgb, .. } => prefetch_at(rgb, 3 * i),
        }
    }

    #[inline]
    fn at(&self, i: usize) -> Rgb {
        match &self.pixels {
            Pixels::Float(pixels) => pixels[i],
            Pixels::Bytes { rgb, linear } => of_bytes(rgb, linear, i),
        }
    }
}

#[inline(always)]
fn of_bytes(rgb: &[u8], linear: &[f32; 256], i: usize) -> Rgb {
    let pixel = &rgb[3 * i..3 * i + 3];
    Rgb::new(linear[pixel[0] as usize], linear[pixel[1] as usize], linear[pixel[2] as usize])
}
