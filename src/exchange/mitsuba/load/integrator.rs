//! What the scene's integrator says of paths: depth, roulette, and whether cameras see lamps.

use super::Builder;
use crate::Result;
use crate::exchange::mitsuba::tree::{Kind, Node};

/// Integrators that solve for all of light transport, or for as much of it as `max_depth` says.
const OF_LIGHT: [&str; 10] =
    ["path", "volpath", "volpathmis", "volpath_simple", "bdpt", "ptracer", "prb", "prbvolpath", "prb_projective", "direct"];
/// Integrators that hold another one.
const AROUND: [&str; 4] = ["aov", "moment", "adaptive", "multichannel"];
/// Russian roulette of a million steps is none.
const DEPTHS: i64 = u32::MAX as i64;

impl<'a> Builder<'a> {
    /// Takes what is said of paths; warns of an integrator that computes something else.
    pub(super) fn integrator(&mut self, node: &'a Node) -> Result<()> {
        let mut params = self.params(node);
        let p = &mut params;
        let name = node.plugin.as_str();
        let nested = p.children(Kind::Integrator)?;
        if AROUND.contains(&name) || (!OF_LIGHT.contains(&name) && !nested.is_empty()) {
            // What it adds to the image is its own affair.
            for inner in nested {
                self.integrator(inner)?;
            }
            return Ok(());
        }
        if !OF_LIGHT.contains(&name) {
            let message = format!("the integrator \"{name}\" is not known: paths of light are traced in its place");
            self.scene.warnings.push(node.at.warning(message));
        }
        let depth = p.integer("max_depth", -1, -1, DEPTHS)?;
        self.scene.max_depth = u32::try_from(depth).ok();
        let at = p.at("max_depth");
        self.scene.max_depth_at = format!("{}:{}", at.file.display(), at.line);
        if depth == 0 {
            let message = "max_depth = 0: Mitsuba's image is black; emission that is seen directly is kept here";
            self.scene.warnings.push(p.at("max_depth").warning(message));
        }
        if p.has("rr_depth") {
            // Beyond any path.
            self.scene.rr_depth = Some(p.integer("rr_depth", 5, -1, DEPTHS)?.try_into().unwrap_or(u32::MAX));
        }
        self.scene.hide_emitters = p.bool("hide_emitters", false)?;
        if name == "direct" {
            self.scene.max_depth = Some(2);
            // Shares of one estimate: the mean is the same.
            p.accept(&["emitter_samples", "bsdf_samples", "shading_samples"]);
        }
        // About time and noise.
        p.accept(&["samples_per_pass", "block_size", "timeout", "strict_normals", "use_spectral_mis", "max_null_collisions"]);
        if OF_LIGHT.contains(&name) {
            params.finish(&mut self.scene.warnings);
        }
        Ok(())
    }
}
