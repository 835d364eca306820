//! `place-probes`.

use crate::base::clock::seconds;
use crate::io::Provenance;
use crate::plan::option::{List, stage, text};
use crate::plan::{Context, Outcome};
use crate::probe::coverage_picture::{self, Coverage};
use crate::probe::nonuniform::{Bounds, NonuniformParams, Reachable, place};
use crate::probe::placement::{Density, Placement, ProbeGrid};
use crate::probe::places::ProbeList;
use crate::probe::plan_picture;
use crate::probe::reach::{ReachParams, blocked, reach};
use crate::probe::refine::RefineParams;
use crate::scene::{Camera, Scene, camera_path};
use crate::transport::World;
use crate::{Error, Result};
use glam::Vec3;
use serde_json::json;
use std::path::PathBuf;

mod check;
mod voxel;

text!(Placement);

stage! {
    /// Places probes: on a regular grid, or where a scene's shape asks for them.
    PlaceProbes "place-probes"
    {
        /// The scene.
        scene,
    }
    {
        /// How to place them.
        "--method" method: Option<Placement>,
        /// Probes along x, y and z.
        "--grid" grid: Option<List<u32, 3, 'x'>>,
        /// About so many probes, evenly spaced; of the other methods, so many.
        "--count" count: Option<u32>,
        /// Distance of neighbours, metres; of voxel, as many probes as a grid of it has.
        "--spacing" spacing: Option<f32>,
        /// Share of the reachable surfaces that probes are to see.
        "--coverage" coverage: Option<f64>,
        /// Passes that move probes to where they see more.
        "--refine" refine: Option<u32>,
        /// Transport of other probes: where more are needed.
        "--refine-by" refine_by: Option<PathBuf>,
        /// The box to fill, metres: its lower corner, then its upper one.
        "--bounds" bounds: Option<List<f32, 6, ','>>,
        /// Camera path whose space is filled.
        "--path" path: Option<PathBuf>,
        /// Widens the box of the camera path, metres.
        "--margin" margin: Option<f32>,
        /// A drawing of the probes in the scene, PNG.
        "--picture" picture: Option<PathBuf>,
        /// A heat map of how many probes see each place, PNG.
        "--coverage-picture" coverage_picture: Option<PathBuf>,
        /// The file to write.
        "--output" output: PathBuf,
    }
}

/// What every method starts from.
struct Ground {
    /// Where cameras stand.
    cameras: Vec<Vec3>,
    /// The first of them.
    first: Option<Camera>,
    bounds: Bounds,
}

impl PlaceProbes {
    fn reach(&self) -> ReachParams {
        let base = ReachParams::default();
        ReachParams { margin: self.margin.unwrap_or(base.margin), ..base }
    }

    fn draws(&self) -> bool {
        self.picture.is_some() || self.coverage_picture.is_some()
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
        let ground = self.ground(&world)?;
        match self.method.unwrap_or_default() {
            Placement::Grid => self.run_grid(cx, &world, &ground),
            Placement::Sdf | Placement::MedialAxis => self.run_nonuniform(cx, &world, &ground),
            Placement::Voxel => self.run_voxel(cx, &world, &ground),
        }
    }

