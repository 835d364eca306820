//! A short run of the fuzz targets (`docs/fuzzing.md`) on what stable Rust has: their seeds, and some thousand changed ones of each.

#[path = "../fuzz/src/lib.rs"]
mod targets;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Changed files a target.
const CHANGED: usize = 3000;
/// Longest time for one file, beside all other tests.
const LONGEST: Duration = Duration::from_secs(5);

macro_rules! replayed {
    ($($name:ident),*) => {
        $(#[test]
        fn $name() {
            replay(stringify!($name), targets::$name);
        })*
        const REPLAYED: &[&str] = &[$(stringify!($name)),*];
    };
}

replayed!(xml, json, gltf, obj, ply, serialized, image, exr, camera_path, lights, probes);

fn fuzz(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz").join(folder)
}

fn names(folder: &str) -> BTreeSet<String> {
    let stem =
        |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned();
    std::fs::read_dir(fuzz(folder)).unwrap().map(stem).collect()
}

#[test]
fn every_target_is_replayed_and_has_seeds() {
    let all: BTreeSet<String> = targets::TARGETS.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(all, REPLAYED.iter().map(|name| (*name).to_owned()).collect());
    assert_eq!(all, names("fuzz_targets"));
    assert_eq!(all, names("seeds"));
    let manifest = std::fs::read_to_string(fuzz("Cargo.toml")).unwrap();
    assert!(all.iter().all(|name| manifest.contains(&format!("path = \"fuzz_targets/{name}.rs\""))));
}

/// Seeds are accepted, but for those named `bad`: what once did harm, and is refused. Of changed ones some are accepted, some refused.
fn replay(name: &str, target: fn(&[u8]) -> bool) {
    let mut files: Vec<PathBuf> = std::fs::read_dir(fuzz("seeds").join(name)).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let seeds: Vec<(bool, Vec<u8>)> = files
        .iter()
        .map(|file| (!file.file_name().unwrap().to_string_lossy().starts_with("bad"), std::fs::read(file).unwrap()))
        .collect();
    for ((good, bytes), file) in seeds.iter().zip(&files) {
        assert_eq!(timed(target, bytes), *good, "{}", file.display());
    }
    let mut change = Change(1);
    let mut accepted = 0;
    for i in 0..CHANGED {
        let other = change.draw(seeds.len());
        let changed = change.of(&seeds[i % seeds.len()].1, &seeds[other].1);
        accepted += usize::from(timed(target, &changed));
    }
    assert!((CHANGED / 100..CHANGED * 99 / 100).contains(&accepted), "{accepted} of {CHANGED} changed files accepted");
}

fn timed(target: fn(&[u8]) -> bool, bytes: &[u8]) -> bool {
    let start = Instant::now();
    let accepted = target(bytes);
    assert!(start.elapsed() < LONGEST, "{:?} for {}", start.elapsed(), String::from_utf8_lossy(bytes));
    accepted
}

/// Numbers that are often forgotten, as text and as bytes.
const WORDS: [&str; 12] = [
    "0",
    "-1",
    "1e39",
    "1e-45",
    "-0",
    "nan",
    "4294967295",
    "2147483648",
    "18446744073709551615",
    "1000000000000000000",
    "",
    "\"\"",
];
const BYTES: [[u8; 4]; 6] =
    [[0; 4], [255; 4], [255, 255, 255, 127], [0, 0, 0, 128], [127, 255, 255, 255], 0x7f80_0000u32.to_le_bytes()];

/// Changes files, always in the same way.
struct Change(u64);

impl Change {
    fn draw(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n.max(1)
    }

    /// A piece of a file.
    fn piece(&mut self, of: &[u8]) -> std::ops::Range<usize> {
        let (start, length) = (self.draw(of.len() + 1), self.draw(40));
        start..(start + length).min(of.len())
    }

    /// One to three changes; some take pieces of `other`.
    fn of(&mut self, bytes: &[u8], other: &[u8]) -> Vec<u8> {
        let mut out = bytes.to_vec();
        for _ in 0..1 + self.draw(3) {
            let at = self.draw(out.len());
            match self.draw(8) {
                0 if !out.is_empty() => out[at] ^= 1 << self.draw(8),
                // Digits to digits, so that text often stays whole and its numbers do not.
                1 | 2 if !out.is_empty() => {
                    let value = self.draw(256) as u8;
                    out[at] = if out[at].is_ascii_digit() { b'0' + value % 10 } else { value };
                }
                3 => {
                    let digits = out[at..].iter().position(u8::is_ascii_digit).map_or(at, |i| at + i);
                    let end = digits + out[digits..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
                    let word = WORDS[self.draw(WORDS.len())].bytes();
                    out.splice(digits..end, word);
                }
                4 => {
                    let word = BYTES[self.draw(BYTES.len())];
                    out.iter_mut().skip(at).zip(word).for_each(|(place, byte)| *place = byte);
                }
                5 => {
                    let piece = self.piece(&out);
                    out.drain(piece);
                }
                6 => {
                    let piece = self.piece(&out);
                    let copy = out[piece].to_vec();
                    out.splice(at..at, copy);
                }
                _ => {
                    let (from, to) = (self.piece(other), self.piece(&out));
                    out.splice(to, other[from].iter().copied());
                }
            }
        }
        out
    }
}
