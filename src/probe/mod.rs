//! Light probes (§4): where they stand, how their texels are spent, what is baked into them.
//!
//! [`placement`] makes the grid where [`reach`] says; [`seen`] casts the buffers from which [`resmap`], with [`dct`], decides
//! how much resolution each direction deserves; [`quasi_harmonic`] turns that into a deformed lat-long mesh, [`mesh_inverse`]
//! inverts it, and [`qhmap`] holds both as the probe's parameterisation; [`bake`] fills the texels of a [`file::Probe`], all of
//! them or those that [`wanted`] names; [`store`] reads a folder of them. [`set`] marks a folder of probe files as complete.

pub mod bake;
mod cholesky;
pub mod dct;
pub mod file;
pub mod lattice;
pub mod mesh_inverse;
pub mod placement;
pub mod qhmap;
pub mod quasi_harmonic;
pub mod reach;
pub mod resmap;
pub mod seen;
pub mod set;
pub mod store;
pub mod wanted;
