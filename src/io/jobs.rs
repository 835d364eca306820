//! The loop that every long stage runs: items that an earlier run has finished are kept, the others of this shard are made, and when none is
//! missing the whole is sealed.

use super::provenance::hash_of;
use super::{ExrImage, Provenance};
use crate::Result;
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;
use std::time::SystemTime;

/// `--shard I/N`: items I, I + N, I + 2N, ..., or a run of neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    count: u32,
}

impl Shard {
    /// Whether item `i` is this shard's.
    pub fn has(&self, i: usize) -> bool {
        i % self.count as usize == self.index as usize
    }

    /// The I-th of N runs of `items` that follow one another, as equal as they can be.
    pub fn run(&self, items: usize) -> Range<usize> {
        let at = |i: u32| items * i as usize / self.count as usize;
        at(self.index)..at(self.index + 1)
    }
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parsed {
            Some((index, count)) if index < count => Ok(Self { index, count }),
            _ => Err("expected I/N with I from 0 to N-1, like 0/4".into()),
        }
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// What became of a stage's items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Done {
    /// Made now.
    pub made: usize,
    /// Found finished, of this shard and of others.
    pub kept: usize,
    /// Of other shards, and not made yet.
    pub missing: usize,
}

impl Done {
    /// What a summary says of items that other shards have yet to make; nothing where none is missing.
    pub fn rest(&self, items: &str) -> String {
        let missing = self.missing;
        if missing > 0 { format!("; {missing}{items} are still missing: run the other shards") } else { String::new() }
    }
}

/// Whether an earlier run with the same inputs and parameters finished this file, and nothing has changed it since.
pub fn is_finished(file: &Path, provenance: &Provenance) -> bool {
    std::fs::read(file).is_ok_and(|bytes| ExrImage::provenance_of_whole(&bytes).as_ref() == Some(provenance))
}

/// Whether a file [`is_finished`] and has this content hash.
pub fn is_sealed_as(hash: &str, file: &Path, provenance: &Provenance) -> bool {
    std::fs::read(file)
        .is_ok_and(|bytes| ExrImage::provenance_of_whole(&bytes).as_ref() == Some(provenance) && hash_of(&bytes) == *hash)
}

/// Makes a file that is up to date as new as if it were written now, so that make does not ask for it again. Where that is not
/// allowed it is up to date all the same.
pub fn touch(file: &Path) {
    if let Ok(file) = std::fs::File::options().write(true).open(file) {
        let _ = file.set_modified(SystemTime::now());
    }
}

/// Makes those of `items` that are not kept and are `shard`'s, in order; and when all are there, seals the whole.
///
/// # Errors
/// What `make` or `seal` come to.
pub fn complete(
    items: &[usize],
    shard: Option<Shard>,
    is_kept: &(dyn Fn(usize) -> bool + Sync),
    make: impl FnOnce(&[usize]) -> Result<()>,
    seal: impl FnOnce() -> Result<()>,
) -> Result<Done> {
    let kept: Vec<bool> = items.par_iter().map(|&i| is_kept(i)).collect();
    let open = || items.iter().zip(&kept).filter(|(_, kept)| !**kept).map(|(&i, _)| i);
    let is_mine = |i: &usize| shard.is_none_or(|s| s.has(*i));
    let todo: Vec<usize> = open().filter(is_mine).collect();
    make(&todo)?;
    // Another shard may have been at work meanwhile.
    let missing = open().filter(|i| !is_mine(i) && !is_kept(*i)).count();
    if missing == 0 {
        seal()?;
    }
    Ok(Done { made: todo.len(), kept: items.len() - todo.len() - missing, missing })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::sync::Mutex;

    #[test]
    fn shards_make_what_is_theirs_and_the_last_one_seals() {
        let there = Mutex::new(BTreeSet::from([3]));
        let mut sealed = 0;
        let mut run = |shard: Option<&str>| {
            let shard = shard.map(|s| s.parse().unwrap());
            let make = |todo: &[usize]| {
                there.lock().unwrap().extend(todo);
                Ok(())
            };
            let is_kept = |i| there.lock().unwrap().contains(&i);
            let done = complete(&[1, 2, 3, 4, 6], shard, &is_kept, make, || {
                sealed += 1;
                Ok(())
            });
            (done.unwrap(), sealed)
        };
        assert_eq!(run(Some("0/2")), (Done { made: 3, kept: 1, missing: 1 }, 0));
        assert_eq!(run(Some("0/2")), (Done { made: 0, kept: 4, missing: 1 }, 0));
        assert_eq!(run(Some("1/2")), (Done { made: 1, kept: 4, missing: 0 }, 1));
        assert_eq!(run(None), (Done { made: 0, kept: 5, missing: 0 }, 2));
    }

    #[test]
    fn runs_of_shards_follow_one_another_and_leave_nothing_out() {
        for (items, count) in [(0, 1), (1, 3), (7, 3), (120, 16), (5, 5)] {
            let runs: Vec<_> = (0..count).map(|index| Shard { index, count }.run(items)).collect();
            assert_eq!(runs.iter().cloned().flatten().collect::<Vec<_>>(), (0..items).collect::<Vec<_>>());
            let lengths = || runs.iter().map(ExactSizeIterator::len);
            assert!(lengths().max().unwrap() - lengths().min().unwrap() <= 1, "{runs:?}");
        }
    }

    #[test]
    fn shards_parse_and_print() {
        assert_eq!("2/3".parse::<Shard>().unwrap().to_string(), "2/3");
        for bad in ["", "3/3", "1", "a/2", "0/0", "-1/2"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
