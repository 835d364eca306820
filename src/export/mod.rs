//! Files that other programs read.

pub mod gltf;
pub mod ktx2;
pub mod probes;

#[cfg(test)]
mod tests;
