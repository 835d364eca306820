//! EXR files with channels that hold fewer samples than the image has pixels, which the `exr` crate does not read: scan lines of one part,
//! uncompressed or with RLE or ZIP.
//!
//! A channel of sampling s has the pixels whose coordinates s divides; the others are interpolated between them. Luminance and chroma
//! (`Y`, `RY`, `BY`) become red, green and blue.

use super::{could_hold, primaries};
use std::io::Read;

const SCAN_LINES_OF_ONE_PART: u32 = 2;

/// A channel's full name and its values, one a pixel.
pub type Plane = (String, Vec<f32>);

/// What a file with subsampled channels holds.
#[derive(Debug)]
pub struct Subsampled {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Channels, brought to full size.
    pub planes: Vec<Plane>,
    /// Red, green, blue and white on CIE's diagram, where the header names them.
    pub primaries: Option<[[f32; 2]; 4]>,
}

struct Channel {
    name: String,
    /// 0: unsigned integers, 1: halves, 2: floats.
    kind: u32,
    sampling: [usize; 2],
    /// Width and height in samples.
    size: [usize; 2],
    samples: Vec<f32>,
}

impl Channel {
    fn width_bytes(&self) -> usize {
        self.size[0] * if self.kind == 1 { 2 } else { 4 }
    }

    fn add_row(&mut self, bytes: &[u8]) {
        let four = |b: &[u8]| [b[0], b[1], b[2], b[3]];
        match self.kind {
            0 => self.samples.extend(bytes.chunks_exact(4).map(|b| u32::from_le_bytes(four(b)) as f32)),
            1 => self.samples.extend(bytes.chunks_exact(2).map(|b| half::f16::from_le_bytes([b[0], b[1]]).to_f32())),
            _ => self.samples.extend(bytes.chunks_exact(4).map(|b| f32::from_le_bytes(four(b)))),
        }
    }

    /// The value at a pixel, from the samples to both sides of it.
    fn at(&self, x: usize, y: usize) -> f32 {
        let along = |i: usize, k: usize| {
            let last = self.size[k] - 1;
            let (low, f) = (i / self.sampling[k], (i % self.sampling[k]) as f32 / self.sampling[k] as f32);
            (low.min(last), (low + 1).min(last), f)
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (along(x, 0), along(y, 1));
        let row = |y: usize| self.samples[y * self.size[0] + x0] * (1.0 - fx) + self.samples[y * self.size[0] + x1] * fx;
        if fy == 0.0 { row(y0) } else { row(y0) * (1.0 - fy) + row(y1) * fy }
    }
}

/// Reads the bytes of an EXR file; `None` where no channel is subsampled, or it is of another kind than this reads.
pub fn read(bytes: &[u8], most_pixels: usize) -> Result<Option<Subsampled>, String> {
    let mut header = Bytes(bytes);
    let Some((_, version)) = header.u32().zip(header.u32()) else { return Ok(None) };
    if version & !0x400 != SCAN_LINES_OF_ONE_PART {
        return Ok(None);
    }
    let (mut channels, mut compression, mut window, mut primaries) = (Vec::new(), 0, None, None);
    loop {
        let Some(name) = header.text() else { return Ok(None) };
        if name.is_empty() {
            break;
        }
        let Some((_, length)) = header.text().zip(header.u32()) else { return Ok(None) };
        let Some(mut value) = header.take(length as usize).map(Bytes) else { return Ok(None) };
        match name.as_str() {
            "channels" => channels = list(&mut value).unwrap_or_default(),
            "compression" => compression = value.take(1).map_or(0, |b| b[0]),
            "dataWindow" => window = value.numbers::<4>().map(|n| n.map(|u| i64::from(u as i32))),
            "chromaticities" => {
                primaries = value.numbers::<8>().map(|n| [0, 2, 4, 6].map(|i| [n[i], n[i + 1]].map(f32::from_bits)))
            }
            _ => {}
        }
    }
    let Some([x0, y0, x1, y1]) = window else { return Ok(None) };
    if channels.iter().all(|c| c.sampling == [1, 1]) {
        return Ok(None);
    }
    let size = [x1 - x0 + 1, y1 - y0 + 1].map(|n| usize::try_from(n).unwrap_or(0));
    if size[0] == 0 || size[1] == 0 || size[0].saturating_mul(size[1]) > most_pixels {
        return Err(format!("{} x {} pixels, expected some, and at most {most_pixels}", size[0], size[1]));
    }
    let all = (size[0] * size[1]) as u64 * 4 * channels.len() as u64;
    if !could_hold(bytes.len(), all) {
        return Err(format!("{} bytes cannot hold {all} bytes of pixels: not a whole image", bytes.len()));
    }
    for c in &mut channels {
        if c.sampling.iter().zip([x0, y0]).any(|(&s, low)| s == 0 || low % s as i64 != 0) || c.kind > 2 {
            return Err(format!("channel \"{}\": its samples do not begin at the image's corner", c.name));
        }
        c.size = [0, 1].map(|k| size[k].div_ceil(c.sampling[k]));
    }
    let lines = match compression {
        0..=2 => 1,
        3 => 16,
        _ => return Err("subsampled channels are read uncompressed or with RLE, ZIPS or ZIP; save it so".into()),
    };
    blocks(&mut header, bytes, compression, lines, size[1], &mut channels)?;
    let planes = channels.iter().map(|c| {
        let values = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| c.at(x, y)));
        (c.name.clone(), values.collect())
    });
    Ok(Some(Subsampled { size, planes: with_colors(planes.collect(), primaries), primaries }))
}

