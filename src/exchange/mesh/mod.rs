//! Mesh files.

pub mod obj;
pub mod ply;
pub mod serialized;
