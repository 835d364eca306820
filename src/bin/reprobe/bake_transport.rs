//! `reprobe bake-transport`.

use reprobe::io::jobs::Shard;
use reprobe::method::radiance_probes::compress::CompressParams;
use reprobe::method::radiance_probes::interpolate::Interpolation;
use reprobe::method::radiance_probes::params::TransportParams;
use reprobe::method::radiance_probes::transport::Kept;
use reprobe::plan::stages::BakeTransport;
use std::path::PathBuf;

/// Bake transport: how every texel's diffuse light follows from the radiance of the probes around it
///
/// What is baked knows neither lights nor colours: render-path --method radiance-probes lights it anew in every frame. Writes NNNN.exr
/// (compressed rows of the operator), receivers.exr, relight.exr (what each probe's rays meet) and set.json. Finished files are kept.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe place-probes room/scene.xml --path room/path.json --count 60 -o probes.json
  reprobe bake-transport room/scene.xml --probes probes.json -o transport/
  reprobe bake-transport room/scene.xml --probes probes.json -o transport/ --texels 50000 --sh-order 4
  reprobe bake-transport room/scene.xml --probes probes.json -o transport/ --volume 0.5
  reprobe render-path room/scene.xml --path room/path.json --method radiance-probes --probes transport/ -o frames/")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The probes, from place-probes
    #[arg(long, value_name = "FILE")]
    probes: PathBuf,
    /// Folder for the operator and set.json
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Order of the probes' spherical harmonics, 0 to 9 [default: 7; 4 with --receiver sh1]
    #[arg(long, value_name = "N")]
    sh_order: Option<u32>,
    /// What a texel keeps of its light: irradiance, or sh1, radiance to first order (for normal maps and gloss)
    #[arg(long, value_name = "WHAT", default_value_t = Kept::default())]
    receiver: Kept,
    /// How probes' radiance comes to a texel: visible, at what both see; for comparison also spatial, in the same direction, and
    /// decomposed, near surfaces apart from the others (Arikan et al. 2005)
    #[arg(long, value_name = "HOW", default_value_t = Interpolation::default())]
    interpolation: Interpolation,
    /// About how many texels receive light
    #[arg(long, value_name = "N", default_value_t = TransportParams::default().atlas.budget, conflicts_with = "texel")]
    texels: u32,
    /// Edge of a texel, metres, in place of --texels
    #[arg(long, value_name = "M")]
    texel: Option<f32>,
    /// Rays over the hemisphere of a texel
    #[arg(long, value_name = "N", default_value_t = TransportParams::default().rays)]
    rays: u32,
    /// Rays by which a frame's light comes to a probe
    #[arg(long, value_name = "N", default_value_t = TransportParams::default().relight_rays)]
    relight_rays: u32,
    /// How far a probe reaches, metres [default: so far that ten of them reach a texel, on average]
    #[arg(long, value_name = "M")]
    radius: Option<f32>,
    /// Edge of the cells of an irradiance volume, metres: receivers in free space too, for shapes that --lights adds
    #[arg(long, value_name = "M")]
    volume: Option<f32>,
    /// Relative error of the compressed operator
    #[arg(long, value_name = "E", default_value_t = CompressParams::default().error)]
    error: f32,
    /// Most coefficients a texel
    #[arg(long, value_name = "N", default_value_t = CompressParams::default().most_terms)]
    most_terms: u32,
    /// Bake groups of texels I, I + N, I + 2N, ... only
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> BakeTransport {
        let Self {
            scene,
            probes,
            output,
            sh_order,
            receiver,
            interpolation,
            texels,
            texel,
            rays,
            relight_rays,
            radius,
            volume,
            error,
            most_terms,
            shard,
        } = self;
        BakeTransport {
            scene,
            probes,
            output,
            sh_order,
            receiver: Some(receiver),
            interpolation: Some(interpolation),
            texels: texel.is_none().then_some(texels),
            texel,
            rays: Some(rays),
            relight_rays: Some(relight_rays),
            radius,
            volume,
            error: Some(error),
            most_terms: Some(most_terms),
            shard,
        }
    }
}
