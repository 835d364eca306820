//! Layers of an image: the channels that one picture shows, and what kind of values they hold.

use super::{ExrImage, Samples};
use crate::{Error, Result};
use glam::{Mat3, Vec3};
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the channels `R`, `G`, `B` that stand in no layer.
pub const IMAGE: &str = "image";
/// Layers that say most of a file, the best first: those that other programs call the whole picture, and those of our files.
const TELLING: [&str; 12] =
    [IMAGE, "combined", "rgba", "rgb", "beauty", "color", "glossy", "radiance", "irradiance", "gathered", "m", "distance"];

/// What a layer's values are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Linear radiance, red, green, blue.
    Colour,
    /// Places or directions: X, Y, Z.
    Vector,
    /// One number a pixel.
    Scalar,
    /// Numbers of things, [`u32::MAX`] for none.
    Index,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::Colour => "colours",
            Self::Vector => "vectors",
            Self::Scalar => "numbers",
            Self::Index => "indices",
        })
    }
}

/// A layer, or a channel that is one by itself.
pub struct Layer<'a> {
    /// Its name; [`IMAGE`] for colours without a layer.
    pub name: String,
    /// What it holds.
    pub kind: Kind,
    /// Three channels of colours and vectors, one of all else.
    channels: Vec<&'a Samples>,
    /// What turns its colours into Rec.709.
    to_rec709: Option<Mat3>,
}

/// What values there are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Values {
    /// The least and the greatest of all channels, where any is finite. Of indices: without those of nothing.
    pub ends: Option<[f64; 2]>,
    /// Pixels with a value that is not finite; of indices, those with nothing.
    pub without: usize,
}

/// The layers of `image`, in order of their names.
pub fn layers(image: &ExrImage) -> Vec<Layer<'_>> {
    let mut groups: BTreeMap<&str, Vec<(&str, &Samples)>> = BTreeMap::new();
    for (name, samples) in &image.channels {
        let (layer, channel) = name.rsplit_once('.').unwrap_or(("", name));
        groups.entry(layer).or_default().push((channel, samples));
    }
    let mut found = Vec::new();
    for (group, mut channels) in groups {
        for (names, kind) in [(["R", "G", "B"], Kind::Colour), (["X", "Y", "Z"], Kind::Vector)] {
            let Some(triple) = take(&mut channels, names) else { continue };
            let name = if group.is_empty() { IMAGE } else { group }.to_owned();
            found.push(Layer { name, kind, channels: triple, to_rec709: image.to_rec709.filter(|_| kind == Kind::Colour) });
        }
        for (channel, samples) in channels {
            let name = if group.is_empty() { channel.to_owned() } else { format!("{group}.{channel}") };
            let kind = if matches!(samples, Samples::U32(_)) { Kind::Index } else { Kind::Scalar };
            found.push(Layer { name, kind, channels: vec![samples], to_rec709: None });
        }
    }
    found
}

/// Takes three channels out of a list, where it has them, by names in capitals or not.
fn take<'a>(channels: &mut Vec<(&str, &'a Samples)>, names: [&str; 3]) -> Option<Vec<&'a Samples>> {
    let find = |n: &str| channels.iter().position(|(name, _)| name.eq_ignore_ascii_case(n));
    let places = [find(names[0])?, find(names[1])?, find(names[2])?];
    let triple = places.map(|i| channels[i].1).to_vec();
    let mut place = 0..;
    channels.retain(|_| place.next().is_none_or(|i| !places.contains(&i)));
    Some(triple)
}

/// The layer of that name, or all that there are; `path` is for the message.
pub fn named<'l, 'a>(path: &Path, layers: &'l [Layer<'a>], name: &str) -> Result<&'l Layer<'a>> {
    layers.iter().find(|l| l.name == name).ok_or_else(|| {
        let there: Vec<&str> = layers.iter().map(|l| l.name.as_str()).collect();
        Error::input(path, format!("has no layer \"{name}\": expected one of {}", there.join(", ")))
    })
}

/// The layer that says most of a file: the image, or what comes nearest to it.
pub fn most_telling<'l, 'a>(path: &Path, layers: &'l [Layer<'a>]) -> Result<&'l Layer<'a>> {
    let last_part = |l: &Layer| l.name.rsplit('.').next().unwrap_or_default().to_lowercase();
    let known = TELLING.iter().find_map(|t| layers.iter().find(|l| last_part(l) == *t));
    let colours = || layers.iter().find(|l| l.kind == Kind::Colour);
    let known = known.or_else(colours).or(layers.first());
    known.ok_or_else(|| Error::input(path, "has no channels: expected at least one"))
}

impl Layer<'_> {
    /// Pixels that it has.
    pub fn len(&self) -> usize {
        match self.channels.first() {
            Some(Samples::F16(v)) => v.len(),
            Some(Samples::F32(v)) => v.len(),
            Some(Samples::U32(v)) => v.len(),
            None => 0,
        }
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A channel's values as floats.
    pub fn plane(&self, channel: usize) -> Vec<f32> {
        match self.channels.get(channel) {
            Some(Samples::F16(v)) => v.iter().map(|x| x.to_f32()).collect(),
            Some(Samples::F32(v)) => v.clone(),
            Some(Samples::U32(v)) => v.iter().map(|&x| x as f32).collect(),
            None => Vec::new(),
        }
    }

    /// All channels; colours in Rec.709.
    pub fn planes(&self) -> Vec<Vec<f32>> {
        let mut planes: Vec<Vec<f32>> = (0..self.channels.len()).map(|c| self.plane(c)).collect();
        if let (Some(matrix), [r, g, b]) = (self.to_rec709, planes.as_mut_slice()) {
            for ((r, g), b) in r.iter_mut().zip(g).zip(b) {
                [*r, *g, *b] = (matrix * Vec3::new(*r, *g, *b)).to_array();
            }
        }
        planes
    }

    /// A channel of indices, as it is stored.
    pub fn indices(&self) -> Option<&[u32]> {
        match self.channels.first() {
            Some(Samples::U32(v)) if self.kind == Kind::Index => Some(v),
            _ => None,
        }
    }
}

