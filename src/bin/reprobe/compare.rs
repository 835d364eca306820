//! `reprobe compare`.

use crate::common::{Common, Outcome};
use anyhow::{Context, bail};
use rayon::prelude::*;
use reprobe::base::progress::Progress;
use reprobe::io::{ExrImage, Provenance, atomic};
use reprobe::metric::report::{FrameMetrics, Picture, Report};
use reprobe::metric::without_noise::without_noise;
use reprobe::metric::{Metrics, Raster, compare, ssim};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Measures frames against their references: metrics.json, error maps and a page to look at
#[derive(clap::Args)]
pub struct Args {
    /// EXR file, or folder of frames
    #[arg(value_name = "A")]
    image: PathBuf,
    /// Reference: EXR file, or folder with the same file names
    #[arg(value_name = "B")]
    reference: PathBuf,
    /// The reference rendered again with another seed, as B: also tells RMSE and DSSIM without the
    /// references' own noise
    #[arg(long, value_name = "C")]
    second_reference: Option<PathBuf>,
    /// Folder for metrics.json, index.html and images/
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    /// Layer to compare, such as glossy [default: the full image]
    #[arg(long, value_name = "NAME", default_value = "full", hide_default_value = true)]
    layer: String,
    /// Stops by which radiance is brightened for the display metrics
    #[arg(long, value_name = "E", default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
    /// Fail where the mean RMSE over RGB is greater
    #[arg(long, value_name = "X", value_parser = threshold)]
    max_rmse: Option<f64>,
    /// Fail where the mean DSSIM over RGB is greater
    #[arg(long, value_name = "X", value_parser = threshold)]
    max_dssim: Option<f64>,
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

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    if !(-32.0..=32.0).contains(&args.exposure) {
        bail!("--exposure {}: expected -32 to 32 stops", args.exposure);
    }
    let pairs = pairs(&args.image, &args.reference)?;
    let progress = common.progress();
    progress.start("compare", pairs.len() as u64);
    let frames: Vec<Measured> = pairs
        .par_iter()
        .enumerate()
        .map(|(i, pair)| {
            let frame = compare_frame(args, i, pair);
            progress.advance(1);
            frame
        })
        .collect::<anyhow::Result<_>>()?;
    progress.finish();

    let hash = |side: usize| {
        let all: String = frames.iter().map(|(_, hashes)| hashes[side].as_str()).collect();
        blake3::hash(all.as_bytes()).to_hex().to_string()
    };
    let parameters = Parameters { layer: &args.layer, exposure: args.exposure };
    let provenance = Provenance::new("compare", "", common.seed, &parameters);
    let roles = ["image", "reference", "second-reference"].into_iter().take(frames[0].1.len()).enumerate();
    let provenance = roles.fold(provenance, |p, (side, role)| p.with_input(role, hash(side)));
    let report = Report::new(frames.into_iter().map(|(frame, _)| frame).collect(), provenance);
    let [a, b] = [&args.image, &args.reference].map(|p| p.display().to_string());
    let page = args.output.join("index.html");
    atomic::write(&page, report.html([&a, &b])?.as_bytes())?;
    atomic::write_json(&args.output.join("metrics.json"), &report)?;
    Ok(outcome(args, &report, &page))
}

