//! `metrics.json` and `index.html`: the numbers for programs, and a page that shows frames, reference and error side by side.

use super::without_noise::WithoutNoise;
use super::{Comparison, Metrics, Raster, flip, view};
use crate::Result;
use crate::io::Provenance;
pub(super) use crate::io::png::png;
use serde::Serialize;

/// `metrics.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Every frame, in order of name.
    pub frames: Vec<FrameMetrics>,
    /// Mean over frames of each number.
    pub mean: Metrics,
    /// Means without the reference's noise, where there are two references.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_noise: Option<WithoutNoise>,
    /// Where the numbers came from.
    pub provenance: Provenance,
}

/// One frame of `metrics.json`.
#[derive(Debug, Clone, Serialize)]
pub struct FrameMetrics {
    /// File name without its extension.
    pub name: String,
    /// Its numbers.
    #[serde(flatten)]
    pub metrics: Metrics,
    /// Its numbers without the reference's noise, where there are two references.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_noise: Option<WithoutNoise>,
}

impl Report {
    /// The report of `frames`, in order of name.
    pub fn new(frames: Vec<FrameMetrics>, provenance: Provenance) -> Self {
        let all: Vec<Metrics> = frames.iter().map(|f| f.metrics).collect();
        let without: Option<Vec<WithoutNoise>> = frames.iter().map(|f| f.without_noise).collect();
        Self { mean: Metrics::mean(&all), without_noise: without.map(|w| WithoutNoise::mean(&w)), frames, provenance }
    }

    /// The table for a terminal, a line a frame and one for the mean.
    pub fn table(&self) -> String {
        let width = self.frames.iter().map(|f| f.name.chars().count()).max().unwrap_or(0).max(5);
        let line = |name: &str, m: &Metrics| {
            let numbers = [m.rmse_rgb, m.rmse_lum, m.dssim_rgb, m.dssim_lum, m.flip, m.rmse_linear, m.relmse_linear];
            let cells: String = numbers.iter().map(|x| format!("{x:>11.4}")).collect();
            format!("{name:width$}{cells}\n")
        };
        let head = ["rmse_rgb", "rmse_lum", "dssim_rgb", "dssim_lum", "flip", "rmse_lin", "relmse_lin"];
        let mut text = format!("{:width$}{}\n", "frame", head.map(|h| format!("{h:>11}")).concat());
        for f in &self.frames {
            text += &line(&f.name, &f.metrics);
        }
        text += &line("mean", &self.mean);
        if let Some(WithoutNoise { rmse_rgb, rmse_lum, dssim_rgb, dssim_lum, noise_rmse_rgb }) = self.without_noise {
            let numbers = [rmse_rgb, rmse_lum, dssim_rgb, dssim_lum].map(|x| format!("{x:>11.4}")).concat();
            text += &format!("mean without the noise of the reference ({noise_rmse_rgb:.4})\n{:width$}{numbers}\n", "");
        }
        text
    }

    /// `index.html`: one page without outside resources; pictures are beside it, at [`Picture::path`], and their values, at
    /// [`values::path`](super::values::path). `titles` name the image and the reference.
    pub fn html(&self, titles: [&str; 2]) -> Result<String> {
        let parameters = &self.provenance.parameters;
        let data = serde_json::json!({
            "frames": self.frames, "mean": self.mean, "titles": titles, "parameters": parameters, "provenance": self.provenance,
            "gain": DIFFERENCE_GAIN, "colours": colours(),
        });
        view::page(include_str!("report.html"), &data)
    }
}

/// Colours of the error maps from the least error to the greatest, as CSS has them: for the bar below a map.
fn colours() -> Vec<String> {
    let steps: Vec<f32> = (0..=16).map(|i| i as f32 / 16.0).collect();
    flip::magma(&steps).chunks_exact(3).map(|c| format!("rgb({}, {}, {})", c[0], c[1], c[2])).collect()
}

