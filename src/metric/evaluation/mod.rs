//! Methods against one reference: `evaluation.json`, the tables of §7.3 in Markdown, and a page to look at.

mod columns;
mod markdown;
mod page;
mod pictures;

pub use markdown::markdown;
pub use page::html;
pub use pictures::{Detail, Gallery, Pictures, Shown};

use super::Metrics;
use super::without_noise::WithoutNoise;
use crate::io::Provenance;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// `evaluation.json`: the errors of all methods. It holds no times, so that the same inputs give the same bytes.
#[derive(Debug, Clone, Serialize)]
pub struct Evaluation {
    /// Name of the scene, for people.
    pub scene: String,
    /// Name of the camera path.
    pub path: String,
    /// Width and height of the frames, pixels.
    pub size: [usize; 2],
    /// What the reference is.
    pub reference: String,
    /// Stops by which radiance is brightened for the display.
    pub exposure: f32,
    /// Names of the frames, in order.
    pub frames: Vec<String>,
    /// Frames a second of the camera path; `None` where it does not say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fps: Option<f64>,
    /// Layers that were compared: `glossy`, `full`.
    pub layers: Vec<String>,
    /// The methods, in the order asked for.
    pub methods: Vec<MethodErrors>,
    /// Where the numbers came from.
    pub provenance: Provenance,
}

/// One method, or a variant of one.
#[derive(Debug, Clone, Serialize)]
pub struct MethodErrors {
    /// Its name in the tables.
    pub name: String,
    /// `--method` of `render-path`.
    pub method: String,
    /// What differs from that method's defaults.
    pub options: Vec<String>,
    /// The experiment that it belongs to; `None` for a method in its own right.
    pub ablation: Option<Ablation>,
    /// Errors by layer.
    pub layers: BTreeMap<String, LayerErrors>,
}

/// What leaving something out, or doing it otherwise, is compared with.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ablation {
    /// Where the paper shows it, like `Fig. 13`.
    pub figure: String,
    /// What was changed.
    pub what: String,
    /// Name of the method that it is compared with.
    pub against: String,
}

/// Errors of one layer.
#[derive(Debug, Clone, Serialize)]
pub struct LayerErrors {
    /// Means over frames.
    pub mean: FrameErrors,
    /// In order of [`Evaluation::frames`].
    pub frames: Vec<FrameErrors>,
}

/// Errors of one frame.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FrameErrors {
    /// Errors of the frame.
    #[serde(flatten)]
    pub metrics: Metrics,
    /// Change of the error since the frame before ([`crate::metric::temporal`]); `None` where that frame is not there.
    pub change: Option<f64>,
    /// Errors without the reference's noise, where there are two references.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_noise: Option<Clean>,
}

/// Where [`FrameErrors::without_noise`] stands in `evaluation.json`.
const WITHOUT_NOISE: &str = "without_noise";

/// Errors of one frame without the reference's noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Clean {
    /// Errors of the frame, as `compare` tells them.
    #[serde(flatten)]
    pub errors: WithoutNoise,
    /// Change of the error since the frame before ([`crate::metric::temporal::change_rms`]); `None` where that frame is not there.
    pub change_rms: Option<f64>,
}

impl LayerErrors {
    /// With the means of `frames`.
    pub fn new(frames: Vec<FrameErrors>) -> Self {
        let metrics: Vec<Metrics> = frames.iter().map(|f| f.metrics).collect();
        let clean: Option<Vec<Clean>> = frames.iter().map(|f| f.without_noise).collect();
        let without_noise = clean.map(|clean| Clean {
            errors: WithoutNoise::mean(&clean.iter().map(|c| c.errors).collect::<Vec<_>>()),
            change_rms: mean(clean.iter().filter_map(|c| c.change_rms)),
        });
        let change = mean(frames.iter().filter_map(|f| f.change));
        Self { mean: FrameErrors { metrics: Metrics::mean(&metrics), change, without_noise }, frames }
    }
}

/// `None` of nothing.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// What the methods cost. Kept apart from [`Evaluation`], as no two runs take the same time.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Costs {
    /// Stages that made the bakes, in order.
    pub stages: Vec<StageCost>,
    /// By method's name.
    pub methods: BTreeMap<String, MethodCost>,
}

/// One stage of the precomputation.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StageCost {
    /// The command, as a person would type it.
    pub command: String,
    /// The subcommand.
    pub stage: String,
    /// Names of the methods that use its output.
    pub methods: Vec<String>,
    /// Seconds: those of the longest run, where it was stopped and continued; `None` where the output was there before.
    pub seconds: Option<f64>,
}

