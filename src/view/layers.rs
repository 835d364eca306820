//! The layers of a frame.

use crate::base::math::Rgb;

/// The layers of a frame, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerImages {
    /// LE.
    pub emission: Vec<Rgb>,
    /// L(S|D)*DE.
    pub diffuse: Vec<Rgb>,
    /// L(S|D)*S+E.
    pub glossy: Vec<Rgb>,
}

impl LayerImages {
    /// The full image.
    pub fn full(&self) -> Vec<Rgb> {
        self.emission.iter().zip(&self.diffuse).zip(&self.glossy).map(|((&e, &d), &g)| e + d + g).collect()
    }
}