impl Values {
    /// Of numbers a pixel.
    pub fn of(planes: &[Vec<f32>]) -> Self {
        let finite = planes.iter().flatten().copied().filter(|v| v.is_finite());
        let ends = finite.fold(None, |ends: Option<[f32; 2]>, v| Some(ends.map_or([v, v], |[a, b]| [a.min(v), b.max(v)])));
        let pixels = planes.first().map_or(0, Vec::len);
        let without = (0..pixels).filter(|&i| planes.iter().any(|p| !p[i].is_finite())).count();
        Self { ends: ends.map(|e| e.map(|end| f64::from(end) + 0.0)), without }
    }

    /// Of indices.
    pub fn of_indices(indices: &[u32]) -> Self {
        let some = || indices.iter().copied().filter(|i| *i != u32::MAX);
        let ends = some().min().zip(some().max()).map(|(a, b)| [f64::from(a), f64::from(b)]);
        Self { ends, without: indices.len() - some().count() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;

    fn names(image: &ExrImage) -> Vec<String> {
        layers(image).into_iter().map(|l| l.name).collect()
    }

    #[test]
    fn channels_are_put_together_by_layer_and_kind() {
        let one = || vec![1.0];
        let image = ExrImage::new(1, 1)
            .with_f32("normal.Z", one())
            .with_f32("normal.X", one())
            .with_f32("normal.Y", one())
            .with_f32("normal.length", one())
            .with_f32("View.Combined.b", one())
            .with_f32("View.Combined.g", one())
            .with_f32("View.Combined.r", one())
            .with_f32("depth", one())
            .with_u32("material", vec![3])
            .with_f32("half.X", one());
        let found: Vec<(String, Kind)> = layers(&image).into_iter().map(|l| (l.name, l.kind)).collect();
        let expected = [
            ("depth", Kind::Scalar),
            ("material", Kind::Index),
            ("View.Combined", Kind::Colour),
            ("half.X", Kind::Scalar),
            ("normal", Kind::Vector),
            ("normal.length", Kind::Scalar),
        ];
        assert_eq!(found, expected.map(|(name, kind)| (name.to_owned(), kind)));
    }

    #[test]
    fn channels_keep_their_order_whatever_order_they_come_in() {
        let image = ExrImage::new(1, 1).with_f32("B", vec![3.0]).with_f32("R", vec![1.0]).with_f32("G", vec![2.0]);
        assert_eq!(layers(&image)[0].planes(), [[1.0], [2.0], [3.0]]);
        let image = ExrImage { to_rec709: Some(Mat3::from_diagonal(Vec3::new(2.0, 3.0, 4.0))), ..image };
        assert_eq!(layers(&image)[0].planes(), [[2.0], [6.0], [12.0]]);
    }

    #[test]
    fn the_most_telling_layer_is_the_image_or_what_comes_nearest() {
        let path = Path::new("a.exr");
        let telling = |image: &ExrImage| most_telling(path, &layers(image)).map(|l| l.name.clone());
        let pixel = [Rgb::ONE];
        let probe = ExrImage::new(1, 1).with_u32("atlas", vec![1]).with_rgb("albedo", &pixel).with_rgb("glossy", &pixel);
        assert_eq!(telling(&probe).unwrap(), "glossy");
        assert_eq!(telling(&probe.with_rgb("", &pixel)).unwrap(), IMAGE);
        let blender = ExrImage::new(1, 1).with_rgb("View.Albedo", &pixel).with_rgb("View.Combined", &pixel);
        assert_eq!(telling(&blender).unwrap(), "View.Combined");
        assert_eq!(telling(&ExrImage::new(1, 1).with_f32("a", vec![1.0]).with_rgb("other", &pixel)).unwrap(), "other");
        assert_eq!(telling(&ExrImage::new(1, 1).with_f32("k1", vec![1.0]).with_f32("k2", vec![1.0])).unwrap(), "k1");
        assert!(telling(&ExrImage::new(1, 1)).unwrap_err().to_string().contains("no channels"));
        let list = ExrImage::new(1, 1).with_f32("k1", vec![1.0]).with_rgb("", &pixel);
        let message = named(path, &layers(&list), "magic").err().unwrap().to_string();
        assert!(message.contains("a.exr: has no layer \"magic\": expected one of image, k1"), "{message}");
        assert_eq!(names(&list), ["image", "k1"]);
    }

    #[test]
    fn values_are_those_that_count() {
        let v = Values::of(&[vec![1.0, f32::NAN], vec![-2.0, 5.0]]);
        assert_eq!(v, Values { ends: Some([-2.0, 5.0]), without: 1 });
        assert_eq!(Values::of_indices(&[7, u32::MAX, 3]), Values { ends: Some([3.0, 7.0]), without: 1 });
        assert_eq!(Values::of(&[vec![f32::INFINITY]]), Values { ends: None, without: 1 });
    }
}
