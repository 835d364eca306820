//! Nearest surface of a probe's texels, and of squares of 2 x 2, 4 x 4, ... of them (Wang 2019, §4.2).
//!
//! *Paper*: built from the faces of a cube, as averages of octahedral texels are distorted. *Ours*: least distances are no averages, so that
//! that of four texels bounds what the four hold, whatever the map; a texel's own is that of its plane over its square.

use super::probe::Surfels;
use glam::Vec2;

/// Bounds of distances, a level after the other.
#[derive(Debug, Clone)]
pub struct Pyramid {
    /// Texels along an edge of level 0: a power of two.
    pub size: usize,
    /// Level 0, and the least of 2 x 2, 4 x 4, ... of its texels, to a single one.
    pub levels: Vec<Vec<f32>>,
}

impl Pyramid {
    /// Of all texels of a probe.
    pub fn new(surfels: &Surfels) -> Self {
        let size = surfels.size;
        let finest: Vec<f32> = (0..size * size).map(|i| least(surfels, i)).collect();
        let mut levels = vec![finest];
        let mut n = size;
        while n > 1 {
            let finer = &levels[levels.len() - 1];
            let half = n / 2;
            let merged = |i: usize| {
                let (x, y) = (2 * (i % half), 2 * (i / half));
                [y * n + x, y * n + x + 1, (y + 1) * n + x, (y + 1) * n + x + 1]
                    .into_iter()
                    .map(|i| finer[i])
                    .fold(f32::INFINITY, f32::min)
            };
            let coarser = (0..half * half).map(merged).collect();
            levels.push(coarser);
            n = half;
        }
        Self { size, levels }
    }

    /// The coarsest level, a single square.
    pub fn top(&self) -> usize {
        self.levels.len() - 1
    }

    /// Least distance in square (x, y) of a level; infinite where there is no surface.
    pub fn at(&self, level: usize, x: usize, y: usize) -> f32 {
        self.levels[level][y * (self.size >> level) + x]
    }

    /// Memory that it takes.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(level.as_slice())).sum()
    }
}

/// Least distance along the directions of a texel to its plane.
fn least(surfels: &Surfels, i: usize) -> f32 {
    let Some(plane) = surfels.plane(i) else { return f32::INFINITY };
    let (x, y) = ((i % surfels.size) as f32, (i / surfels.size) as f32);
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
        .map(|[dx, dy]| plane.along(surfels.direction(Vec2::new(x + dx, y + dy))));
    corners.into_iter().fold(surfels.distance[i], f32::min)
}
