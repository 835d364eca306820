//! A scene's skeleton, from which probes are chosen ([Wang et al. 2019] §3.1): the free space on a grid of voxels ([`voxels`], [`field`],
//! [`space`]), and on it two ways to candidates: the distance field's [`ridge`], and the [`medial_axis`] by shrinking balls ([`nearest`]).

pub mod field;
pub mod medial_axis;
pub mod nearest;
pub mod ridge;
pub mod space;
pub mod voxels;
