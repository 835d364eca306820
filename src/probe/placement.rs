//! Probes on a regular grid (§4): positions, the file `probes.json`, and the eight probes around a point.
//!
//! *Paper*: 252 probes on a regular grid. *Ours*: the grid is 7 x 6 x 6; its box is split into equal cells with a probe in the
//! middle of each, so that none lies in a wall that bounds the box; probes that no line of sight connects with a camera
//! (those inside objects or behind walls) are marked as blocked, and take no part in the interpolation.

use crate::io::{Provenance, json};
use crate::{Error, Result};
use glam::{UVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Most probes that a grid may have.
pub const PROBES_MAX: usize = 10_000;

/// How probes are placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Placement {
    /// On a regular grid.
    #[default]
    Grid,
    /// On the ridge of the scene's distance field.
    Sdf,
    /// On its medial axis.
    MedialAxis,
    /// Evenly, in empty voxels next to its surfaces.
    Voxel,
}

impl Placement {
    /// All of them, with their names.
    pub const ALL: [(Self, &str); 4] =
        [(Self::Grid, "grid"), (Self::Sdf, "sdf"), (Self::MedialAxis, "medial-axis"), (Self::Voxel, "voxel")];
}

impl std::fmt::Display for Placement {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let name = Self::ALL.iter().find(|(p, _)| p == self).map_or("", |(_, name)| name);
        f.write_str(name)
    }
}

impl std::str::FromStr for Placement {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let found = Self::ALL.iter().find(|(_, name)| *name == text).map(|(p, _)| *p);
        found.ok_or_else(|| format!("\"{text}\": expected {}", Self::ALL.map(|(_, name)| name).join(", ")))
    }
}

/// How densely a box is filled.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Density {
    /// So many probes along x, y and z.
    Counts([u32; 3]),
    /// A probe every so many metres along each axis, the grid centred in the box.
    Spacing(f32),
    /// About so many probes in all, as far apart along one axis as along another.
    Count(u32),
}

impl Default for Density {
    /// 252 probes, as in the paper (§7); how they were arranged it does not say.
    fn default() -> Self {
        Self::Counts([7, 6, 6])
    }
}

/// A regular grid of probes: the content of `probes.json`. Index order: x fastest, then y, then z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProbeGrid {
    /// Position of probe 0, the one at the lowest x, y and z, metres.
    pub origin: [f32; 3],
    /// Distance of neighbours along each axis, metres.
    pub spacing: [f32; 3],
    /// Number of probes along each axis.
    pub counts: [u32; 3],
    /// Indices of probes inside objects or behind walls, ascending. They are baked like the rest, but not used.
    pub blocked: Vec<u32>,
    /// All positions in index order, metres: `origin + spacing * (ix, iy, iz)`. For the readers of the file; a loaded grid was checked
    /// to agree with them.
    pub positions: Vec<[f32; 3]>,
    /// Where the grid came from.
    pub provenance: Provenance,
}

/// A probe's share in a point's interpolation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeWeight {
    /// Probe index.
    pub probe: usize,
    /// Trilinear weight t_i (§5.2); the eight sum to 1, or are all 0 where every probe around is blocked.
    pub weight: f32,
}

impl ProbeGrid {
    /// Fills the box from `lower` to `upper`. No probe is blocked yet.
    pub fn in_box(lower: Vec3, upper: Vec3, density: Density, provenance: Provenance) -> Result<Self> {
        let (counts, spacing) = cells(lower, upper, density)?;
        let origin = (lower + upper) * 0.5 - spacing * (counts - 1).as_vec3() * 0.5;
        let mut grid = Self {
            origin: origin.to_array(),
            spacing: spacing.to_array(),
            counts: counts.to_array(),
            blocked: Vec::new(),
            positions: Vec::new(),
            provenance,
        };
        grid.positions = (0..grid.len()).map(|i| grid.position(i).to_array()).collect();
        Ok(grid)
    }

    /// Number of probes.
    pub fn len(&self) -> usize {
        self.counts.iter().map(|&n| n as usize).product()
    }

    /// Never true for a grid that was made or read.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Place of a probe on the grid.
    pub fn coordinates(&self, probe: usize) -> [u32; 3] {
        let [nx, ny, _] = self.counts.map(|n| n as usize);
        [probe % nx, probe / nx % ny, probe / (nx * ny)].map(|i| i as u32)
    }

