//! How a stage tells how far it has come, without knowing who listens.

/// Observer of a long computation. Stages call it from many threads.
pub trait Progress: Sync {
    /// A new piece of work of `total` units starts.
    fn start(&self, _what: &str, _total: u64) {}
    /// `n` more units are done.
    fn advance(&self, _n: u64) {}
    /// The piece of work is over.
    fn finish(&self) {}
}

/// Listens to nothing.
pub struct Silent;

impl Progress for Silent {}
