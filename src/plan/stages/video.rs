//! `video`.

use super::view::{STOPS, check_range, layer, refuse_idle};
use crate::base::named::within;
use crate::io::layer::{Kind, layers, most_telling};
use crate::io::picture::{self, Look, Picture};
use crate::io::provenance::{hash_file, hash_of};
use crate::io::video::{Ffmpeg, Format, Video as Encoder};
use crate::io::{ExrImage, Provenance};
use crate::plan::option::{List, stage};
use crate::plan::timings::Timings;
use crate::plan::{Context, Outcome};
use crate::{Error, Result};
use rayon::prelude::*;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;

stage! {
    /// Makes a video of frames.
    Video "video"
    {
        /// Folder of frames.
        frames,
    }
    {
        /// Frames a second; those of the camera path, or 24, without it.
        "--fps" fps: Option<f64>,
        /// The layer to show; the image, or the most telling one, without it.
        "--layer" layer: Option<String>,
        /// Stops by which colours are brightened.
        "--exposure" exposure: Option<f32>,
        /// What is dark and what is bright; what is so in the first frame, without it.
        "--range" range: Option<List<f32, 2, ','>>,
        /// Another folder of the same frames, to the right.
        "--beside" beside: Option<PathBuf>,
        /// The video to write.
        "--output" output: PathBuf,
    }
}

/// Frames a second where nothing else is said.
const FPS: f64 = 24.0;
/// Most frames that are read at once: each takes the memory of all its layers.
const AT_ONCE: usize = 8;

/// What is the same for all frames.
struct Shot<'a> {
    /// One folder, or two.
    folders: Vec<&'a Path>,
    layer: String,
    kind: Kind,
    legend: String,
    look: Look,
    /// Content hash of the scene, where the first frame says it.
    scene: String,
    /// Width and height of each folder's frames.
    sizes: Vec<[usize; 2]>,
}

impl Video {
    /// Refuses what is out of range.
    pub fn check(&self) -> Result<()> {
        Format::of(&self.output)?;
        within("--fps", self.fps.unwrap_or(FPS), 0.01..=1000.0)?;
        within("--exposure", self.exposure.unwrap_or(0.0), STOPS)?;
        check_range(self.range)
    }

    /// Reads the frames in order, draws them, and has them encoded.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        self.check()?;
        let frames = self.numbers(cx)?;
        let ffmpeg = Ffmpeg::find()?;
        let shot = self.shot(&frames[0].1)?;
        refuse_idle(self.exposure.is_some(), self.range.is_some(), std::iter::once(shot.kind))?;
        let of_path = || Timings::read(&self.frames.join("timings.json")).and_then(|t| t.fps);
        let fps = self.fps.or_else(of_path).unwrap_or(FPS);
        let provenance = self.provenance(cx, &shot, &frames, fps)?;
        self.encode(&shot, &frames, ffmpeg.start(&self.output, shot.size(), fps, &provenance)?, cx)?;
        let size = Format::of(&self.output)?.padded(shot.size());
        let (count, seconds) = (frames.len(), frames.len() as f64 / fps);
        let summary = format!(
            "{}: {count} frames of {} x {} at {fps} a second, {seconds:.1} s\n  {}: {}",
            self.output.display(),
            size[0],
            size[1],
            shot.layer,
            shot.legend
        );
        let figures = json!({
            "output": self.output, "frames": count, "size": size, "fps": fps, "seconds": seconds,
            "layer": shot.layer, "kind": shot.kind.to_string(), "legend": shot.legend,
        });
        Ok(Outcome { summary, figures, ..Outcome::default() })
    }

    /// The frames by their numbers; says which are missing between them.
    fn numbers(&self, cx: &Context) -> Result<Vec<(u64, String)>> {
        let frames = numbered(&self.frames)?;
        if let Some(beside) = &self.beside {
            let others = numbered(beside)?;
            let lacks =
                |here: &Path, there: &Path, name: &str| Error::input(here, format!("no {name}, which {} has", there.display()));
            if let Some((_, name)) = frames.iter().find(|f| !others.contains(f)) {
                return Err(lacks(beside, &self.frames, name));
            }
            if let Some((_, name)) = others.iter().find(|f| !frames.contains(f)) {
                return Err(lacks(&self.frames, beside, name));
            }
        }
        let (first, last) = (frames[0].0, frames[frames.len() - 1].0);
        let missing = last - first + 1 - frames.len() as u64;
        if missing > 0 {
            let folder = self.frames.display();
            cx.listener
                .warn(&format!("{folder} has {} of the frames {first} to {last}: the video leaves out {missing}", frames.len()));
        }
        Ok(frames)
    }

    /// Where the video comes from: what is shown of which frames.
    fn provenance(&self, cx: &Context, shot: &Shot, frames: &[(u64, String)], fps: f64) -> Result<Provenance> {
        let parameters = json!({
            "layer": shot.layer, "legend": shot.legend, "fps": fps, "frames": frames.iter().map(|(number, _)| number).collect::<Vec<_>>(),
        });
        let provenance = Provenance::new(Self::COMMAND, &shot.scene, cx.seed, &parameters);
        shot.folders.iter().zip(["frames", "beside"]).try_fold(provenance, |provenance, (folder, role)| {
            let hashes = frames.par_iter().map(|(_, name)| hash_file(&folder.join(name))).collect::<Result<Vec<_>>>()?;
            Ok(provenance.with_input(role, hash_of(hashes.concat().as_bytes())))
        })
    }

    /// What the first frame says of all.
    fn shot(&self, name: &str) -> Result<Shot<'_>> {
        let folders: Vec<&Path> = std::iter::once(&self.frames).chain(&self.beside).map(PathBuf::as_path).collect();
        let path = folders[0].join(name);
        let image = ExrImage::read(&path)?;
        let all = layers(&image);
        let chosen = match &self.layer {
            Some(name) => layer(&path, &all, name)?,
            None => most_telling(&path, &all)?,
        };
        // Of one frame for all: with its own for each, what stays the same would flicker.
        let ranges = self.range.map(|r| [r.0; 3]).or_else(|| picture::ranges(chosen));
        let exposure = self.exposure.unwrap_or_else(|| picture::usual_exposure(&image));
        let look = Look { exposure, ranges };
        let Picture { layer, kind, legend, .. } = picture::draw(&image, chosen, &look);
        let mut sizes = vec![[image.width, image.height]];
        if let Some(beside) = folders.get(1) {
            let path = beside.join(name);
            let other = ExrImage::read(&path)?;
            if other.height != image.height {
                let message = format!(
                    "has {} x {} pixels, {} has {} x {}: expected one height",
                    other.width,
                    other.height,
                    folders[0].join(name).display(),
                    image.width,
                    image.height
                );
                return Err(Error::input(&path, message));
            }
            sizes.push([other.width, other.height]);
        }
        let scene = image.provenance.as_ref().map_or_else(String::new, |p| p.scene.clone());
        Ok(Shot { folders, layer, kind, legend, look, scene, sizes })
    }

    /// Frames are read in parallel, some at once, and handed over in order while the next ones are read.
    fn encode(&self, shot: &Shot, frames: &[(u64, String)], mut encoder: Encoder, cx: &Context) -> Result<()> {
        let progress = cx.progress();
        progress.start("video", frames.len() as u64);
        let at_once = rayon::current_num_threads().clamp(1, AT_ONCE);
        let (send, receive) = sync_channel::<Vec<Vec<u8>>>(1);
        let (read, written) = std::thread::scope(|scope| {
            let writer = scope.spawn(move || -> Result<Encoder> {
                for drawn in receive {
                    for rgb in drawn {
                        encoder.add(&rgb)?;
                        progress.advance(1);
                    }
                }
                Ok(encoder)
            });
            let read = || {
                for some in frames.chunks(at_once) {
                    let drawn = some.par_iter().map(|(_, name)| shot.frame(name)).collect::<Result<Vec<_>>>()?;
                    // Nobody takes it where the encoder has failed, and then that is the error.
                    if send.send(drawn).is_err() {
                        break;
                    }
                }
                Ok(())
            };
            let read: Result<()> = read();
            drop(send);
            (read, writer.join())
        });
        progress.finish();
        read?;
        written.map_err(|_| Error::input(&self.output, "the thread that hands frames to ffmpeg has died"))??.finish()
    }
}