    fn run_grid(&self, cx: &Context, world: &World, ground: &Ground) -> Result<Outcome> {
        let (density, (lower, upper)) = (self.density(), ground.bounds.filled);
        let provenance = self.provenance(cx, world, ground, json!({ "density": density }));
        let mut grid = ProbeGrid::in_box(lower, upper, density, provenance)?;
        if !ground.cameras.is_empty() {
            grid.blocked = blocked(world, &grid, &ground.cameras);
        }
        let coverage = self.draw_grid(cx, world, ground, &grid)?;
        grid.write(&self.output)?;
        let ([nx, ny, nz], [sx, sy, sz]) = (grid.counts, grid.spacing);
        let mut figures = json!({
            "count": grid.len(), "counts": grid.counts, "spacing": grid.spacing, "blocked": grid.blocked.len(),
            "bounds": [lower.to_array(), upper.to_array()],
        });
        let mut summary = format!(
            "{}: {} probes ({nx}x{ny}x{nz}), {sx:.2} x {sy:.2} x {sz:.2} m apart, from {lower:.2} to {upper:.2}, {} of them blocked",
            self.output.display(),
            grid.len(),
            grid.blocked.len(),
        );
        if let Some(coverage) = coverage {
            figures["coverage"] = coverage.into();
            summary += &format!("; the others see {} of the reachable surfaces", percent(coverage));
        }
        Ok(Outcome { summary, figures, ..Outcome::default() })
    }

    /// The pictures of a grid, if they are asked for, and what the probes that are not blocked see.
    fn draw_grid(&self, cx: &Context, world: &World, ground: &Ground, grid: &ProbeGrid) -> Result<Option<f64>> {
        if !self.draws() {
            return Ok(None);
        }
        // As the other methods would have it, so that shares can be compared.
        let bounds = Bounds { filled: ground.bounds.seen, ..ground.bounds };
        let reachable = Reachable::new(world, &bounds, &ground.cameras, &NonuniformParams::default())?;
        let used: Vec<Vec3> = grid.used().into_iter().map(|i| grid.position(i)).collect();
        let times = reachable.sides.times_seen(&reachable.sides.rows(world, &used));
        self.draw(cx, world, (ground, &reachable), (&used, &times, &grid.provenance))?;
        let seen: f64 = reachable.sides.list.iter().zip(&times).filter(|(_, n)| **n > 0).map(|(s, _)| f64::from(s.area)).sum();
        Ok(Some(seen / reachable.sides.area))
    }

    fn run_nonuniform(&self, cx: &Context, world: &World, ground: &Ground) -> Result<Outcome> {
        let (clock, method) = (seconds(), self.method.unwrap_or_default());
        let params = NonuniformParams {
            method,
            count: self.count,
            coverage: self.coverage,
            refine: RefineParams { passes: self.refine.unwrap_or(0), ..RefineParams::default() },
            ..NonuniformParams::default()
        };
        let reachable = Reachable::new(world, &ground.bounds, &ground.cameras, &params)?;
        let sides = reachable.sides.list.len();
        cx.listener.detail(&format!("free space and {sides} reachable sides of texels in {:.2} s", clock()));
        let placed = place(world, &reachable, &params, (cx.seed, cx.progress()))?;
        let (count, candidates) = (placed.positions.len(), placed.candidates);
        if let Some(wanted) = self.count.filter(|&n| self.coverage.is_none() && n as usize > count) {
            cx.listener.warn(&format!("--count {wanted}: the scene has places for {count} probes only"));
        }
        if let Some(wanted) = self.coverage.filter(|&c| self.count.is_none() && c > placed.before.coverage) {
            cx.listener.warn(&format!("--coverage {wanted}: {count} probes see {} at most", percent(placed.before.coverage)));
        }
        let list = ProbeList {
            method,
            positions: placed.positions.iter().map(|p| p.to_array()).collect(),
            radius: None,
            provenance: self.provenance(cx, world, ground, json!({ "nonuniform": params })),
        };
        list.write(&self.output)?;
        let seconds = clock();
        let times = reachable.sides.times_seen(&placed.rows);
        self.draw(cx, world, (ground, &reachable), (&placed.positions, &times, &list.provenance))?;
        let (lower, upper) = ground.bounds.filled;
        let refined = match self.refine {
            Some(n) => format!("; after {n} passes of refinement {}", percent(placed.after.coverage)),
            None => String::new(),
        };
        Ok(Outcome {
            summary: format!(
                "{}: {count} probes of {candidates} candidates ({method}) see {} of the reachable surfaces{refined}; {seconds:.1} s",
                self.output.display(),
                percent(placed.before.coverage),
            ),
            figures: json!({
                "method": method, "count": count, "candidates": candidates, "sides": sides, "coverage": placed.after.coverage,
                "before": placed.before, "after": placed.after, "seconds": seconds,
                "bounds": [lower.to_array(), upper.to_array()],
            }),
            ..Outcome::default()
        })
    }

