//! `index.html`: one file without outside resources, pictures and all.

use super::markdown::layer_title;
use super::{COLUMNS, Costs, Evaluation};
use crate::metric::view;
use crate::{Error, Result};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// JPEG files of one method's frames, or of the reference's, by number of the frame.
#[derive(Debug, Clone, Default)]
pub struct Pictures {
    /// Display values.
    pub frames: BTreeMap<usize, Vec<u8>>,
    /// FLIP errors, white for 1; none of the reference.
    pub flip: BTreeMap<usize, Vec<u8>>,
}

/// Pictures of one layer.
#[derive(Debug, Clone, Default)]
pub struct Shown {
    /// The reference's.
    pub reference: Pictures,
    /// Each method's, in order of [`Evaluation::methods`].
    pub methods: Vec<Pictures>,
}

/// Quality of the pictures of frames, 1 to 100. The page computes differences from them: at 90 they are good to some 2 of 255.
const QUALITY: u8 = 90;
/// Quality of the error maps.
const MAP_QUALITY: u8 = 80;

/// A picture of three bytes a pixel as a JPEG file.
pub fn jpeg_rgb(bytes: &[u8], size: [usize; 2]) -> Result<Vec<u8>> {
    jpeg(bytes, size, ExtendedColorType::Rgb8, QUALITY)
}

/// A map of values in [0, 1] as a JPEG file.
pub fn jpeg_gray(values: &[f32], size: [usize; 2]) -> Result<Vec<u8>> {
    let bytes: Vec<u8> = values.iter().map(|x| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
    jpeg(&bytes, size, ExtendedColorType::L8, MAP_QUALITY)
}

fn jpeg(bytes: &[u8], [width, height]: [usize; 2], kind: ExtendedColorType, quality: u8) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    JpegEncoder::new_with_quality(&mut out, quality)
        .encode(bytes, width as u32, height as u32, kind)
        .map_err(|e| Error::Request(format!("JPEG of {width} x {height}: {e}")))?;
    Ok(out)
}

/// The page. `shown` holds pictures by layer.
pub fn html(evaluation: &Evaluation, costs: &Costs, shown: &BTreeMap<String, Shown>) -> Result<String> {
    let files = |files: &BTreeMap<usize, Vec<u8>>| -> Value {
        files
            .iter()
            .map(|(frame, bytes)| (frame.to_string(), STANDARD.encode(bytes).into()))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let pictures = |p: &Pictures| json!({ "frames": files(&p.frames), "flip": files(&p.flip) });
    let layer =
        |s: &Shown| json!({ "reference": pictures(&s.reference), "methods": s.methods.iter().map(pictures).collect::<Vec<_>>() });
    let layers: serde_json::Map<String, Value> = shown.iter().map(|(name, s)| (name.clone(), layer(s))).collect();
    let verdicts: serde_json::Map<String, Value> =
        evaluation.layers.iter().map(|l| (l.clone(), evaluation.verdict(l, costs).into())).collect();
    let titles: serde_json::Map<String, Value> = evaluation.layers.iter().map(|l| (l.clone(), layer_title(l).into())).collect();
    let data = json!({
        "evaluation": evaluation, "costs": costs, "pictures": layers, "verdicts": verdicts, "titles": titles, "columns": COLUMNS,
    });
    view::page(include_str!("page.html"), &data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::evaluation::tests::example;

    #[test]
    fn the_page_holds_its_pictures_and_a_name_cannot_break_out_of_it() {
        let (evaluation, costs) = example();
        let map = jpeg_gray(&[0.5; 32], [8, 4]).unwrap();
        let frame = jpeg_rgb(&[7; 96], [8, 4]).unwrap();
        let pictures = Pictures { frames: [(0, frame.clone())].into(), flip: [(0, map)].into() };
        let shown = Shown { reference: Pictures::default(), methods: vec![pictures; 3] };
        let page = html(&evaluation, &costs, &[("glossy".to_owned(), shown)].into()).unwrap();
        assert!(page.contains(&STANDARD.encode(&frame)));
        assert!(!page.contains("</script>theirs") && page.contains("\\u003c/script>theirs"));
        view::tests::is_usable_by_all(&page);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("index.html"), &page).unwrap();
        assert_eq!(view::page_provenance(&folder.path().join("index.html")).unwrap(), Some(evaluation.provenance));
        let decoded = image::load_from_memory(&frame).unwrap().to_rgb8();
        assert!((decoded.width(), decoded.height()) == (8, 4) && decoded.pixels().all(|p| p.0.iter().all(|c| c.abs_diff(7) < 3)));
    }
}
