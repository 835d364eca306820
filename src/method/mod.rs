//! The methods, a folder each: parameters, bakes, passes, and the passes' twins on a GPU.

pub mod glossy_probes;
pub mod image_space_gather;
pub mod lightmap_rt;
pub mod path_trace;
pub mod ulr;
