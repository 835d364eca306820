//! `place-probes --method voxel`.

use super::{Ground, PlaceProbes, percent};
use crate::Result;
use crate::base::clock::seconds;
use crate::plan::{Context, Outcome};
use crate::probe::nonuniform::{NonuniformParams, Reachable};
use crate::probe::placement::{Density, Placement};
use crate::probe::places::ProbeList;
use crate::probe::sparse::{COUNT, Sparse, SparseParams, place};
use crate::transport::World;
use serde_json::json;

impl PlaceProbes {
    pub(super) fn run_voxel(&self, cx: &Context, world: &World, ground: &Ground) -> Result<Outcome> {
        let clock = seconds();
        let density = if self.spacing.is_some() { self.density() } else { Density::Count(self.count.unwrap_or(COUNT)) };
        let params = SparseParams::new(ground.bounds.filled, density)?;
        let surfaces = NonuniformParams { resolution: params.resolution, texels: params.texels, ..NonuniformParams::default() };
        let reachable = Reachable::new(world, &ground.bounds, &ground.cameras, &surfaces)?;
        cx.listener.detail(&format!(
            "free space and {} reachable sides of texels in {:.2} s",
            reachable.sides.list.len(),
            clock()
        ));
        let placed = place(world, &reachable, &params, cx.progress())?;
        if placed.positions.len() < params.count as usize {
            let (wanted, count) = (params.count, placed.positions.len());
            cx.listener.warn(&format!("{wanted} probes were asked for: the scene has places for {count} only"));
        }
        let list = ProbeList {
            method: Placement::Voxel,
            positions: placed.positions.iter().map(|p| p.to_array()).collect(),
            radius: Some(placed.radius),
            provenance: self.provenance(cx, world, ground, json!({ "sparse": params })),
        };
        list.write(&self.output)?;
        let seconds = clock();
        let times = reachable.sides.times_seen(&placed.rows);
        self.draw(cx, world, (ground, &reachable), (&placed.positions, &times))?;
        Ok(self.report(ground, &params, &placed, seconds))
    }

    fn report(&self, ground: &Ground, params: &SparseParams, placed: &Sparse, seconds: f64) -> Outcome {
        let (count, (lower, upper)) = (placed.positions.len(), ground.bounds.filled);
        let Sparse { candidates, radius, overlap, supported, before, seen, .. } = *placed;
        Outcome {
            summary: format!(
                "{}: {count} probes of {candidates} candidates (voxel, spacing {:.3} m), support radius {radius:.3} m; of the reachable \
                 surfaces {} are under a probe's support, by {overlap:.1} on average, and {} are seen by a probe; {seconds:.1} s",
                self.output.display(),
                params.spacing,
                percent(supported),
                percent(seen),
            ),
            figures: json!({
                "method": Placement::Voxel, "count": count, "candidates": candidates, "spacing": params.spacing, "radius": radius,
                "overlap": overlap, "supported": supported, "before": before, "seen": seen, "seconds": seconds,
                "bounds": [lower.to_array(), upper.to_array()],
            }),
            ..Outcome::default()
        }
    }
}