fn outcome(args: &Args, report: &Report, page: &Path) -> Outcome {
    let Metrics { rmse_rgb, dssim_rgb, .. } = report.mean;
    let mut summary = report.table();
    let mut check_failed = false;
    for (name, value, limit) in [("RMSE", rmse_rgb, args.max_rmse), ("DSSIM", dssim_rgb, args.max_dssim)] {
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

fn threshold(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| *x >= 0.0).ok_or_else(|| format!("expected a number of at least 0, found {text}"))
}

/// Reads, measures and draws one frame.
fn compare_frame(args: &Args, index: usize, pair: &Pair) -> anyhow::Result<Measured> {
    let [fa, fb] = &pair.files;
    let [a, b] = read_pair(fa, fb, &args.layer)?;
    let comparison = compare(&a, &b, args.exposure);
    for picture in Picture::ALL {
        atomic::write(&args.output.join(picture.path(index)), &picture.png(&comparison)?)?;
    }
    let mut files = vec![fa.clone(), fb.clone()];
    let mut frame = FrameMetrics { name: pair.name.clone(), metrics: comparison.metrics, without_noise: None };
    if let Some(second) = &args.second_reference {
        let fc = if second.is_dir() { second.join(fb.file_name().unwrap_or_default()) } else { second.clone() };
        let [_, c] = read_pair(fa, &fc, &args.layer)?;
        if b == c {
            bail!("{} has the pixels of {}: expected the reference rendered with another seed", fc.display(), fb.display());
        }
        frame.without_noise = Some(without_noise(&a, [&b, &c], args.exposure));
        files.push(fc);
    }
    let hashes = files.iter().map(|f| reprobe::io::provenance::hash_file(f)).collect::<Result<_, _>>()?;
    Ok((frame, hashes))
}

/// One layer (`full` for the image itself) of a frame and of its reference, fit to be compared.
pub fn read_pair(fa: &Path, fb: &Path, layer: &str) -> anyhow::Result<[Raster; 2]> {
    let layer = if layer == "full" { "" } else { layer };
    let (a, b) = (read(fa, layer)?, read(fb, layer)?);
    if a.size != b.size {
        let [(wa, ha), (wb, hb)] = [(a.size[0], a.size[1]), (b.size[0], b.size[1])];
        bail!("{} has {wa} x {ha} pixels, {} has {wb} x {hb}: expected one size", fa.display(), fb.display());
    }
    if a.size.iter().any(|&n| n < ssim::WINDOW) {
        let n = ssim::WINDOW;
        bail!("{}: found {} x {} pixels, expected at least {n} x {n}: the window of SSIM", fa.display(), a.size[0], a.size[1]);
    }
    Ok([a, b])
}

fn read(path: &Path, layer: &str) -> anyhow::Result<Raster> {
    let image = ExrImage::read(path)?;
    let pixels = image.rgb(path, layer)?;
    if let Some(i) = pixels.iter().position(|p| !p.is_finite()) {
        let (x, y) = (i % image.width, i / image.width);
        bail!("{}: pixel ({x}, {y}) is {}: expected finite radiance", path.display(), pixels[i]);
    }
    Ok(Raster { size: [image.width, image.height], pixels })
}

/// The frames of two files, or of two folders with the same file names.
fn pairs(a: &Path, b: &Path) -> anyhow::Result<Vec<Pair>> {
    for p in [a, b] {
        if !p.exists() {
            bail!("{}: no such file or folder", p.display());
        }
    }
    let stem = |p: &Path| p.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    match (a.is_dir(), b.is_dir()) {
        (false, false) => Ok(vec![Pair { name: stem(a), files: [a.into(), b.into()] }]),
        (true, true) => {
            let (in_a, in_b) = (frames(a)?, frames(b)?);
            if let Some(name) = in_a.iter().find(|n| !in_b.contains(n)) {
                bail!("{}: no {name}, which {} has ({} frames here, {} there)", b.display(), a.display(), in_b.len(), in_a.len());
            }
            if let Some(name) = in_b.iter().find(|n| !in_a.contains(n)) {
                bail!("{}: no {name}, which {} has ({} frames here, {} there)", a.display(), b.display(), in_a.len(), in_b.len());
            }
            Ok(in_a.iter().map(|n| Pair { name: stem(Path::new(n)), files: [a.join(n), b.join(n)] }).collect())
        }
        (a_is_folder, _) => {
            let (folder, file) = if a_is_folder { (a, b) } else { (b, a) };
            bail!("{} is a folder and {} a file: expected two of one kind", folder.display(), file.display())
        }
    }
}

/// Names of the EXR files in a folder, sorted; at least one.
pub fn frames(folder: &Path) -> anyhow::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
            names.extend(path.file_name().map(|n| n.to_string_lossy().into_owned()));
        }
    }
    if names.is_empty() {
        bail!("{}: found no EXR file, expected frames NNNN.exr", folder.display());
    }
    names.sort();
    Ok(names)
}
