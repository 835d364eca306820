//! Where probes stand, on a grid or anywhere: the two forms of `probes.json`.

use super::neighbors;
use super::placement::{PROBES_MAX, Placement, ProbeGrid, ProbeWeight, method};
use crate::io::{Provenance, json, read_text};
use crate::{Error, Result};
use glam::Vec3;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;

/// Probes without an order in space: the content of a `probes.json` that is no grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProbeList {
    /// How they were placed: any but [`Placement::Grid`].
    pub method: Placement,
    /// Their positions, metres; on a skeleton, those that add most to what the ones before them see come first.
    pub positions: Vec<[f32; 3]>,
    /// How far each probe's light is interpolated ([`super::support`]), metres, if the method says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f32>,
    /// Where the list came from.
    pub provenance: Provenance,
}

impl ProbeList {
    /// Writes `probes.json`.
    pub fn write(&self, path: &Path) -> Result<()> {
        json::write(path, self)
    }

    fn check(&self) -> std::result::Result<(), String> {
        if self.method == Placement::Grid {
            return Err("method grid: expected origin, spacing and counts".into());
        }
        if !(1..=PROBES_MAX).contains(&self.positions.len()) {
            return Err(format!("{} positions, expected from 1 to {PROBES_MAX}", self.positions.len()));
        }
        if let Some(radius) = self.radius.filter(|r| !(r.is_finite() && *r > 0.0)) {
            return Err(format!("radius {radius}: expected a positive number of metres"));
        }
        match self.positions.iter().position(|p| !Vec3::from(*p).is_finite()) {
            Some(i) => Err(format!("position {i} is {:?}, expected finite numbers", self.positions[i])),
            None => Ok(()),
        }
    }
}

/// What a `probes.json` holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Places {
    /// A regular grid.
    Grid(ProbeGrid),
    /// Any set.
    List(ProbeList),
}

impl Places {
    /// Reads `probes.json`.
    ///
    /// # Errors
    /// It cannot be read, was changed since it was written, or holds neither a grid nor a list.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &read_text(path)?)
    }

    /// [`Places::read`], of a text; `path` is for messages.
    ///
    /// # Errors
    /// It was changed since it was written, or holds neither a grid nor a list.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        if method(path, text)? == Placement::Grid {
            return ProbeGrid::parse(path, text).map(Self::Grid);
        }
        let list: ProbeList = json::parse(path, text)?;
        list.check().map_err(|message| Error::input(path, message))?;
        Ok(Self::List(list))
    }

    /// How they were placed.
    pub fn method(&self) -> Placement {
        match self {
            Self::Grid(_) => Placement::Grid,
            Self::List(list) => list.method,
        }
    }

    /// The grid, if they are one.
    pub fn grid(&self) -> Option<&ProbeGrid> {
        match self {
            Self::Grid(grid) => Some(grid),
            Self::List(_) => None,
        }
    }

    /// Number of probes.
    pub fn len(&self) -> usize {
        match self {
            Self::Grid(grid) => grid.len(),
            Self::List(list) => list.positions.len(),
        }
    }

    /// Never true for places that were read.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Position of a probe, metres.
    pub fn position(&self, probe: usize) -> Vec3 {
        match self {
            Self::Grid(grid) => grid.position(probe),
            Self::List(list) => Vec3::from(list.positions[probe]),
        }
    }

    /// Whether a probe of a grid is inside an object or behind a wall. Those of a list never are.
    pub fn is_blocked(&self, probe: usize) -> bool {
        self.grid().is_some_and(|grid| grid.is_blocked(probe))
    }

    /// Indices of the probes that are not blocked.
    pub fn used(&self) -> Vec<usize> {
        (0..self.len()).filter(|&i| !self.is_blocked(i)).collect()
    }

    /// The probes around `p` with their weights, which sum to 1: of a grid the eight of its cell ([`ProbeGrid::around`]), of a list the eight
    /// nearest ([`neighbors::around`]).
    pub fn around(&self, p: Vec3) -> [ProbeWeight; 8] {
        match self {
            Self::Grid(grid) => grid.around(p),
            Self::List(list) => neighbors::around(&list.positions, p),
        }
    }

    /// The probes around an eye with their weights t_i (§5.2), or the `count` of largest weight, the largest first.
    pub fn nearest(&self, eye: Vec3, count: usize) -> Vec<(usize, f32)> {
        // At the border of the grid, and in a grid of one layer, corners coincide.
        let mut merged: Vec<(usize, f32)> = Vec::with_capacity(8);
        for ProbeWeight { probe, weight } in self.around(eye) {
            match merged.iter_mut().find(|(i, _)| *i == probe) {
                Some((_, w)) => *w += weight,
                None if self.is_blocked(probe) => {}
                None => merged.push((probe, weight)),
            }
        }
        merged.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        merged.truncate(count.clamp(1, 8));
        merged
    }

    /// All positions, metres; those of blocked probes of a grid too.
    pub fn positions(&self) -> Vec<Vec3> {
        let list = match self {
            Self::Grid(grid) => &grid.positions,
            Self::List(list) => &list.positions,
        };
        list.iter().map(|p| Vec3::from(*p)).collect()
    }

    /// How far each probe's light is interpolated ([`super::support`]), metres; only lists may say.
    pub fn radius(&self) -> Option<f32> {
        match self {
            Self::Grid(_) => None,
            Self::List(list) => list.radius,
        }
    }

    /// Where they came from.
    pub fn provenance(&self) -> &Provenance {
        match self {
            Self::Grid(grid) => &grid.provenance,
            Self::List(list) => &list.provenance,
        }
    }
}

