//! EXR files whose channels have a sample for each pixel: the first part of the file that is so.
//!
//! The `exr` crate reads the header and unpacks blocks. Its readers of whole images trust that a block is the one that its place in the
//! file's table is for, and write where it says itself; here such a file is an error.

use super::could_hold;
use exr::block::UncompressedBlock;
use exr::block::lines::LineRef;
use exr::block::reader::ChunksReader;
use exr::error::Result;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::prelude::{Error, Vec2};
use half::f16;
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::Cursor;

/// Bytes of a file that one thread reads.
const SMALL: usize = 1 << 16;
/// Blocks that are unpacked at once.
const BATCH: usize = 64;
/// The level of an image that is all of it; others are smaller copies.
const WHOLE: Vec2<usize> = Vec2(0, 0);

/// Samples of one channel, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// Half floats.
    F16(Vec<f16>),
    /// Floats.
    F32(Vec<f32>),
    /// Unsigned integers.
    U32(Vec<u32>),
}

/// A part of a file: its header, and the samples of its channels, in the header's order.
pub struct Flat {
    pub header: Header,
    pub samples: Vec<Samples>,
}

/// Reads the bytes of an EXR file whose parts have at most `most` pixels each.
pub fn read(bytes: &[u8], most: usize) -> Result<Flat> {
    let reader = exr::block::read(Cursor::new(bytes), false)?;
    check_sizes(reader.headers(), bytes.len(), most)?;
    let part = reader.headers().iter().position(is_flat);
    let part = part.ok_or(Error::NotSupported("no part has a sample for each channel and pixel".into()))?;
    let mut chunks = reader.filter_chunks(false, |_, tile, block| block.layer == part && tile.level_index == WHOLE)?;
    let meta = chunks.meta_data().clone();
    let header = &meta.headers[part];
    let mut samples: Vec<Samples> = header.channels.list.iter().map(|c| zeros(c.sample_type, header.layer_size.area())).collect();
    loop {
        let batch = chunks.by_ref().take(BATCH).collect::<Result<Vec<_>>>()?;
        if batch.is_empty() {
            break;
        }
        let unpack = |chunk| UncompressedBlock::decompress_chunk(chunk, &meta, false);
        let blocks: Result<Vec<_>> = match bytes.len() < SMALL {
            true => batch.into_iter().map(unpack).collect(),
            false => batch.into_par_iter().map(unpack).collect(),
        };
        for block in blocks? {
            if block.index.layer != part || block.index.level != WHOLE {
                return Err(invalid("a block is of another part or level than its place in the table is for"));
            }
            for line in block.lines(&header.channels) {
                let start = line.location.position.y() * header.layer_size.width() + line.location.position.x();
                fill(&mut samples[line.location.channel], start, line)?;
            }
        }
    }
    Ok(Flat { header: header.clone(), samples })
}

fn invalid(message: impl Into<Cow<'static, str>>) -> Error {
    Error::Invalid(message.into())
}

fn is_flat(header: &Header) -> bool {
    !header.deep && header.channels.list.iter().all(|c| c.sampling == Vec2(1, 1))
}

/// An error where a part has more than `most` pixels, or all of them more than `bytes` could hold.
fn check_sizes(headers: &[Header], bytes: usize, most: usize) -> Result<()> {
    let mut all = 0u64;
    for header in headers {
        let (Vec2(width, height), each) = (header.layer_size, header.channels.bytes_per_pixel as u64);
        if width.saturating_mul(height) > most {
            return Err(invalid(format!("{width} x {height} pixels are more than the {most} allowed")));
        }
        all = all.saturating_add((width as u64 * height as u64).saturating_mul(each));
    }
    match could_hold(bytes, all) {
        true => Ok(()),
        false => Err(invalid(format!("{bytes} bytes cannot hold {all} bytes of pixels"))),
    }
}

fn zeros(kind: SampleType, count: usize) -> Samples {
    match kind {
        SampleType::F16 => Samples::F16(vec![f16::ZERO; count]),
        SampleType::F32 => Samples::F32(vec![0.0; count]),
        SampleType::U32 => Samples::U32(vec![0; count]),
    }
}

/// Writes a row of a block to its place.
fn fill(samples: &mut Samples, start: usize, line: LineRef<'_>) -> Result<()> {
    let place = start..start + line.location.sample_count;
    let outside = || invalid("a block lies outside the image");
    match samples {
        Samples::F16(all) => line.read_samples_into_slice(all.get_mut(place).ok_or_else(outside)?),
        Samples::F32(all) => line.read_samples_into_slice(all.get_mut(place).ok_or_else(outside)?),
        Samples::U32(all) => line.read_samples_into_slice(all.get_mut(place).ok_or_else(outside)?),
    }
}
