//! Where a bake keeps its finished blocks: in memory, or in a folder from which a killed bake goes on.

use crate::io::atomic;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Words of a finished texel.
pub const WORDS: usize = 7;

/// A finished texel: three radiometric values, flags, the variance of the values' luminance, the number of a sample that counts, and how many
/// do, all as bits.
pub type Record = [u32; WORDS];

/// Keeps finished blocks.
pub trait Store: Sync {
    /// Whether a block is there.
    fn has(&self, block: u32, len: usize) -> bool {
        self.get(block, len).is_some()
    }
    /// A finished block of `len` records.
    fn get(&self, block: u32, len: usize) -> Option<Vec<Record>>;
    /// Keeps a finished block.
    fn put(&self, block: u32, records: &[Record]) -> Result<()>;
}

/// Blocks in memory.
#[derive(Debug, Default)]
pub struct Memory(Mutex<BTreeMap<u32, Vec<Record>>>);

impl Store for Memory {
    fn get(&self, block: u32, len: usize) -> Option<Vec<Record>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(&block).filter(|b| b.len() == len).cloned()
    }

    fn put(&self, block: u32, records: &[Record]) -> Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(block, records.to_vec());
        Ok(())
    }
}

/// Blocks in a folder, one file each: the bake's key, the records, and their hash.
/// A file of another bake, a torn one or a changed one counts as missing.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    key: [u8; 32],
}

impl Folder {
    /// The folder at `path` for the bake that `key` describes (its provenance, say).
    pub fn new(path: &Path, key: &str) -> Self {
        Self { path: path.into(), key: *blake3::hash(key.as_bytes()).as_bytes() }
    }

    fn file(&self, block: u32) -> PathBuf {
        self.path.join(format!("{block:06}.part"))
    }

    /// Deletes the folder's blocks, and the folder if nothing else is in it.
    pub fn remove(&self) -> Result<()> {
        if self.path.is_dir() {
            atomic::sweep(&self.path);
        }
        let entries = match std::fs::read_dir(&self.path) {
            Ok(entries) => entries,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
            Err(e) => return Err(Error::io(&self.path, e)),
        };
        for entry in entries.flatten() {
            if entry.path().extension().is_some_and(|e| e == "part") {
                std::fs::remove_file(entry.path()).map_err(|e| Error::io(entry.path(), e))?;
            }
        }
        // Somebody else's files are left where they are.
        let _ = std::fs::remove_dir(&self.path);
        Ok(())
    }
}

impl Store for Folder {
    fn get(&self, block: u32, len: usize) -> Option<Vec<Record>> {
        let bytes = std::fs::read(self.file(block)).ok()?;
        let (key, rest) = bytes.split_first_chunk::<32>()?;
        let (records, hash) = rest.split_last_chunk::<32>()?;
        if *key != self.key || records.len() != 4 * WORDS * len || blake3::hash(records) != *hash {
            return None;
        }
        let word = |b: &[u8]| u32::from_le_bytes(b.try_into().unwrap_or_default());
        Some(records.chunks_exact(4 * WORDS).map(|r| std::array::from_fn(|i| word(&r[4 * i..4 * i + 4]))).collect())
    }

    fn put(&self, block: u32, records: &[Record]) -> Result<()> {
        let mut bytes = self.key.to_vec();
        bytes.extend(records.iter().flatten().flat_map(|w| w.to_le_bytes()));
        let hash = blake3::hash(&bytes[32..]);
        bytes.extend(hash.as_bytes());
        atomic::write(&self.file(block), &bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_blocks_of_the_same_bake_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lightmap.exr.parts");
        let records = vec![[1, 2, 3, 4, 5, 6, 7], [8, 9, 10, u32::MAX, 11, 12, 13]];
        let store = Folder::new(&path, "a bake");
        store.put(3, &records).unwrap();
        assert_eq!(store.get(3, 2), Some(records));
        assert_eq!(store.get(3, 3), None);
        assert_eq!(store.get(4, 2), None);
        assert_eq!(Folder::new(&path, "another bake").get(3, 2), None);
        let file = store.file(3);
        let bytes = std::fs::read(&file).unwrap();
        let mut changed = bytes.clone();
        changed[40] ^= 1;
        for broken in [&bytes[..bytes.len() - 1], &bytes[..20], &changed[..], &[]] {
            std::fs::write(&file, broken).unwrap();
            assert_eq!(store.get(3, 2), None);
        }
        store.remove().unwrap();
        assert!(!path.exists());
        store.remove().unwrap();
    }
}