fn list(value: &mut Bytes) -> Option<Vec<Channel>> {
    let mut channels = Vec::new();
    loop {
        let name = value.text()?;
        if name.is_empty() {
            return Some(channels);
        }
        let [kind, _, x, y] = value.numbers()?;
        channels.push(Channel { name, kind, sampling: [x as usize, y as usize], size: [0; 2], samples: Vec::new() });
    }
}

/// Reads all blocks of `lines` rows, in the order of their rows.
fn blocks(
    table: &mut Bytes,
    bytes: &[u8],
    compression: u8,
    lines: usize,
    height: usize,
    channels: &mut [Channel],
) -> Result<(), String> {
    const EARLY: &str = "the file ends before all its rows are there";
    for first in (0..height).step_by(lines) {
        let offset = table.numbers::<2>().ok_or(EARLY)?;
        let at = u64::from(offset[0]) | u64::from(offset[1]) << 32;
        let mut block = Bytes(usize::try_from(at).ok().and_then(|at| bytes.get(at..)).ok_or(EARLY)?);
        let [_, length] = block.numbers::<2>().ok_or(EARLY)?;
        let packed = block.take(length as usize).ok_or(EARLY)?;
        let rows: Vec<usize> = (first..height.min(first + lines)).collect();
        let has = |c: &Channel, y: usize| y.is_multiple_of(c.sampling[1]);
        let size = rows.iter().flat_map(|&y| channels.iter().filter(move |c| has(c, y)).map(Channel::width_bytes)).sum();
        let plain = unpack(packed, compression, size)?;
        let mut rest = plain.as_slice();
        for y in rows {
            for c in channels.iter_mut().filter(|c| has(c, y)) {
                let (row, after) = rest.split_at(c.width_bytes());
                c.add_row(row);
                rest = after;
            }
        }
    }
    Ok(())
}

