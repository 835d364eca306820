//! `place-probes --method voxel`.

use super::{Ground, PlaceProbes, percent};
use crate::Result;
use crate::base::clock::seconds;
use crate::io::provenance::hash_file;
use crate::method::radiance_probes::round_trip::{load, norms};
use crate::method::radiance_probes::transport::sample;
use crate::plan::{Context, Outcome};
use crate::probe::nonuniform::{NonuniformParams, Reachable};
use crate::probe::placement::{Density, Placement};
use crate::probe::places::ProbeList;
use crate::probe::set::ProbeSet;
use crate::probe::sparse::{COUNT, Need, Sparse, SparseParams, place};
use crate::transport::World;
use serde_json::json;

/// Receivers that say where probes are needed.
const RECEIVERS: u32 = 4000;

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
        let needs = self.needs(cx, world)?;
        let placed = place(world, &reachable, &params, &needs, cx.progress())?;
        if placed.positions.len() < params.count as usize {
            let (wanted, count) = (params.count, placed.positions.len());
            cx.listener.warn(&format!("{wanted} probes were asked for: the scene has places for {count} only"));
        }
        let list = ProbeList {
            method: Placement::Voxel,
            positions: placed.positions.iter().map(|p| p.to_array()).collect(),
            radius: Some(placed.radius),
            provenance: match &self.refine_by {
                Some(folder) => self
                    .provenance(cx, world, ground, json!({ "sparse": params }))
                    .with_input("transport", hash_file(&ProbeSet::path(folder))?),
                None => self.provenance(cx, world, ground, json!({ "sparse": params })),
            },
        };
        list.write(&self.output)?;
        let seconds = clock();
        let times = reachable.sides.times_seen(&placed.rows);
        self.draw(cx, world, (ground, &reachable), (&placed.positions, &times, &list.provenance))?;
        Ok(self.report(ground, &params, &placed, seconds))
    }

    /// What a transport of other probes loses at receivers, on the way to them and back (§5.2).
    fn needs(&self, cx: &Context, world: &World) -> Result<Vec<Need>> {
        let Some(folder) = &self.refine_by else { return Ok(Vec::new()) };
        let transport = load(folder, &world.scene)?;
        let receivers = sample(transport.receivers.len(), RECEIVERS);
        cx.listener.detail(&format!("what {} receivers lose on the way to the probes of {}", receivers.len(), folder.display()));
        let norms = norms(world, &transport, &receivers);
        Ok(receivers.iter().map(|&r| transport.place(world, r)).zip(norms).collect())
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
