//! Folders with a file a probe: fills them in parallel, keeps what is finished, marks them when complete.

use crate::common::Common;
use rayon::prelude::*;
use reprobe::base::progress::Progress;
use reprobe::io::ExrImage;
use reprobe::probe::set::{ProbeSet, numbered};
use std::path::Path;
use std::sync::Mutex;

/// Makes all files of `set` that `folder` does not hold yet, by `make(state, index)`, and then marks it as complete.
/// Each thread takes a state that nobody else uses, made by `state` when there is none. Says how many files were kept.
pub fn fill<S: Send>(
    folder: &Path,
    set: &ProbeSet,
    common: &Common,
    state: impl Fn() -> reprobe::Result<S> + Sync,
    make: impl Fn(&mut S, usize) -> reprobe::Result<()> + Sync,
) -> reprobe::Result<usize> {
    let stage = &set.provenance.stage;
    if set.is_complete_or_unmark(folder, stage)? && (0..set.count).all(|i| numbered(folder, i).is_file()) {
        return Ok(set.count);
    }
    let kept = |i: &usize| ExrImage::read_provenance(&numbered(folder, *i)).is_ok_and(|p| p.as_ref() == Some(&set.provenance));
    let missing: Vec<usize> = (0..set.count).into_par_iter().filter(|i| !kept(i)).collect();
    let states = Mutex::new(Vec::new());
    let bar = common.progress();
    bar.start(stage, missing.len() as u64);
    missing.par_iter().with_max_len(1).try_for_each(|&i| {
        let spare = states.lock().unwrap_or_else(|e| e.into_inner()).pop();
        let mut own = spare.map_or_else(&state, Ok)?;
        make(&mut own, i)?;
        states.lock().unwrap_or_else(|e| e.into_inner()).push(own);
        bar.advance(1);
        Ok::<(), reprobe::Error>(())
    })?;
    bar.finish();
    set.write(folder)?;
    Ok(set.count - missing.len())
}
