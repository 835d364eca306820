//! Light transport: BVH, emitter sampling, the path tracer.

pub mod bvh;
pub mod efficiency;
pub mod envmap;
pub mod facet;
pub mod follow;
pub mod guide;
pub mod light_sample;
pub mod light_tree;
mod light_triangle;
pub mod lights;
mod met;
pub mod mirrors;
pub mod outlook;
pub mod path;
pub(crate) mod places;
mod round_light;
pub mod sampler;
pub(crate) mod shares;
mod steps;
mod sun;
mod vertex;
pub mod world;

pub use sampler::Sampler;
pub use world::World;
