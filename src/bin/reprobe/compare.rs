//! `reprobe compare`.

use reprobe::plan::stages::Compare;
use reprobe::plan::views::FrameList;
use std::path::PathBuf;

/// Measure frames against their references: metrics.json, error maps and a page to look at
///
/// Exit code 1 where a --max-* is passed.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe compare frames/ reference/ -o report/
  reprobe compare frames/0003.exr mitsuba.exr -o report/ --layer glossy --exposure 1
  reprobe compare frames/ reference/ -o report/ --max-rmse 0.02 --max-dssim 0.03")]
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
    /// Which frames of two folders, like 0,3,5-8 [default: all, the same in both]
    #[arg(long, value_name = "LIST")]
    frames: Option<FrameList>,
    /// Layer to compare, such as glossy [default: the full image]
    #[arg(long, value_name = "NAME", default_value = "full", hide_default_value = true)]
    layer: String,
    /// Stops by which radiance is brightened for the display metrics
    #[arg(long, value_name = "E", default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
    /// Fail where the mean RMSE over RGB is greater
    #[arg(long, value_name = "X")]
    max_rmse: Option<f64>,
    /// Fail where the mean DSSIM over RGB is greater
    #[arg(long, value_name = "X")]
    max_dssim: Option<f64>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> Compare {
        let Self { image, reference, second_reference, output, frames, layer, exposure, max_rmse, max_dssim } = self;
        Compare {
            image,
            reference,
            second_reference,
            output,
            frames,
            layer: Some(layer),
            exposure: Some(exposure),
            max_rmse,
            max_dssim,
        }
    }
}
