//! Many lights with reflectance filtering: Maletz, Bowers and Wang 2009, "Reflectance Filtering for Interactive Global Illumination in
//! Semi-Glossy Scenes".
//!
//! Nothing is baked. Virtual point lights lie evenly on all surfaces ([`points`], [`repel`], [`settle`]), in a tree of clusters ([`tree`]). A frame samples
//! light straight from emitters at each ([`emit`]), which sends it on as diffuse radiance and one Phong lobe; lobes are filtered up the tree
//! ([`lobe`], [`mixture`], [`gather`]), lights light one another for more bounces ([`bounce`]), and a view's points gather from clusters by solid angle
//! ([`shade`], [`disc`]), at nodes between two cuts ([`cuts`]) and at few pixels ([`adaptive`]).
//!
//! *Paper*: indirect light ignores what is in its way. *Ours*: [`ManyLightParams::shadow_rays`] asks for it.
//!
//! In: a world and a view. Out: the diffuse and glossy layers, linear radiance.

pub mod adaptive;
pub mod arrival;
pub mod bounce;
pub mod cuts;
pub mod descend;
pub mod disc;
pub mod emit;
pub mod follow;
pub mod gather;
pub mod gpu;
pub mod lobe;
pub mod mixture;
pub(crate) mod params;
pub mod place;
pub mod points;
pub mod repel;
mod row;
pub mod settle;
pub mod shade;
pub mod tally;
#[cfg(test)]
mod tests;
pub mod tree;

pub use params::{Kernel, ManyLightParams, Sampling, Traversal};
pub use row::METHOD;
