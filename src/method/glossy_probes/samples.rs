//! What probes offer a pixel (§5.2).

use glam::Vec2;

/// What one probe offers a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Its energy (Eq. 1).
    pub energy: f32,
    /// Its continuous texel coordinate.
    pub texel: Vec2,
}

/// What eight probes offer a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Samples {
    /// Energies; infinite where a probe has nothing.
    pub energy: [f32; 8],
    /// Continuous texel coordinates, x and y.
    pub texel: [[f32; 8]; 2],
}

impl Samples {
    pub(crate) const NONE: Self = Self { energy: [f32::INFINITY; 8], texel: [[0.0; 8]; 2] };

    /// That of one probe.
    pub fn of(&self, k: usize) -> Option<Sample> {
        let energy = self.energy[k];
        energy.is_finite().then(|| Sample { energy, texel: Vec2::new(self.texel[0][k], self.texel[1][k]) })
    }

    pub(crate) fn set(&mut self, k: usize, sample: Sample) {
        self.energy[k] = sample.energy;
        (self.texel[0][k], self.texel[1][k]) = (sample.texel.x, sample.texel.y);
    }
}