/// A block's `size` bytes. One that would not have shrunk is stored as it is.
fn unpack(packed: &[u8], compression: u8, size: usize) -> Result<Vec<u8>, String> {
    if packed.len() == size {
        return Ok(packed.to_vec());
    }
    let mut bytes = Vec::new();
    match compression {
        0 => {}
        1 => runs(packed, size, &mut bytes),
        _ => {
            let stream = flate2::read::ZlibDecoder::new(packed);
            stream.take(size as u64 + 1).read_to_end(&mut bytes).map_err(|e| format!("cannot decompress: {e}"))?;
        }
    }
    if bytes.len() != size {
        return Err(format!("a block of {} bytes, expected {size}", bytes.len()));
    }
    // Stored as differences, even bytes before odd ones.
    for i in 1..size {
        bytes[i] = bytes[i - 1].wrapping_add(bytes[i]).wrapping_sub(128);
    }
    let half = size.div_ceil(2);
    Ok((0..size).map(|i| bytes[i / 2 + if i % 2 == 0 { 0 } else { half }]).collect())
}

fn runs(packed: &[u8], size: usize, out: &mut Vec<u8>) {
    let mut rest = packed;
    while let Some((&count, after)) = rest.split_first().filter(|_| out.len() <= size) {
        let count = i32::from(count as i8);
        let used = if count < 0 { (-count) as usize } else { 1 };
        let Some(bytes) = after.get(..used) else { return };
        match count {
            ..0 => out.extend_from_slice(bytes),
            _ => out.extend(std::iter::repeat_n(bytes[0], count as usize + 1)),
        }
        rest = &after[used..];
    }
}

/// Adds red, green and blue to layers of luminance and chroma, in their place.
fn with_colors(mut planes: Vec<Plane>, primaries: Option<[[f32; 2]; 4]>) -> Vec<Plane> {
    let weights = primaries::luminance_weights(primaries);
    let layers: Vec<String> = planes.iter().filter_map(|(n, _)| n.strip_suffix("RY").map(str::to_owned)).collect();
    for layer in layers {
        let place = |planes: &[Plane], c: &str| planes.iter().position(|(n, _)| *n == format!("{layer}{c}"));
        let [Some(y), Some(ry), Some(by)] = ["Y", "RY", "BY"].map(|c| place(&planes, c)) else { continue };
        let colors: Vec<[f32; 3]> = (0..planes[y].1.len())
            .map(|i| {
                let luminance = planes[y].1[i];
                let (r, b) = ((planes[ry].1[i] + 1.0) * luminance, (planes[by].1[i] + 1.0) * luminance);
                [r, (luminance - weights[0] * r - weights[2] * b) / weights[1], b]
            })
            .collect();
        planes.retain(|(n, _)| !["Y", "RY", "BY"].iter().any(|c| *n == format!("{layer}{c}")));
        planes.extend(
            ["R", "G", "B"].iter().enumerate().map(|(k, c)| (format!("{layer}{c}"), colors.iter().map(|v| v[k]).collect())),
        );
    }
    planes
}

