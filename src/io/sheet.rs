//! Contact sheets: pictures in rows, each with a few words above it.

use super::canvas::{BACKGROUND, Canvas, INK, LETTER, LINE, wrapped};
use crate::{Error, Result};

/// Most pixels that a picture may have: it is held in memory some times over before it is written.
pub const MOST_PIXELS: usize = 1 << 27;
/// Space around pictures, pixels.
const GAP: usize = 8;
/// Least width for words, pixels.
const LEAST: usize = 40 * LETTER;
/// Width of a sheet over its height, as near as rows allow.
const SHAPE: f64 = 1.6;

/// A picture, and lines of words about it.
pub struct Cell {
    /// The picture.
    pub picture: Canvas,
    /// The words.
    pub words: Vec<String>,
}

impl Cell {
    fn lines(&self, width: usize) -> Vec<String> {
        self.words.iter().flat_map(|words| wrapped(words, width / LETTER)).collect()
    }
}

/// Puts pictures in rows.
pub fn draw(cells: &[Cell]) -> Result<Canvas> {
    let most = |of: &dyn Fn(&Cell) -> usize| cells.iter().map(of).max().unwrap_or(0);
    let width = most(&|c| c.picture.size[0]).max(LEAST);
    let words = LINE * most(&|c| c.lines(width).len());
    let cell = [width + GAP, most(&|c| c.picture.size[1]) + words + GAP];
    let columns = columns(cells.len(), cell);
    let size = [columns * cell[0] + GAP, cells.len().div_ceil(columns) * cell[1] + GAP];
    if size[0].saturating_mul(size[1]) > MOST_PIXELS {
        let message = format!(
            "{} pictures on a sheet are {} x {} pixels, more than the {MOST_PIXELS} allowed: choose fewer layers or files",
            cells.len(),
            size[0],
            size[1]
        );
        return Err(Error::Request(message));
    }
    let mut sheet = Canvas::new(size, BACKGROUND);
    for (i, c) in cells.iter().enumerate() {
        let at = [GAP + i % columns * cell[0], GAP + i / columns * cell[1]];
        for (k, line) in c.lines(width).iter().enumerate() {
            sheet.text([at[0], at[1] + k * LINE], line, INK);
        }
        sheet.paste([at[0], at[1] + words], &c.picture);
    }
    Ok(sheet)
}

/// The number of columns that brings a sheet of `count` cells nearest to its shape.
fn columns(count: usize, [width, height]: [usize; 2]) -> usize {
    let off = |columns: usize| {
        let shape = (columns * width) as f64 / (count.div_ceil(columns) * height) as f64;
        (shape / SHAPE).ln().abs()
    };
    (1..=count.max(1)).min_by(|&a, &b| off(a).total_cmp(&off(b))).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_in_rows_below_their_words() {
        let colours = [[255, 0, 0], [0, 255, 0], [0, 0, 255]];
        let cells = colours.map(|c| Cell { picture: Canvas::new([300, 200], c), words: vec!["one".into(), "two".into()] });
        let sheet = draw(&cells).unwrap();
        // Two columns of 308 and two rows of 236: nearer to the shape than three in a row.
        assert_eq!(sheet.size, [2 * 308 + 8, 2 * 236 + 8]);
        for (colour, [x, y]) in colours.into_iter().zip([[8, 36], [316, 36], [8, 272]]) {
            let at = |x: usize, y: usize| sheet.pixels[y * sheet.size[0] + x];
            assert_eq!([at(x, y), at(x + 299, y + 199), at(x + 300, y)], [colour, colour, BACKGROUND]);
            let inked = (y - 28..y).flat_map(|v| (x..x + 40).map(move |u| (u, v))).filter(|&(u, v)| at(u, v) == INK).count();
            assert!(inked > 20, "{inked} pixels of words");
        }
    }

    #[test]
    fn a_sheet_that_no_memory_holds_is_refused() {
        let cells: Vec<Cell> = (0..40).map(|_| Cell { picture: Canvas::new([3000, 1200], [0; 3]), words: Vec::new() }).collect();
        assert!(draw(&cells).unwrap_err().to_string().contains("choose fewer layers or files"));
    }

    #[test]
    fn words_wider_than_a_small_picture_are_wrapped() {
        let words = vec!["word ".repeat(20)];
        let sheet = draw(&[Cell { picture: Canvas::new([4, 4], [9; 3]), words }]).unwrap();
        assert_eq!(sheet.size, [LEAST + 16, 3 * LINE + 4 + 16]);
    }
}
