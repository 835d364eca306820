//! Efficiency-aware Russian roulette and splitting: paths go on where that lowers the image's error by more than it costs.
//!
//! Rath et al. 2022, "EARS: Efficiency-Aware Russian Roulette and Splitting". The efficiency of an image is one over its mean
//! relative variance V times its cost C. Where a path that reaches a vertex weighs T, relative to its pixel's radiance I, an
//! estimate there is worth being made
//!
//! ```text
//! s = T/I sqrt(V_r / c_r) sqrt(C / V)          times where that is above 1 (splitting)
//! s = T/I sqrt(E[L_r^2] / c_r) sqrt(C / V)     times where that is below 1 (roulette)
//! ```
//!
//! on average, with the variance V_r, the second moment E\[L_r²\] and the cost c_r of one such estimate. Whatever s is, the mean stays
//! the same: a poor guess costs time alone. Where rays go that leave diffuse surfaces is learned from the same samples
//! ([`crate::transport::guide`]).
//!
//! *Ours*: a vertex has two estimates, each with an s of its own: light from an emitter that is drawn (a shadow ray is left out
//! where little can come of it), and what a ray onward brings, decided before the ray is cast. The moments lie in a grid of cells
//! ([`Moments`]), filled by the image's own first samples, in place of an octree that is refined from pass to pass. The cost of
//! an estimate is counted in rays, so that images do not depend on the machine's speed. First vertices have one estimate of
//! either kind: more gained less than it cost.

mod lessons;
mod moments;
mod walk;

pub use lessons::{Lessons, Plan};
pub use moments::{Estimate, Moments, RAY_COST};
pub use walk::{Start, Walk};
