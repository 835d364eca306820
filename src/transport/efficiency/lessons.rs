//! What an image's samples tell of those to come.

use super::moments::{Moments, Tally};
use crate::transport::guide::{Arrivals, Guide};
use glam::Vec3;

/// What continuations of a path's vertices go by.
#[derive(Debug)]
pub struct Plan {
    /// What estimates are like.
    pub moments: Moments,
    /// Where light comes from.
    pub guide: Guide,
    /// sqrt(C / V): cost and mean relative variance of one sample of a pixel.
    pub efficiency: f32,
}

/// All that paths have met. Lessons of parts of an image are put together in the order of the parts, so that sums do not depend on
/// threads.
#[derive(Debug, Clone)]
pub struct Lessons {
    pub(super) tally: Tally,
    pub(super) arrivals: Arrivals,
}

/// Rays that leave vertices, of a sample of a pixel; about.
const RAYS: f32 = 4.0;

impl Lessons {
    /// Over `points`: what the camera sees.
    pub fn over(points: Vec<Vec3>) -> Self {
        Self { tally: Tally::over(points.clone()), arrivals: Arrivals::over(points) }
    }

    /// Over the same places with nothing in them, for a part of a pass of so many samples.
    pub fn empty(&self, samples: usize) -> Self {
        Self { tally: self.tally.empty(), arrivals: self.arrivals.empty(samples as f32 * RAYS) }
    }

    /// Takes in all of other ones.
    pub fn absorb(&mut self, other: &Self) {
        self.tally.absorb(&other.tally);
        self.arrivals.absorb(&other.arrivals);
    }

    /// What follows from them.
    pub fn plan(&self, efficiency: f32) -> Plan {
        Plan { moments: self.tally.moments(), guide: self.arrivals.guide(), efficiency }
    }
}
