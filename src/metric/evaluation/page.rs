//! `index.html`: one file without outside resources, pictures and all.

use super::markdown::layer_title;
use super::{Costs, Evaluation, Gallery, Pictures, Shown};
use crate::Result;
use crate::metric::view;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The page.
pub fn html(evaluation: &Evaluation, costs: &Costs, gallery: &Gallery) -> Result<String> {
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
    let layers: serde_json::Map<String, Value> = gallery.layers.iter().map(|(name, s)| (name.clone(), layer(s))).collect();
    let verdicts: serde_json::Map<String, Value> =
        evaluation.layers.iter().map(|l| (l.clone(), evaluation.verdict(l, costs).into())).collect();
    let titles: serde_json::Map<String, Value> = evaluation.layers.iter().map(|l| (l.clone(), layer_title(l).into())).collect();
    let data = json!({
        "evaluation": evaluation, "costs": costs, "pictures": layers, "detail": gallery.detail, "verdicts": verdicts, "titles": titles,
        "columns": evaluation.columns_of_page(), "note": evaluation.note(), "variants": evaluation.variants(costs),
    });
    view::page(include_str!("page.html"), &data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;
    use crate::metric::evaluation::Detail;
    use crate::metric::evaluation::tests::{example, with_pair};
    use crate::metric::{ErrorMaps, Raster};

    /// A page of three methods with one picture each, and that picture.
    fn page(evaluation: &Evaluation, costs: &Costs, detail: Detail) -> (String, Vec<u8>) {
        let frame = detail.frame(&Raster { size: [8, 4], pixels: vec![Rgb::splat(0.1); 32] }).unwrap();
        let maps = ErrorMaps { difference: vec![], dssim: vec![], flip: vec![0.5; 32] };
        let flip = [(0, detail.flip(&maps, [8, 4]).unwrap())].into();
        let pictures = Pictures { frames: [(0, frame.clone())].into(), flip };
        let shown = Shown { reference: Pictures::default(), methods: vec![pictures; 3] };
        let gallery = Gallery { layers: [("glossy".to_owned(), shown)].into(), detail };
        (html(evaluation, costs, &gallery).unwrap(), frame)
    }

    #[test]
    fn the_page_holds_its_pictures_and_a_name_cannot_break_out_of_it() {
        let (evaluation, costs) = example();
        let (page, frame) = page(&evaluation, &costs, Detail::MOST);
        assert!(page.contains(&STANDARD.encode(&frame)));
        assert!(!page.contains("</script>theirs") && page.contains("\\u003c/script>theirs"));
        view::tests::is_usable_by_all(&page);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("index.html"), &page).unwrap();
        assert_eq!(view::page_provenance(&folder.path().join("index.html")).unwrap(), Some(evaluation.provenance));
    }

    #[test]
    fn the_page_plays_at_the_paths_pace_and_tells_what_is_clean() {
        let (_, costs) = example();
        let evaluation = Evaluation { fps: Some(25.0), ..with_pair() };
        let (page, _) = page(&evaluation, &costs, Detail { shrink: 2, ..Detail::MOST });
        for part in [
            "\"fps\":25.0",
            "\"shrink\":2",
            "[\"without_noise.rmse_rgb\",\"clean RMSE RGB\",true]",
            "[\"rmse_rgb\",\"RMSE RGB\",false]",
            "<select id=\"rate\"",
            "<button id=\"play\"",
        ] {
            assert!(page.contains(part), "{part}");
        }
        view::tests::is_usable_by_all(&page);
    }
}
