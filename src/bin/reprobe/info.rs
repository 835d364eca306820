//! `reprobe info`.

use anyhow::ensure;
use reprobe::exchange::is_gltf;
use reprobe::io::picture::pictures;
use reprobe::io::provenance::hash_file;
use reprobe::io::{ExrImage, Provenance, Samples, png, read_text};
use reprobe::plan::carried::{self, Carried, Kind};
use reprobe::plan::stages::frame_names;
use reprobe::plan::{Context, Outcome};
use reprobe::scene::summary::Summary;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Show what a scene or an output holds
///
/// Of a scene: shapes, triangles, materials by model, emitters, bounds, and what is not supported. Of an EXR file: channels, ranges
/// and where it came from. Of a folder: its files. Of probes.json, set.json and other outputs in JSON: their members. Of pictures,
/// videos, textures, exported scenes and pages (.png, .mp4, .webm, .gif, .ktx2, .glb, .html): where they came from.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe info room/scene.xml
  reprobe info out/probes.json out/resmap/ out/lightmap.exr
  reprobe info walk.mp4 glossy.png scene.glb out/report/index.html
  reprobe info out/resmap/0003.exr --pictures look/     one PNG a layer")]
pub struct Args {
    /// Scenes, outputs of any stage, folders of them
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
    if let Some(kind) = Kind::of(file) {
        return other(file, kind);
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
    let exported = if Kind::of(file) == Some(Kind::Scene) { carried::read(file, Kind::Scene)?.provenance } else { None };
    let origin = exported.as_ref().map(|p| format!("\n{}", origin(p))).unwrap_or_default();
    let not = unsupported.as_ref().map_or_else(String::new, |list| format!("\nnot supported: {list}"));
    let mut figures = json!({ "file": file, "scene": summary, "unsupported": unsupported });
    if let Some(provenance) = exported {
        figures["provenance"] = json!(provenance);
    }
    Ok(Said(format!("{}: scene\n{summary}{not}{origin}", file.display()), figures))
}

/// A picture, a video, a texture or a page.
fn other(file: &Path, kind: Kind) -> anyhow::Result<Said> {
    let Carried { size, provenance } = carried::read(file, kind)?;
    let sides: Vec<String> = size.iter().map(u32::to_string).collect();
    let of = if sides.is_empty() { String::new() } else { format!(" of {}", sides.join(" x ")) };
    let origin = provenance.as_ref().map_or_else(|| "no provenance: not written by this version of reprobe".into(), origin);
    let text = format!("{}: {}{of}\n{origin}", file.display(), kind.name());
    Ok(Said(text, json!({ "file": file, "kind": kind.name(), "size": size, "provenance": provenance })))
}

fn origin(provenance: &Provenance) -> String {
    format!("provenance:\n{}", serde_json::to_string_pretty(provenance).unwrap_or_default())
}

/// A folder of outputs: how many files of which kind, and what says where they came from.
fn folder(folder: &Path) -> anyhow::Result<Said> {
    let frames = match frame_names(folder) {
        Err(none) => return others(folder, none),
        Ok(frames) => frames,
    };
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

/// A folder without EXR files: textures for engines, or a report.
fn others(folder: &Path, none: reprobe::Error) -> anyhow::Result<Said> {
    let mut counts: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if let Some(kind) = Kind::of(&entry.path()) {
            let count = counts.entry(kind.name()).or_default();
            *count = (count.0 + 1, count.1 + entry.metadata().map_or(0, |m| m.len()));
        }
    }
    if counts.is_empty() {
        return Err(none.into());
    }
    let (files, bytes) = counts.values().fold((0, 0), |(n, b), count| (n + count.0, b + count.1));
    let kinds: Vec<String> =
        counts.iter().map(|(kind, (n, _))| format!("{n} {kind}{}", if *n == 1 { "" } else { "s" })).collect();
    let mut summary = format!("{}: {}, {:.1} MiB\n", folder.display(), kinds.join(", "), bytes as f64 / 1048576.0);
    let mut figures = json!({ "folder": folder, "files": files, "bytes": bytes });
    for name in ["probes.json", "metrics.json", "evaluation.json"] {
        let path = folder.join(name);
        if path.is_file() {
            let value: Value = reprobe::io::json::parse(&path, &read_text(&path)?)?;
            summary += &members(&path, &value).0;
            figures[name] = value;
        }
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
        writeln!(summary, "{}", origin(p))?;
    }
    if let Some(folder) = &args.pictures {
        summary += &write_pictures(file, &image, folder, args.exposure)?;
    }
    let figures = json!({ "file": file, "width": image.width, "height": image.height, "channels": channels, "provenance": image.provenance });
    Ok(Said(summary, figures))
}

/// A PNG of each layer; what they show.
fn write_pictures(file: &Path, image: &ExrImage, folder: &Path, exposure: f32) -> anyhow::Result<String> {
    let scene = image.provenance.as_ref().map_or("", |p| p.scene.as_str());
    let hash = hash_file(file)?;
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut legends = String::new();
    for p in pictures(image, exposure) {
        let path = folder.join(format!("{stem}_{}.png", p.layer));
        png::check_png(&path)?;
        let parameters = json!({ "layer": p.layer, "legend": p.legend });
        let provenance = Provenance::new("info", scene, 0, &parameters).with_input("file", hash.clone());
        png::write_png(&path, &p.rgb, [p.width, p.height].map(|n| n as usize), &provenance)?;
        writeln!(legends, "{}: {}", path.display(), p.legend)?;
    }
    Ok(legends)
}
