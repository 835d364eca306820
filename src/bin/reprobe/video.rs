//! `reprobe video`.

use reprobe::plan::option::List;
use reprobe::plan::stages::Video;
use std::path::PathBuf;

/// Make a video of a folder of frames
///
/// ffmpeg encodes it: the one on the PATH, or the program that $FFMPEG names. The ending says what it is: .mp4 (H.264), .webm (VP9) or
/// .gif. Numbers and vectors have the range of the first frame in all of them.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe video out/frames/ -o walk.mp4
  reprobe video out/frames/ --layer glossy --exposure 1 --fps 12 -o glossy.mp4
  reprobe video out/frames/ --beside out/reference/ -o both.webm
  reprobe video frames/ --layer depth --range 0,6 -o depth.gif")]
pub struct Args {
    /// Folder of frames NNNN.exr
    frames: PathBuf,
    /// The video to write
    #[arg(short, long, value_name = "FILE.mp4")]
    output: PathBuf,
    /// Frames a second [default: those of the camera path that the frames are of, or 24]
    #[arg(long, value_name = "N")]
    fps: Option<f64>,
    /// The layer to show [default: the image, or what tells most of a frame]
    #[arg(long, value_name = "LAYER")]
    layer: Option<String>,
    /// Stops by which colours are brightened [default: 0; of irradiance -1.65, as a white wall has it]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true)]
    exposure: Option<f32>,
    /// The numbers that are dark and bright [default: nearly the least and the greatest of the first frame]
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    range: Option<List<f32, 2, ','>>,
    /// Another folder of frames of the same names, to the right
    #[arg(long, value_name = "FRAMES")]
    beside: Option<PathBuf>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> Video {
        let Self { frames, output, fps, layer, exposure, range, beside } = self;
        Video { frames, fps, layer, exposure, range, beside, output }
    }
}
