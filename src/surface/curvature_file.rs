//! `curvature.exr`: a table with one entry a vertex, in rows of [`ROW`].
//!
//! Channels `k1`, `k2` (1/m), `d1.X`, `d1.Y`, `d1.Z`; entries past the last vertex are 0.

use super::CurvatureMap;
use crate::io::{ExrImage, Provenance};
use crate::{Error, Result};
use glam::Vec3;
use std::path::Path;

/// Vertices in a row of the table.
pub const ROW: usize = 4096;

/// Writes the table.
pub fn write(map: &CurvatureMap, path: &Path, provenance: Provenance) -> Result<()> {
    let height = map.k1.len().div_ceil(ROW).max(1);
    let column = |values: &mut dyn Iterator<Item = f32>| {
        let mut column: Vec<f32> = values.collect();
        column.resize(ROW * height, 0.0);
        column
    };
    let axis = |i: usize| column(&mut map.d1.iter().map(|d| d[i]));
    ExrImage::new(ROW, height)
        .with_f32("k1", column(&mut map.k1.iter().copied()))
        .with_f32("k2", column(&mut map.k2.iter().copied()))
        .with_f32("d1.X", axis(0))
        .with_f32("d1.Y", axis(1))
        .with_f32("d1.Z", axis(2))
        .with_provenance(provenance)
        .write(path)
}

/// Reads the table of a scene with `vertices` vertices and the hash `scene`.
pub fn read(path: &Path, vertices: usize, scene: &str) -> Result<CurvatureMap> {
    let image = ExrImage::read(path)?;
    image.provenance(path)?.check_scene(path, scene)?;
    let expected = (ROW, vertices.div_ceil(ROW).max(1));
    if (image.width, image.height) != expected {
        let message = format!(
            "{} x {} entries; expected {} x {} for the scene's {vertices} vertices",
            image.width, image.height, expected.0, expected.1
        );
        return Err(Error::input(path, message));
    }
    let column = |name: &str| -> Result<Vec<f32>> {
        let mut values = image.f32(path, name)?;
        values.truncate(vertices);
        match values.iter().position(|v| !v.is_finite()) {
            Some(i) => {
                Err(Error::input(path, format!("channel \"{name}\", vertex {i}: {}; expected a finite number", values[i])))
            }
            None => Ok(values),
        }
    };
    let (x, y, z) = (column("d1.X")?, column("d1.Y")?, column("d1.Z")?);
    let d1 = (0..vertices).map(|i| Vec3::new(x[i], y[i], z[i])).collect();
    Ok(CurvatureMap { k1: column("k1")?, k2: column("k2")?, d1 })
}
