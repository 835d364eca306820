//! `timings.json`: milliseconds a pass and frame, and memory. Kept apart from the frames, whose bits must not depend on it.

use crate::base::clock::timed;
use crate::base::simd::Lanes;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// What a run took.
#[derive(Serialize, Deserialize, Default)]
pub struct Timings {
    /// `--method`.
    pub method: String,
    /// Worker threads.
    pub threads: usize,
    /// Instruction set that the CPU's lanes were of ([`Lanes::name`]).
    #[serde(default)]
    pub simd: String,
    /// The GPU that frames were made on; `None` for the CPU.
    pub device: Option<String>,
    /// Whose clock the passes on the GPU were timed by: "gpu", or "cpu" for the host's, which includes handing them over.
    pub clock: String,
    /// What the noise was taken out by; `None` for nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoiser: Option<String>,
    /// Frames a second of the camera path, or of what changes in the scene; `None` where neither says. What `video` reads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fps: Option<f64>,
    /// Scene loading, milliseconds.
    pub load_ms: f64,
    /// Acceleration structures, milliseconds.
    pub build_ms: f64,
    /// Frames in order.
    pub frames: Vec<FrameTimings>,
    /// Mean of each pass over the frames whose times are known, milliseconds.
    pub mean_ms: BTreeMap<String, f64>,
    /// Milliseconds a frame: the sum of `mean_ms` but for loading, auxiliary layers and writing. What `--match-time` reads.
    pub frame_ms: f64,
    /// Samples of the method (a pixel's paths, rays or taps), given or chosen; `None` for methods without.
    pub samples: Option<u32>,
    /// Milliseconds a frame for which `samples` was chosen.
    pub budget_ms: Option<f64>,
    /// Most memory that probes took at once, bytes; 0 for methods without them.
    pub probe_memory_bytes: u64,
    /// Most memory that probes took at once on the GPU, bytes.
    pub gpu_probe_memory_bytes: u64,
    /// Most memory that the process has held, bytes; `None` where the system does not say.
    pub peak_memory_bytes: Option<u64>,
}

/// What a frame took.
#[derive(Serialize, Deserialize, Default)]
pub struct FrameTimings {
    /// File name.
    pub name: String,
    /// An earlier run had finished it.
    pub kept: bool,
    /// Share of sub-pixels that neither a probe nor the frame before served; `None` for methods without probes.
    pub unserved_fraction: Option<f64>,
    /// What else the method counts, by name: shading points, say.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub counts: BTreeMap<String, f64>,
    /// Milliseconds of each pass, in the run that rendered the frame.
    pub passes_ms: BTreeMap<String, f64>,
}

impl Timings {
    /// Of a method, on the CPU, with nothing timed as yet.
    pub fn of(method: &str) -> Self {
        Self {
            method: method.into(),
            threads: rayon::current_num_threads(),
            simd: Lanes::chosen().name().into(),
            clock: "cpu".into(),
            ..Self::default()
        }
    }

    /// Notes the bytes that probes take, in the host's memory and on the GPU, where they are the most so far.
    pub fn note_probes(&mut self, [host, gpu]: [u64; 2]) {
        self.probe_memory_bytes = self.probe_memory_bytes.max(host);
        self.gpu_probe_memory_bytes = self.gpu_probe_memory_bytes.max(gpu);
    }

    /// Notes the GPU that frames are made on, and whether its own clock times their passes.
    pub fn on_gpu(&mut self, device: &str, has_clock: bool) {
        self.device = Some(device.to_owned());
        self.clock = if has_clock { "gpu" } else { "cpu" }.into();
    }

    /// Reads what [`Timings::finish`] led to; `None` where there is no such file.
    pub fn read(path: &Path) -> Option<Self> {
        crate::io::json::parse(path, &std::fs::read_to_string(path).ok()?).ok()
    }

    /// Fills in the means and the memory; frames that were kept have the times that the `earlier` file tells of them.
    pub fn finish(&mut self, earlier: &Path) {
        let written = |path: &Path| path.metadata().and_then(|m| m.modified()).ok();
        if let Some(found) = self.frames.iter().any(|f| f.kept).then(|| Self::read(earlier)).flatten() {
            self.probe_memory_bytes = self.probe_memory_bytes.max(found.probe_memory_bytes);
            for before in found.frames {
                // A frame newer than the file is of a run that was stopped before it could write its times.
                let known = written(&earlier.with_file_name(&before.name)) <= written(earlier);
                if let Some(frame) = self.frames.iter_mut().find(|f| known && f.kept && f.name == before.name) {
                    *frame = FrameTimings { kept: true, ..before };
                }
            }
        }
        let mut sums = BTreeMap::<String, (f64, u32)>::new();
        for (pass, ms) in self.frames.iter().flat_map(|f| &f.passes_ms) {
            let (sum, count) = sums.entry(pass.clone()).or_default();
            *sum += ms;
            *count += 1;
        }
        self.mean_ms = sums.into_iter().map(|(pass, (sum, count))| (pass, sum / f64::from(count))).collect();
        self.frame_ms = frame_ms(&self.mean_ms);
        self.peak_memory_bytes = peak_memory();
    }
}

/// Milliseconds of a frame's passes, without what is no part of rendering it.
pub fn frame_ms(passes_ms: &BTreeMap<String, f64>) -> f64 {
    passes_ms.iter().filter(|(pass, _)| is_rendering(pass)).map(|(_, ms)| ms).sum()
}

/// Whether a pass is part of rendering a frame.
pub fn is_rendering(pass: &str) -> bool {
    !["load", "aov", "write"].contains(&pass)
}

impl FrameTimings {
    /// Notes passes that were timed where they ran.
    pub fn passes(&mut self, passes: &[(&'static str, f64)]) {
        self.passes_ms.extend(passes.iter().map(|&(pass, ms)| (pass.into(), ms)));
    }

    /// Runs a pass and notes its time.
    pub fn pass<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let (result, ms) = timed(work);
        self.passes_ms.insert(name.into(), ms);
        result
    }
}

/// High-water mark of the resident set, from Linux's `/proc`.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
