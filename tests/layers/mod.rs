//! Layers of frames of 36 x 24 pixels, and what of them two renderers can be compared by.

use crate::folder::Folder;
use reprobe::base::math::Rgb;
use reprobe::io::ExrImage;

/// A layer of a frame, given by its file.
pub fn layer(f: &Folder, frame: &str, name: &str) -> Vec<Rgb> {
    let path = f.at(frame);
    ExrImage::read(&path).unwrap().rgb(&path, name).unwrap()
}

/// Means of squares of 6 x 4 pixels: of less noise than pixels.
pub fn squares(pixels: &[Rgb]) -> Vec<Rgb> {
    let square = |k: usize| {
        let at = |i: usize| pixels[(k / 6 * 4 + i / 6) * 36 + k % 6 * 6 + i % 6];
        (0..24).map(at).sum::<Rgb>() / 24.0
    };
    (0..36).map(square).collect()
}
