//! Diagrams: a canvas with lines, marks, words and legends.

use super::Provenance;
use super::picture::heat;
use super::png::write_png;
use crate::Result;
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::ascii::FONT_6X13;
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::{DrawTarget, OriginDimensions, Pixel, Point, Primitive, Size};
use embedded_graphics::primitives::{Line, PrimitiveStyle};
use embedded_graphics::text::{Baseline, Text};
use embedded_graphics::{Drawable, geometry::Dimensions};
use glam::Vec2;
use std::convert::Infallible;
use std::path::Path;

/// Red, green and blue.
pub type Colour = [u8; 3];

/// Width of a letter, pixels.
pub const LETTER: usize = 6;
/// Height of a line of words, pixels.
pub const LINE: usize = 14;
/// Behind everything.
pub const BACKGROUND: Colour = [24, 24, 28];
/// Words and lines upon it.
pub const INK: Colour = [225, 225, 225];

/// Pixels in rows from the top. What is drawn beyond its edges is left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Canvas {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// The pixels.
    pub pixels: Vec<Colour>,
}

impl Canvas {
    /// Of one colour.
    pub fn new(size: [usize; 2], colour: Colour) -> Self {
        Self { size, pixels: vec![colour; size[0] * size[1]] }
    }

    /// Of pixels, each of them `zoom` x `zoom` of the canvas.
    pub fn zoomed(size: [usize; 2], pixels: &[Colour], zoom: usize) -> Self {
        let large = size.map(|n| n * zoom);
        let at = |i: usize| pixels[i / large[0] / zoom * size[0] + i % large[0] / zoom];
        Self { size: large, pixels: (0..large[0] * large[1]).map(at).collect() }
    }

    /// Writes a PNG file that says where it came from.
    pub fn write(&self, path: &Path, provenance: &Provenance) -> Result<()> {
        write_png(path, &self.pixels.concat(), self.size, provenance)
    }

    /// Gives a pixel a colour.
    pub fn set(&mut self, [x, y]: [usize; 2], colour: Colour) {
        if x < self.size[0] && y < self.size[1] {
            self.pixels[y * self.size[0] + x] = colour;
        }
    }

    /// Copies another canvas to a place.
    pub fn paste(&mut self, at: [usize; 2], other: &Self) {
        for (i, colour) in other.pixels.iter().enumerate() {
            self.set([at[0] + i % other.size[0], at[1] + i / other.size[0]], *colour);
        }
    }

    /// Fills a rectangle.
    pub fn fill(&mut self, at: [usize; 2], size: [usize; 2], colour: Colour) {
        self.paste(at, &Self::new(size, colour));
    }

    /// A straight line, `width` pixels wide.
    pub fn line(&mut self, ends: [Vec2; 2], width: u32, colour: Colour) {
        // The library's integers hold no more than a canvas, and it asks for every pixel on the way.
        let margin = Vec2::splat(2.0 * width as f32);
        let size = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let Some([a, b]) = clipped(ends, -margin, size + margin) else { return };
        let [a, b] = [a.floor(), b.floor()];
        let point = |p: Vec2| Point::new(p.x as i32, p.y as i32);
        let style = PrimitiveStyle::with_stroke(rgb(colour), width);
        let Ok(()) = Line::new(point(a), point(b)).into_styled(style).draw(self);
    }

