//! `reprobe qhmap`.

use crate::common::{Common, Outcome, parse_size};
use crate::probe_set;
use reprobe::io::provenance::hash_file;
use reprobe::io::{ExrImage, Provenance};
use reprobe::method::glossy_probes::qhmap::{QhmapParams, parameter_map};
use reprobe::method::glossy_probes::quasi_harmonic::Solver;
use reprobe::method::glossy_probes::resmap::{density_correlation, read_m};
use reprobe::probe::set::{ProbeSet, numbered};
use reprobe::{Error, Result};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

/// Turn resolution maps into parameterisations of the probes
///
/// Writes NNNN.exr (inverse.U, inverse.V: the lat-long coordinate that each texel looks at; derivative.X, derivative.Y) and
/// NNNN_forward.exr (forward.U, forward.V: where each vertex of the lat-long mesh lies in the probe). Finished files are kept.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe qhmap resmap/ -o qhmap/
  reprobe qhmap resmap/ -o qhmap/ --size 512x256 --epsilon 0.05")]
pub struct Args {
    /// Folder of resolution maps, from resmap
    #[arg(value_name = "RESMAP")]
    resmap: PathBuf,
    /// Folder for NNNN.exr, NNNN_forward.exr and set.json
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Size of the probes, texels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "1024x512")]
    size: [u32; 2],
    /// Added to m, in units of its mean: larger compresses directions without need less
    #[arg(long, value_name = "E", default_value_t = QhmapParams::default().epsilon)]
    epsilon: f32,
    /// Plain lat-long maps, whatever the resolution maps ask for
    #[arg(long, conflicts_with = "epsilon")]
    lat_long: bool,
}

/// What the maps of one run came to.
#[derive(Default)]
struct Tally {
    correlation: Vec<(usize, f64)>,
    raised: usize,
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    let params = QhmapParams { size: args.size, epsilon: args.epsilon, lat_long: args.lat_long };
    params.validate()?;
    let start = Instant::now();
    let from = ProbeSet::read(&args.resmap, "resmap")?;
    let mut provenance = Provenance::new("qhmap", &from.provenance.scene, common.seed, &params)
        .with_input("resmap", hash_file(&ProbeSet::path(&args.resmap))?);
    provenance.inputs.extend(from.provenance.inputs.clone());
    let set = ProbeSet { count: from.count, size: params.size, provenance };
    let tally = Mutex::new(Tally::default());
    let kept = probe_set::fill(
        &args.output,
        &set,
        common,
        || Solver::new(from.size),
        |solver, i| {
            let path = numbered(&args.resmap, i);
            let image = ExrImage::read(&path)?;
            check(&path, &image, &from)?;
            let (_, m) = read_m(&path, &image)?;
            let (map, epsilon) = parameter_map(solver, &m, &params)?;
            if !params.lat_long {
                let correlation = density_correlation(&map.log_density(), &m);
                let mut tally = tally.lock().unwrap_or_else(|e| e.into_inner());
                tally.correlation.push((i, correlation));
                tally.raised += usize::from(epsilon > params.epsilon);
            }
            map.save(&args.output, i, &set.provenance)
        },
    )?;
    let Tally { mut correlation, raised } = tally.into_inner().unwrap_or_else(|e| e.into_inner());
    correlation.sort_by_key(|c| c.0);
    // None where all maps were kept from before.
    let least = correlation.iter().map(|c| c.1).reduce(f64::min);
    let mean = least.map(|_| correlation.iter().map(|c| c.1).sum::<f64>() / correlation.len() as f64);
    let seconds = start.elapsed().as_secs_f64();
    let [w, h] = params.size;
    let follows = match (mean, least) {
        (Some(mean), Some(least)) => format!(", log-density follows log m by {mean:.2} (at least {least:.2})"),
        _ => String::new(),
    };
    let warning = if raised > 0 { format!(", {raised} with a larger epsilon, lest quads flip") } else { String::new() };
    Ok(Outcome {
        summary: format!(
            "{}: {} maps of {w} x {h}, {kept} kept from before{follows}{warning}, {seconds:.1} s",
            args.output.display(),
            set.count
        ),
        figures: json!({
            "count": set.count, "kept": kept, "size": params.size, "correlation": mean, "correlation_least": least,
            "epsilon_raised": raised, "seconds": seconds,
        }),
        ..Outcome::default()
    })
}

/// Refuses a file that does not belong to its folder's set.
fn check(path: &std::path::Path, image: &ExrImage, set: &ProbeSet) -> Result<()> {
    let found = [image.width as u32, image.height as u32];
    if found != set.size {
        let ([w, h], [sw, sh]) = (found, set.size);
        return Err(Error::input(path, format!("{w} x {h} pixels, expected {sw} x {sh} as set.json says")));
    }
    if image.provenance(path)? != &set.provenance {
        return Err(Error::input(path, "from another run than its set.json says; run resmap again"));
    }
    Ok(())
}
