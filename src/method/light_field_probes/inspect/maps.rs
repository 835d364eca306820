//! A probe's octahedral maps side by side.

use crate::io::ExrImage;
use crate::io::canvas::{BACKGROUND, Canvas, Colour, INK, LINE};
use crate::io::picture::{Picture, pictures, usual_exposure};

/// Least edge of a map in the picture, pixels.
const EDGE: usize = 256;
/// Space around maps, pixels.
const GAP: usize = 8;
/// Maps beside each other.
const COLUMNS: usize = 3;
/// Height of a map's words: a title, and up to three lines of what its colours mean.
const WORDS: usize = 4 * LINE + 4;
/// Layers that are shown, and their titles.
const SHOWN: [(&str, &str); 5] = [
    ("radiance", "radiance"),
    ("distance", "distance, metres"),
    ("normal", "normal"),
    ("irradiance", "irradiance"),
    ("moment.1", "mean distance, metres"),
];

/// A map of the picture, and what its colours mean.
pub struct Shown {
    /// Name of the layer.
    pub layer: String,
    /// What its colours mean.
    pub legend: String,
}

/// Draws a probe's files, colours `exposure` stops brighter. +Y is in the middle of a map, -Y in its corners, +X at the right, +Z below.
pub fn draw(title: &str, images: &[ExrImage], exposure: f32) -> (Canvas, Vec<Shown>) {
    let of = |image: &ExrImage| pictures(image, exposure + usual_exposure(image));
    let all: Vec<Picture> = images.iter().flat_map(of).collect();
    let shown: Vec<(&Picture, &str)> =
        SHOWN.iter().filter_map(|(layer, title)| Some((all.iter().find(|p| p.layer == *layer)?, *title))).collect();
    let edge = shown.iter().map(|(p, _)| p.width as usize).max().unwrap_or(0).max(EDGE);
    let rows = shown.len().div_ceil(COLUMNS);
    let head = LINE + GAP;
    let mut canvas = Canvas::new([COLUMNS * (edge + GAP) + GAP, head + rows * (edge + WORDS + GAP)], BACKGROUND);
    canvas.text([GAP, GAP / 2], title, INK);
    for (i, (picture, title)) in shown.iter().enumerate() {
        let (x, y) = (GAP + i % COLUMNS * (edge + GAP), head + i / COLUMNS * (edge + WORDS + GAP));
        canvas.text([x, y], &format!("{title} ({0} x {0})", picture.width), INK);
        let pixels: Vec<Colour> = picture.rgb.as_chunks().0.to_vec();
        let zoom = edge / picture.width as usize;
        canvas.paste([x, y + LINE], &Canvas::zoomed([picture.width, picture.height].map(|n| n as usize), &pixels, zoom));
        canvas.paragraph([x, y + LINE + edge + 2], edge, &picture.legend, INK);
    }
    let shown = shown.iter().map(|(p, _)| Shown { layer: p.layer.clone(), legend: p.legend.clone() }).collect();
    (canvas, shown)
}