    /// Position of a probe, metres.
    pub fn position(&self, probe: usize) -> Vec3 {
        Vec3::from(self.origin) + Vec3::from(self.spacing) * UVec3::from(self.coordinates(probe)).as_vec3()
    }

    /// Whether a probe is inside an object or behind a wall.
    pub fn is_blocked(&self, probe: usize) -> bool {
        self.blocked.binary_search(&(probe as u32)).is_ok()
    }

    /// Indices of the probes that are not blocked.
    pub fn used(&self) -> Vec<usize> {
        (0..self.len()).filter(|&i| !self.is_blocked(i)).collect()
    }

    /// The eight probes around `p` with their trilinear weights (§5.2), those of blocked probes shared out among the rest.
    /// A point outside the grid is interpolated as the nearest point of the grid's box. Along an axis with a single probe both
    /// sides name that one, the second with weight 0.
    pub fn around(&self, p: Vec3) -> [ProbeWeight; 8] {
        let last = UVec3::from(self.counts) - 1;
        let spacing = Vec3::from(self.spacing).max(Vec3::splat(f32::MIN_POSITIVE));
        let at = ((p - Vec3::from(self.origin)) / spacing).clamp(Vec3::ZERO, last.as_vec3());
        let low = at.as_uvec3().min(last.saturating_sub(UVec3::ONE));
        let t = at - low.as_vec3();
        let mut result = std::array::from_fn(|k| {
            let side = UVec3::new(k as u32 & 1, k as u32 >> 1 & 1, k as u32 >> 2);
            let cell = (low + side).min(last);
            let share = |axis: usize| if side[axis] == 1 { t[axis] } else { 1.0 - t[axis] };
            let probe = ((cell.z * self.counts[1] + cell.y) * self.counts[0] + cell.x) as usize;
            let weight = share(0) * share(1) * share(2);
            ProbeWeight { probe, weight: if self.is_blocked(probe) { 0.0 } else { weight } }
        });
        let sum: f32 = result.iter().map(|w| w.weight).sum();
        if sum > 0.0 {
            result.iter_mut().for_each(|w| w.weight /= sum);
        }
        result
    }

    /// Writes `probes.json`.
    pub fn write(&self, path: &Path) -> Result<()> {
        json::write(path, self)
    }

    /// What the text of a file with a grid says.
    pub(super) fn parse(path: &Path, text: &str) -> Result<Self> {
        let grid: Self = json::parse(path, text)?;
        grid.check().map_err(|message| Error::input(path, message))?;
        Ok(grid)
    }

    pub(super) fn check(&self) -> std::result::Result<(), String> {
        check_counts(self.counts)?;
        let numbers = self.origin.iter().chain(&self.spacing);
        if numbers.clone().any(|x| !x.is_finite()) || self.spacing.iter().any(|&s| s < 0.0) {
            return Err("origin or spacing is not finite, or spacing is negative".into());
        }
        if self.positions.len() != self.len() {
            return Err(format!("{} positions, expected {} (counts {:?})", self.positions.len(), self.len(), self.counts));
        }
        let slack = 1e-4 * numbers.fold(1f32, |a, x| a.max(x.abs()));
        if let Some(i) = (0..self.len()).find(|&i| (self.position(i) - Vec3::from(self.positions[i])).length() > slack) {
            let found = self.positions[i];
            return Err(format!(
                "position {i} is {found:?}, expected {:?} from origin, spacing and counts",
                self.position(i).to_array()
            ));
        }
        if !self.blocked.is_sorted_by(|a, b| a < b) || self.blocked.last().is_some_and(|&b| b as usize >= self.len()) {
            return Err(format!("blocked: expected ascending indices below {}", self.len()));
        }
        Ok(())
    }
}

/// What tells a list from a grid.
#[derive(Deserialize)]
struct Head {
    method: Option<Placement>,
}

/// How the probes of a file were placed: what a list says of itself, or `Grid`.
pub(super) fn method(path: &Path, text: &str) -> Result<Placement> {
    let head: Head = serde_json::from_str(text).map_err(|e| Error::at_line(path, e.line() as u32, e.to_string()))?;
    Ok(head.method.unwrap_or_default())
}

