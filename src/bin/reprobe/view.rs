//! `reprobe view`.

use reprobe::plan::option::List;
use reprobe::plan::stages::View;
use std::path::PathBuf;

/// Draw a layer of an EXR file as a PNG, in colours that fit it
///
/// Radiance as sRGB, directions and places as red, green and blue, numbers from dark to bright, indices in random colours; what is not
/// finite is magenta. Several files or layers are put on one sheet, with their names and what the colours mean. `info` lists the layers.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe view out/frames/0003.exr -o frame.png
  reprobe view out/probes/0000.exr --layer reflector.triangle --scale 2 -o triangles.png
  reprobe view out/resmap/0000.exr --layer m,m_mat,m_size,m_complexity -o terms.png
  reprobe view out/frames/0003.exr out/reference/0003.exr --layer glossy --exposure 1 -o both.png
  reprobe view frames/0003.exr --layer depth --range 0,6 -o depth.png")]
pub struct Args {
    /// EXR files, ours or other programs'
    #[arg(required = true, value_name = "FILE.exr")]
    files: Vec<PathBuf>,
    /// The picture to write
    #[arg(short, long, value_name = "FILE.png")]
    output: PathBuf,
    /// Layers, with commas between them, or all [default: the image, or what tells most of the file]
    #[arg(long, value_name = "LAYER")]
    layer: Option<String>,
    /// Stops by which colours are brightened [default: 0; of irradiance -1.65, as a white wall has it]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true)]
    exposure: Option<f32>,
    /// The numbers that are dark and bright, for pictures that can be compared [default: nearly the least and the greatest]
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    range: Option<List<f32, 2, ','>>,
    /// Draw each pixel as N x N
    #[arg(long, value_name = "N")]
    scale: Option<u32>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> View {
        let Self { files, output, layer, exposure, range, scale } = self;
        View { files, layer, exposure, range, scale, output }
    }
}
