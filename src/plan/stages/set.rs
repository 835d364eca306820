//! Folders with a file a probe: filled in parallel, sealed by `set.json` when complete.

use crate::Result;
use crate::base::progress::Progress;
use crate::io::jobs::{Done, Shard, complete, is_finished, touch};
use crate::probe::set::ProbeSet;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Makes those items of `set`, of one shard or all, whose `files` are not all in `folder`, whole, by `make(state, index)`, and marks
/// the set as complete once none is missing.
/// Each thread takes a state that nobody else uses, made by `state` when there is none.
pub fn fill<S: Send>(
    folder: &Path,
    (set, shard): (&ProbeSet, Option<Shard>),
    files: impl Fn(usize) -> Vec<PathBuf> + Sync,
    progress: &dyn Progress,
    state: impl Fn() -> Result<S> + Sync,
    make: impl Fn(&mut S, usize) -> Result<()> + Sync,
) -> Result<Done> {
    let stage = &set.provenance.stage;
    let sealed = set.is_complete_or_unmark(folder, stage)?;
    let items: Vec<usize> = (0..set.count).collect();
    let is_kept = |i| files(i).iter().all(|file| is_finished(file, &set.provenance));
    let states = Mutex::new(Vec::new());
    let make_all = |todo: &[usize]| {
        progress.start(stage, todo.len() as u64);
        todo.par_iter().with_max_len(1).try_for_each(|&i| {
            let spare = states.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut own = spare.map_or_else(&state, Ok)?;
            make(&mut own, i)?;
            states.lock().unwrap_or_else(PoisonError::into_inner).push(own);
            progress.advance(1);
            Ok::<(), crate::Error>(())
        })?;
        progress.finish();
        Ok(())
    };
    let seal = || {
        if sealed {
            touch(&ProbeSet::path(folder));
            return Ok(());
        }
        set.write(folder)
    };
    complete(&items, shard, &is_kept, make_all, seal)
}
