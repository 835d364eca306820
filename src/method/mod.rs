//! From probes and light map to frames, one file a pass, in the order in which [`glossy_probes`] calls them (§5, §6);
//! and the other methods that the same frames can be rendered by.

pub mod aov;
pub mod baseline;
pub mod candidates;
pub mod composite;
pub mod coverage;
pub mod filter;
pub mod footprint;
pub mod gather;
pub mod gbuffer;
pub mod glossy_probes;
pub mod inspect;
pub mod mirror;
pub mod mirror_light;
pub mod path_trace;
pub mod perturb;
