//! Layers that show how a glossy-probe frame came about (`--aov all`).

use super::whole::Buffers;
use crate::io::ExrImage;
use crate::view::mirror::{NOTHING, SKY};
use glam::Vec3;

/// Adds the passes' buffers to a frame's image, one sub-pixel (the upper left) for each pixel: `gathered.*` before the filter,
/// `energy` (Eq. 1; -1 where no probe served), `probe` and `texel.X/Y` of the best sample, `reflected.*`, the reflector's
/// principal curvatures `curvature.{k1,k2}` in 1/m, and the filter's covariance `covariance.{xx,xy,yy}` in sub-pixels².
pub fn with_passes(image: ExrImage, b: &Buffers, supersample: u32) -> ExrImage {
    let n = supersample as usize;
    let (width, height) = (image.width, image.height);
    let at: Vec<usize> = (0..width * height).map(|i| i / width * n * b.width + i % width * n).collect();
    let scalar = |f: &dyn Fn(usize) -> f32| at.iter().map(|&i| f(i)).collect::<Vec<f32>>();
    let index = |f: &dyn Fn(usize) -> u32| at.iter().map(|&i| f(i)).collect::<Vec<u32>>();
    let material = |i: usize| match b.reflected[i].material {
        SKY => u32::MAX - 1,
        NOTHING => u32::MAX,
        m => u32::from(m),
    };
    let gathered: Vec<Vec3> = at.iter().map(|&i| b.gathered[i].color).collect();
    let texel = |i: usize, axis: usize| b.gathered[i].best.map_or(-1.0, |(_, t)| t[axis]);
    image
        .with_rgb("gathered", &gathered)
        .with_f32("energy", scalar(&|i| if b.gathered[i].energy.is_finite() { b.gathered[i].energy } else { -1.0 }))
        .with_u32("probe", index(&|i| b.gathered[i].best.map_or(u32::MAX, |(p, _)| p as u32)))
        .with_f32("texel.X", scalar(&|i| texel(i, 0)))
        .with_f32("texel.Y", scalar(&|i| texel(i, 1)))
        .with_f32("reflected.X", scalar(&|i| b.reflected[i].point.x))
        .with_f32("reflected.Y", scalar(&|i| b.reflected[i].point.y))
        .with_f32("reflected.Z", scalar(&|i| b.reflected[i].point.z))
        .with_u32("reflected.material", index(&material))
        .with_f32("curvature.k1", scalar(&|i| b.curvature[i][0]))
        .with_f32("curvature.k2", scalar(&|i| b.curvature[i][1]))
        .with_f32("covariance.xx", scalar(&|i| b.covariance[i][0]))
        .with_f32("covariance.xy", scalar(&|i| b.covariance[i][1]))
        .with_f32("covariance.yy", scalar(&|i| b.covariance[i][2]))
}
