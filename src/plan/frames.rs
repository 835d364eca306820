//! The loop over a path's frames, for every method: kept frames, equal time, layers, timings.

use super::budget::Budget;
use super::timings::{FrameTimings, Timings};
use super::{Context, Outcome};
use crate::Result;
use crate::base::clock::timed;
use crate::base::progress::{Progress, Silent};
use crate::io::jobs::{Done, Shard, is_finished};
use crate::io::provenance::hash_of;
use crate::io::{ExrImage, Provenance, json};
use crate::method::{Frame, Method, Renderer, Setup};
use crate::scene::Camera;
use crate::scene::camera::ALL_DEPTHS;
use crate::view::View;
use crate::view::aov::with_first_hits;
use serde_json::{Value, json};
use std::path::Path;

/// Frames that are rendered to find the sample count of a budget.
const PILOTS: usize = 3;

/// Frames of one method.
pub struct Frames<'a> {
    /// The method.
    pub method: &'a Method,
    /// What they are made of.
    pub setup: &'a Setup<'a>,
    /// Where they come from; the parameters are filled in.
    pub provenance: Provenance,
    /// Their folder.
    pub output: &'a Path,
    /// A run of them, which this run renders alone.
    pub shard: Option<Shard>,
    /// How long they may take, where samples are chosen by that.
    pub budget: Option<Budget>,
    /// Makes the renderer, once there is something to render.
    pub make: &'a dyn Fn() -> Result<Box<dyn Renderer + 'a>>,
}

/// Renders the views that are not finished, of one shard or all, with the sample count that is given or that the budget allows.
pub fn render(frames: &Frames, cx: &Context, mut timings: Timings) -> Result<Outcome> {
    let mut renderer = None;
    timings.samples = frames.method.count(frames.setup.parameters);
    if let Some(budget) = &frames.budget {
        timings.budget_ms = Some(budget.ms);
        let renderer = made(&mut renderer, frames, &mut timings)?;
        timings.samples = Some(choose_samples(frames.setup.views, renderer, budget)?);
        // Before the frames are rendered with it, so that a run that is stopped can be repeated.
        json::write(&frames.output.join("timings.json"), &timings)?;
    }
    let samples = timings.samples.unwrap_or(1);
    let parameters = frames.method.with_samples(frames.setup.parameters, samples);
    let views = frames.setup.views;
    let mine = frames.shard.map_or(0..views.len(), |shard| shard.run(views.len()));
    let (mut last, mut missing) = (None, 0);
    let progress = cx.progress();
    progress.start(frames.method.name, views.iter().map(|v| u64::from(v.camera.size[1])).sum());
    for (i, (view, provenance)) in views.iter().zip(frames.provenance(&parameters)).enumerate() {
        let kept = is_finished(&frames.output.join(name(view)), &provenance);
        let mut times = FrameTimings { name: name(view), kept, ..FrameTimings::default() };
        if kept || !mine.contains(&i) {
            progress.advance(view.camera.size[1].into());
        }
        if !kept && !mine.contains(&i) {
            missing += 1;
            continue;
        }
        if !kept {
            let renderer = made(&mut renderer, frames, &mut timings)?;
            let frame = match frames.method.sequential && (last.is_none() || last != i.checked_sub(1)) {
                false => renderer.frame(view, views.get(i + 1), samples, progress)?,
                true => after_those_before(renderer, views, i, samples, progress)?,
            };
            last = Some(i);
            timings.note_probes(renderer.probe_bytes());
            times.passes(&frame.passes);
            times.unserved_fraction = frame.unserved.map(|n| n as f64 / frames.sub_pixels(view));
            times.counts = frame.counts.iter().map(|&(what, count)| (what.into(), count)).collect();
            let image = times.pass_if(frames.setup.inspect, "aov", || frames.image(&frame, view));
            let path = frames.output.join(&times.name);
            times.pass("write", || image.with_provenance(provenance).write(&path))?;
        }
        let passes: Vec<String> = times.passes_ms.iter().map(|(pass, ms)| format!("{pass} {ms:.1}")).collect();
        let what = if kept { "finished already".into() } else { format!("milliseconds: {}", passes.join(", ")) };
        cx.listener.detail(&format!("{}: {what}", times.name));
        timings.frames.push(times);
    }
    progress.finish();
    finish(timings, missing, frames.output)
}

/// View `i` of a method whose frames may depend on those before them, rendered after as many of these as matter: none where every
/// pixel is served, since a pixel that is not takes its colour from the frame before.
fn after_those_before(
    renderer: &mut dyn Renderer,
    views: &[View],
    i: usize,
    samples: u32,
    progress: &dyn Progress,
) -> Result<Frame> {
    let mut progress = Some(progress);
    let mut first = i;
    let mut frame = loop {
        renderer.forget();
        let frame = renderer.frame(&views[first], views.get(first + 1), samples, progress.take().unwrap_or(&Silent))?;
        if first == 0 || frame.unserved == Some(0) {
            break frame;
        }
        first -= 1;
    };
    for later in first + 1..=i {
        frame = renderer.frame(&views[later], views.get(later + 1), samples, &Silent)?;
    }
    Ok(frame)
}

