//! A probe's parameterisation: from directions to texels and back (§4.2.2, Fig. 4h and 4i).
//!
//! The forward map says where each vertex of the lat-long mesh lies in the probe; the inverse map says which lat-long
//! coordinate each texel of the probe looks at. Probe coordinates are (u, v) in the unit square, texel coordinates are
//! those times the probe's size, so that texel (i, j) has its centre at (i + ½, j + ½). u wraps, v does not.
//!
//! *Reading*: §5.2 scales the search step by |∂f⁻¹/∂x|⁻¹, and §7.3 counts "parameterization and its derivatives" as
//! 8 bytes at half resolution, i.e. four halves: two of them are then derivatives. We take one a probe axis: the
//! length of ∂f⁻¹/∂x and of ∂f⁻¹/∂y, both in lat-long texels of the probe's size per texel, 1 for plain lat-long.

use super::mesh_inverse;
use crate::base::math::{direction_from_lat_long, floor, lat_long_from_direction};
use crate::io::{ExrImage, Provenance};
use crate::{Error, Result};
use glam::{IVec2, UVec2, Vec2, Vec3};
use half::f16;
use std::path::{Path, PathBuf};

/// Smallest derivative that [`ParameterMap::search_scale`] divides by, lat-long texels per texel.
pub(crate) const DERIVATIVE_MIN: f32 = 1.0 / 64.0;

/// The parameterisation of one probe.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterMap {
    /// Quads of the lat-long mesh in u and v; the mesh has one vertex more each way.
    pub mesh: [u32; 2],
    /// Probe coordinate of each mesh vertex, rows from the top. u is unwrapped: it may leave [0, 1), and the last
    /// column is the first plus 1.
    pub forward: Vec<Vec2>,
    /// Width and height of the probe, texels.
    pub size: [u32; 2],
    /// Lat-long coordinate that each texel's centre looks at, rows from the top; u is unwrapped so that it stays near the
    /// texel's own u. Empty where only the forward map is kept ([`ParameterMap::without_inverse`]).
    pub inverse: Vec<Vec2>,
    /// Lengths of ∂f⁻¹/∂x and ∂f⁻¹/∂y, lat-long texels per texel, at half the probe's resolution (rounded up).
    pub derivative: Vec<[f16; 2]>,
}

impl ParameterMap {
    /// Plain lat-long: what a constant resolution map gives.
    pub fn identity(size: [u32; 2]) -> Self {
        let forward = vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
        Self::from_forward([1, 1], forward, size)
    }

    /// Inverts a forward map at the probe's resolution. No quad may be flipped.
    pub fn from_forward(mesh: [u32; 2], forward: Vec<Vec2>, size: [u32; 2]) -> Self {
        let inverse = mesh_inverse::invert(mesh, &forward, size);
        let derivative = halve(size, &inverse.derivative);
        Self { mesh, forward, size, inverse: inverse.lat_long, derivative }
    }

    /// Drops the inverse map, which only the bake needs: 4 MiB a probe of 1024x512.
    pub fn without_inverse(mut self) -> Self {
        self.inverse = Vec::new();
        self
    }

    /// Probe coordinate of a lat-long coordinate; u unwrapped. Bilinear within each quad of the mesh.
    pub fn forward_at(&self, lat_long: Vec2) -> Vec2 {
        let mesh = UVec2::from(self.mesh);
        let turn = floor(lat_long.x) as f32;
        let p = Vec2::new(lat_long.x - turn, lat_long.y.clamp(0.0, 1.0)) * mesh.as_vec2();
        let cell = p.as_uvec2().min(mesh - 1);
        let t = p - cell.as_vec2();
        let row = mesh.x as usize + 1;
        let i = cell.y as usize * row + cell.x as usize;
        let f = &self.forward;
        f[i].lerp(f[i + 1], t.x).lerp(f[i + row].lerp(f[i + row + 1], t.x), t.y) + Vec2::new(turn, 0.0)
    }

    /// Continuous texel coordinate at which the probe sees the unit direction `d`: x in [0, width), y in [0, height].
    /// Inverse of [`ParameterMap::direction_from_texel`].
    pub fn texel_from_direction(&self, d: Vec3) -> Vec2 {
        let p = self.forward_at(lat_long_from_direction(d));
        let size = UVec2::from(self.size).as_vec2();
        let x = (p.x - floor(p.x) as f32) * size.x;
        Vec2::new(if x < size.x { x } else { 0.0 }, p.y.clamp(0.0, 1.0) * size.y)
    }

