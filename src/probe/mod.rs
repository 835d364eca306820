//! What every kind of probe shares: where probes stand ([`places`]: on a grid, [`placement`] and [`reach`]; on a scene's skeleton,
//! [`nonuniform`]: [`skeleton`], [`clip`], [`coverage`], [`select`], [`refine`], [`plan_picture`], [`coverage_picture`]; or evenly along its surfaces, [`sparse`]: [`thin`], [`shift`];
//! their weights: [`neighbors`], [`support`]), how directions and texels belong together
//! ([`parameter_map`], [`mesh_inverse`]; [`octahedral`]), what a texel holds ([`file`]), and folders of them ([`set`], [`store`]).

pub mod clip;
pub mod coverage;
pub mod coverage_picture;
pub mod file;
pub mod mesh_inverse;
pub mod neighbors;
pub mod nonuniform;
#[cfg(test)]
mod nonuniform_tests;
pub mod parameter_map;
pub mod placement;
pub mod places;
pub mod plan_picture;
pub mod reach;
pub mod refine;
pub mod select;
pub mod set;
pub mod shift;
pub mod skeleton;
pub mod sparse;
#[cfg(test)]
mod sparse_tests;
pub mod store;
pub mod support;
pub mod thin;
