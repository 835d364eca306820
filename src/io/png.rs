//! PNG files, and what those of ours say of themselves: who wrote them, and where they came from.

use super::{Provenance, atomic};
use crate::{Error, Result};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// How every such file begins.
const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
/// Bytes before the first chunk that says something about the picture: signature and header.
const HEAD: usize = SIGNATURE.len() + 25;
/// What a file that a stage writes says of itself: a chunk's type, its keyword and its text.
const OURS: &[u8] = b"tEXtSoftware\0reprobe";
/// How the chunk goes on that says where a picture came from: its type, its keyword, and that neither compression nor a language follows.
const ORIGIN: &[u8] = b"iTXtprovenance\0\0\0\0\0";
/// Most bytes of such a chunk: files are not trusted.
const ORIGIN_MOST: u32 = 1 << 24;

/// Three bytes a pixel as a file.
pub fn png(pixels: &[u8], size: [usize; 2]) -> Result<Vec<u8>> {
    encoded(pixels, size, ExtendedColorType::Rgb8)
}

/// Pixels of any kind as a file.
pub(crate) fn encoded(pixels: &[u8], [width, height]: [usize; 2], kind: ExtendedColorType) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(pixels, width as u32, height as u32, kind)
        .map_err(|e| Error::Request(format!("PNG of {width} x {height}: {e}")))?;
    Ok(bytes)
}

/// Writes a file in one step, and into it who did and what of.
pub fn write_png(path: &Path, pixels: &[u8], size: [usize; 2], provenance: &Provenance) -> Result<()> {
    atomic::write(path, &signed(path, png(pixels, size)?, provenance)?)
}

/// A file with what says who wrote it, and where it came from. `path` is for messages.
pub fn signed(path: &Path, mut bytes: Vec<u8>, provenance: &Provenance) -> Result<Vec<u8>> {
    let text = serde_json::to_string(provenance).map_err(|e| Error::input(path, e.to_string()))?;
    let chunks = [chunk(OURS), chunk(&[ORIGIN, text.as_bytes()].concat())].concat();
    bytes.splice(HEAD..HEAD, chunks);
    Ok(bytes)
}

/// A chunk of a type and its data.
fn chunk(content: &[u8]) -> Vec<u8> {
    let mut sum = flate2::Crc::new();
    sum.update(content);
    let length = (content.len() - 4) as u32;
    [&length.to_be_bytes()[..], content, &sum.sum().to_be_bytes()].concat()
}

/// Refuses to write a picture where a file is that is not one of [`write_png`]'s, or where its name says that it is none.
pub fn check_png(path: &Path) -> Result<()> {
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) {
        return Err(Error::input(path, "expected a name that ends in .png"));
    }
    match std::fs::read(path) {
        Ok(bytes) if !is_ours(&bytes) => {
            Err(Error::input(path, "was not written by reprobe: remove it, or give the picture another name"))
        }
        _ => Ok(()),
    }
}

/// Whether a file that begins like this was written by [`write_png`].
pub fn is_ours(start: &[u8]) -> bool {
    start.get(HEAD + 4..).is_some_and(|rest| rest.starts_with(OURS))
}

/// Width and height of a file's picture, and where it came from, if it says so; its pixels stay unread.
pub fn read_provenance(path: &Path) -> Result<([u32; 2], Option<Provenance>)> {
    let fail = |e| Error::io(path, e);
    let bad = |what: &str| Error::input(path, format!("not a readable PNG file: {what}"));
    let mut file = BufReader::new(std::fs::File::open(path).map_err(fail)?);
    let mut head = [0; HEAD];
    file.read_exact(&mut head).map_err(|_| bad("it ends within its header"))?;
    if !head.starts_with(&SIGNATURE) || &head[12..16] != b"IHDR" {
        return Err(bad("it begins otherwise"));
    }
    let size = [word(&head[16..]), word(&head[20..])];
    loop {
        let mut start = [0; 8];
        file.read_exact(&mut start).map_err(|_| bad("it ends before its pixels"))?;
        let (length, kind) = (word(&start), &start[4..]);
        match kind {
            b"IDAT" | b"IEND" => return Ok((size, None)),
            b"iTXt" if length <= ORIGIN_MOST => {
                let mut content = start[4..].to_vec();
                file.by_ref().take(u64::from(length)).read_to_end(&mut content).map_err(fail)?;
                if let Some(text) = content.strip_prefix(ORIGIN) {
                    let found = serde_json::from_slice(text);
                    return Ok((size, Some(found.map_err(|e| bad(&format!("its text \"provenance\": {e}")))?)));
                }
                file.seek(SeekFrom::Current(4)).map_err(fail)?;
            }
            _ => {
                file.seek(SeekFrom::Current(i64::from(length) + 4)).map_err(fail)?;
            }
        }
    }
}

fn word(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).fold(0, |word, byte| word << 8 | u32::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_pictures_are_told_from_others_and_say_where_they_came_from() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        check_png(&path).unwrap();
        let provenance = Provenance::new("view", "abc", 7, &serde_json::json!({ "layer": "Löwe" }));
        write_png(&path, &[1, 2, 3, 4, 5, 6], [2, 1], &provenance).unwrap();
        check_png(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(image::load_from_memory(&bytes).unwrap().to_rgb8().as_raw(), &[1, 2, 3, 4, 5, 6]);
        assert_eq!(read_provenance(&path).unwrap(), ([2, 1], Some(provenance)));
        std::fs::write(&path, png(&[0; 3], [1, 1]).unwrap()).unwrap();
        assert!(check_png(&path).unwrap_err().to_string().contains("not written by reprobe"));
        assert_eq!(read_provenance(&path).unwrap(), ([1, 1], None));
        assert!(check_png(&folder.path().join("scene.xml")).unwrap_err().to_string().contains(".png"));
        for end in 0..bytes.len() {
            std::fs::write(&path, &bytes[..end]).unwrap();
            if let Err(e) = read_provenance(&path) {
                assert!(e.to_string().contains("a.png: not a readable PNG file"), "{end}: {e}");
            }
        }
    }
}
