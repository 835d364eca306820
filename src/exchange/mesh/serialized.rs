//! Mitsuba's compressed mesh files (`serialized`), versions 3 and 4, single and double precision.
//!
//! A file is a row of meshes, each a small header and a zlib stream; at its end stand the offsets of all meshes and their
//! number. The stream holds flags, (version 4) a name, the two counts, then positions, normals, texture coordinates,
//! colours and indices, all little-endian.

use super::{MeshAttribute, MeshFile};
use crate::io::read_named;
use crate::scene::mesh::Mesh;
use crate::{Error, Result};
use flate2::bufread::ZlibDecoder;
use glam::{Vec2, Vec3};
use std::io::Read;
use std::path::Path;

const FORMAT: u16 = 0x041c;
const HAS_NORMALS: u32 = 0x0001;
const HAS_UVS: u32 = 0x0002;
const HAS_COLORS: u32 = 0x0008;
const DOUBLE: u32 = 0x2000;
/// Longest name, bytes.
const MAX_NAME: usize = 1 << 16;

/// Reads mesh `shape_index` of a serialized file.
pub fn load(path: &Path, shape_index: usize) -> Result<MeshFile> {
    parse(&read_named(path)?, shape_index, path)
}

/// Reads mesh `shape_index` from the bytes of a serialized file; `path` is for messages.
pub fn parse(bytes: &[u8], shape_index: usize, path: &Path) -> Result<MeshFile> {
    let file = decode(bytes, shape_index).map_err(|e| Error::input(path, e))?;
    file.check().map_err(|e| Error::input(path, format!("mesh {shape_index}: {e}")))?;
    Ok(file)
}

fn decode(bytes: &[u8], shape_index: usize) -> std::result::Result<MeshFile, String> {
    let version = header(bytes)?;
    let offset = offset(bytes, version, shape_index)?;
    let body = usize::try_from(offset).ok().and_then(|o| bytes.get(o..)).unwrap_or_default();
    header(body).map_err(|e| format!("mesh {shape_index} at byte {offset}: {e}"))?;

    let mut stream = Stream(ZlibDecoder::new(&body[4..]));
    let flags = stream.u32("flags")?;
    if version >= 4 {
        stream.skip_name()?;
    }
    let vertices = stream.count("vertex count")?;
    let triangles = stream.count("triangle count")?;
    let (mut mesh, mut attributes) = (Mesh::default(), Vec::new());
    let wide = flags & DOUBLE != 0;
    mesh.positions = stream.floats(vertices, 3, wide, "positions")?.chunks_exact(3).map(Vec3::from_slice).collect();
    if flags & HAS_NORMALS != 0 {
        mesh.normals = stream.floats(vertices, 3, wide, "normals")?.chunks_exact(3).map(Vec3::from_slice).collect();
    }
    if flags & HAS_UVS != 0 {
        mesh.uvs = stream.floats(vertices, 2, wide, "texture coordinates")?.chunks_exact(2).map(Vec2::from_slice).collect();
    }
    if flags & HAS_COLORS != 0 {
        let values = stream.floats(vertices, 3, wide, "colours")?.chunks_exact(3).map(Vec3::from_slice).collect();
        attributes.push(MeshAttribute { name: "vertex_color".into(), values });
    }
    let indices = stream.bytes(triangles * 12, "triangles")?;
    let index = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    mesh.triangles = indices.chunks_exact(12).map(|t| [index(t), index(&t[4..]), index(&t[8..])]).collect();
    Ok(MeshFile { mesh, attributes })
}

/// Version of the file or mesh that begins with `bytes`.
fn header(bytes: &[u8]) -> std::result::Result<u16, String> {
    let Some(&[a, b, c, d]) = bytes.first_chunk::<4>() else {
        return Err("the file ends before a mesh header".into());
    };
    let (format, version) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
    if format != FORMAT {
        return Err(format!("found the format mark {format:#06x}, expected {FORMAT:#06x} of a serialized mesh"));
    }
    if !(3..=4).contains(&version) {
        return Err(format!("found version {version}, expected 3 or 4"));
    }
    Ok(version)
}

/// Where mesh `index` begins, from the table at the end of the file.
fn offset(bytes: &[u8], version: u16, index: usize) -> std::result::Result<u64, String> {
    let (rest, count) = bytes.split_last_chunk::<4>().ok_or("the file is too short")?;
    let count = u32::from_le_bytes(*count) as usize;
    let width = if version >= 4 { 8 } else { 4 };
    let table = count.checked_mul(width).and_then(|size| rest.len().checked_sub(size)).map(|start| &rest[start..]);
    let table = table.ok_or_else(|| format!("the table at the end tells of {count} meshes, more than the file can hold"))?;
    if index >= count {
        return Err(format!("asked for mesh {index}, but the file has {count}"));
    }
    let entry = &table[index * width..][..width];
    Ok(entry.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte)))
}

struct Stream<R>(R);

impl<R: Read> Stream<R> {
    /// Exactly `n` bytes. Memory grows with what is there, not with what is asked for.
    fn bytes(&mut self, n: u64, what: &str) -> std::result::Result<Vec<u8>, String> {
        let mut out = Vec::new();
        (&mut self.0).take(n).read_to_end(&mut out).map_err(|e| format!("cannot decompress the {what}: {e}"))?;
        if (out.len() as u64) < n {
            return Err(format!("the {what} end after {} of {n} bytes", out.len()));
        }
        Ok(out)
    }

