//! Folders of transport. `receivers.exr` has the receivers, `relight.exr` the receiver that each relight ray meets (a row a probe), and
//! `NNNN.exr` the clusters of a group of receivers; with receivers in free space, `volume.exr` has their numbers in its grid, and their groups
//! come after those of texels. These are tables, not pictures: entry `i` is pixel `i` in row order. `set.json` comes last.

use super::compress::Cluster;
use super::operator::Transport;
use super::params::TransportParams;
use super::relight::RelightRays;
use super::seen::NO_RECEIVER;
use super::volume::{Grid, NUMBERS, Volume};
use crate::io::provenance::hash_file;
use crate::io::{ExrImage, Provenance};
use crate::lightmap::bake::atlas_of;
use crate::lightmap::receivers::{BACK_BIT, POINTS, Receiver};
use crate::lightmap::texels::Point;
use crate::probe::places::Places;
use crate::probe::set::{ProbeSet, numbered, read_member};
use crate::probe::store::read_set_of;
use crate::scene::Scene;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use half::f16;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Entries of a table's row.
const WIDTH: usize = 1024;

/// `set.json` of such a folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TransportSet {
    /// What was baked.
    pub bake: TransportParams,
    /// Where the probes stand. Blocked ones take no part.
    pub places: Places,
    /// Radius of the probes' support, metres.
    pub radius: f32,
    /// Number of receivers.
    pub receivers: usize,
    /// Receivers in free space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<VolumeSet>,
    /// Content hashes of `receivers.exr`, `relight.exr`, `volume.exr` where there is one, and each group's file.
    pub files: Vec<String>,
    /// Where it came from: the same in every file.
    pub provenance: Provenance,
}

/// What `set.json` says of receivers in free space.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VolumeSet {
    /// Where they lie.
    pub grid: Grid,
    /// How many of the grid's points they are.
    pub points: usize,
    /// Files of their clusters, the last ones.
    pub groups: usize,
}

/// Files that all groups share; `volume.exr` where there are receivers in free space.
pub fn shared_files(folder: &Path, has_volume: bool) -> Vec<PathBuf> {
    let names = ["receivers.exr", "relight.exr", "volume.exr"];
    names[..if has_volume { 3 } else { 2 }].iter().map(|name| folder.join(name)).collect()
}

/// All files of a folder of so many groups, in the order of [`TransportSet::files`].
fn all_files(folder: &Path, has_volume: bool, groups: usize) -> Vec<PathBuf> {
    shared_files(folder, has_volume).into_iter().chain((0..groups).map(|i| numbered(folder, i))).collect()
}

/// Where the probes stand that take part.
pub fn positions(places: &Places) -> Vec<Vec3> {
    places.used().into_iter().map(|i| places.position(i)).collect()
}

impl TransportSet {
    /// The subcommand that writes it.
    const STAGE: &str = "bake-transport";

    /// Reads `set.json`.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = ProbeSet::path(folder);
        let set = read_set_of::<Self>(folder, Self::STAGE)?;
        let set = set.ok_or_else(|| Error::input(&path, "is not of transport: expected a folder that bake-transport wrote"))?;
        let grid = set.volume.map(|v| v.grid);
        let is_grid = |g: Grid| g.low.is_finite() && g.spacing > 0.0 && g.has_points();
        let groups = set.volume.map_or(0, |v| v.groups);
        let has_files = set.files.len() >= shared_files(folder, grid.is_some()).len() + groups;
        if !(set.radius > 0.0 && set.radius.is_finite() && has_files && grid.is_none_or(is_grid)) {
            return Err(Error::input(&path, "holds no radius above 0 or no files: run bake-transport again"));
        }
        crate::base::named::Parameters::validate(&set.bake)?;
        Ok(set)
    }

    /// All files of the folder, in the order of [`Self::files`].
    pub fn paths(&self, folder: &Path) -> Vec<PathBuf> {
        let shared = shared_files(folder, self.volume.is_some()).len();
        all_files(folder, self.volume.is_some(), self.files.len().saturating_sub(shared))
    }

    /// Hashes of the files of so many groups, and those that they share, as they are.
    pub fn hashes(folder: &Path, has_volume: bool, groups: usize) -> Result<Vec<String>> {
        all_files(folder, has_volume, groups).iter().map(|file| hash_file(file)).collect()
    }
}

