//! `inspect-transport`.

use crate::base::named::within;
use crate::io::{Provenance, json, png};
use crate::method::radiance_probes::inspect::draw;
use crate::method::radiance_probes::round_trip::{load, norms};
use crate::method::radiance_probes::transport::sample;
use crate::plan::option::stage;
use crate::plan::views::views;
use crate::plan::{Context, Outcome};
use crate::probe::store::set_hash;
use crate::scene::Camera;
use crate::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

stage! {
    /// Draws where radiance probes lose light.
    InspectTransport "inspect-transport"
    {
        /// The scene.
        scene,
    }
    {
        /// The operator.
        "--probes" probes: PathBuf,
        /// About how many receivers are asked.
        "--receivers" receivers: Option<u32>,
        /// The camera path.
        "--path" path: Option<PathBuf>,
        /// Frame of it.
        "--frame" frame: Option<u32>,
        /// The norm of each of these receivers, JSON.
        "--table" table: Option<PathBuf>,
        /// The picture to write.
        "--output" output: PathBuf,
    }
}

/// The stage that the operator comes from.
const TRANSPORT: &str = "bake-transport";
/// Receivers that are asked where nothing else is said.
pub const RECEIVERS: u32 = 8000;

impl InspectTransport {
    /// Refuses what is out of range.
    pub fn check(&self) -> Result<()> {
        png::check_png(&self.output)?;
        within("--receivers", self.receivers.unwrap_or(RECEIVERS), 1..=1 << 26)
    }

    /// Reads, asks, draws.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        self.check()?;
        let world = cx.opaque_world(&self.scene)?;
        let transport = load(&self.probes, &world.scene)?;
        let views = views(&world.scene, self.path.as_deref(), None, None)?;
        let number = self.frame.unwrap_or(0) as usize;
        let Some(view) = views.get(number) else {
            return Err(Error::Request(format!("--frame {number}: the path has frames 0 to {}", views.len() - 1)));
        };
        let receivers = sample(transport.receivers.len(), self.receivers.unwrap_or(RECEIVERS));
        let found = norms(&world, &transport, &receivers);
        let list: Vec<(u32, f32)> = receivers.into_iter().zip(found).collect();
        let provenance = self.provenance(cx, &world.scene.hash, &view.camera)?;
        draw(&world, &transport, &list, &view.camera).write(&self.output, &provenance)?;
        if let Some(table) = &self.table {
            let entry = |(r, norm): &(u32, f32)| {
                let (receiver, p) = (&transport.receivers[*r as usize], transport.place(&world, *r));
                json!({ "pixel": receiver.pixel, "back": receiver.back, "position": p.to_array(), "norm": norm })
            };
            json::write(table, &json!({ "receivers": list.iter().map(entry).collect::<Vec<_>>(), "provenance": provenance }))?;
        }
        let mut sorted: Vec<f32> = list.iter().map(|n| n.1).collect();
        sorted.sort_by(f32::total_cmp);
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
        let mean = sorted.iter().map(|&n| f64::from(n)).sum::<f64>() / sorted.len() as f64;
        Ok(Outcome {
            summary: format!(
                "{}: {} probes lose {mean:.3} of the light of {} texels on average, {:.3} of the median and {:.3} of the worst twentieth",
                self.output.display(),
                transport.probes.len(),
                sorted.len(),
                at(0.5),
                at(0.95),
            ),
            figures: json!({
                "probes": transport.probes.len(), "receivers": sorted.len(), "mean": mean, "median": at(0.5), "p95": at(0.95),
            }),
            ..Outcome::default()
        })
    }

    /// Where picture and table come from.
    fn provenance(&self, cx: &Context, scene: &str, camera: &Camera) -> Result<Provenance> {
        let parameters = json!({
            "receivers": self.receivers.unwrap_or(RECEIVERS), "to_world": camera.to_world.to_cols_array(), "fov_x_rad": camera.fov_x,
            "size": camera.size,
        });
        let provenance = Provenance::new(Self::COMMAND, scene, cx.seed, &parameters);
        Ok(provenance.with_input("probes", set_hash(&self.probes, TRANSPORT)?))
    }
}