    /// Lat-long coordinate at a continuous texel coordinate; u unwrapped. Exact at texel centres, interpolated between them.
    pub fn lat_long_from_texel(&self, texel: Vec2) -> Vec2 {
        let size = IVec2::new(self.size[0] as i32, self.size[1] as i32);
        let p = texel - 0.5;
        let floor = p.floor();
        let (cell, t) = (floor.as_ivec2(), p - floor);
        // Displacements from plain lat-long are continuous across the seam, where the coordinates themselves jump.
        let displacement = |dx: i32, dy: i32| {
            let x = (cell.x + dx).rem_euclid(size.x);
            let y = (cell.y + dy).clamp(0, size.y - 1);
            let centre = (Vec2::new(x as f32, y as f32) + 0.5) / size.as_vec2();
            self.inverse[(y * size.x + x) as usize] - centre
        };
        let d = displacement(0, 0).lerp(displacement(1, 0), t.x).lerp(displacement(0, 1).lerp(displacement(1, 1), t.x), t.y);
        let uv = texel / size.as_vec2() + d;
        Vec2::new(uv.x, uv.y.clamp(0.0, 1.0))
    }

    /// Unit direction that a continuous texel coordinate looks along. Needs the inverse map.
    /// Inverse of [`ParameterMap::texel_from_direction`], within half a texel.
    pub fn direction_from_texel(&self, texel: Vec2) -> Vec3 {
        direction_from_lat_long(self.lat_long_from_texel(texel))
    }

    /// Factor on the search step at a continuous texel coordinate, one a probe axis: |∂f⁻¹/∂x|⁻¹ (§5.2).
    /// More than 1 where the map magnifies, so that a step covers about the same angle everywhere.
    pub fn search_scale(&self, texel: Vec2) -> Vec2 {
        let half = UVec2::from(half_size(self.size));
        let p = (texel * 0.5).max(Vec2::ZERO).as_uvec2().min(half - 1);
        scale(&self.derivative[(p.y * half.x + p.x) as usize])
    }

    /// All of those factors, at half the probe's resolution (rounded up).
    pub fn search_scales(&self) -> impl Iterator<Item = Vec2> {
        self.derivative.iter().map(scale)
    }

    /// Log of texel density, relative to plain lat-long, in each quad of the mesh: ln of the area that the quad's image takes.
    pub fn log_density(&self) -> Vec<f32> {
        let area = 1.0 / (self.mesh[0] as f32 * self.mesh[1] as f32);
        quads(self.mesh).map(|q| (quad_area(q.map(|i| self.forward[i])) / area).ln()).collect()
    }

    /// The forward map as an image, a pixel a vertex: `forward.U`, `forward.V`.
    pub fn forward_image(&self) -> ExrImage {
        let [w, h] = self.mesh;
        ExrImage::new(w as usize + 1, h as usize + 1)
            .with_f32("forward.U", self.forward.iter().map(|p| p.x).collect())
            .with_f32("forward.V", self.forward.iter().map(|p| p.y).collect())
    }

    /// The inverse map as an image, a pixel a texel: `inverse.U`, `inverse.V` and `derivative.X`, `derivative.Y`.
    pub fn inverse_image(&self) -> ExrImage {
        let [w, h] = self.size;
        let half = half_size(self.size);
        let at = |i: usize| {
            let (x, y) = (i as u32 % w, i as u32 / w);
            self.derivative[(y / 2 * half[0] + x / 2) as usize]
        };
        let n = self.inverse.len();
        ExrImage::new(w as usize, h as usize)
            .with_f32("inverse.U", self.inverse.iter().map(|p| p.x).collect())
            .with_f32("inverse.V", self.inverse.iter().map(|p| p.y).collect())
            .with_f16("derivative.X", (0..n).map(|i| at(i)[0].to_f32()))
            .with_f16("derivative.Y", (0..n).map(|i| at(i)[1].to_f32()))
    }

    /// The map from its two images; the paths are for messages.
    pub fn from_images(forward: (&Path, &ExrImage), inverse: (&Path, &ExrImage)) -> Result<Self> {
        let (path, image) = forward;
        if image.width < 2 || image.height < 2 {
            return Err(Error::input(path, format!("{} x {} vertices: expected at least 2 x 2", image.width, image.height)));
        }
        let mesh = [image.width as u32 - 1, image.height as u32 - 1];
        let vertices = pairs(path, image, "forward.U", "forward.V")?;
        let flips = count_flipped(mesh, &vertices);
        if flips > 0 {
            return Err(Error::input(path, format!("{flips} quads of the map are flipped: expected none; run qhmap again")));
        }
        let (path, image) = inverse;
        let size = [image.width as u32, image.height as u32];
        let lat_long = pairs(path, image, "inverse.U", "inverse.V")?;
        let derivative = halve(size, &pairs(path, image, "derivative.X", "derivative.Y")?);
        Ok(Self { mesh, forward: vertices, size, inverse: lat_long, derivative })
    }

