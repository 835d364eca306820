//! `reprobe info`.

use anyhow::Context;
use reprobe::io::picture::pictures;
use reprobe::io::{ExrImage, Samples, atomic};
use reprobe::plan::Outcome;
use serde_json::json;
use std::fmt::Write;
use std::io::Cursor;
use std::path::PathBuf;

/// Show what a stage wrote: channels, ranges, provenance, pictures
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe info out/probes/0003.exr
  reprobe info out/resmap/0003.exr --pictures look/     one PNG a layer")]
pub struct Args {
    /// An EXR file
    file: PathBuf,
    /// Write a PNG of each layer into this folder
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Stops by which colours are brightened
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let image = ExrImage::read(&args.file)?;
    let mut summary = format!("{}: {} x {}\n", args.file.display(), image.width, image.height);
    let mut channels = Vec::new();
    for (name, samples) in &image.channels {
        let (kind, values): (_, Vec<f64>) = match samples {
            Samples::F16(v) => ("half", v.iter().map(|x| x.to_f64()).collect()),
            Samples::F32(v) => ("float", v.iter().map(|&x| f64::from(x)).collect()),
            Samples::U32(v) => ("uint", v.iter().map(|&x| f64::from(x)).collect()),
        };
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let lo = finite.iter().copied().fold(f64::INFINITY, f64::min);
        let hi = finite.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
        let bad = values.len() - finite.len();
        writeln!(
            summary,
            "  {name:24} {kind:6} min {lo:<12.6} mean {mean:<12.6} max {hi:<12.6}{}",
            if bad > 0 { format!(" {bad} not finite") } else { String::new() }
        )?;
        channels.push(json!({ "name": name, "type": kind, "min": lo, "mean": mean, "max": hi, "not_finite": bad }));
    }
    if let Some(p) = &image.provenance {
        writeln!(summary, "provenance:\n{}", serde_json::to_string_pretty(p)?)?;
    }
    if let Some(folder) = &args.pictures {
        let stem = args.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        for p in pictures(&image, args.exposure) {
            let path = folder.join(format!("{stem}_{}.png", p.layer));
            let buffer = image::RgbImage::from_raw(p.width, p.height, p.rgb).context("picture size")?;
            let mut png = Cursor::new(Vec::new());
            buffer.write_to(&mut png, image::ImageFormat::Png)?;
            atomic::write(&path, &png.into_inner())?;
            writeln!(summary, "{}: {}", path.display(), p.legend)?;
        }
    }
    let figures = json!({ "file": args.file, "width": image.width, "height": image.height, "channels": channels, "provenance": image.provenance });
    Ok(Outcome { summary, figures, ..Outcome::default() })
}
