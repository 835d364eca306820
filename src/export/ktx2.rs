//! KTX 2.0 textures of half floats: what engines read light from.

use crate::base::math::Rgb;
use crate::io::Provenance;
use crate::{Error, Result};
use half::f16;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// How every such file begins.
pub const IDENTIFIER: [u8; 12] = *b"\xabKTX 20\xbb\r\n\x1a\n";
/// `VK_FORMAT_R16G16B16A16_SFLOAT`.
const HALF_RGBA: u32 = 97;
/// Bytes of a texel.
const TEXEL: usize = 8;
/// What the file says wrote it.
const WRITER: &[u8] = concat!("KTXwriter\0reprobe ", env!("CARGO_PKG_VERSION"), "\0").as_bytes();
/// The key of what says where a texture came from. Keys stand in order of their letters.
const ORIGIN: &[u8] = b"reprobe.provenance\0";
/// Most bytes of keys and values: files are not trusted.
const KEYS_MOST: u32 = 1 << 24;

/// A texture of colours in half floats, alpha 1.
pub struct Texture {
    /// Width, height and depth of the finest level; a depth of 0 stands for a texture of two dimensions.
    pub size: [u32; 3],
    /// 6 for a cube, whose faces follow one another within a level: +X, -X, +Y, -Y, +Z, -Z; else 1.
    pub faces: u32,
    /// Texels of each level, the finest first; rows from the top, slices from the front.
    pub levels: Vec<Vec<Rgb>>,
}

impl Texture {
    /// The file's bytes, with where the texture came from.
    pub fn encode(&self, provenance: &Provenance) -> Vec<u8> {
        let levels = self.levels.len();
        let format = format();
        let text = serde_json::to_string(provenance).unwrap_or_default();
        let written = [entry(WRITER), entry(&[ORIGIN, text.as_bytes(), b"\0"].concat())].concat();
        let index = 80 + 24 * levels;
        let (format_at, written_at) = (index, index + format.len());
        let mut bytes = IDENTIFIER.to_vec();
        let [width, height, depth] = self.size;
        let words = [HALF_RGBA, 2, width, height, depth, 0, self.faces, levels as u32, 0];
        let blocks = [format_at, format.len(), written_at, written.len()].map(|n| n as u32);
        bytes.extend(words.into_iter().chain(blocks).flat_map(u32::to_le_bytes));
        // No data that a compression of the whole would share.
        bytes.extend([0; 16]);
        // Levels lie in the file from the coarsest to the finest, each at a multiple of a texel's bytes.
        let mut at = (written_at + written.len()).next_multiple_of(TEXEL);
        let mut places = vec![0; levels];
        for (place, level) in places.iter_mut().zip(&self.levels).rev() {
            *place = at;
            at += level.len() * TEXEL;
        }
        for (place, level) in places.iter().zip(&self.levels) {
            let length = level.len() * TEXEL;
            bytes.extend([*place, length, length].into_iter().flat_map(|n| (n as u64).to_le_bytes()));
        }
        bytes.extend(format);
        bytes.extend(written);
        bytes.resize(bytes.len().next_multiple_of(TEXEL), 0);
        let one = f16::ONE.to_le_bytes();
        for color in self.levels.iter().rev().flatten() {
            bytes.extend(color.to_array().into_iter().flat_map(|x| f16::from_f32(x.min(f16::MAX.to_f32())).to_le_bytes()));
            bytes.extend(one);
        }
        bytes
    }
}

/// Whether a file that begins like this was written by [`Texture::encode`].
pub fn is_ours(start: &[u8]) -> bool {
    let name = &WRITER[..b"KTXwriter\0reprobe ".len()];
    start.starts_with(&IDENTIFIER) && start.windows(name.len()).any(|w| w == name)
}

/// Width, height and depth of a file's texture, and where it came from, if it says so; its texels stay unread.
pub fn read_provenance(path: &Path) -> Result<([u32; 3], Option<Provenance>)> {
    let fail = |e| Error::io(path, e);
    let bad = |what: &str| Error::input(path, format!("not a readable KTX 2.0 file: {what}"));
    let mut file = std::fs::File::open(path).map_err(fail)?;
    let mut head = [0; 80];
    file.read_exact(&mut head).map_err(|_| bad("it ends within its header"))?;
    if !head.starts_with(&IDENTIFIER) {
        return Err(bad("it begins otherwise"));
    }
    let (size, [at, length]) = ([20, 24, 28].map(|at| word(&head[at..])), [56, 60].map(|at| word(&head[at..])));
    if length > KEYS_MOST {
        return Err(bad(&format!("{length} bytes of keys and values are more than the {KEYS_MOST} allowed")));
    }
    let mut keys = Vec::new();
    file.seek(SeekFrom::Start(u64::from(at))).map_err(fail)?;
    file.take(u64::from(length)).read_to_end(&mut keys).map_err(fail)?;
    let mut rest = keys.as_slice();
    while rest.len() > 4 {
        let length = word(rest) as usize;
        let content = rest.get(4..4 + length).ok_or_else(|| bad("a value ends beyond the last one's end"))?;
        if let Some(text) = content.strip_prefix(ORIGIN) {
            let found = serde_json::from_slice(text.strip_suffix(b"\0").unwrap_or(text));
            return Ok((size, Some(found.map_err(|e| bad(&format!("its value \"reprobe.provenance\": {e}")))?)));
        }
        rest = rest.get(4 + length.next_multiple_of(4)..).unwrap_or_default();
    }
    Ok((size, None))
}

fn word(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// The data format descriptor: four linear, signed floats of 16 bits, Rec.709 primaries.
fn format() -> Vec<u8> {
    const SAMPLES: u32 = 4;
    let block = 24 + 16 * SAMPLES;
    // Version 2 of the basic descriptor; RGB without compression, BT.709, linear, straight alpha; texels of 1 x 1.
    let mut words = vec![4 + block, 0, 2 | (block << 16), 1 | (1 << 8) | (1 << 16), 0, TEXEL as u32, 0];
    for (i, channel) in [0, 1, 2, 15].into_iter().enumerate() {
        const SIGNED_FLOAT: u32 = 0xc0;
        let bits = (16 * i as u32) | (15 << 16) | ((channel | SIGNED_FLOAT) << 24);
        words.extend([bits, 0, (-1f32).to_bits(), 1f32.to_bits()]);
    }
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// A key and its value, filled up to four bytes.
fn entry(content: &[u8]) -> Vec<u8> {
    let mut bytes = (content.len() as u32).to_le_bytes().to_vec();
    bytes.extend(content);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}
