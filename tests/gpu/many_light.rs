//! Frames by many lights. Both sides have the same lights, tree and random numbers, and differ in rounding.

use crate::Device;
use crate::paths::difference;
use reprobe::base::math::Rgb;
use reprobe::gpu::Checks;
use std::path::Path;

const SPHERES: &str = "lights-spheres";
const SHADOWED: &str = "lights-shadowed";

pub fn frames_are_the_cpus(device: &Device) {
    let few = "--set repulsion=4 --set direct_samples=4";
    // Kernels are compiled for each: one has no checks.
    let settings: &[(&str, &str)] = match device.checks {
        Checks::Off => &[(SHADOWED, "--set vpls=2000 --set sampling=full --set shadow_rays=2 --set bounces=1")],
        Checks::On => &[
            ("lights-adaptive", "--set vpls=2000 --supersample 2 --lights objects.json"),
            // All of the kernels' other branches.
            (
                SPHERES,
                "--set vpls=300 --set sampling=bilateral --set traversal=leaves --set kernel=gaussian --set sphere=1 --set bounces=3 \
                 --set mirror_rays=0",
            ),
        ],
    };
    for &(name, options) in settings {
        let (frames, timings) = device.baked().both(device, name, &format!("--method many-light {few} {options}"));
        for images in &frames {
            for layer in ["emission", "diffuse", "glossy", ""] {
                let [a, b] = images.each_ref().map(|i| i.rgb(Path::new(""), layer).unwrap());
                let (apart, mean) = difference(&b, &a);
                eprintln!("{name}, {layer}: {apart} of the pixels, means by {mean}");
                assert!(layer == "emission" || a.iter().filter(|c| **c != Rgb::ZERO).count() * 3 > a.len(), "{name}: {layer}");
                // A node that rounding draws in place of another is another sample; and a spherical light in a pixel's plane, on the other side of
                // a sheet, lies before or behind it as rounding has it.
                let most = match name {
                    SHADOWED => 0.01,
                    SPHERES => 0.02,
                    _ => 1e-3,
                };
                assert!(apart <= most && mean < 2e-3, "{name}, {layer}: {apart} of the pixels, means by {mean}");
            }
        }
        for pass in ["light sampling", "filtering", "gbuffer", "gather", "direct", "composite"] {
            assert!(timings["mean_ms"][pass].as_f64().is_some_and(|ms| ms > 0.0), "{name}: {pass}");
        }
        let counts = &timings["frames"][0]["counts"];
        let [points, least, most] = ["shading points", "least nodes", "most nodes"].map(|c| counts[c].as_f64().unwrap());
        assert_eq!(counts["mirror pixels"].as_f64().unwrap() > 100.0, name != SPHERES, "{name}: {counts}");
        assert!(points > 100.0 && least > 0.0 && least <= most, "{name}: {counts}");
        assert!(name != SPHERES || (least == most && most <= 300.0), "{counts}");
    }
}
