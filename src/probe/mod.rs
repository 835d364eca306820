//! Light probes (§4): where they stand, how their texels are spent, what is baked into them.
//!
//! [`placement`] makes the grid; [`resmap`] decides how much resolution each
//! direction deserves; [`quasi_harmonic`] turns that into a deformed lat-long mesh, [`mesh_inverse`] inverts it, and
//! [`qhmap`] holds both as the probe's parameterisation; [`bake`] fills the texels.

pub mod bake;
pub mod file;
pub mod mesh_inverse;
pub mod placement;
pub mod qhmap;
pub mod quasi_harmonic;
pub mod resmap;
pub mod set;