/// The pictures of a frame in the report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Picture {
    /// The image compared.
    Image,
    /// Its reference.
    Reference,
    /// Absolute difference of display values, times [`DIFFERENCE_GAIN`].
    Difference,
    /// (1 - SSIM) / 2.
    Dssim,
    /// FLIP error.
    Flip,
}

/// Brightens the difference picture, as a tenth of the display's range is already a gross error. The bar below the map tells it.
pub const DIFFERENCE_GAIN: f32 = 4.0;

impl Picture {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Image, Self::Reference, Self::Difference, Self::Dssim, Self::Flip];

    /// Where the picture of frame number `index` lies, relative to `index.html`, which knows these names too.
    pub fn path(self, index: usize) -> String {
        let kind = match self {
            Self::Image => "image",
            Self::Reference => "reference",
            Self::Difference => "difference",
            Self::Dssim => "dssim",
            Self::Flip => "flip",
        };
        format!("images/{index:04}_{kind}.png")
    }

    /// The picture as a PNG file.
    pub fn png(self, comparison: &Comparison) -> Result<Vec<u8>> {
        let size = comparison.display[0].size;
        let shown = |r: &Raster| flip::to_rgb8(r);
        let pixels = match self {
            Self::Image => shown(&comparison.display[0]),
            Self::Reference => shown(&comparison.display[1]),
            Self::Difference => {
                let brighter: Vec<f32> = comparison.maps.difference.iter().map(|x| x * DIFFERENCE_GAIN).collect();
                flip::magma(&brighter)
            }
            Self::Dssim => flip::magma(&comparison.maps.dssim),
            Self::Flip => flip::magma(&comparison.maps.flip),
        };
        png(&pixels, size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(names: &[&str]) -> Report {
        let metrics = |i: usize| Metrics { rmse_rgb: i as f64, flip: 0.5, ..Metrics::default() };
        let frames = names
            .iter()
            .enumerate()
            .map(|(i, n)| FrameMetrics { name: (*n).into(), metrics: metrics(i), without_noise: None })
            .collect();
        Report::new(frames, Provenance::new("compare", "", 0, &serde_json::json!({})))
    }

    #[test]
    fn json_has_the_names_that_programs_rely_on() {
        let json = serde_json::to_value(report(&["0000", "0001"])).unwrap();
        let keys = ["rmse_rgb", "rmse_lum", "dssim_rgb", "dssim_lum", "flip", "rmse_linear", "relmse_linear"];
        for key in keys {
            assert!(json["frames"][1][key].is_number() && json["mean"][key].is_number(), "{key}");
        }
        assert_eq!(json["frames"][1]["name"], "0001");
        assert_eq!(json["mean"]["rmse_rgb"], 0.5);
    }

    #[test]
    fn a_name_cannot_break_out_of_the_page() {
        let html = report(&["</script><script>alert(1)"]).html(["a", "b"]).unwrap();
        assert!(!html.contains("</script><script>alert") && html.contains("\\u003c/script>\\u003cscript>alert(1)"));
        view::tests::is_usable_by_all(&html);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("index.html"), &html).unwrap();
        let found = view::page_provenance(&folder.path().join("index.html")).unwrap();
        assert_eq!(found, Some(report(&[]).provenance));
    }

    #[test]
    fn the_bar_has_the_colours_and_the_range_of_the_maps() {
        let html = report(&["0000"]).html(["a", "b"]).unwrap();
        assert!(
            html.contains("\"gain\":4.0") && html.contains("[\"difference\", 1 / data.gain,"),
            "the bar of the difference ends at 0.25"
        );
        let ends = flip::magma(&[0.0, 1.0]);
        let colours = colours();
        for (colour, end) in [(&colours[0], &ends[..3]), (&colours[16], &ends[3..])] {
            assert_eq!(*colour, format!("rgb({}, {}, {})", end[0], end[1], end[2]));
            assert!(html.contains(colour.as_str()));
        }
    }
}
