//! Sparse radiance probes with precomputed local reconstruction (Silvennoinen and Lehtinen 2017, *Real-time Global Illumination by
//! Precomputed Local Reconstruction from Sparse Radiance Probes*): diffuse light under lights and colours that change from frame to frame.
//!
//! What a receiver sees is interpolated from the spherical harmonics of the probes around it, direction by direction, from those alone that
//! see the same point (§3.2). That is linear in the probes' radiance, and knows neither lights nor colours: it is baked ([`transport`]) and
//! compressed ([`compress`]). A frame lights the surfaces, gathers them at the probes ([`relight`]) and takes them from there to the receivers
//! ([`operator`], [`clusters`], [`light`]).

pub mod bake;
pub mod cluster;
pub mod clusters;
pub mod compress;
pub mod frame_map;
pub mod gpu;
pub mod harmonics;
pub mod inspect;
pub mod interpolate;
pub mod light;
pub mod lit;
pub mod operator;
pub mod params;
pub mod relight;
pub mod round_trip;
mod row;
pub mod seen;
pub mod shade;
pub mod store;
#[cfg(test)]
mod tests;
pub mod transport;
pub mod volume;

pub use row::METHOD;
