//! Sample points: Owen-scrambled Sobol, one decorrelated stream a pixel or texel.

use glam::Vec2;

/// The sample dimensions of one path, drawn in order.
#[derive(Debug, Clone)]
pub struct Sampler {
    stream: u32,
    index: u32,
    dimension: u32,
}

impl Sampler {
    /// Sample `index` of the stream `stream` (a hash of seed and pixel: see [`crate::math::hash_words`]).
    pub fn new(stream: u32, index: u32) -> Self {
        Self { stream, index, dimension: 0 }
    }

    /// The next dimension, in [0, 1).
    pub fn next_1d(&mut self) -> f32 {
        let (set, dimension) = (self.dimension / 256, self.dimension % 256);
        self.dimension += 1;
        sobol_burley::sample(
            self.index % 65536,
            dimension,
            self.stream ^ set.wrapping_mul(0x9e37_79b9) ^ (self.index / 65536).wrapping_mul(0x85eb_ca6b),
        )
    }

    /// The next two dimensions.
    pub fn next_2d(&mut self) -> Vec2 {
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }
}
