//! EXR images of named channels, with provenance.

use super::flat::{self, Flat, Samples};
use super::subsampled::{self, Subsampled};
use super::{Provenance, atomic, primaries, seal};
use crate::base::math::Rgb;
use crate::{Error, Result};
use exr::prelude as e;
use exr::prelude::WritableImage;
use glam::Mat3;
use half::f16;
use std::io::Cursor;
use std::path::Path;

/// Most pixels that an image may have: untrusted files do not get to allocate more.
const MAX_PIXELS: usize = 1 << 28;

/// An image of named channels (`glossy.R`, `m_size`, ...), all of one size.
#[derive(Debug, Clone, PartialEq)]
pub struct ExrImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Channels by full name.
    pub channels: Vec<(String, Samples)>,
    /// Where the image came from.
    pub provenance: Option<Provenance>,
    /// What turns its colours into Rec.709, where its header names other primaries.
    pub to_rec709: Option<Mat3>,
}

impl ExrImage {
    /// An image without channels.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, channels: Vec::new(), provenance: None, to_rec709: None }
    }

    /// Adds a channel of floats.
    pub fn with_f32(mut self, name: &str, values: Vec<f32>) -> Self {
        self.channels.push((name.into(), Samples::F32(values)));
        self
    }

    /// Adds a channel of floats, stored as halves (clamped to their range).
    pub fn with_f16(mut self, name: &str, values: impl IntoIterator<Item = f32>) -> Self {
        let max = f16::MAX.to_f32();
        let values = values.into_iter().map(|v| f16::from_f32(v.clamp(-max, max))).collect();
        self.channels.push((name.into(), Samples::F16(values)));
        self
    }

    /// Adds a channel of integers.
    pub fn with_u32(mut self, name: &str, values: Vec<u32>) -> Self {
        self.channels.push((name.into(), Samples::U32(values)));
        self
    }

    /// Adds `layer.R`, `layer.G`, `layer.B` (or plain `R`, `G`, `B` for an empty layer name).
    pub fn with_rgb(mut self, layer: &str, pixels: &[Rgb]) -> Self {
        for (i, c) in ["R", "G", "B"].into_iter().enumerate() {
            let name = if layer.is_empty() { c.into() } else { format!("{layer}.{c}") };
            self.channels.push((name, Samples::F32(pixels.iter().map(|p| p[i]).collect())));
        }
        self
    }

    /// Sets the provenance.
    pub fn with_provenance(mut self, provenance: Provenance) -> Self {
        self.provenance = Some(provenance);
        self
    }

    fn names(&self) -> String {
        self.channels.iter().map(|(n, _)| n.as_str()).collect::<Vec<_>>().join(", ")
    }

    fn channel(&self, path: &Path, name: &str) -> Result<&Samples> {
        self.channels
            .iter()
            .find(|(n, _)| n == name)
            .map(|(_, s)| s)
            .ok_or_else(|| Error::input(path, format!("channel \"{name}\" is missing (found {})", self.names())))
    }

    /// Whether there is a channel of that name.
    pub fn has(&self, name: &str) -> bool {
        self.channels.iter().any(|(n, _)| n == name)
    }

    /// A channel as floats, whatever it is stored as. `path` is for the message.
    pub fn f32(&self, path: &Path, name: &str) -> Result<Vec<f32>> {
        Ok(match self.channel(path, name)? {
            Samples::F16(v) => v.iter().map(|x| x.to_f32()).collect(),
            Samples::F32(v) => v.clone(),
            Samples::U32(v) => v.iter().map(|&x| x as f32).collect(),
        })
    }

    /// A channel of integers.
    pub fn u32(&self, path: &Path, name: &str) -> Result<Vec<u32>> {
        match self.channel(path, name)? {
            Samples::U32(v) => Ok(v.clone()),
            _ => Err(Error::input(path, format!("channel \"{name}\" should hold unsigned integers"))),
        }
    }

    /// Three channels `layer.R`, `layer.G`, `layer.B` (plain `R`, `G`, `B` for an empty layer name) as colours of Rec.709.
    pub fn rgb(&self, path: &Path, layer: &str) -> Result<Vec<Rgb>> {
        let get = |c: &str| self.f32(path, &if layer.is_empty() { c.into() } else { format!("{layer}.{c}") });
        let (r, g, b) = (get("R")?, get("G")?, get("B")?);
        let matrix = self.to_rec709.unwrap_or(Mat3::IDENTITY);
        let color = |c: Rgb| if self.to_rec709.is_some() { matrix * c } else { c };
        Ok(r.into_iter().zip(g).zip(b).map(|((r, g), b)| color(Rgb::new(r, g, b))).collect())
    }

    /// The image that the file is of: `R`, `G`, `B`; else the colours of a layer; else luminance, or the one channel that there is, as
    /// grey. Also a word of the layers that were passed over, where several would do.
    pub fn picture(&self, path: &Path) -> Result<(Vec<Rgb>, Option<String>)> {
        if self.channels.iter().any(|(name, _)| ["r", "g", "b"].contains(&last_part(name))) {
            return self.with_capitals().picture(path);
        }
        let has = |name: &str| self.channels.iter().any(|(n, _)| n == name);
        if has("R") && has("G") && has("B") {
            return Ok((self.rgb(path, "")?, None));
        }
        if has("X") && has("Y") && has("Z") {
            let [x, y, z] = ["X", "Y", "Z"].map(|name| self.f32(path, name));
            let xyz = x?.into_iter().zip(y?).zip(z?).map(|((x, y), z)| Rgb::new(x, y, z));
            return Ok((xyz.map(primaries::rec709_from_xyz).collect(), None));
        }
        let layers: Vec<&str> = self.channels.iter().filter_map(|(n, _)| n.strip_suffix(".R")).collect();
        let layers: Vec<&str> = layers.into_iter().filter(|l| has(&format!("{l}.G")) && has(&format!("{l}.B"))).collect();
        // The pass that Blender and others call the whole picture.
        let whole =
            |l: &&&str| ["combined", "rgba", "rgb", "beauty", "color", "c"].contains(&last_part(l).to_lowercase().as_str());
        if let Some(layer) = layers.iter().find(whole).or(layers.first()) {
            let others = (layers.len() > 1).then(|| format!("of the layers {} \"{layer}\" is taken", layers.join(", ")));
            return Ok((self.rgb(path, layer)?, others));
        }
        let mut grey = self.channels.iter().map(|(n, _)| n.as_str()).filter(|n| last_part(n) != "A");
        let name = match (grey.next(), grey.next()) {
            (Some(only), None) => only,
            _ => "Y",
        };
        Ok((self.f32(path, name)?.into_iter().map(Rgb::splat).collect(), None))
    }

    /// The same with channels `r`, `g`, `b` under their usual names.
    fn with_capitals(&self) -> Self {
        let mut image = self.clone();
        for (name, _) in &mut image.channels {
            if let Some(start) = ["r", "g", "b", "a"].contains(&last_part(name)).then(|| name.len() - 1) {
                let capital = name[start..].to_uppercase();
                name.replace_range(start.., &capital);
            }
        }
        image
    }

    /// The provenance, or an error that says that there is none.
    pub fn provenance(&self, path: &Path) -> Result<&Provenance> {
        self.provenance.as_ref().ok_or_else(|| Error::input(path, "has no provenance attribute: not written by reprobe"))
    }

    /// Writes the file in one step.
    pub fn write(&self, path: &Path) -> Result<()> {
        atomic::write(path, &self.encode(path)?)
    }

    /// The bytes that [`ExrImage::write`] writes.
    pub fn encode(&self, path: &Path) -> Result<Vec<u8>> {
        self.to_bytes(path, e::Compression::ZIP16)
    }

    /// [`ExrImage::write`] without compression: for large maps of floats, which hardly shrink and take longer to compress
    /// than to compute.
    pub fn write_uncompressed(&self, path: &Path) -> Result<()> {
        atomic::write(path, &self.to_bytes(path, e::Compression::Uncompressed)?)
    }

    fn to_bytes(&self, path: &Path, compression: e::Compression) -> Result<Vec<u8>> {
        let mut list: Vec<_> = self.channels.iter().collect();
        list.sort_by(|a, b| a.0.cmp(&b.0));
        let channels = list
            .into_iter()
            .map(|(name, samples)| {
                let flat = match samples {
                    Samples::F16(v) => e::FlatSamples::F16(v.clone()),
                    Samples::F32(v) => e::FlatSamples::F32(v.clone()),
                    Samples::U32(v) => e::FlatSamples::U32(v.clone()),
                };
                let name = e::Text::new_or_none(name);
                name.map(|name| e::AnyChannel::new(name, flat)).ok_or("the name of a channel is not Latin-1")
            })
            .collect::<std::result::Result<_, _>>()
            .map_err(|message| Error::input(path, message))?;
        let mut attributes = e::LayerAttributes::default();
        if let Some(p) = &self.provenance {
            // One attribute only: the crate keeps them in a hash map, whose order would differ from run to run.
            let text = seal::blank(&serde_json::to_string(p).map_err(|err| Error::input(path, err.to_string()))?);
            attributes.other.insert("provenance".into(), e::AttributeValue::Text(text.as_str().into()));
        }
        let encoding = e::Encoding { compression, blocks: e::Blocks::ScanLines, line_order: e::LineOrder::Increasing };
        let layer = e::Layer::new((self.width, self.height), attributes, encoding, e::AnyChannels::sort(channels));
        let mut bytes = Cursor::new(Vec::new());
        e::Image::from_layer(layer)
            .write()
            .to_buffered(&mut bytes)
            .map_err(|err| Error::input(path, format!("cannot be encoded: {err}")))?;
        let mut bytes = bytes.into_inner();
        seal::seal(&mut bytes);
        Ok(bytes)
    }

    /// Reads a file written by [`ExrImage::write`], or any flat EXR file.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_bytes(path, &super::read(path)?)
    }

    /// The provenance in a file's header, without its pixels; `None` where there is none.
    pub fn read_provenance(path: &Path) -> Result<Option<Provenance>> {
        let file = std::fs::File::open(path).map_err(|err| Error::io(path, err))?;
        let meta = exr::meta::MetaData::read_from_buffered(std::io::BufReader::new(file), true)
            .map_err(|err| Error::input(path, format!("not a readable EXR file: {err}")))?;
        meta.headers.first().map_or(Ok(None), |h| provenance(path, &h.own_attributes))
    }

    /// The provenance of a file that is as we wrote it, to its last byte; `None` for any other.
    pub fn provenance_of_whole(bytes: &[u8]) -> Option<Provenance> {
        let meta = || exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), true).ok();
        let is_whole = seal::holds(bytes) == Some(true);
        provenance(Path::new(""), &is_whole.then(meta)??.headers.first()?.own_attributes).ok()?
    }

    /// Reads the bytes of an EXR file; `path` is for messages.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        seal::check(path, bytes)?;
        let bad = |err: exr::error::Error| Error::input(path, format!("not a readable EXR file: {err}"));
        let matrix = |primaries: [[f32; 2]; 4]| {
            primaries::to_rec709(primaries).map_err(|m| Error::input(path, format!("attribute \"chromaticities\": {m}")))
        };
        let sparse =
            subsampled::read(bytes, MAX_PIXELS).map_err(|m| Error::input(path, format!("not a readable EXR file: {m}")))?;
        if let Some(Subsampled { size: [width, height], planes, primaries }) = sparse {
            let channels = planes.into_iter().map(|(name, values)| (name, Samples::F32(values))).collect();
            let to_rec709 = primaries.map(matrix).transpose()?.flatten();
            return Ok(Self { width, height, channels, provenance: None, to_rec709 });
        }
        let Flat { header, samples } = flat::read(bytes, MAX_PIXELS).map_err(bad)?;
        let provenance = provenance(path, &header.own_attributes)?;
        let named = header.shared_attributes.chromaticities.as_ref();
        let named = named.map(|c| [c.red, c.green, c.blue, c.white].map(|e::Vec2(x, y)| [x, y]));
        let to_rec709 = named.map(matrix).transpose()?.flatten();
        let channels = header.channels.list.iter().map(|c| c.name.to_string()).zip(samples).collect();
        Ok(Self { width: header.layer_size.0, height: header.layer_size.1, channels, provenance, to_rec709 })
    }
}