/// What a method's frames cost.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct MethodCost {
    /// Mean milliseconds of each pass that makes the picture.
    pub passes_ms: BTreeMap<String, f64>,
    /// Their sum.
    pub frame_ms: f64,
    /// Seconds of its stages; `None` where some were not run here.
    pub precompute_seconds: Option<f64>,
    /// Its probes.
    pub probes: Option<ProbeCost>,
    /// What the noise was taken out by; `None` for nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoiser: Option<String>,
}

/// A set of probes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ProbeCost {
    /// Probes that are not blocked.
    pub count: usize,
    /// Those that were baked: all, or those that the views use.
    pub baked: usize,
    /// Width and height of a probe, texels.
    pub size: [u32; 2],
    /// Memory that the baked ones take, bytes.
    pub bytes: u64,
}

impl Evaluation {
    /// Methods in their own right.
    pub fn contenders(&self) -> impl Iterator<Item = &MethodErrors> {
        self.methods.iter().filter(|m| m.ablation.is_none())
    }

    /// The method of a name.
    pub fn method(&self, name: &str) -> Option<&MethodErrors> {
        self.methods.iter().find(|m| m.name == name)
    }

    /// Methods that are not what their name says alone: the name, the method, what differs from its defaults, and which denoiser it was.
    pub fn variants(&self, costs: &Costs) -> Vec<String> {
        let line = |m: &MethodErrors| {
            let denoiser = costs.methods.get(&m.name).and_then(|c| c.denoiser.as_ref());
            let by = denoiser.map_or(String::new(), |d| format!(", denoised by {d}"));
            format!("{}: {}{by}", m.name, [std::slice::from_ref(&m.method), &m.options[..]].concat().join(", "))
        };
        self.contenders().filter(|m| m.name != m.method || !m.options.is_empty()).map(line).collect()
    }

    /// What the numbers of a layer say, in sentences: who is best, by how much, and in how many frames.
    pub fn verdict(&self, layer: &str, costs: &Costs) -> Vec<String> {
        let contenders: Vec<_> = self.contenders().filter_map(|m| Some((m, m.layers.get(layer)?))).collect();
        if contenders.len() < 2 {
            return Vec::new();
        }
        let mut lines = Vec::new();
        for column in self.judging() {
            let mut order: Vec<_> = contenders.iter().filter_map(|(m, l)| Some((*m, *l, (column.of)(&l.mean)?))).collect();
            order.sort_by(|a, b| a.2.total_cmp(&b.2));
            let [(best, best_layer, error), (second, _, next), ..] = order[..] else { continue };
            let of = |l: &LayerErrors, frame: usize| (column.of)(&l.frames[frame]);
            let frames: Vec<usize> = (0..self.frames.len()).filter(|&f| of(best_layer, f).is_some()).collect();
            let wins = frames.iter().filter(|&&f| contenders.iter().all(|(_, l)| of(best_layer, f) <= of(l, f))).count();
            let what = match column.is_change() {
                true => "The error changes least from frame to frame with".to_owned(),
                false => format!("Least {}:", column.name),
            };
            lines.push(format!(
                "{what} {}, {}, before {}, {}; best in {wins} of {} frames.",
                best.name,
                number(error),
                second.name,
                number(next),
                frames.len()
            ));
        }
        if let Some(noise) = self.noise(layer) {
            lines.push(format!("The reference's own noise is {} by RMSE RGB.", number(noise)));
        }
        let time = |m: &MethodErrors| costs.methods.get(&m.name).map(|c| c.frame_ms).filter(|&ms| ms > 0.0);
        let mut times: Vec<_> = contenders.iter().filter_map(|(m, _)| Some((time(m)?, &m.name))).collect();
        times.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let [(fast, name), .., (slow, last)] = times[..] {
            lines.push(format!("Fastest: {name}, {fast:.0} ms a frame; slowest: {last}, {slow:.0} ms."));
        }
        lines
    }
}

