//! `place-probes`.

use crate::io::Provenance;
use crate::plan::option::{List, stage};
use crate::plan::{Context, Outcome};
use crate::probe::placement::{Density, ProbeGrid};
use crate::probe::reach::{ReachParams, blocked, reach};
use crate::scene::{Scene, camera_path};
use crate::{Error, Result};
use glam::Vec3;
use serde_json::json;
use std::path::PathBuf;

stage! {
    /// Places probes on a regular grid.
    PlaceProbes "place-probes"
    {
        /// The scene.
        scene,
    }
    {
        /// Probes along x, y and z.
        "--grid" grid: Option<List<u32, 3, 'x'>>,
        /// About so many probes, evenly spaced.
        "--count" count: Option<u32>,
        /// Distance of neighbours, metres.
        "--spacing" spacing: Option<f32>,
        /// The box to fill, metres: its lower corner, then its upper one.
        "--bounds" bounds: Option<List<f32, 6, ','>>,
        /// Camera path whose space is filled.
        "--path" path: Option<PathBuf>,
        /// Widens the box of the camera path, metres.
        "--margin" margin: Option<f32>,
        /// The file to write.
        "--output" output: PathBuf,
    }
}

impl PlaceProbes {
    fn reach(&self) -> ReachParams {
        let base = ReachParams::default();
        ReachParams { margin: self.margin.unwrap_or(base.margin), ..base }
    }

    /// Refuses what does not go together.
    pub fn check(&self) -> Result<()> {
        if let Some(margin) = self.margin.filter(|m| !(m.is_finite() && *m >= 0.0)) {
            return Err(Error::Request(format!("--margin {margin}: expected metres, not negative")));
        }
        if let Some(bounds) = &self.bounds
            && !(bounds.0.iter().all(|x| x.is_finite()) && (0..3).all(|i| bounds.0[i] <= bounds.0[i + 3]))
        {
            return Err(Error::Request(format!(
                "--bounds {bounds}: expected x0,y0,z0,x1,y1,z1, the lower corner first, like -2,0,-2,2,2.5,2"
            )));
        }
        let density = [self.grid.is_some(), self.count.is_some(), self.spacing.is_some()];
        if density.into_iter().filter(|given| *given).count() > 1 {
            return Err(Error::Request("--grid, --count, --spacing: expected one of them".into()));
        }
        if self.bounds.is_some() && self.path.is_some() {
            return Err(Error::Request("--bounds, --path: expected one of them".into()));
        }
        Ok(())
    }

    fn density(&self) -> Density {
        match (self.spacing, self.grid, self.count) {
            (Some(s), ..) => Density::Spacing(s),
            (_, Some(counts), _) => Density::Counts(counts.0),
            (.., Some(n)) => Density::Count(n),
            _ => Density::default(),
        }
    }

    /// Reads the scene, places, writes.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        self.check()?;
        let world = cx.opaque_world(&self.scene)?;
        let cameras = self.cameras(&world.scene)?;
        let (params, density) = (self.reach(), self.density());
        let (lower, upper) = match self.bounds {
            Some(List([x0, y0, z0, x1, y1, z1])) => (Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1)),
            None if cameras.is_empty() => return Err(Error::input(&self.scene, "has no sensor; give --bounds or --path")),
            None => reach(&world, &cameras, &params)?,
        };
        let parameters = json!({
            "density": density, "bounds": [lower.to_array(), upper.to_array()], "reach": self.bounds.is_none().then_some(params),
            "cameras": cameras.iter().map(|c| c.to_array()).collect::<Vec<_>>(),
        });
        let provenance = Provenance::new(Self::COMMAND, &world.scene.hash, cx.seed, &parameters);
        let mut grid = ProbeGrid::in_box(lower, upper, density, provenance)?;
        if !cameras.is_empty() {
            grid.blocked = blocked(&world, &grid, &cameras);
        }
        grid.write(&self.output)?;
        let ([nx, ny, nz], [sx, sy, sz]) = (grid.counts, grid.spacing);
        Ok(Outcome {
            summary: format!(
                "{}: {} probes ({nx}x{ny}x{nz}), {sx:.2} x {sy:.2} x {sz:.2} m apart, from {lower:.2} to {upper:.2}, {} of them blocked",
                self.output.display(),
                grid.len(),
                grid.blocked.len(),
            ),
            figures: json!({
                "count": grid.len(), "counts": grid.counts, "spacing": grid.spacing, "blocked": grid.blocked.len(),
                "bounds": [lower.to_array(), upper.to_array()],
            }),
            ..Outcome::default()
        })
    }

    /// Where the camera stands: along the path, or the scene's own sensor.
    fn cameras(&self, scene: &Scene) -> Result<Vec<Vec3>> {
        Ok(match &self.path {
            Some(path) => {
                camera_path::load(path, scene.sensor.as_ref(), scene.unit_scale.0)?.iter().map(|c| c.position()).collect()
            }
            None => scene.sensor.iter().map(|c| c.position()).collect(),
        })
    }
}