/// How many cells a grid of a density has along each axis of the box from `lower` to `upper`, and their size, metres.
pub(super) fn cells(lower: Vec3, upper: Vec3, density: Density) -> Result<(UVec3, Vec3)> {
    let extent = upper - lower;
    if !extent.is_finite() || extent.min_element() < 0.0 {
        return Err(Error::Request(format!("box from {lower} to {upper}: expected finite corners, the lower one first")));
    }
    let (counts, spacing) = match density {
        Density::Counts(counts) => {
            let counts = UVec3::from(counts);
            (counts, extent / counts.max(UVec3::ONE).as_vec3())
        }
        Density::Spacing(s) if s.is_finite() && s > 0.0 => {
            ((extent / s).round().min(Vec3::splat(1e6)).as_uvec3().max(UVec3::ONE), Vec3::splat(s))
        }
        Density::Count(n) if n > 0 => {
            let counts = UVec3::from(even_counts(extent, n));
            (counts, extent / counts.as_vec3())
        }
        Density::Count(n) => return Err(Error::Request(format!("{n} probes: expected at least 1"))),
        Density::Spacing(s) => return Err(Error::Request(format!("spacing {s}: expected a positive number of metres"))),
    };
    check_counts(counts.to_array()).map_err(Error::Request)?;
    Ok((counts, spacing))
}

fn check_counts(counts: [u32; 3]) -> std::result::Result<(), String> {
    let n = counts.iter().try_fold(1usize, |n, &c| n.checked_mul(c as usize)).unwrap_or(usize::MAX);
    if n == 0 || n > PROBES_MAX {
        let [x, y, z] = counts;
        return Err(format!("grid of {x}x{y}x{z} probes: expected from 1 to {PROBES_MAX} in all"));
    }
    Ok(())
}

