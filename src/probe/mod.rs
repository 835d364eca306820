//! What every kind of probe shares: where probes stand ([`placement`], [`reach`]), how directions and texels belong together
//! ([`parameter_map`], [`mesh_inverse`]), what a texel holds ([`file`]), and folders of them ([`set`], [`store`]).

pub mod file;
pub mod mesh_inverse;
pub mod parameter_map;
pub mod placement;
pub mod reach;
pub mod set;
pub mod store;
