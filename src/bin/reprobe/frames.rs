//! The loop over a path's frames that all methods but glossy-probes share: kept frames, equal time, layers, timings.

use crate::budget;
use crate::common::{Common, Outcome};
use crate::render_path::{Args, describe, finish, is_finished};
use crate::timings::{FrameTimings, Timings, frame_ms};
use crate::views::View;
use anyhow::bail;
use reprobe::base::progress::{Progress, Silent};
use reprobe::io::{ExrImage, Provenance};
use reprobe::transport::World;
use reprobe::view::aov::with_first_hits;
use reprobe::view::layers::LayerImages;
use serde_json::{Value, json};

/// Frames that are rendered to find the sample count of a budget.
const PILOTS: usize = 3;
/// Largest sample count that a budget may choose.
const MOST_SAMPLES: u32 = 1 << 16;

/// A method that renders each frame by itself.
pub struct Method<'a> {
    /// The scene as it sees it.
    pub world: &'a World,
    /// Where its frames come from; the parameters are filled in.
    pub provenance: Provenance,
    /// The sample count that the command line gives; `None` for a method without one.
    pub samples: Option<u32>,
    /// Its parameters with a sample count, as provenance keeps them.
    pub parameters: &'a dyn Fn(u32) -> Value,
    /// Renders a view with a sample count into an empty image; advances the progress by the view's rows.
    pub render: Render<'a>,
}

type Render<'a> = &'a mut dyn FnMut(&View, u32, ExrImage, &mut FrameTimings, &dyn Progress) -> anyhow::Result<ExrImage>;

/// Renders the views that are not finished, with the sample count that is given or that the budget allows.
pub fn render(args: &Args, common: &Common, mut timings: Timings, views: &[View], method: Method) -> anyhow::Result<Outcome> {
    let Method { world, provenance, mut samples, parameters, render } = method;
    let empty = |v: &View| ExrImage::new(v.camera.size[0] as usize, v.camera.size[1] as usize);
    timings.budget_ms = budget::budget_ms(args, common)?;
    if let Some(ms) = timings.budget_ms {
        if samples.is_none() {
            bail!("--method {} has no sample count that a budget could choose; set --supersample", timings.method);
        }
        let pilots: Vec<&View> =
            (0..PILOTS.min(views.len())).map(|i| &views[i * views.len() / PILOTS.min(views.len())]).collect();
        let mut time = |count: u32| {
            let mut sum = 0.0;
            for view in &pilots {
                let mut times = FrameTimings::default();
                render(view, count, empty(view), &mut times, &Silent)?;
                sum += frame_ms(&times.passes_ms);
            }
            Ok(sum / pilots.len() as f64)
        };
        samples = Some(budget::choose(ms, MOST_SAMPLES, &mut time)?);
        timings.samples = samples;
        budget::record(&timings, &args.output)?;
    }
    timings.samples = samples;
    let count = samples.unwrap_or(1);
    let bar = common.progress();
    bar.start(&timings.method, views.iter().map(|v| u64::from(v.camera.size[1])).sum());
    for view in views {
        let View { frame, camera } = view;
        let mut times = FrameTimings { name: format!("{frame:04}.exr"), ..FrameTimings::default() };
        let path = args.output.join(&times.name);
        let mut of_frame = json!({
            "method": timings.method, "frame": frame, "aov": args.aov.is_some(), "camera": describe(camera),
        });
        if let (Value::Object(all), Value::Object(own)) = (&mut of_frame, parameters(count)) {
            all.extend(own);
        }
        let provenance = Provenance { parameters: of_frame, ..provenance.clone() };
        if is_finished(&path, &provenance) {
            times.kept = true;
            bar.advance(u64::from(camera.size[1]));
        } else {
            let mut image = render(view, count, empty(view).with_provenance(provenance), &mut times, &bar)?;
            if args.aov.is_some() {
                image = times.pass("aov", || with_first_hits(image, world, camera));
            }
            times.pass("write", || image.write(&path))?;
        }
        timings.frames.push(times);
    }
    bar.finish();
    finish(timings, &args.output)
}

/// The frame and its layers.
pub fn with_layers(image: ExrImage, layers: &LayerImages) -> ExrImage {
    image
        .with_rgb("", &layers.full())
        .with_rgb("emission", &layers.emission)
        .with_rgb("diffuse", &layers.diffuse)
        .with_rgb("glossy", &layers.glossy)
}
