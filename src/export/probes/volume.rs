//! Diffuse light of a grid as a volume of ambient cubes (McTaggart 2004): six values a place, one for each direction of the axes.
//!
//! The layout is that of Bevy's `IrradianceVolume`: of Rx x Ry x Rz places a texture of Rx x 2 Ry x 3 Rz texels, the values of the X, Y and Z axes one behind
//! the other along z, and those of their negative directions after the positive ones along y.

use crate::base::math::Rgb;
use crate::export::ktx2::Texture;
use glam::Vec3;

/// The directions of a cube's values: axis and sign.
const AXES: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];

/// A volume of the grid's `counts`. `diffuse` tells of each probe the light on a surface with a normal, or `None` of a blocked one, whose place has the mean of
/// those next to it.
pub fn volume(counts: [u32; 3], diffuse: impl Fn(usize, Vec3) -> Option<Rgb>) -> Texture {
    let [nx, ny, nz] = counts.map(|n| n as usize);
    let number = |[x, y, z]: [usize; 3]| (z * ny + y) * nx + x;
    let (width, height, depth) = (nx, 2 * ny, 3 * nz);
    let mut texels = vec![Rgb::ZERO; width * height * depth];
    for (axis, sign) in (0..3).flat_map(|axis| [(axis, 1.0), (axis, -1.0)]) {
        let values = (0..nx * ny * nz).map(|i| diffuse(i, AXES[axis] * sign)).collect::<Vec<_>>();
        let values = filled(values, counts);
        for (x, y, z) in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (x, y, z)))) {
            let (row, slice) = (y + if sign < 0.0 { ny } else { 0 }, z + axis * nz);
            texels[(slice * height + row) * width + x] = values[number([x, y, z])];
        }
    }
    Texture { size: [width as u32, height as u32, depth as u32], faces: 1, levels: vec![texels] }
}

/// Gives places without a value the mean of their neighbours', again and again until all have one.
fn filled(mut values: Vec<Option<Rgb>>, counts: [u32; 3]) -> Vec<Rgb> {
    let [nx, ny, nz] = counts.map(|n| n as usize);
    let around = |values: &[Option<Rgb>], i: usize| {
        let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
        let steps = [(x > 0, i.wrapping_sub(1)), (x + 1 < nx, i + 1), (y > 0, i.wrapping_sub(nx)), (y + 1 < ny, i + nx)];
        let deep = [(z > 0, i.wrapping_sub(nx * ny)), (z + 1 < nz, i + nx * ny)];
        let known: Vec<Rgb> = steps.into_iter().chain(deep).filter(|s| s.0).filter_map(|s| values[s.1]).collect();
        (!known.is_empty()).then(|| known.iter().sum::<Rgb>() / known.len() as f32)
    };
    while values.iter().any(Option::is_none) {
        let next: Vec<_> = (0..values.len()).map(|i| values[i].or_else(|| around(&values, i))).collect();
        if next == values {
            break;
        }
        values = next;
    }
    values.into_iter().map(Option::unwrap_or_default).collect()
}