impl Transport {
    /// Reads a folder that was baked from `scene`.
    pub fn load(folder: &Path, scene: &Scene) -> Result<Self> {
        let set = TransportSet::read(folder)?;
        set.provenance.check_scene(&ProbeSet::path(folder), &scene.hash)?;
        let files = set.paths(folder);
        let probes = positions(&set.places);
        let read = |path: &PathBuf| read_member(path, None, &set.provenance);
        let atlas = atlas_of(scene, &set.bake.atlas)?;
        let [triangles, pixels] = [scene.geometry.triangles.len() as u32, atlas.size[0] * atlas.size[1]];
        let receivers = decode_receivers(&files[0], &read(&files[0])?, set.receivers, [triangles, pixels])?;
        let hits = relight(&files[1], &read(&files[1])?, probes.len() * set.bake.relight_rays as usize, receivers.len())?;
        let of = |files: &[PathBuf], numbers: usize, count: usize| -> Result<Vec<Cluster>> {
            let shape = Shape { terms: set.bake.terms(), numbers, receivers: count, probes: probes.len() };
            let clusters = |path: &PathBuf| decode_clusters(path, &read(path)?, &shape);
            let clusters: Vec<Vec<Cluster>> = files.par_iter().map(clusters).collect::<Result<_>>()?;
            Ok(clusters.concat())
        };
        let groups = &files[shared_files(folder, set.volume.is_some()).len()..];
        let (texels, space) = groups.split_at(groups.len() - set.volume.map_or(0, |v| v.groups));
        let clusters = of(texels, set.bake.receiver.rows(), receivers.len())?;
        let volume = match set.volume {
            None => None,
            Some(VolumeSet { grid, points, .. }) => {
                let cells = decode_cells(&files[2], &read(&files[2])?, &grid, points)?;
                Some(Volume { grid, cells, clusters: of(space, NUMBERS, points)? })
            }
        };
        let rays = RelightRays::new(set.bake.relight_rays, set.bake.sh_order);
        Ok(Self { params: set.bake, probes, radius: set.radius, atlas, receivers, rays, hits, clusters, volume })
    }
}

/// An image of a table's columns.
fn table(rows: usize) -> ExrImage {
    ExrImage::new(WIDTH, rows.div_ceil(WIDTH).max(1))
}

fn padded<T: Clone + Default>(mut column: Vec<T>, image: &ExrImage) -> Vec<T> {
    column.resize(image.width * image.height, T::default());
    column
}

/// The receivers' table.
pub fn encode_receivers(receivers: &[Receiver], provenance: &Provenance) -> ExrImage {
    let mut image = table(receivers.len());
    image = image.clone().with_u32("pixel", padded(receivers.iter().map(Receiver::word).collect(), &image));
    for k in 0..POINTS {
        let column = |of: &dyn Fn(&Point) -> f32| receivers.iter().map(|r| of(&r.points[k])).collect::<Vec<_>>();
        let triangles = receivers.iter().map(|r| r.points[k].triangle).collect();
        let (u, v) = (column(&|p| p.barycentric.x), column(&|p| p.barycentric.y));
        image = image.clone().with_u32(&format!("point{k}.triangle"), padded(triangles, &image));
        image = image.clone().with_f32(&format!("point{k}.u"), padded(u, &image));
        image = image.clone().with_f32(&format!("point{k}.v"), padded(v, &image));
    }
    image.with_provenance(provenance.clone())
}

fn decode_receivers(path: &Path, image: &ExrImage, count: usize, [triangles, pixels]: [u32; 2]) -> Result<Vec<Receiver>> {
    let pixel = image.u32(path, "pixel")?;
    if pixel.len() < count {
        return Err(Error::input(path, format!("has {} entries, expected {count}", pixel.len())));
    }
    let mut receivers: Vec<Receiver> = pixel[..count]
        .iter()
        .map(|&p| Receiver {
            pixel: p & !BACK_BIT,
            back: p & BACK_BIT != 0,
            points: [Point { triangle: 0, barycentric: Vec2::ZERO }; POINTS],
        })
        .collect();
    for k in 0..POINTS {
        let triangle = image.u32(path, &format!("point{k}.triangle"))?;
        let (u, v) = (image.f32(path, &format!("point{k}.u"))?, image.f32(path, &format!("point{k}.v"))?);
        for (i, r) in receivers.iter_mut().enumerate() {
            r.points[k] = Point { triangle: triangle[i], barycentric: Vec2::new(u[i], v[i]) };
        }
    }
    let is_right = |r: &Receiver| {
        let point =
            |p: &Point| p.triangle < triangles && p.barycentric.cmpge(Vec2::ZERO).all() && p.barycentric.element_sum() < 1.01;
        r.pixel < pixels && r.points.iter().all(point)
    };
    match receivers.iter().position(|r| !is_right(r)) {
        Some(i) => Err(Error::input(path, format!("receiver {i} lies outside the scene or its atlas"))),
        None => Ok(receivers),
    }
}

