//! `reprobe info`.

use anyhow::{Context as _, ensure};
use reprobe::exchange::is_gltf;
use reprobe::io::picture::pictures;
use reprobe::io::{ExrImage, Samples, atomic, read_text};
use reprobe::plan::stages::frame_names;
use reprobe::plan::{Context, Outcome};
use reprobe::scene::summary::Summary;
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Show what a scene or an output holds
///
/// Of a scene: shapes, triangles, materials by model, emitters, bounds, and what is not supported. Of an EXR file: channels, ranges
/// and where it came from. Of a folder: its files. Of probes.json, set.json and other outputs in JSON: their members.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe info room/scene.xml
  reprobe info out/probes.json out/resmap/ out/lightmap.exr
  reprobe info out/resmap/0003.exr --pictures look/     one PNG a layer")]
pub struct Args {
    /// Scenes, EXR files, JSON outputs, folders of outputs
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Write a PNG of each layer of the EXR files into this folder
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Stops by which colours are brightened
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
}

/// What there is to say of a file, to people and to programs.
struct Said(String, Value);

pub fn run(args: &Args, cx: &Context) -> anyhow::Result<Outcome> {
    ensure!(
        args.pictures.is_none() || args.files.iter().any(|f| has_ending(f, "exr")),
        "--pictures: none of the files is an EXR file"
    );
    let said: Vec<Said> = args.files.iter().map(|file| of(file, args, cx)).collect::<Result<_, _>>()?;
    let summary = said.iter().map(|s| s.0.trim_end()).collect::<Vec<_>>().join("\n\n");
    let mut figures: Vec<Value> = said.into_iter().map(|s| s.1).collect();
    let figures = if figures.len() == 1 { figures.remove(0) } else { json!({ "files": figures }) };
    Ok(Outcome { summary, figures, ..Outcome::default() })
}

fn has_ending(file: &Path, ending: &str) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

fn of(file: &Path, args: &Args, cx: &Context) -> anyhow::Result<Said> {
    if file.is_dir() {
        return folder(file);
    }
    if has_ending(file, "xml") || is_gltf(file) {
        return scene(file, cx);
    }
    if has_ending(file, "json") {
        let text = read_text(file)?;
        let value: Value = reprobe::io::json::parse(file, &text)?;
        return if value["type"] == "scene" { scene(file, cx) } else { Ok(members(file, &value)) };
    }
    exr(file, args)
}

fn scene(file: &Path, cx: &Context) -> anyhow::Result<Said> {
    let (loaded, unsupported) = match cx.load_scene(file) {
        Err(e) if e.is_unsupported() => {
            let mut skipping = cx.clone();
            skipping.load.skip_unsupported = true;
            (skipping.load_scene(file)?, Some(e.to_string()))
        }
        other => (other?, None),
    };
    let summary = Summary::of(&loaded);
    let not = unsupported.as_ref().map_or_else(String::new, |list| format!("\nnot supported: {list}"));
    let figures = json!({ "file": file, "scene": summary, "unsupported": unsupported });
    Ok(Said(format!("{}: scene\n{summary}{not}", file.display()), figures))
}

/// A folder of outputs: how many files of which kind, and what says where they came from.
fn folder(folder: &Path) -> anyhow::Result<Said> {
    let frames = frame_names(folder)?;
    let first = folder.join(&frames[0]);
    let image = ExrImage::read(&first)?;
    let layers = image.channels.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
    let bytes: u64 = frames.iter().filter_map(|name| folder.join(name).metadata().ok()).map(|m| m.len()).sum();
    let mut summary = format!("{}: {} EXR files, {:.1} MiB\n", folder.display(), frames.len(), bytes as f64 / 1048576.0);
    writeln!(summary, "  {}: {} x {}, {layers}", frames[0], image.width, image.height)?;
    let mut figures = json!({ "folder": folder, "files": frames.len(), "bytes": bytes, "size": [image.width, image.height] });
    for name in ["set.json", "timings.json"] {
        let path = folder.join(name);
        if path.is_file() {
            let value: Value = reprobe::io::json::parse(&path, &read_text(&path)?)?;
            let Said(text, _) = members(&path, &value);
            summary += &text;
            figures[name] = value;
        }
    }
    if let (false, Some(p)) = (folder.join("set.json").is_file(), &image.provenance) {
        writeln!(summary, "  provenance of {}: {}", frames[0], serde_json::to_string(p)?)?;
    }
    Ok(Said(summary, figures))
}

/// The members of an object, long ones in short.
fn members(file: &Path, value: &Value) -> Said {
    let mut text = format!("{}\n", file.display());
    for (name, value) in value.as_object().unwrap_or(&Map::new()) {
        let shown = match value {
            Value::Array(list) if list.len() > 8 => format!("{} entries", list.len()),
            Value::String(s) => s.clone(),
            other => other.to_string(),
        };
        text += &format!("  {name:16} {shown}\n");
    }
    Said(text, json!({ "file": file, "content": value }))
}

fn exr(file: &Path, args: &Args) -> anyhow::Result<Said> {
    let image = ExrImage::read(file)?;
    let mut summary = format!("{}: {} x {}\n", file.display(), image.width, image.height);
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
        summary += &write_pictures(file, &image, folder, args.exposure)?;
    }
    let figures = json!({ "file": file, "width": image.width, "height": image.height, "channels": channels, "provenance": image.provenance });
    Ok(Said(summary, figures))
}

/// A PNG of each layer; what they show.
fn write_pictures(file: &Path, image: &ExrImage, folder: &Path, exposure: f32) -> anyhow::Result<String> {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut legends = String::new();
    for p in pictures(image, exposure) {
        let path = folder.join(format!("{stem}_{}.png", p.layer));
        let buffer = image::RgbImage::from_raw(p.width, p.height, p.rgb).context("picture size")?;
        let mut png = Cursor::new(Vec::new());
        buffer.write_to(&mut png, image::ImageFormat::Png)?;
        atomic::write(&path, &png.into_inner())?;
        writeln!(legends, "{}: {}", path.display(), p.legend)?;
    }
    Ok(legends)
}
