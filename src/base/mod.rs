//! What every room stands on: small geometry, lanes, rays, errors, progress, clocks.

pub mod clock;
pub mod error;
pub mod math;
pub mod named;
pub mod octahedral;
pub mod prefetch;
pub mod progress;
pub mod ray;
pub mod simd;
