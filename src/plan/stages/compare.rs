//! `compare`.

use crate::base::named::within;
use crate::io::provenance::hash_file;
use crate::io::{ExrImage, Provenance, atomic, json, png};
use crate::metric::report::{FrameMetrics, Picture, Report};
use crate::metric::without_noise::without_noise;
use crate::metric::{Metrics, Raster, compare, ssim, values};
use crate::plan::option::stage;
use crate::plan::views::FrameList;
use crate::plan::{Context, Outcome};
use crate::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};

stage! {
    /// Measures frames against their references.
    Compare "compare"
    {
        /// EXR file, or folder of frames.
        image,
        /// The reference.
        reference,
    }
    {
        /// The reference rendered again with another seed.
        "--second-reference" second_reference: Option<PathBuf>,
        /// Which frames of two folders; all, which must be the same ones, where it is not given.
        "--frames" frames: Option<FrameList>,
        /// Layer to compare.
        "--layer" layer: Option<String>,
        /// Stops by which radiance is brightened.
        "--exposure" exposure: Option<f32>,
        /// Fail where the mean RMSE over RGB is greater.
        "--max-rmse" max_rmse: Option<f64>,
        /// Fail where the mean DSSIM over RGB is greater.
        "--max-dssim" max_dssim: Option<f64>,
        /// Folder for the report.
        "--output" output: PathBuf,
    }
}

#[derive(Serialize)]
struct Parameters<'a> {
    layer: &'a str,
    exposure: f32,
}

/// A frame of both sides.
struct Pair {
    name: String,
    files: [PathBuf; 2],
}

/// A measured frame, and the content hashes of its image, its reference and the second reference.
type Measured = (FrameMetrics, Vec<String>);

impl Compare {
    fn layer(&self) -> &str {
        self.layer.as_deref().unwrap_or("full")
    }

    fn exposure(&self) -> f32 {
        self.exposure.unwrap_or(0.0)
    }

    /// Refuses what is out of range.
    pub fn check(&self) -> Result<()> {
        within("--exposure", self.exposure(), -32.0..=32.0)?;
        for (option, limit) in [("--max-rmse", self.max_rmse), ("--max-dssim", self.max_dssim)] {
            limit.map_or(Ok(()), |limit| within(option, limit, 0.0..=f64::MAX))?;
        }
        Ok(())
    }

    /// Reads, measures and draws all frames.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        self.check()?;
        atomic::sweep(&self.output.join("images"));
        let pairs = pairs(&self.image, &self.reference, self.frames.as_ref())?;
        let progress = cx.progress();
        progress.start("compare", pairs.len() as u64);
        let frames: Vec<Measured> = pairs
            .par_iter()
            .enumerate()
            .map(|(i, pair)| {
                let frame = self.frame(cx, i, pair);
                progress.advance(1);
                frame
            })
            .collect::<Result<_>>()?;
        progress.finish();

        let hash = |side: usize| {
            let all: String = frames.iter().map(|(_, hashes)| hashes[side].as_str()).collect();
            blake3::hash(all.as_bytes()).to_hex().to_string()
        };
        let provenance = self.provenance(cx, &(0..frames[0].1.len()).map(hash).collect::<Vec<_>>());
        let report = Report::new(frames.into_iter().map(|(frame, _)| frame).collect(), provenance);
        let [a, b] = [&self.image, &self.reference].map(|p| p.display().to_string());
        let page = self.output.join("index.html");
        atomic::write(&page, report.html([&a, &b])?.as_bytes())?;
        json::write(&self.output.join("metrics.json"), &report)?;
        Ok(self.outcome(&report, &page))
    }

    /// Where an output comes from, by the hashes of image, reference and second reference.
    fn provenance(&self, cx: &Context, hashes: &[String]) -> Provenance {
        let parameters = Parameters { layer: self.layer(), exposure: self.exposure() };
        let provenance = Provenance::new(Self::COMMAND, "", cx.seed, &parameters);
        let roles = ["image", "reference", "second-reference"].into_iter().zip(hashes);
        roles.fold(provenance, |p, (role, hash)| p.with_input(role, hash.clone()))
    }

    fn outcome(&self, report: &Report, page: &Path) -> Outcome {
        let Metrics { rmse_rgb, dssim_rgb, .. } = report.mean;
        let mut summary = report.table();
        let mut check_failed = false;
        for (name, value, limit) in [("RMSE", rmse_rgb, self.max_rmse), ("DSSIM", dssim_rgb, self.max_dssim)] {
            if let Some(limit) = limit {
                let failed = value.is_nan() || value > limit;
                let relation = if failed { "FAILED: greater than" } else { "ok: at most" };
                summary += &format!("{name} {value:.4} {relation} {limit}\n");
                check_failed |= failed;
            }
        }
        summary += &format!("see {}", page.display());
        Outcome {
            summary,
            figures: serde_json::json!({
                "mean": report.mean, "without_noise": report.without_noise, "frames": report.frames, "passed": !check_failed
            }),
            check_failed,
        }
    }

    /// Reads, measures and draws one frame.
    fn frame(&self, cx: &Context, index: usize, pair: &Pair) -> Result<Measured> {
        let [fa, fb] = &pair.files;
        let [a, b] = read_pair(fa, fb, self.layer())?;
        let comparison = compare(&a, &b, self.exposure());
        let mut files = vec![fa.clone(), fb.clone()];
        let mut frame = FrameMetrics { name: pair.name.clone(), metrics: comparison.metrics, without_noise: None };
        if let Some(second) = &self.second_reference {
            let fc = if second.is_dir() { second.join(fb.file_name().unwrap_or_default()) } else { second.clone() };
            let c = read_second((fb, &b), &fc, self.layer())?;
            frame.without_noise = Some(without_noise(&a, [&b, &c], self.exposure()));
            files.push(fc);
        }
        let hashes = files.iter().map(|f| hash_file(f)).collect::<Result<Vec<_>>>()?;
        let provenance = self.provenance(cx, &hashes);
        for picture in Picture::ALL {
            let path = self.output.join(picture.path(index));
            atomic::write(&path, &png::signed(&path, picture.png(&comparison)?, &provenance)?)?;
        }
        let values = values::script(index, [&a, &b], &comparison)?;
        atomic::write(&self.output.join(values::path(index)), values.as_bytes())?;
        Ok((frame, hashes))
    }
}

