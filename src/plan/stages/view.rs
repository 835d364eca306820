//! `view`.

use crate::base::named::within;
use crate::io::canvas::{Canvas, Colour};
use crate::io::layer::{IMAGE, Kind, Layer, layers, most_telling, named};
use crate::io::picture::{self, Look, Picture};
use crate::io::provenance::hash_of;
use crate::io::sheet::{self, Cell, MOST_PIXELS};
use crate::io::{self, ExrImage, Provenance, png};
use crate::plan::option::{List, stage};
use crate::plan::{Context, Outcome};
use crate::{Error, Result};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

stage! {
    /// Draws layers of EXR files.
    View "view"
    [
        /// EXR files.
        files
    ]
    {}
    {
        /// Layers, with commas between them, or `all`; the most telling one of each file without it.
        "--layer" layer: Option<String>,
        /// Stops by which colours are brightened.
        "--exposure" exposure: Option<f32>,
        /// What is dark and what is bright.
        "--range" range: Option<List<f32, 2, ','>>,
        /// Pixels of the picture for one of the file, in each direction.
        "--scale" scale: Option<u32>,
        /// The picture to write, PNG.
        "--output" output: PathBuf,
    }
}

/// Stops that any exposure is within.
pub(super) const STOPS: std::ops::RangeInclusive<f32> = -32.0..=32.0;

/// A layer of a file, drawn.
struct Shown {
    file: PathBuf,
    picture: Picture,
}

/// What a file is, and what of.
struct Origin {
    /// Its content hash.
    hash: String,
    /// That of its scene, where it says so.
    scene: Option<String>,
}

/// The scene that all files are of; empty where they are of several, or do not say.
fn scene_of(origins: &[Origin]) -> &str {
    let first = origins.first().and_then(|of| of.scene.as_deref()).unwrap_or_default();
    if origins.iter().all(|of| of.scene.as_deref() == Some(first)) { first } else { "" }
}

impl View {
    /// Refuses what is out of range.
    pub fn check(&self) -> Result<()> {
        png::check_png(&self.output)?;
        within("--exposure", self.exposure.unwrap_or(0.0), STOPS)?;
        within("--scale", self.scale.unwrap_or(1), 1..=64)?;
        check_range(self.range)?;
        if self.files.is_empty() {
            return Err(Error::Request("view: expected at least one EXR file".into()));
        }
        Ok(())
    }

    /// Reads, draws, writes.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        self.check()?;
        let drawn: Vec<(Vec<Shown>, Origin)> = self.files.iter().map(|file| self.draw(file)).collect::<Result<_>>()?;
        let (shown, origins): (Vec<Vec<Shown>>, Vec<Origin>) = drawn.into_iter().unzip();
        let shown: Vec<Shown> = shown.into_iter().flatten().collect();
        refuse_idle(self.exposure.is_some(), self.range.is_some(), shown.iter().map(|s| s.picture.kind))?;
        let size = self.write(&shown, &self.provenance(cx, &shown, &origins))?;
        let mut summary = format!("{}: {} x {}\n", self.output.display(), size[0], size[1]);
        for Shown { file, picture } in &shown {
            summary += &format!("  {} {}: {}; {}\n", file.display(), picture.layer, picture.legend, values(picture));
        }
        let figures = json!({ "output": self.output, "size": size, "pictures": shown.iter().map(figures).collect::<Vec<_>>() });
        Ok(Outcome { summary, figures, ..Outcome::default() })
    }

    /// Where the picture comes from: what of which files is drawn, and how.
    fn provenance(&self, cx: &Context, shown: &[Shown], origins: &[Origin]) -> Provenance {
        let pictures = |of: fn(&Picture) -> &String| -> Vec<&String> { shown.iter().map(|s| of(&s.picture)).collect() };
        let parameters = json!({
            "layers": pictures(|p| &p.layer), "legends": pictures(|p| &p.legend), "scale": self.scale.unwrap_or(1),
        });
        let provenance = Provenance::new(Self::COMMAND, scene_of(origins), cx.seed, &parameters);
        match origins {
            [only] => provenance.with_input("file", only.hash.clone()),
            all => all.iter().enumerate().fold(provenance, |p, (i, of)| p.with_input(&format!("files/{i:04}"), of.hash.clone())),
        }
    }

    /// The layers of a file that are asked for.
    fn draw(&self, file: &Path) -> Result<(Vec<Shown>, Origin)> {
        let bytes = io::read(file)?;
        let image = ExrImage::from_bytes(file, &bytes)?;
        let origin = Origin { hash: hash_of(&bytes), scene: image.provenance.as_ref().map(|p| p.scene.clone()) };
        let all = layers(&image);
        let chosen: Vec<&Layer> = match self.layer.as_deref() {
            None => vec![most_telling(file, &all)?],
            Some("all") if !all.is_empty() => all.iter().collect(),
            Some(list) => list.split(',').map(|name| layer(file, &all, name.trim())).collect::<Result<_>>()?,
        };
        let exposure = self.exposure.unwrap_or_else(|| picture::usual_exposure(&image));
        let look = Look { exposure, ranges: self.range.map(|r| [r.0; 3]) };
        let shown = chosen.into_iter().map(|l| Shown { file: file.into(), picture: picture::draw(&image, l, &look) });
        Ok((shown.collect(), origin))
    }

    /// Writes one picture as it is, and several on a sheet; the size of what was written.
    fn write(&self, shown: &[Shown], provenance: &Provenance) -> Result<[usize; 2]> {
        let zoomed = shown.iter().map(|s| self.zoomed(&s.picture));
        let canvas = match shown {
            [Shown { picture, .. }] => self.zoomed(picture)?,
            _ => {
                let words = |s: &Shown| vec![format!("{} {}", short(&s.file), s.picture.layer), s.picture.legend.clone()];
                let cell = |(s, canvas): (&Shown, Result<Canvas>)| Ok(Cell { picture: canvas?, words: words(s) });
                sheet::draw(&shown.iter().zip(zoomed).map(cell).collect::<Result<Vec<_>>>()?)?
            }
        };
        canvas.write(&self.output, provenance)?;
        Ok(canvas.size)
    }

    fn zoomed(&self, picture: &Picture) -> Result<Canvas> {
        let scale = self.scale.unwrap_or(1) as usize;
        let size = [picture.width, picture.height].map(|n| n as usize);
        if scale > 1 && size.iter().map(|n| n * scale).product::<usize>() > MOST_PIXELS {
            let [w, h] = size.map(|n| n * scale);
            let message = format!("--scale {scale}: {w} x {h} pixels are more than the {MOST_PIXELS} allowed");
            return Err(Error::Request(message));
        }
        let pixels: Vec<Colour> = picture.rgb.as_chunks().0.to_vec();
        Ok(if scale == 1 { Canvas { size, pixels } } else { Canvas::zoomed(size, &pixels, scale) })
    }
}