impl<'de> Deserialize<'de> for Places {
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(from)?;
        if value.get("method").is_some() {
            let list: ProbeList = serde_json::from_value(value).map_err(D::Error::custom)?;
            return list.check().map(|()| Self::List(list)).map_err(D::Error::custom);
        }
        let grid: ProbeGrid = serde_json::from_value(value).map_err(D::Error::custom)?;
        grid.check().map(|()| Self::Grid(grid)).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::placement::Density;

    #[test]
    fn both_forms_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("probes.json");
        let provenance = Provenance::new("place-probes", "abc", 0, &0);
        let grid = ProbeGrid::in_box(Vec3::ZERO, Vec3::ONE, Density::Counts([2, 1, 1]), provenance.clone()).unwrap();
        grid.write(&path).unwrap();
        let places = Places::read(&path).unwrap();
        assert_eq!((places.method(), places.positions().len()), (Placement::Grid, 2));
        assert_eq!(places, Places::Grid(grid));

        let positions = vec![[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]];
        let list = ProbeList {
            method: Placement::MedialAxis,
            positions: positions.clone(),
            radius: None,
            provenance: provenance.clone(),
        };
        list.write(&path).unwrap();
        let places = Places::read(&path).unwrap();
        assert_eq!(places.positions()[1], Vec3::new(1.0, 2.0, 3.0));
        assert_eq!((places.provenance().stage.as_str(), places.method()), ("place-probes", Placement::MedialAxis));
        assert_eq!(places, Places::List(list));
        let within: Places = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!((within.radius(), within), (None, places));
        assert!(!std::fs::read_to_string(&path).unwrap().contains("radius"));

        let list = ProbeList { method: Placement::Voxel, positions, radius: Some(0.75), provenance };
        list.write(&path).unwrap();
        assert_eq!((Places::read(&path).unwrap().radius(), Places::read(&path).unwrap()), (Some(0.75), Places::List(list)));

        let sealed = std::fs::read_to_string(&path).unwrap();
        let good: String = sealed.lines().filter(|line| !line.contains("\"checksum\"")).map(|line| format!("{line}\n")).collect();
        for (from, to, expected) in [
            ("voxel", "magic", "unknown variant `magic`"),
            ("voxel", "grid", "missing field `origin`"),
            ("0.75", "-0.5", "radius -0.5: expected a positive number of metres"),
            ("0.75", "0.0", "radius 0: expected a positive number"),
            ("0.75", "1e60", "number out of range"),
            ("0.1", "1e99", "probes.json"),
            ("\"positions\"", "\"places\"", "missing field `positions`"),
            ("[\n    [", "[], \"x\": [\n    [", "0 positions, expected from 1"),
        ] {
            std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
            let message = Places::read(&path).unwrap_err().to_string();
            assert!(message.contains(expected), "{to}: {message}");
        }
        std::fs::write(&path, sealed.replace("0.1", "0.2")).unwrap();
        assert!(Places::read(&path).unwrap_err().to_string().contains("has changed"));
    }
}
