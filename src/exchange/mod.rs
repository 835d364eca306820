//! Files that scenes come in, read into [`crate::scene`]'s types.

pub mod animation;
pub mod mesh;
pub mod mitsuba;

pub use mitsuba::load::{LoadOptions, load};