/// The table of relight rays, a row a probe.
pub fn encode_relight(hits: &[u32], probes: usize, provenance: &Provenance) -> ExrImage {
    ExrImage::new(hits.len() / probes, probes).with_u32("receiver", hits.to_vec()).with_provenance(provenance.clone())
}

fn relight(path: &Path, image: &ExrImage, count: usize, receivers: usize) -> Result<Vec<u32>> {
    let hits = image.u32(path, "receiver")?;
    if hits.len() != count || hits.iter().any(|&r| r != NO_RECEIVER && r as usize >= receivers) {
        return Err(Error::input(path, format!("expected {count} receivers below {receivers}")));
    }
    Ok(hits)
}

/// The table of receivers in free space.
pub fn encode_cells(cells: &[u32], provenance: &Provenance) -> ExrImage {
    let image = table(cells.len());
    let column = padded(cells.to_vec(), &image);
    image.with_u32("cell", column).with_provenance(provenance.clone())
}

fn decode_cells(path: &Path, image: &ExrImage, grid: &Grid, count: usize) -> Result<Vec<u32>> {
    let cells = image.u32(path, "cell")?;
    let is_right = |cells: &[u32]| cells.is_sorted_by(|a, b| a < b) && cells.last().is_none_or(|&c| (c as usize) < grid.count());
    match cells.get(..count).filter(|cells| is_right(cells)) {
        Some(cells) => Ok(cells.to_vec()),
        None => Err(Error::input(path, format!("expected {count} points of the grid, in order"))),
    }
}

/// What the clusters of a file are of: harmonics of a probe, numbers of a receiver, and how many receivers and probes there are.
struct Shape {
    terms: usize,
    numbers: usize,
    receivers: usize,
    probes: usize,
}

/// A group's clusters: `index` has their number, then of each its numbers of receivers and probes, its rank, and the lists; `value` has
/// projection and reconstruction of each.
pub fn encode_clusters(clusters: &[Cluster], provenance: &Provenance) -> ExrImage {
    let mut index = vec![clusters.len() as u32];
    let mut values: Vec<f32> = Vec::new();
    for c in clusters {
        index.extend([c.receivers.len() as u32, c.probes.len() as u32, c.rank as u32]);
        index.extend(c.receivers.iter().chain(&c.probes));
        values.extend(c.projection.iter().chain(&c.reconstruction).map(|h| h.to_f32()));
    }
    let image = table(index.len().max(values.len()));
    let (index, values) = (padded(index, &image), padded(values, &image));
    image.with_u32("index", index).with_f16("value", values).with_provenance(provenance.clone())
}

fn decode_clusters(path: &Path, image: &ExrImage, shape: &Shape) -> Result<Vec<Cluster>> {
    let (index, values) = (image.u32(path, "index")?, image.f32(path, "value")?);
    let bad = || Error::input(path, "its tables do not fit: run bake-transport again");
    let (mut index, mut values) = (index.as_slice(), values.as_slice());
    let mut word = |n: usize| -> Result<Vec<u32>> {
        let (head, rest) = index.split_at_checked(n).ok_or_else(bad)?;
        index = rest;
        Ok(head.to_vec())
    };
    let mut halves = |n: usize| -> Result<Vec<f16>> {
        let (head, rest) = values.split_at_checked(n).ok_or_else(bad)?;
        values = rest;
        Ok(head.iter().map(|&v| f16::from_f32(v)).collect())
    };
    let mut clusters = Vec::new();
    for _ in 0..word(1)?[0] {
        let numbers = word(3)?;
        let [r, p, rank] = [0, 1, 2].map(|k| numbers[k] as usize);
        let (list, of) = (word(r)?, word(p)?);
        if list.iter().any(|&i| i as usize >= shape.receivers) || of.iter().any(|&i| i as usize >= shape.probes) {
            return Err(bad());
        }
        let (columns, rows) = (p * shape.terms, r * shape.numbers);
        let count = |n: usize| n.checked_mul(rank).ok_or_else(bad);
        let (projection, reconstruction) = (halves(count(columns)?)?, halves(count(rows)?)?);
        clusters.push(Cluster { receivers: list, probes: of, rank, projection, reconstruction });
    }
    Ok(clusters)
}
