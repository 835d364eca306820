//! The text of kernels, put together from the files of `shaders/`.
//!
//! A file says at its head what it needs: `// #include "shared/math.wgsl"`. Each file comes once, after those that it includes.

use crate::{Error, Result};

/// The files: name below `shaders/`, and text.
macro_rules! files {
    ($($name:literal),+ $(,)?) => {
        &[$(($name, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $name)))),+]
    };
}

/// All shaders. A test checks that none of the folder is left out.
pub(crate) const FILES: &[(&str, &str)] = files![
    "glossy_probes/cover.wgsl",
    "glossy_probes/fill.wgsl",
    "glossy_probes/filter.wgsl",
    "glossy_probes/filter_end.wgsl",
    "glossy_probes/filter_pass.wgsl",
    "glossy_probes/filter_start.wgsl",
    "glossy_probes/find_anchors.wgsl",
    "glossy_probes/footprint.wgsl",
    "glossy_probes/gather.wgsl",
    "glossy_probes/gathered.wgsl",
    "glossy_probes/perturb.wgsl",
    "glossy_probes/search.wgsl",
    "image_space_gather/gather_image.wgsl",
    "light_field_probes/add_glossy.wgsl",
    "light_field_probes/direct_starts.wgsl",
    "light_field_probes/lit_diffuse.wgsl",
    "light_field_probes/lobe_ray.wgsl",
    "light_field_probes/lobe_rays.wgsl",
    "light_field_probes/march.wgsl",
    "light_field_probes/octahedral.wgsl",
    "light_field_probes/params.wgsl",
    "light_field_probes/places.wgsl",
    "light_field_probes/trace_rays.wgsl",
    "lightmap_rt/mean_light.wgsl",
    "lightmap_rt/view_starts.wgsl",
    "many_light/add_up.wgsl",
    "many_light/bounce.wgsl",
    "many_light/choose_pixels.wgsl",
    "many_light/exponent.wgsl",
    "many_light/expose.wgsl",
    "many_light/filter_nodes.wgsl",
    "many_light/follow_lobes.wgsl",
    "many_light/gather.wgsl",
    "many_light/grid.wgsl",
    "many_light/light_pixels.wgsl",
    "many_light/lit_pixel.wgsl",
    "many_light/lobe.wgsl",
    "many_light/node.wgsl",
    "many_light/params.wgsl",
    "many_light/receive.wgsl",
    "many_light/reflected.wgsl",
    "many_light/sample_lights.wgsl",
    "many_light/site.wgsl",
    "many_light/tally.wgsl",
    "many_light/view_layers.wgsl",
    "path_trace/add_guides.wgsl",
    "path_trace/add_samples.wgsl",
    "path_trace/camera_hits.wgsl",
    "path_trace/denoise.wgsl",
    "path_trace/denoise_end.wgsl",
    "path_trace/denoise_start.wgsl",
    "path_trace/despeckle.wgsl",
    "path_trace/guide.wgsl",
    "path_trace/smooth_level.wgsl",
    "path_trace/with_variance.wgsl",
    "radiance_probes/added_light.wgsl",
    "radiance_probes/blocker.wgsl",
    "radiance_probes/blocker_radiance.wgsl",
    "radiance_probes/blockers.wgsl",
    "radiance_probes/cluster_projection.wgsl",
    "radiance_probes/fill_ring.wgsl",
    "radiance_probes/first_order.wgsl",
    "radiance_probes/map_light.wgsl",
    "radiance_probes/probe_relight.wgsl",
    "radiance_probes/receiver_light.wgsl",
    "radiance_probes/receiver_radiance.wgsl",
    "radiance_probes/reconstruct.wgsl",
    "radiance_probes/taps.wgsl",
    "radiance_probes/volume.wgsl",
    "radiance_probes/volume_light.wgsl",
    "shared/albedo.wgsl",
    "shared/bsdf.wgsl",
    "shared/camera.wgsl",
    "shared/camera_ray.wgsl",
    "shared/closest.wgsl",
    "shared/direct_at.wgsl",
    "shared/direct_light.wgsl",
    "shared/envmap.wgsl",
    "shared/factors.wgsl",
    "shared/follow.wgsl",
    "shared/fresnel.wgsl",
    "shared/gbuffer.wgsl",
    "shared/glossy_direct.wgsl",
    "shared/layer_pixel.wgsl",
    "shared/layers.wgsl",
    "shared/light_tree.wgsl",
    "shared/lightmap.wgsl",
    "shared/lights.wgsl",
    "shared/math.wgsl",
    "shared/microfacet.wgsl",
    "shared/mirror.wgsl",
    "shared/mirror_light.wgsl",
    "shared/mirror_pass.wgsl",
    "shared/models.wgsl",
    "shared/outlook.wgsl",
    "shared/path.wgsl",
    "shared/pixel_run.wgsl",
    "shared/principled.wgsl",
    "shared/probe.wgsl",
    "shared/random.wgsl",
    "shared/scene.wgsl",
    "shared/start.wgsl",
    "shared/surface.wgsl",
    "shared/texture.wgsl",
    "shared/traverse.wgsl",
    "shared/view.wgsl",
    "shared/view_factors.wgsl",
    "ulr/ulr.wgsl",
    "ulr/ulr_blend.wgsl",
    "ulr/ulr_look.wgsl",
];