/// The renderer, made when it is first needed.
fn made<'r, 'a>(
    renderer: &'r mut Option<Box<dyn Renderer + 'a>>,
    frames: &Frames<'a>,
    timings: &mut Timings,
) -> Result<&'r mut (dyn Renderer + 'a)> {
    if renderer.is_none() {
        let new = (frames.make)()?;
        if let Some((device, has_clock)) = new.gpu() {
            timings.on_gpu(device, has_clock);
        }
        *renderer = Some(new);
    }
    renderer.as_deref_mut().ok_or_else(|| crate::Error::Request("no renderer".into()))
}

fn name(view: &View) -> String {
    format!("{:04}.exr", view.frame)
}

/// The count whose frames take as long as the budget allows, by frames of three views.
fn choose_samples(views: &[View], renderer: &mut dyn Renderer, budget: &Budget) -> Result<u32> {
    let pilots: Vec<&View> = (0..PILOTS.min(views.len())).map(|i| &views[i * views.len() / PILOTS.min(views.len())]).collect();
    let mut time = |count: u32| {
        let mut sum = 0.0;
        for view in &pilots {
            let mut times = FrameTimings::default();
            times.passes(&renderer.frame(view, None, count, &Silent)?.passes);
            sum += super::timings::frame_ms(&times.passes_ms);
        }
        Ok(sum / pilots.len() as f64)
    };
    budget.choose(&mut time)
}

impl Frames<'_> {
    /// Where each view's frame comes from; of a method whose frames may depend on those before them, that of these, too.
    fn provenance(&self, parameters: &Value) -> Vec<Provenance> {
        let mut before = None;
        let mut of = |view| {
            let mut provenance = self.provenance_of(view, parameters);
            if self.method.sequential {
                if let Some(before) = before.take() {
                    provenance.parameters["before"] = Value::String(before);
                }
                before = Some(hash_of(provenance.parameters.to_string().as_bytes()));
            }
            provenance
        };
        self.setup.views.iter().map(&mut of).collect()
    }

    fn provenance_of(&self, view: &View, parameters: &Value) -> Provenance {
        let mut parameters = json!({
            "method": self.method.name, "frame": view.frame, "aov": self.setup.inspect, "camera": describe(&view.camera),
            "parameters": parameters,
        });
        if let Some(joined) = self.setup.diffuse {
            parameters["diffuse"] = json!({ "method": joined.method.name, "parameters": joined.parameters });
        }
        // What is seen, not what is lit by: no part of the scene's content.
        if self.setup.world.scene.hide_emitters {
            parameters["hide_emitters"] = true.into();
        }
        Provenance { parameters, ..self.provenance.clone() }
    }

    /// Rays through a view's pixels.
    fn sub_pixels(&self, view: &View) -> f64 {
        let supersample = self.setup.parameters["supersample"].as_u64().unwrap_or(1) as f64;
        view.camera.size.iter().map(|&s| f64::from(s) * supersample).product()
    }

    /// The frame, its layers, and the auxiliary ones.
    fn image(&self, frame: &Frame, view: &View) -> ExrImage {
        let [width, height] = view.camera.size.map(|n| n as usize);
        let mut image = frame.with_pictures(ExrImage::new(width, height));
        if self.setup.inspect {
            let of_frame = self.setup.world_at(view);
            image = with_first_hits(image, of_frame.as_ref().unwrap_or(self.setup.world), &view.camera);
        }
        if let Some(more) = &frame.inspected {
            image.channels.extend(more.channels.iter().cloned());
        }
        image
    }
}

/// The camera, as provenance keeps it.
fn describe(camera: &Camera) -> Value {
    let mut described = json!({
        "to_world": camera.to_world.to_cols_array(), "fov_x_rad": camera.fov_x, "size": camera.size,
        "aperture_radius": camera.aperture_radius, "focus_distance": camera.focus_distance,
    });
    // What few cameras have is said of those alone, so that the others' finished frames stay finished.
    if camera.shift != glam::Vec2::ZERO {
        described["shift"] = json!(camera.shift.to_array());
    }
    if camera.clip != ALL_DEPTHS {
        // Infinity is no number of JSON's.
        described["clip"] = json!(camera.clip.map(|depth| depth.to_string()));
    }
    if let Some(half) = camera.orthographic {
        described["orthographic"] = json!(half.to_array());
    }
    described
}

/// Writes `timings.json` and sums up the run.
fn finish(mut timings: Timings, missing: usize, output: &Path) -> Result<Outcome> {
    timings.finish(&output.join("timings.json"));
    json::write(&output.join("timings.json"), &timings)?;
    let kept = timings.frames.iter().filter(|f| f.kept).count();
    let count = timings.frames.len();
    let rest = Done { made: count - kept, kept, missing }.rest(" frames");
    let mean: f64 = timings.mean_ms.values().sum();
    let out = output.display();
    let summary = match kept {
        k if k == count => format!("{count} frames in {out} were finished already{rest}"),
        0 => format!("{count} frames in {out}, {mean:.0} ms a frame{rest}"),
        _ => format!("{count} frames in {out}, {kept} of them finished already, {mean:.0} ms a frame{rest}"),
    };
    let mut figures = serde_json::to_value(&timings).map_err(|e| crate::Error::Request(e.to_string()))?;
    figures["missing"] = missing.into();
    Ok(Outcome { summary, figures, check_failed: false })
}

impl FrameTimings {
    /// Runs a pass and notes its time, where `noted` holds.
    fn pass_if<T>(&mut self, noted: bool, name: &str, work: impl FnOnce() -> T) -> T {
        let (result, ms) = timed(work);
        if noted {
            self.passes_ms.insert(name.into(), ms);
        }
        result
    }
}