impl Shot<'_> {
    fn size(&self) -> [usize; 2] {
        [self.sizes.iter().map(|s| s[0]).sum(), self.sizes[0][1]]
    }

    /// A frame's pixels.
    fn frame(&self, name: &str) -> Result<Vec<u8>> {
        let parts = self.folders.iter().zip(&self.sizes).map(|(folder, size)| self.part(&folder.join(name), *size));
        let parts = parts.collect::<Result<Vec<_>>>()?;
        let [_, height] = self.size();
        let rows = (0..height).flat_map(|y| parts.iter().zip(&self.sizes).map(move |(p, [w, _])| &p[3 * w * y..][..3 * w]));
        Ok(rows.flatten().copied().collect())
    }

    fn part(&self, path: &Path, size: [usize; 2]) -> Result<Vec<u8>> {
        let image = ExrImage::read(path)?;
        if [image.width, image.height] != size {
            let [w, h] = size;
            let message = format!("has {} x {} pixels: expected {w} x {h}, as the first frame", image.width, image.height);
            return Err(Error::input(path, message));
        }
        let all = layers(&image);
        let layer = layer(path, &all, &self.layer)?;
        if layer.kind != self.kind {
            let message = format!("layer \"{}\" holds {}: expected {}, as in the first frame", layer.name, layer.kind, self.kind);
            return Err(Error::input(path, message));
        }
        Ok(picture::draw(&image, layer, &self.look).rgb)
    }
}

/// A folder's frames `NNNN.exr`, by their numbers; at least one.
fn numbered(folder: &Path) -> Result<Vec<(u64, String)>> {
    let number = |path: &Path| {
        let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        let digits = path.file_stem()?.to_str()?;
        let is_number = is_exr && digits.bytes().all(|b| b.is_ascii_digit());
        is_number.then(|| digits.parse().ok().zip(path.file_name()?.to_str().map(str::to_owned))).flatten()
    };
    let mut frames = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        frames.extend(number(&entry.map_err(|e| Error::io(folder, e))?.path()));
    }
    frames.sort();
    if frames.is_empty() {
        return Err(Error::input(folder, "found no frame, expected EXR files NNNN.exr"));
    }
    if let Some(two) = frames.windows(2).find(|two| two[0].0 == two[1].0) {
        let message = format!("has both {} and {}: expected one frame of each number", two[0].1, two[1].1);
        return Err(Error::input(folder, message));
    }
    Ok(frames)
}