/// One layer (`full` for the image itself) of a frame and of its reference, fit to be compared.
pub fn read_pair(fa: &Path, fb: &Path, layer: &str) -> Result<[Raster; 2]> {
    let (a, b) = (read(fa, layer)?, read(fb, layer)?);
    check_sizes([fa, fb], [a.size, b.size])?;
    if a.size.iter().any(|&n| n < ssim::WINDOW) {
        let n = ssim::WINDOW;
        let message = format!("found {} x {} pixels, expected at least {n} x {n}: the window of SSIM", a.size[0], a.size[1]);
        return Err(Error::input(fa, message));
    }
    Ok([a, b])
}

/// The same layer of the second render of a reference.
pub fn read_second((first, b): (&Path, &Raster), second: &Path, layer: &str) -> Result<Raster> {
    let c = read(second, layer)?;
    check_sizes([first, second], [b.size, c.size])?;
    if *b == c {
        let message = format!("has the pixels of {}: expected the reference rendered with another seed", first.display());
        return Err(Error::input(second, message));
    }
    Ok(c)
}

fn check_sizes([fa, fb]: [&Path; 2], [a, b]: [[usize; 2]; 2]) -> Result<()> {
    if a == b {
        return Ok(());
    }
    let [(wa, ha), (wb, hb)] = [(a[0], a[1]), (b[0], b[1])];
    Err(Error::input(fa, format!("has {wa} x {ha} pixels, {} has {wb} x {hb}: expected one size", fb.display())))
}

fn read(path: &Path, layer: &str) -> Result<Raster> {
    let image = ExrImage::read(path)?;
    let pixels = image.rgb(path, if layer == "full" { "" } else { layer })?;
    if let Some(i) = pixels.iter().position(|p| !p.is_finite()) {
        let (x, y) = (i % image.width, i / image.width);
        return Err(Error::input(path, format!("pixel ({x}, {y}) is {}: expected finite radiance", pixels[i])));
    }
    Ok(Raster { size: [image.width, image.height], pixels })
}

/// The frames of two files, or of two folders with the same file names: those of `frames` alone, where they are given.
fn pairs(a: &Path, b: &Path, frames: Option<&FrameList>) -> Result<Vec<Pair>> {
    for p in [a, b] {
        if !p.exists() {
            return Err(Error::input(p, "no such file or folder"));
        }
    }
    let stem = |p: &Path| p.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    match (a.is_dir(), b.is_dir()) {
        (false, false) if frames.is_some() => Err(Error::Request("--frames: expected two folders, found two files".into())),
        (false, false) => Ok(vec![Pair { name: stem(a), files: [a.into(), b.into()] }]),
        (true, true) => {
            let (in_a, in_b) = (chosen(a, frames)?, chosen(b, frames)?);
            let lacks = |here: &Path, name: &String, there: &Path, counts: [usize; 2]| {
                let [n, m] = counts;
                Error::input(here, format!("no {name}, which {} has ({n} frames here, {m} there)", there.display()))
            };
            if let Some(name) = in_a.iter().find(|n| !in_b.contains(n)) {
                return Err(lacks(b, name, a, [in_b.len(), in_a.len()]));
            }
            if let Some(name) = in_b.iter().find(|n| !in_a.contains(n)) {
                return Err(lacks(a, name, b, [in_a.len(), in_b.len()]));
            }
            Ok(in_a.iter().map(|n| Pair { name: stem(Path::new(n)), files: [a.join(n), b.join(n)] }).collect())
        }
        (a_is_folder, _) => {
            let (folder, file) = if a_is_folder { (a, b) } else { (b, a) };
            let message = format!("is a folder and {} a file: expected two of one kind", file.display());
            Err(Error::input(folder, message))
        }
    }
}

/// The names of a folder's frames that are among `frames`, by their number.
fn chosen(folder: &Path, frames: Option<&FrameList>) -> Result<Vec<String>> {
    let mut names = frame_names(folder)?;
    if let Some(frames) = frames {
        let number = |name: &String| Path::new(name).file_stem()?.to_str()?.parse().ok();
        names.retain(|name| number(name).is_some_and(|n| frames.has(n)));
        if names.is_empty() {
            return Err(Error::input(folder, format!("has none of the frames {frames}")));
        }
    }
    Ok(names)
}

/// Names of the EXR files in a folder, sorted; at least one.
pub fn frame_names(folder: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
            names.extend(path.file_name().map(|n| n.to_string_lossy().into_owned()));
        }
    }
    if names.is_empty() {
        return Err(Error::input(folder, "found no EXR file, expected frames NNNN.exr"));
    }
    names.sort();
    Ok(names)
}
