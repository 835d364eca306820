//! The page's pictures, JPEG files: how coarse and how small they have to be for the page to hold those of every frame.

use crate::metric::flip::to_rgb8;
use crate::metric::{ErrorMaps, Raster};
use crate::{Error, Result};
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use serde::Serialize;
use std::collections::BTreeMap;

/// JPEG files of one method's frames, or of the reference's, by number of the frame.
#[derive(Debug, Clone, Default)]
pub struct Pictures {
    /// Display values.
    pub frames: BTreeMap<usize, Vec<u8>>,
    /// FLIP errors, white for 1; none of the reference.
    pub flip: BTreeMap<usize, Vec<u8>>,
}

/// Pictures of one layer.
#[derive(Debug, Clone, Default)]
pub struct Shown {
    /// The reference's.
    pub reference: Pictures,
    /// Each method's, in order of [`super::Evaluation::methods`].
    pub methods: Vec<Pictures>,
}

/// All pictures of a page.
#[derive(Debug, Clone)]
pub struct Gallery {
    /// By layer.
    pub layers: BTreeMap<String, Shown>,
    /// What they show of the frames.
    pub detail: Detail,
}

/// How much of a frame its picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Detail {
    /// A pixel of the picture is the mean of so many of the frame's along either side.
    pub shrink: usize,
    /// Quality of the pictures of frames, 1 to 100.
    pub quality: u8,
    /// That of the error maps.
    pub map_quality: u8,
}

/// Least width of a picture that is smaller than its frame, pixels.
const LEAST_WIDTH: usize = 96;

impl Detail {
    /// The most that a picture shows. The page computes differences from the pictures: these are good to some 2 of 255.
    pub const MOST: Self = Self { shrink: 1, quality: 90, map_quality: 80 };
    /// From the most to the least.
    const LADDER: [Self; 7] = [
        Self::MOST,
        Self { shrink: 1, quality: 70, map_quality: 60 },
        Self { shrink: 2, quality: 85, map_quality: 75 },
        Self { shrink: 2, quality: 65, map_quality: 55 },
        Self { shrink: 4, quality: 80, map_quality: 70 },
        Self { shrink: 4, quality: 65, map_quality: 55 },
        Self { shrink: 8, quality: 70, map_quality: 60 },
    ];

    /// What pictures of frames of this width can show, from the most to the least.
    pub fn of_width(width: usize) -> impl Iterator<Item = Self> {
        Self::LADDER.into_iter().filter(move |d| d.shrink == 1 || width / d.shrink >= LEAST_WIDTH)
    }

    /// The most with which pictures of `frames` frames fit into `bytes`, or else the least; and every how many frames there may be pictures.
    /// `choices` has the bytes of one frame's pictures for each.
    pub fn choose(choices: &[(Self, usize)], frames: usize, bytes: usize) -> (Self, usize) {
        let every = |a_frame: usize| frames.saturating_mul(a_frame).div_ceil(bytes.max(1)).max(1);
        let fits = choices.iter().find(|(_, a_frame)| every(*a_frame) == 1).or(choices.last());
        fits.map_or((Self::MOST, 1), |(detail, a_frame)| (*detail, every(*a_frame)))
    }

    /// A frame's picture.
    pub fn frame(&self, display: &Raster) -> Result<Vec<u8>> {
        let channels =
            [0, 1, 2].map(|c| shrunk(&display.pixels.iter().map(|p| p[c]).collect::<Vec<_>>(), display.size, self.shrink));
        let (size, count) = (channels[0].1, channels[0].0.len());
        let pixel = |i: usize| channels.each_ref().map(|(values, _)| values[i]).into();
        let pixels = (0..count).map(pixel).collect();
        jpeg(&to_rgb8(&Raster { size, pixels }), size, ExtendedColorType::Rgb8, self.quality)
    }

    /// The picture of its FLIP errors.
    pub fn flip(&self, maps: &ErrorMaps, size: [usize; 2]) -> Result<Vec<u8>> {
        let (values, size) = shrunk(&maps.flip, size, self.shrink);
        let bytes: Vec<u8> = values.iter().map(|x| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
        jpeg(&bytes, size, ExtendedColorType::L8, self.map_quality)
    }
}

/// Means of squares of `side` x `side` values; those at the right and the lower edge may be smaller.
fn shrunk(values: &[f32], [width, height]: [usize; 2], side: usize) -> (Vec<f32>, [usize; 2]) {
    let size = [width.div_ceil(side), height.div_ceil(side)];
    let mean = |x: usize, y: usize| {
        let rows = y * side..height.min((y + 1) * side);
        let square = rows.flat_map(|row| &values[row * width..][x * side..width.min((x + 1) * side)]);
        let (sum, count) = square.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
        sum / count as f32
    };
    ((0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect(), size)
}

fn jpeg(bytes: &[u8], [width, height]: [usize; 2], kind: ExtendedColorType, quality: u8) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    JpegEncoder::new_with_quality(&mut out, quality)
        .encode(bytes, width as u32, height as u32, kind)
        .map_err(|e| Error::Request(format!("JPEG of {width} x {height}: {e}")))?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;

    #[test]
    fn pictures_get_coarser_then_smaller_before_frames_go_without() {
        let choices: Vec<(Detail, usize)> = Detail::of_width(240).zip([30_000, 15_000, 9_000, 6_000]).collect();
        assert_eq!(choices.iter().map(|c| c.0.shrink).collect::<Vec<_>>(), [1, 1, 2, 2], "none of 60 pixels");
        for (frames, expected) in
            [(3, (0, 1)), (60, (1, 1)), (100, (2, 1)), (150, (3, 1)), (151, (3, 1)), (167, (3, 2)), (600, (3, 4))]
        {
            let (detail, every) = Detail::choose(&choices, frames, 1_000_000);
            assert_eq!((detail, every), (choices[expected.0].0, expected.1), "{frames} frames");
        }
        assert_eq!(Detail::of_width(40).count(), 2);
        assert_eq!(Detail::of_width(1920).count(), 7);
    }

    #[test]
    fn a_smaller_picture_is_the_mean_of_squares() {
        let (values, size) = shrunk(&[0.0, 1.0, 4.0, 2.0, 3.0, 6.0, 5.0, 7.0, 9.0], [3, 3], 2);
        assert_eq!((values, size), (vec![1.5, 5.0, 6.0, 9.0], [2, 2]));
    }

    #[test]
    fn files_hold_what_was_drawn() {
        let display = Raster { size: [16, 9], pixels: vec![Rgb::new(0.2, 0.5, 0.8); 144] };
        let maps = ErrorMaps { difference: vec![], dssim: vec![], flip: vec![0.5; 144] };
        for (detail, size) in [(Detail::MOST, (16, 9)), (Detail { shrink: 2, ..Detail::MOST }, (8, 5))] {
            let frame = image::load_from_memory(&detail.frame(&display).unwrap()).unwrap().to_rgb8();
            let flip = image::load_from_memory(&detail.flip(&maps, [16, 9]).unwrap()).unwrap().to_luma8();
            assert_eq!((frame.dimensions(), flip.dimensions()), (size, size));
            assert!(frame.pixels().all(|p| p.0.iter().zip([51, 128, 204]).all(|(a, b)| a.abs_diff(b) < 3)));
            assert!(flip.pixels().all(|p| p.0[0].abs_diff(128) < 3));
        }
    }
}