/// Bytes still to be read.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    fn numbers<const N: usize>(&mut self) -> Option<[u32; N]> {
        let mut out = [0; N];
        for number in &mut out {
            *number = self.u32()?;
        }
        Some(out)
    }

    fn text(&mut self) -> Option<String> {
        let end = self.0.iter().position(|b| *b == 0)?;
        let text = String::from_utf8_lossy(&self.0[..end]).into_owned();
        self.0 = &self.0[end + 1..];
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, kind: &str, value: &[u8]) -> Vec<u8> {
        [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &(value.len() as u32).to_le_bytes(), value].concat()
    }

    /// The even bytes before the odd ones, and differences: what RLE and ZIP compress.
    fn prepared(plain: &[u8]) -> Vec<u8> {
        let order: Vec<u8> = plain.iter().step_by(2).chain(plain.iter().skip(1).step_by(2)).copied().collect();
        let mut out = order.clone();
        (1..out.len()).for_each(|i| out[i] = order[i].wrapping_sub(order[i - 1]).wrapping_add(128));
        out
    }

    /// Name, sampling, value at each sample by its pixel.
    type Given<'a> = (&'a str, u32, fn(u32, u32) -> f32);

    /// A file of floats.
    fn file(size: [u32; 2], channels: &[Given], compression: u8) -> Vec<u8> {
        let mut list = Vec::new();
        for (name, s, _) in channels {
            list.extend([name.as_bytes(), b"\0"].concat());
            [2, 0, *s, *s].iter().for_each(|n: &u32| list.extend(n.to_le_bytes()));
        }
        list.push(0);
        let window: Vec<u8> = [0, 0, size[0] - 1, size[1] - 1].iter().flat_map(|n| n.to_le_bytes()).collect();
        let mut out = [&[0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0], attribute("channels", "chlist", &list).as_slice()].concat();
        out.extend(attribute("compression", "compression", &[compression]));
        out.extend(attribute("dataWindow", "box2i", &window));
        out.push(0);
        let lines = if compression == 3 { 16 } else { 1 };
        let blocks: Vec<Vec<u8>> = (0..size[1])
            .step_by(lines)
            .map(|first| {
                let mut plain = Vec::new();
                for y in first..size[1].min(first + lines as u32) {
                    for (_, s, value) in channels.iter().filter(|(_, s, _)| y % s == 0) {
                        (0..size[0]).step_by(*s as usize).for_each(|x| plain.extend(value(x, y).to_le_bytes()));
                    }
                }
                let packed = match compression {
                    0 => plain.clone(),
                    // Runs of one byte, and single bytes: not small, but as the format has it.
                    1 => prepared(&plain).iter().flat_map(|&b| [0, b]).collect(),
                    _ => {
                        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
                        std::io::Write::write_all(&mut encoder, &prepared(&plain)).unwrap();
                        encoder.finish().unwrap()
                    }
                };
                [&first.to_le_bytes()[..], &(packed.len() as u32).to_le_bytes(), &packed].concat()
            })
            .collect();
        let mut at = out.len() + 8 * blocks.len();
        for block in &blocks {
            out.extend((at as u64).to_le_bytes());
            at += block.len();
        }
        out.extend(blocks.concat());
        out
    }

    #[test]
    fn samples_stand_at_their_pixels_and_chroma_becomes_colour() {
        let y: fn(u32, u32) -> f32 = |x, y| 0.2 + 0.01 * (x + 8 * y) as f32;
        let ry: fn(u32, u32) -> f32 = |x, y| 0.1 * x as f32 - 0.05 * y as f32;
        let by: fn(u32, u32) -> f32 = |x, _| 0.02 * x as f32;
        for compression in 0..4 {
            let bytes = file([40, 37], &[("BY", 2, by), ("RY", 2, ry), ("Y", 1, y)], compression);
            let found = read(&bytes, 1 << 20).unwrap().unwrap();
            assert_eq!(found.size, [40, 37]);
            let plane = |name: &str| &found.planes.iter().find(|(n, _)| n == name).unwrap().1;
            // Linear chroma: between the samples, too, it is what it says.
            for (px, py) in [(0, 0), (6, 4), (7, 5), (3, 20), (38, 36)] {
                let i = (py * 40 + px) as usize;
                let luminance = y(px, py);
                let (r, b) = ((ry(px, py) + 1.0) * luminance, (by(px, py) + 1.0) * luminance);
                let g = (luminance - 0.212_639 * r - 0.072_192 * b) / 0.715_169;
                for (name, expected) in [("R", r), ("G", g), ("B", b)] {
                    assert!(
                        (plane(name)[i] - expected).abs() < 2e-5,
                        "{compression} {name} ({px}, {py}): {} {expected}",
                        plane(name)[i]
                    );
                }
            }
            for cut in (8..bytes.len()).step_by(97) {
                assert!(!matches!(read(&bytes[..cut], 1 << 20), Ok(Some(_))), "cut at {cut}");
            }
        }
        let plain = file([4, 4], &[("Y", 1, y)], 0);
        assert!(read(&plain, 1 << 20).unwrap().is_none());
        assert!(read(&file([4, 4], &[("Y", 1, y), ("Z", 2, y)], 4), 1 << 20).unwrap_err().contains("RLE"));
    }
}