    /// Writes probe `index`'s map into a folder: `NNNN.exr` (inverse) after `NNNN_forward.exr`.
    pub fn save(&self, folder: &Path, index: usize, provenance: &Provenance) -> Result<()> {
        let [forward, inverse] = map_paths(folder, index);
        self.forward_image().with_provenance(provenance.clone()).write_uncompressed(&forward)?;
        self.inverse_image().with_provenance(provenance.clone()).write_uncompressed(&inverse)
    }

    /// Reads what [`ParameterMap::save`] wrote, and its provenance.
    pub fn load(folder: &Path, index: usize) -> Result<(Self, Provenance)> {
        let [forward_path, inverse_path] = map_paths(folder, index);
        let (forward, inverse) = (ExrImage::read(&forward_path)?, ExrImage::read(&inverse_path)?);
        let provenance = inverse.provenance(&inverse_path)?.clone();
        if forward.provenance(&forward_path)? != &provenance {
            return Err(Error::input(
                &forward_path,
                format!("not from the same run as {}; run qhmap again", inverse_path.display()),
            ));
        }
        Ok((Self::from_images((&forward_path, &forward), (&inverse_path, &inverse))?, provenance))
    }
}

/// Files of probe `index`'s map: forward, inverse.
pub fn map_paths(folder: &Path, index: usize) -> [PathBuf; 2] {
    [folder.join(format!("{index:04}_forward.exr")), folder.join(format!("{index:04}.exr"))]
}

/// Vertex indices of each quad of a mesh: upper left, upper right, lower right, lower left.
pub(crate) fn quads(mesh: [u32; 2]) -> impl Iterator<Item = [usize; 4]> {
    let (w, h) = (mesh[0] as usize, mesh[1] as usize);
    (0..h).flat_map(move |j| (0..w).map(move |i| [0, 1, w + 2, w + 1].map(|k| j * (w + 1) + i + k)))
}

/// Signed area of a quad; positive where it keeps its orientation.
pub(crate) fn quad_area([a, b, c, d]: [Vec2; 4]) -> f32 {
    0.5 * (c - a).perp_dot(d - b)
}

/// Quads with a corner that turns the wrong way: the map is not one-to-one there.
pub fn count_flipped(mesh: [u32; 2], forward: &[Vec2]) -> usize {
    let turns = |q: [Vec2; 4]| (0..4).all(|k| (q[(k + 1) % 4] - q[k]).perp_dot(q[(k + 3) % 4] - q[k]) > 0.0);
    quads(mesh).filter(|q| !turns(q.map(|i| forward[i]))).count()
}

fn scale(derivative: &[f16; 2]) -> Vec2 {
    Vec2::from(derivative.map(f16::to_f32)).max(Vec2::splat(DERIVATIVE_MIN)).recip()
}

fn half_size(size: [u32; 2]) -> [u32; 2] {
    size.map(|n| n.div_ceil(2))
}

/// Means of 2x2 texels.
fn halve(size: [u32; 2], values: &[Vec2]) -> Vec<[f16; 2]> {
    let [w, h] = half_size(size);
    let texel = |x: u32, y: u32| values[(y.min(size[1] - 1) * size[0] + x.min(size[0] - 1)) as usize];
    (0..w * h)
        .map(|i| {
            let (x, y) = (i % w * 2, i / w * 2);
            let mean = (texel(x, y) + texel(x + 1, y) + texel(x, y + 1) + texel(x + 1, y + 1)) * 0.25;
            [f16::from_f32(mean.x), f16::from_f32(mean.y)]
        })
        .collect()
}

fn pairs(path: &Path, image: &ExrImage, x: &str, y: &str) -> Result<Vec<Vec2>> {
    let (xs, ys) = (image.f32(path, x)?, image.f32(path, y)?);
    if let Some(i) = xs.iter().zip(&ys).position(|(x, y)| !(x.is_finite() && y.is_finite())) {
        let message = format!("channels {x}, {y}: ({}, {}) at pixel {i}, expected finite numbers", xs[i], ys[i]);
        return Err(Error::input(path, message));
    }
    Ok(xs.into_iter().zip(ys).map(|(x, y)| Vec2::new(x, y)).collect())
}