    /// A ring of what is nearer to `centre` than `radii[1]`, but not than `radii[0]`.
    pub fn ring(&mut self, centre: Vec2, radii: [f32; 2], colour: Colour) {
        let low = (centre - radii[1]).max(Vec2::ZERO);
        for y in low.y as usize..self.size[1].min((centre.y + radii[1] + 1.0).max(0.0) as usize) {
            for x in low.x as usize..self.size[0].min((centre.x + radii[1] + 1.0).max(0.0) as usize) {
                let r = centre.distance(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
                if r >= radii[0] && r < radii[1] {
                    self.set([x, y], colour);
                }
            }
        }
    }

    /// A dot of `radius` pixels, with a dark rim of two more.
    pub fn dot(&mut self, centre: Vec2, radius: f32, colour: Colour) {
        self.ring(centre, [radius, radius + 2.0], [0; 3]);
        self.ring(centre, [0.0, radius], colour);
    }

    /// A cross of two diagonals, with a dark rim.
    pub fn cross(&mut self, centre: Vec2, radius: f32, colour: Colour) {
        for (width, colour) in [(5, [0; 3]), (2, colour)] {
            for turn in [Vec2::new(radius, radius), Vec2::new(radius, -radius)] {
                self.line([centre - turn, centre + turn], width, colour);
            }
        }
    }

    /// Words from a place to the right and below, and how wide they are.
    pub fn text(&mut self, [x, y]: [usize; 2], words: &str, colour: Colour) -> usize {
        let style = MonoTextStyle::new(&FONT_6X13, rgb(colour));
        let text = Text::with_baseline(words, Point::new(x as i32, y as i32), style, Baseline::Top);
        let Ok(_) = text.draw(self);
        text.bounding_box().size.width as usize
    }

    /// Lines of words, as wide as `width` pixels, and how high they are.
    pub fn paragraph(&mut self, [x, y]: [usize; 2], width: usize, words: &str, colour: Colour) -> usize {
        let lines = wrapped(words, (width / LETTER).max(1));
        for (i, line) in lines.iter().enumerate() {
            self.text([x, y + i * LINE], line, colour);
        }
        lines.len() * LINE
    }

    /// A bar of [`heat`] from 0 to 1, lying, with words below it at their places in [0, 1].
    pub fn heat_bar(&mut self, [x, y]: [usize; 2], [width, height]: [usize; 2], ends: [f32; 2], marks: &[(f32, String)]) {
        let along = |share: f32| (share * (width - 1) as f32) as usize;
        for column in 0..width {
            let share = column as f32 / (width - 1).max(1) as f32;
            self.fill([x + column, y], [1, height], heat(ends[0] + (ends[1] - ends[0]) * share));
        }
        for (share, words) in marks {
            self.fill([x + along(*share), y + height], [1, 3], INK);
            let left = (words.len() * LETTER / 2).min(x + along(*share));
            self.text([x + along(*share) - left, y + height + 4], words, INK);
        }
    }
}

/// What of a straight line lies in a box.
fn clipped([a, b]: [Vec2; 2], lower: Vec2, upper: Vec2) -> Option<[Vec2; 2]> {
    let along = b - a;
    let (mut from, mut to) = (0.0f32, 1.0f32);
    for axis in 0..2 {
        if along[axis] == 0.0 {
            if !(lower[axis]..=upper[axis]).contains(&a[axis]) {
                return None;
            }
            continue;
        }
        let [s, t] = [lower, upper].map(|end| (end[axis] - a[axis]) / along[axis]);
        (from, to) = (from.max(s.min(t)), to.min(s.max(t)));
    }
    (from <= to).then(|| [a + along * from, a + along * to])
}

/// Words in lines of at most `most` letters; a word that is longer stands alone.
pub(super) fn wrapped(words: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.len() + 1 + word.len() <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.into()),
        }
    }
    lines
}

fn rgb([r, g, b]: Colour) -> Rgb888 {
    Rgb888::new(r, g, b)
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.size[0] as u32, self.size[1] as u32)
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> std::result::Result<(), Infallible> {
        use embedded_graphics::pixelcolor::RgbColor;
        for Pixel(at, colour) in pixels {
            if let (Ok(x), Ok(y)) = (usize::try_from(at.x), usize::try_from(at.y)) {
                self.set([x, y], [colour.r(), colour.g(), colour.b()]);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_drawn_is_where_it_should_be_and_nothing_beyond_the_edges() {
        let mut canvas = Canvas::new([40, 30], BACKGROUND);
        let red = [255, 0, 0];
        canvas.line([Vec2::new(2.0, 5.0), Vec2::new(1e9, 5.0)], 1, red);
        assert!((2..40).all(|x| canvas.pixels[5 * 40 + x] == red) && canvas.pixels[5 * 40 + 1] == BACKGROUND);
        let before = canvas.clone();
        for ends in [[Vec2::new(-9.0, 99.0), Vec2::new(1e9, 99.0)], [Vec2::new(-50.0, 10.0), Vec2::new(10.0, -50.0)]] {
            canvas.line(ends, 3, red);
        }
        assert_eq!(canvas, before);
        canvas.dot(Vec2::new(10.5, 20.5), 3.0, red);
        assert_eq!(
            (canvas.pixels[20 * 40 + 10], canvas.pixels[20 * 40 + 14], canvas.pixels[20 * 40 + 17]),
            (red, [0; 3], BACKGROUND)
        );
        canvas.dot(Vec2::new(-50.0, 4000.0), 3.0, red);
        canvas.paste([38, 28], &Canvas::new([9, 9], [1; 3]));
        assert_eq!(canvas.pixels[29 * 40 + 39], [1; 3]);
        let before = canvas.clone();
        assert_eq!(canvas.text([0, 8], "ab", INK), 2 * LETTER);
        assert!(canvas != before && canvas.pixels.contains(&INK));
    }

    #[test]
    fn words_are_wrapped() {
        assert_eq!(wrapped("from 1 to 10 metres", 9), ["from 1 to", "10 metres"]);
        assert_eq!(wrapped("unbreakable x", 4), ["unbreakable", "x"]);
        assert!(wrapped("", 5).is_empty());
    }
}