/// The counts along x, y and z whose product comes nearest to `count` among those that a cubic spacing gives.
fn even_counts(extent: Vec3, count: u32) -> [u32; 3] {
    let longest = extent.max_element().max(f32::MIN_POSITIVE);
    let with_longest = |n: u32| (extent * (n as f32 / longest)).round().max(Vec3::ONE).as_uvec3().to_array();
    let product = |c: &[u32; 3]| c.iter().map(|&n| u64::from(n)).product::<u64>();
    let fits = (1..=count.min(PROBES_MAX as u32)).map(with_longest);
    fits.min_by_key(|c| product(c).abs_diff(u64::from(count))).unwrap_or([1; 3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_gives_an_even_grid_of_about_as_many() {
        assert_eq!(even_counts(Vec3::splat(3.0), 64), [4, 4, 4]);
        assert_eq!(even_counts(Vec3::new(4.0, 2.0, 2.0), 16), [4, 2, 2]);
        assert_eq!(even_counts(Vec3::new(5.0, 0.0, 0.0), 7), [7, 1, 1]);
        for n in [1, 12, 64, 252] {
            let [x, y, z] = even_counts(Vec3::new(3.1, 2.2, 4.3), n);
            assert!((x * y * z).abs_diff(n) <= n / 8, "{n}: {x}x{y}x{z}");
        }
    }

    fn read(path: &Path) -> Result<ProbeGrid> {
        ProbeGrid::parse(path, &std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?)
    }

    fn grid(density: Density) -> ProbeGrid {
        let provenance = Provenance::new("place-probes", "abc", 0, &density);
        ProbeGrid::in_box(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(6.0, 3.0, 8.0), density, provenance).unwrap()
    }

    /// The interpolated position of the probes around a point is that point, if the weights are trilinear.
    fn interpolated(grid: &ProbeGrid, p: Vec3) -> Vec3 {
        grid.around(p).iter().map(|w| grid.position(w.probe) * w.weight).sum()
    }

    #[test]
    fn probes_stand_in_the_middle_of_equal_cells_x_fastest() {
        let grid = grid(Density::default());
        assert_eq!(grid.len(), 252);
        assert_eq!((grid.position(0), grid.position(1)), (Vec3::new(-0.5, 0.25, 2.5), Vec3::new(0.5, 0.25, 2.5)));
        assert_eq!((grid.position(7), grid.position(42)), (Vec3::new(-0.5, 0.75, 2.5), Vec3::new(-0.5, 0.25, 3.5)));
        assert_eq!(grid.position(251), Vec3::new(5.5, 2.75, 7.5));
    }

    #[test]
    fn spacing_is_kept_and_the_grid_centred() {
        let grid = grid(Density::Spacing(2.0));
        assert_eq!((grid.counts, grid.spacing), ([4, 2, 3], [2.0; 3]));
        let centre: Vec3 = (0..grid.len()).map(|i| grid.position(i)).sum::<Vec3>() / grid.len() as f32;
        assert!((centre - Vec3::new(2.5, 1.5, 5.0)).length() < 1e-5, "{centre}");
    }

    #[test]
    fn trilinear_weights_interpolate_linear_functions_exactly() {
        let grid = grid(Density::default());
        for i in 0..500 {
            let r = |k: u32| crate::base::math::hash_words(&[i, k]) as f32 / u32::MAX as f32;
            let p = Vec3::new(-0.5, 0.25, 2.5) + Vec3::new(6.0, 2.5, 5.0) * Vec3::new(r(0), r(1), r(2));
            assert!((interpolated(&grid, p) - p).length() < 1e-5, "{p}");
        }
        assert_eq!(grid.around(grid.position(100)).iter().filter(|w| w.weight > 1e-5).count(), 1);
    }

    #[test]
    fn outside_the_grid_the_nearest_point_of_its_box_counts() {
        let grid = grid(Density::default());
        let p = interpolated(&grid, Vec3::new(-50.0, 1.0, 90.0));
        assert!((p - Vec3::new(-0.5, 1.0, 7.5)).length() < 1e-5, "{p}");
        let one = crate::probe::placement::ProbeGrid::in_box(Vec3::ZERO, Vec3::ONE, Density::Counts([1, 2, 1]), grid.provenance)
            .unwrap();
        let sum: f32 = one.around(Vec3::new(3.0, 0.4, -2.0)).iter().map(|w| w.weight).sum();
        assert!((sum - 1.0).abs() < 1e-6 && interpolated(&one, Vec3::splat(0.4)).abs_diff_eq(Vec3::new(0.5, 0.4, 0.5), 1e-5));
    }

    #[test]
    fn blocked_probes_share_their_weight_out() {
        let mut grid = grid(Density::default());
        let p = grid.position(0) + Vec3::splat(0.3);
        let before = grid.around(p);
        grid.blocked = vec![0, 1];
        let after = grid.around(p);
        assert_eq!((after[0].weight, after[1].weight), (0.0, 0.0));
        assert!((after.iter().map(|w| w.weight).sum::<f32>() - 1.0).abs() < 1e-6);
        assert!((after[3].weight / after[7].weight - before[3].weight / before[7].weight).abs() < 1e-4);
    }

    #[test]
    fn the_file_round_trips_and_nonsense_in_it_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("probes.json");
        let grid = grid(Density::Counts([2, 1, 2]));
        grid.write(&path).unwrap();
        assert_eq!(read(&path).unwrap(), grid);
        let sealed = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, sealed.replace("    2,", "    3,")).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("has changed since it was written"));
        // As another program would write it: without a checksum.
        let good: String = sealed.lines().filter(|line| !line.contains("\"checksum\"")).map(|line| format!("{line}\n")).collect();
        for (from, to, expected) in [
            ("\"blocked\": []", "\"blocked\": [9]", "ascending indices below 4"),
            ("\"counts\"", "\"count\"", "missing field `counts`"),
            ("\"blocked\": []", "\"blocked\": [", "probes.json:"),
            ("    1,\n", "    4000000000,\n", "expected from 1 to 10000"),
            ("    1,\n", "    2,\n", "4 positions, expected 8"),
        ] {
            std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
            let message = read(&path).unwrap_err().to_string();
            assert!(message.contains(expected), "{to}: {message}");
        }
    }

    #[test]
    fn impossible_grids_are_refused() {
        let provenance = Provenance::new("place-probes", "abc", 0, &0);
        for density in [Density::Counts([0, 1, 1]), Density::Counts([u32::MAX; 3]), Density::Spacing(0.0), Density::Spacing(1e-9)]
        {
            assert!(ProbeGrid::in_box(Vec3::ZERO, Vec3::ONE, density, provenance.clone()).is_err(), "{density:?}");
        }
        assert!(ProbeGrid::in_box(Vec3::ONE, Vec3::ZERO, Density::default(), provenance).is_err());
    }
}