/// The layer of that name; `full` is the image, as `compare` calls it.
pub(super) fn layer<'l, 'a>(file: &Path, all: &'l [Layer<'a>], name: &str) -> Result<&'l Layer<'a>> {
    let is_alias = name == "full" && !all.iter().any(|l| l.name == name);
    named(file, all, if is_alias { IMAGE } else { name })
}

/// Refuses a range that is none.
pub(super) fn check_range(range: Option<List<f32, 2, ','>>) -> Result<()> {
    match range.map(|r| r.0) {
        Some([lo, hi]) if !(lo < hi && lo.is_finite() && hi.is_finite()) => {
            Err(Error::Request(format!("--range {lo},{hi}: expected two finite numbers, the lesser one first")))
        }
        _ => Ok(()),
    }
}

/// Refuses options that do nothing for what is drawn.
pub(super) fn refuse_idle(exposure: bool, range: bool, drawn: impl Iterator<Item = Kind> + Clone) -> Result<()> {
    let kinds = || drawn.clone().map(|kind| kind.to_string()).collect::<std::collections::BTreeSet<_>>();
    let has = |wanted: &[Kind]| drawn.clone().any(|kind| wanted.contains(&kind));
    let found = || kinds().into_iter().collect::<Vec<_>>().join(" and ");
    if exposure && !has(&[Kind::Colour]) {
        return Err(Error::Request(format!("--exposure is for colours; the layer holds {}", found())));
    }
    if range && !has(&[Kind::Scalar, Kind::Vector]) {
        return Err(Error::Request(format!("--range is for numbers and vectors; the layer holds {}", found())));
    }
    Ok(())
}

/// A file's name with its folder's: several folders have frames of one name.
fn short(file: &Path) -> String {
    let name = |p: &Path| p.file_name().map(|n| n.to_string_lossy().into_owned());
    let folder = file.parent().and_then(name);
    let file = name(file).unwrap_or_default();
    folder.map_or(file.clone(), |folder| format!("{folder}/{file}"))
}

/// The values of a layer in words.
fn values(picture: &Picture) -> String {
    let ends = match picture.values.ends {
        Some([lo, hi]) => format!("values from {} to {}", number(lo), number(hi)),
        None => "no values".into(),
    };
    match (picture.values.without, picture.kind) {
        (0, _) => ends,
        (n, Kind::Index) => format!("{ends}, {n} pixels of none"),
        (n, _) => format!("{ends}, {n} pixels not finite"),
    }
}

/// Five digits, and whole numbers as such.
fn number(x: f64) -> String {
    match x.abs() {
        _ if x.fract() == 0.0 && x.abs() < 1e9 => format!("{x}"),
        size if (1e-3..1e6).contains(&size) => format!("{:.*}", (4.0 - size.log10().floor()).max(0.0) as usize, x),
        _ => format!("{x:.4e}"),
    }
}

fn figures(shown: &Shown) -> Value {
    let Picture { layer, kind, legend, values, width, height, .. } = &shown.picture;
    let nothing = if *kind == Kind::Index { "none" } else { "not_finite" };
    json!({
        "file": shown.file, "layer": layer, "kind": kind.to_string(), "size": [width, height], "legend": legend,
        "least": values.ends.map(|e| e[0]), "greatest": values.ends.map(|e| e[1]), nothing: values.without,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_with_five_digits() {
        for (x, expected) in [
            (0.0, "0"),
            (-3.0, "-3"),
            (1.234_567, "1.2346"),
            (123.456_789, "123.46"),
            (1e-5, "1.0000e-5"),
            (0.012_345_6, "0.012346"),
        ] {
            assert_eq!(number(x), expected);
        }
        assert_eq!(short(Path::new("out/frames/0003.exr")), "frames/0003.exr");
        assert_eq!(short(Path::new("0003.exr")), "0003.exr");
    }
}