fn last_part(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}

fn provenance(path: &Path, attributes: &e::LayerAttributes) -> Result<Option<Provenance>> {
    match attributes.other.get(&e::Text::from("provenance")) {
        Some(e::AttributeValue::Text(t)) => serde_json::from_str(&t.to_string())
            .map(Some)
            .map_err(|err| Error::input(path, format!("attribute \"provenance\": {err}"))),
        _ => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_and_provenance_round_trip() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let image = ExrImage::new(3, 2)
            .with_f32("a.X", (0..6).map(|i| i as f32 * 0.1).collect())
            .with_u32("b", (0..6).map(|i| u32::MAX - i).collect())
            .with_f16("c", (0..6).map(|i| i as f32))
            .with_provenance(Provenance::new("test", "abc", 7, &serde_json::json!({"x": 1})));
        image.write(&path).unwrap();
        let back = ExrImage::read(&path).unwrap();
        assert_eq!(back, image);
        assert_eq!(ExrImage::read_provenance(&path).unwrap(), image.provenance);
        image.write_uncompressed(&path).unwrap();
        assert_eq!(ExrImage::read(&path).unwrap(), image);
        assert_eq!(ExrImage::provenance_of_whole(&std::fs::read(&path).unwrap()), image.provenance);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "no temporary file stays behind");
    }

    #[test]
    fn any_changed_byte_is_found() {
        let path = Path::new("a.exr");
        let image = ExrImage::new(4, 3)
            .with_f32("a", (0..12).map(|i| i as f32 * 0.1).collect())
            .with_provenance(Provenance::new("test", "abc", 7, &serde_json::json!({"x": 1})));
        for compression in [e::Compression::ZIP16, e::Compression::Uncompressed] {
            let whole = image.to_bytes(path, compression).unwrap();
            assert_eq!(ExrImage::from_bytes(path, &whole).unwrap(), image);
            let start = whole.windows(11).position(|w| w == b"{\"checksum\"").unwrap();
            let checksum = start..start + 80;
            for at in 0..whole.len() {
                let mut bytes = whole.clone();
                bytes[at] ^= 4;
                assert_eq!(ExrImage::provenance_of_whole(&bytes), None, "byte {at}");
                // Where it is taken for somebody else's file, it has the same pixels, or is no image.
                let read = ExrImage::from_bytes(path, &bytes);
                assert!(read.is_err() || !checksum.contains(&at), "byte {at}");
                if let Ok(read) = read {
                    assert_eq!(read.channels, image.channels, "byte {at}");
                }
            }
            for length in 0..whole.len() {
                assert_eq!(ExrImage::provenance_of_whole(&whole[..length]), None, "cut at {length}");
                assert!(ExrImage::from_bytes(path, &whole[..length]).is_err(), "cut at {length}");
            }
        }
    }

    #[test]
    fn a_truncated_or_foreign_file_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        ExrImage::new(8, 8).with_f32("a", vec![1.0; 64]).write(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for cut in [0, 3, 20, bytes.len() / 2, bytes.len() - 1] {
            assert!(ExrImage::from_bytes(&path, &bytes[..cut]).is_err(), "cut at {cut}");
        }
        assert!(ExrImage::from_bytes(&path, b"not an image at all").is_err());
        let message = ExrImage::read(&path).unwrap().f32(&path, "b").unwrap_err().to_string();
        assert!(message.contains("\"b\" is missing (found a)"), "{message}");
    }
}