/// Four decimals, without the zero before the point, as the paper's tables have them.
pub(crate) fn number(x: f64) -> String {
    let text = format!("{x:.4}");
    text.strip_prefix('0').map_or(text.clone(), str::to_owned)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn frame(rmse: f64, change: Option<f64>) -> FrameErrors {
        let metrics = Metrics { rmse_rgb: rmse, dssim_rgb: 2.0 * rmse, ..Metrics::default() };
        FrameErrors { metrics, change, without_noise: None }
    }

    /// Two methods and an ablation over two frames.
    pub fn example() -> (Evaluation, Costs) {
        let method = |name: &str, ablation: Option<Ablation>, rmse: [f64; 2]| MethodErrors {
            name: name.into(),
            method: "glossy-probes".into(),
            options: Vec::new(),
            ablation,
            layers: [("glossy".to_owned(), LayerErrors::new(vec![frame(rmse[0], None), frame(rmse[1], Some(0.01))]))].into(),
        };
        let ablation = Ablation { figure: "Fig. 14".into(), what: "one probe".into(), against: "ours".into() };
        let evaluation = Evaluation {
            scene: "room".into(),
            path: "walk".into(),
            size: [8, 4],
            reference: "path-trace".into(),
            exposure: 0.0,
            frames: vec!["0000".into(), "0001".into()],
            fps: None,
            layers: vec!["glossy".into()],
            methods: vec![
                method("ours", None, [0.02, 0.04]),
                method("</script>theirs", None, [0.01, 0.08]),
                method("one-probe", Some(ablation), [0.05, 0.07]),
            ],
            provenance: Provenance::new("evaluate", "", 0, &serde_json::json!({})),
        };
        let probes = ProbeCost { count: 12, baked: 9, size: [256, 128], bytes: 9 << 20 };
        let cost = MethodCost {
            passes_ms: [("gather".to_owned(), 30.0), ("filter".to_owned(), 12.0)].into(),
            frame_ms: 42.0,
            precompute_seconds: Some(61.0),
            probes: Some(probes),
            denoiser: None,
        };
        let stage = StageCost {
            command: "reprobe curvature".into(),
            stage: "curvature".into(),
            methods: vec!["ours".into()],
            seconds: Some(61.0),
        };
        (evaluation, Costs { stages: vec![stage], methods: [("ours".to_owned(), cost)].into() })
    }

    /// The same with two references, of whose noise half of every error was: but for the second method, which has none else.
    pub fn with_pair() -> Evaluation {
        let (mut evaluation, _) = example();
        for (i, method) in evaluation.methods.iter_mut().enumerate() {
            for layer in method.layers.values_mut() {
                let of = |f: &FrameErrors| {
                    let share = if i == 1 { 0.1 } else { 0.5 };
                    let errors =
                        WithoutNoise { rmse_rgb: share * f.metrics.rmse_rgb, noise_rmse_rgb: 0.005, ..WithoutNoise::default() };
                    let clean = Clean { errors, change_rms: f.change.map(|c| share * c) };
                    FrameErrors { without_noise: Some(clean), ..*f }
                };
                *layer = LayerErrors::new(layer.frames.iter().map(of).collect());
            }
        }
        evaluation
    }

    #[test]
    fn the_verdict_goes_by_what_is_clean() {
        let (_, costs) = example();
        let lines = with_pair().verdict("glossy", &costs);
        assert_eq!(lines[0], "Least clean RMSE RGB: </script>theirs, .0045, before ours, .0150; best in 2 of 2 frames.");
        assert!(lines.contains(&"The reference's own noise is .0050 by RMSE RGB.".to_owned()), "{lines:?}");
        assert!(lines[3].ends_with("theirs, .0010, before ours, .0050; best in 1 of 1 frames."), "{lines:?}");
    }

    #[test]
    fn the_mean_of_the_change_is_over_frames_that_have_one() {
        let (evaluation, _) = example();
        let mean = evaluation.methods[0].layers["glossy"].mean;
        assert!((mean.metrics.rmse_rgb - 0.03).abs() < 1e-12);
        assert_eq!(mean.change, Some(0.01));
        assert_eq!(LayerErrors::new(vec![frame(0.1, None)]).mean.change, None);
    }

    #[test]
    fn the_verdict_names_the_best_and_in_how_many_frames() {
        let (evaluation, costs) = example();
        let lines = evaluation.verdict("glossy", &costs);
        assert_eq!(lines[0], "Least RMSE RGB: ours, .0300, before </script>theirs, .0450; best in 1 of 2 frames.");
        assert!(evaluation.verdict("full", &costs).is_empty());
    }

    #[test]
    fn json_has_errors_and_no_times() {
        let (evaluation, _) = example();
        let json = serde_json::to_value(&evaluation).unwrap();
        let glossy = &json["methods"][0]["layers"]["glossy"];
        for key in ["rmse_rgb", "rmse_lum", "dssim_rgb", "dssim_lum", "flip", "change"] {
            assert!(glossy["mean"][key].is_number() && glossy["frames"][1][key].is_number(), "{key}");
        }
        assert!(glossy["mean"].get(WITHOUT_NOISE).is_none());
        assert!(!json.to_string().contains("_ms"));
    }
}