/// The names that a file includes.
pub(crate) fn includes(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(|line| line.strip_prefix("// #include \"")?.strip_suffix('"'))
}

/// The names of `file` and of all that it includes, each after what it needs. Errors where one is missing or includes itself.
pub(crate) fn resolve<'a>(files: &[(&'a str, &'a str)], file: &'a str) -> Result<Vec<&'a str>> {
    let (mut order, mut open) = (Vec::new(), Vec::new());
    visit(files, file, &mut open, &mut order)?;
    Ok(order)
}

fn visit<'a>(files: &[(&'a str, &'a str)], file: &'a str, open: &mut Vec<&'a str>, order: &mut Vec<&'a str>) -> Result<()> {
    if order.contains(&file) {
        return Ok(());
    }
    let error = |what: String| Error::Request(format!("shaders/{}: {what}", open.last().unwrap_or(&file)));
    if open.contains(&file) {
        return Err(error(format!("includes \"{file}\", which includes it: {} -> {file}", open.join(" -> "))));
    }
    let Some((_, text)) = files.iter().find(|(name, _)| *name == file) else {
        return Err(error(format!("expected \"{file}\" in shaders/, found no such file")));
    };
    open.push(file);
    for name in includes(text) {
        visit(files, name, open, order)?;
    }
    open.pop();
    order.push(file);
    Ok(())
}

/// The text of a kernel's file with all that it includes.
pub(crate) fn assemble(file: &'static str) -> Result<String> {
    let names = resolve(FILES, file)?;
    let text = |name: &str| FILES.iter().find(|(n, _)| *n == name).map_or("", |(_, text)| text);
    Ok(names.into_iter().map(text).collect::<Vec<_>>().join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_file_comes_once_and_after_those_that_it_includes() {
        let files =
            [("d", "// #include \"b\"\n// #include \"c\"\n"), ("c", "// #include \"a\""), ("b", "// #include \"a\""), ("a", "")];
        assert_eq!(resolve(&files, "d").unwrap(), ["a", "b", "c", "d"]);
    }

    #[test]
    fn missing_files_and_circles_are_errors_that_name_them() {
        let files =
            [("a", "// #include \"b\""), ("b", "// #include \"c\""), ("c", "// #include \"b\""), ("d", "// #include \"e\"")];
        let error = |file| resolve(&files, file).unwrap_err().to_string();
        assert!(error("a").contains("shaders/c: includes \"b\"") && error("a").contains("a -> b -> c -> b"), "{}", error("a"));
        assert!(error("d").contains("shaders/d: expected \"e\""), "{}", error("d"));
        assert!(error("f").contains("\"f\""), "{}", error("f"));
    }

    #[test]
    fn all_of_the_folder_is_embedded() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
        let mut found = Vec::new();
        for folder in std::fs::read_dir(&root).unwrap() {
            for file in std::fs::read_dir(folder.unwrap().path()).unwrap() {
                let path = file.unwrap().path();
                found.push(path.strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/"));
            }
        }
        found.sort();
        assert_eq!(found, FILES.iter().map(|(name, _)| *name).collect::<Vec<_>>());
    }
}
