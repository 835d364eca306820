//! Mitsuba's scenes: XML (0.5 to 3) or JSON into one [`tree`] of plugins, and that into a scene ([`load`]).

pub mod assets;
pub mod document;
pub mod ior;
pub mod json;
pub mod load;
pub mod params;
pub mod sky;
pub mod spectrum;
pub mod spectrum_plugin;
pub mod transform;
pub mod tree;
pub mod xml;