    /// Writes the pictures that are asked for; `times`: how many probes see each side. They come from what the probes come from.
    fn draw(
        &self,
        cx: &Context,
        world: &World,
        (ground, reachable): (&Ground, &Reachable),
        (probes, times, origin): (&[Vec3], &[u32], &Provenance),
    ) -> Result<()> {
        if let Some(path) = &self.picture {
            plan_picture::draw(world, &reachable.space, probes).write(path, origin)?;
        }
        if let (Some(path), Some(camera)) = (&self.coverage_picture, &ground.first) {
            let coverage = Coverage { sides: &reachable.sides, times, probes, camera };
            let mut origin = origin.clone();
            origin.parameters["view"] = json!({
                "to_world": camera.to_world.to_cols_array(), "fov_x_rad": camera.fov_x, "size": camera.size,
            });
            coverage_picture::draw(world, &coverage, cx.progress()).write(path, &origin)?;
        }
        Ok(())
    }

    /// Where an output comes from: a method's parameters, and what all methods have.
    fn provenance(&self, cx: &Context, world: &World, ground: &Ground, method: serde_json::Value) -> Provenance {
        let (lower, upper) = ground.bounds.filled;
        let mut parameters = method;
        parameters["bounds"] = json!([lower.to_array(), upper.to_array()]);
        parameters["reach"] = json!(self.bounds.is_none().then_some(self.reach()));
        parameters["cameras"] = json!(ground.cameras.iter().map(|c| c.to_array()).collect::<Vec<_>>());
        Provenance::new(Self::COMMAND, &world.scene.hash, cx.seed, &parameters)
    }

    /// Where cameras stand, and the boxes. A grid fills the space that a path moves in; the other methods fill all that its cameras see:
    /// from there they have something to choose.
    fn ground(&self, world: &World) -> Result<Ground> {
        let views = self.cameras(&world.scene)?;
        let cameras: Vec<Vec3> = views.iter().map(Camera::position).collect();
        let seen = |margin: f32| reach(world, &cameras, &ReachParams { margin, ..self.reach() });
        let is_grid = self.method.unwrap_or_default() == Placement::Grid;
        if cameras.is_empty() && (!is_grid || self.draws()) {
            return Err(Error::input(&self.scene, "has no sensor: a camera says which space is free; give --path"));
        }
        let filled = match self.bounds {
            Some(List([x0, y0, z0, x1, y1, z1])) => (Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1)),
            None if cameras.is_empty() => return Err(Error::input(&self.scene, "has no sensor; give --bounds or --path")),
            None => seen(if is_grid { self.reach().margin } else { f32::INFINITY })?,
        };
        // A grid with neither picture nor cameras has no use for it.
        let seen = if is_grid && !self.draws() { filled } else { seen(f32::INFINITY)? };
        Ok(Ground { cameras, first: views.into_iter().next(), bounds: Bounds { filled, seen } })
    }

    /// The cameras of the path, or the scene's own sensor.
    fn cameras(&self, scene: &Scene) -> Result<Vec<Camera>> {
        Ok(match &self.path {
            Some(path) => camera_path::load(path, scene.sensor.as_ref(), scene.unit_scale.0)?,
            None => scene.sensor.iter().cloned().collect(),
        })
    }
}

/// A share as people read it; never 100 % of what is less, and never -0 %, which the sum of nothing is.
fn percent(share: f64) -> String {
    format!("{:.2} %", if share < 1.0 { (share * 100.0).clamp(0.0, 99.99) + 0.0 } else { 100.0 })
}
