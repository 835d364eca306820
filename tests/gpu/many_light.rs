//! Frames by many lights. Both sides have the same lights, tree and random numbers, and differ in rounding.

use crate::Device;
use crate::frames::rmse;
use reprobe::gpu::Checks;
use std::path::Path;

/// Of CPU and GPU, relative to the layer's RMS. Where a shadow ray is drawn, or a pixel left out, by what rounding decides, another is not.
pub fn frames_are_the_cpus(device: &Device) {
    let few = "--set vpls=2000 --set repulsion=4 --set direct_samples=4";
    for (name, options, most) in [
        ("lights-full", "--set sampling=full", 1e-3),
        ("lights-adaptive", "--supersample 2", 3e-3),
        (
            "lights-leaves",
            "--set sampling=full --set traversal=leaves --set kernel=gaussian --set sphere=1 --set bounces=3",
            1e-3,
        ),
        ("lights-shadowed", "--set sampling=bilateral --set shadow_rays=2 --set bounces=1", 0.02),
        ("lights-moved", "--set sampling=full --lights dark.json", 1e-3),
        ("lights-objects", "--set sampling=full --lights objects.json", 1e-3),
    ] {
        // Kernels are compiled for each; this one has them all.
        if device.checks == Checks::Off && name != "lights-shadowed" {
            continue;
        }
        let (frames, timings) = device.baked().both(device, name, &format!("--method many-light {few} {options}"));
        for images in &frames {
            for layer in ["emission", "diffuse", "glossy", ""] {
                let all = images[0].rgb(Path::new(""), layer).unwrap();
                let size = (all.iter().map(|c| c.length_squared()).sum::<f32>() / (3 * all.len()) as f32).sqrt();
                let error = rmse(images, layer) / size.max(1e-3);
                eprintln!("{name}, {layer}: {error} of {size}");
                assert!(size > 0.01 || layer == "emission", "{name}: next to no {layer}");
                assert!(error < most, "{name}, {layer}: {error}");
            }
        }
        for pass in ["light sampling", "filtering", "gbuffer", "gather", "direct", "composite"] {
            assert!(timings["mean_ms"][pass].as_f64().is_some_and(|ms| ms > 0.0), "{name}: {pass}");
        }
        let counts = &timings["frames"][0]["counts"];
        let [points, least, most] = ["shading points", "least nodes", "most nodes"].map(|c| counts[c].as_f64().unwrap());
        assert!(points > 100.0 && least > 0.0 && least < most, "{name}: {counts}");
        if name == "lights-leaves" {
            assert!(least > 0.9 * most && most <= 2000.0, "{counts}");
        }
    }
}
