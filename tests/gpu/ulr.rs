//! Frames of `render-path --method ulr`.

use crate::Device;
use crate::frames::{rmse, text};
use std::path::Path;

pub fn lumigraphs_are_the_cpus(device: &Device) {
    let baked = device.baked();
    for (name, options) in [
        ("ulr", ""),
        // Fewer probes than a pixel could blend, seen from more sub-pixels.
        ("ulr-few", "--supersample 2 --set probes=3"),
        // Texels that count as hidden where a slant spreads them, hardly worse than the others; memory for a few probes of the eighteen.
        ("ulr-hidden", "--set blend=2 --set plane_tolerance=0.0001 --set hidden=0.05 --gpu-memory 7M"),
    ] {
        let (frames, timings) = baked.both(device, name, &format!("--method ulr {options}"));
        for images in &frames {
            for layer in ["emission", "diffuse", "glossy", ""] {
                assert!(rmse(images, layer) < 1e-3, "{name}, {layer}: {}", rmse(images, layer));
            }
            let glossy = images[0].rgb(Path::new(""), "glossy").unwrap();
            assert!(glossy.iter().filter(|c| c.max_element() > 0.0).count() * 4 > glossy.len(), "next to nothing is glossy");
        }
        assert!(timings["mean_ms"]["gather"].as_f64().unwrap() > 0.0 && timings["device"].is_string());
    }
    let output = baked.render("ulr-refused", Some(device), "--method ulr --gpu-memory 1M");
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("--gpu-memory"), "{}", text(&output.stderr));
}