    fn u32(&mut self, what: &str) -> std::result::Result<u32, String> {
        let b = self.bytes(4, what)?;
        Ok(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    /// A count that 32-bit indices can reach.
    fn count(&mut self, what: &str) -> std::result::Result<u64, String> {
        let (low, high) = (self.u32(what)?, self.u32(what)?);
        if high != 0 || low == u32::MAX {
            return Err(format!("the {what} is {}, expected less than {}", u64::from(high) << 32 | u64::from(low), u32::MAX));
        }
        Ok(low.into())
    }

    fn skip_name(&mut self) -> std::result::Result<(), String> {
        for _ in 0..MAX_NAME {
            if self.bytes(1, "name")?[0] == 0 {
                return Ok(());
            }
        }
        Err(format!("the name has more than {MAX_NAME} bytes"))
    }

    fn floats(&mut self, vertices: u64, each: u64, wide: bool, what: &str) -> std::result::Result<Vec<f32>, String> {
        let bytes = self.bytes(vertices * each * if wide { 8 } else { 4 }, what)?;
        Ok(if wide {
            let double = |b: &[u8]| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]) as f32;
            bytes.chunks_exact(8).map(double).collect()
        } else {
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    const P: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5]];

    /// A file of two meshes, the second with its positions in reverse; checked once against Mitsuba 3.9.1's reader.
    fn file(version: u16, flags: u32, counts: [u64; 2], last_index: u32) -> Vec<u8> {
        let mut out = Vec::new();
        let mut offsets = Vec::new();
        for reverse in [false, true] {
            offsets.push(out.len() as u64);
            let mut body = flags.to_le_bytes().to_vec();
            if version == 4 {
                body.extend(b"name\0");
            }
            counts.iter().for_each(|c| body.extend(c.to_le_bytes()));
            let mut put = |x: f32| {
                if flags & DOUBLE != 0 { body.extend(f64::from(x).to_le_bytes()) } else { body.extend(x.to_le_bytes()) }
            };
            let mut positions = P;
            if reverse {
                positions.reverse();
            }
            positions.as_flattened().iter().for_each(|&x| put(x));
            if flags & HAS_NORMALS != 0 {
                (0..9).for_each(|i| put(if i % 3 == 2 { 1.0 } else { 0.0 }));
            }
            if flags & HAS_UVS != 0 {
                [0.0, 0.0, 0.25, 0.0, 0.5, 1.0].into_iter().for_each(&mut put);
            }
            if flags & HAS_COLORS != 0 {
                (0..9).for_each(|_| put(0.5));
            }
            [0u32, 1, last_index].iter().for_each(|i| body.extend(i.to_le_bytes()));
            out.extend(FORMAT.to_le_bytes());
            out.extend(version.to_le_bytes());
            let mut encoder = flate2::write::ZlibEncoder::new(&mut out, flate2::Compression::default());
            encoder.write_all(&body).unwrap();
            encoder.finish().unwrap();
        }
        for o in offsets {
            let width = if version == 4 { 8 } else { 4 };
            out.extend_from_slice(&o.to_le_bytes()[..width]);
        }
        out.extend(2u32.to_le_bytes());
        out
    }

    fn read(bytes: &[u8], index: usize) -> Result<Mesh> {
        parse(bytes, index, Path::new("a.serialized")).map(|file| file.mesh)
    }

    #[test]
    fn both_versions_and_precisions_say_the_same() {
        for version in [3, 4] {
            for flags in [0x1000, 0x100b, 0x2003, 0x200b, 0x1010] {
                let bytes = file(version, flags, [3, 1], 2);
                let mesh = read(&bytes, 1).unwrap();
                assert_eq!(mesh.positions, [P[2], P[1], P[0]].map(Vec3::from));
                assert_eq!(mesh.triangles, [[0, 1, 2]]);
                assert_eq!(mesh.normals.len(), if flags & HAS_NORMALS != 0 { 3 } else { 0 });
                assert_eq!(mesh.uvs.get(2).copied(), (flags & HAS_UVS != 0).then_some(Vec2::new(0.5, 1.0)));
                assert_eq!(read(&bytes, 0).unwrap().positions, P.map(Vec3::from));
            }
        }
    }

    #[test]
    fn bad_files_are_errors() {
        let good = file(4, 0x1003, [3, 1], 2);
        let cases = [
            (good.clone(), 2, "asked for mesh 2, but the file has 2"),
            (file(4, 0x1003, [3, 1], 3), 0, "triangle 0 has vertices [0, 1, 3]"),
            (file(3, 0x1003, [1 << 31, 1], 2), 0, "positions end after"),
            (file(3, 0x1003, [u64::MAX, 1], 2), 0, "vertex count is 18446744073709551615"),
            (file(3, 0x1003, [3, 4_000_000_000], 2), 0, "triangles end after"),
            (b"PK\x03\x04....".to_vec(), 0, "format mark"),
            (vec![0x1c, 0x04, 9, 0, 0, 0, 0, 0], 0, "version 9"),
            (vec![0x1c, 0x04, 4, 0, 0xff, 0xff, 0xff, 0xff], 0, "4294967295 meshes"),
            (Vec::new(), 0, "ends before"),
        ];
        for (bytes, index, expected) in cases {
            let message = read(&bytes, index).expect_err(expected).to_string();
            assert!(message.starts_with("a.serialized: ") && message.contains(expected), "{message}");
        }
    }

    #[test]
    fn no_truncation_or_changed_byte_panics() {
        let good = file(4, 0x1003, [3, 1], 2);
        for n in 0..good.len() {
            let _ = read(&good[..n], 0);
            let mut changed = good.clone();
            changed[n] ^= 0x55;
            let _ = read(&changed, 1);
        }
    }
}
