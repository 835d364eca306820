//! Sites of a bake: the open sides of its texels as points of the scene's surfaces, which of them see one another, and their light without its
//! noise.

use super::bake::{OPEN, PART, Pass, Plan};
use super::denoise::{DenoiseParams, Light, Surfaces};
use super::links::{Links, Site, link};
use super::parts::Record;
use super::receivers::place;
use super::texels::Point;
use super::visible::Visibility;
use crate::base::math::Rgb;
use crate::base::progress::Progress;
use glam::Vec3;
use rayon::prelude::*;

/// Points that a whole texel's centre is the mean of.
const PLACES: u32 = 4;

impl Plan<'_> {
    /// A pass's texel sides without most of their noise. Those pressed against something or inside of it stay as they are.
    pub(super) fn denoise(&self, pass: &Pass, records: &mut [Record], params: &DenoiseParams, progress: &dyn Progress) {
        let sites = self.sites(pass, records);
        let links = self.links(&sites);
        let light = |s: &Site| {
            let [r, g, b, _, variance, ..] = records[s.item as usize].map(f32::from_bits);
            Light { color: Rgb::new(r, g, b), variance }
        };
        let light: Vec<Light> = sites.iter().map(light).collect();
        let surface = Surfaces { sites: &sites, links: &links, texel: self.atlas.texel, params, reach: None };
        for (site, clean) in sites.iter().zip(surface.denoise(&light, progress)) {
            records[site.item as usize][..3].copy_from_slice(&clean.color.to_array().map(f32::to_bits));
        }
    }

    /// The sites of a pass, in the order of its texel sides.
    fn sites(&self, pass: &Pass, records: &[Record]) -> Vec<Site> {
        let visibility = self.visibility();
        let site = |(item, (&(texel, back), record)): (usize, (&(u32, bool), &Record))| {
            let (texel, side) = (texel as usize, if back { -1.0 } else { 1.0 });
            let in_part = record[3] & PART != 0;
            // A texel that is hidden in part and gets no light is a gap that none comes into.
            if record[3] & OPEN == 0 || in_part && record[..3] == [0; 3] {
                return None;
            }
            let surfaces: Vec<_> = if in_part {
                vec![self.draw(pass, texel, back, record[5]).0]
            } else {
                (0..PLACES).map(|i| visibility.sample(texel, place(i))).collect()
            };
            let mean = |of: &dyn Fn(usize) -> Vec3| (0..surfaces.len()).map(of).sum::<Vec3>() / surfaces.len() as f32;
            let first = &surfaces[0];
            Some(Site {
                item: item as u32,
                point: Point { triangle: first.triangle, barycentric: first.barycentric },
                position: mean(&|i| surfaces[i].p),
                normal: mean(&|i| surfaces[i].frame.n).try_normalize().unwrap_or(first.ng) * side,
                material: first.material,
                in_part,
            })
        };
        self.items.par_iter().zip(records).enumerate().filter_map(site).collect()
    }

    /// Which of them lie beside one another.
    fn links(&self, sites: &[Site]) -> Links {
        let visibility = self.visibility();
        let is_back = |s: &Site| self.items[s.item as usize].1;
        link(sites, self.atlas.texel, &|a, b| {
            let (a, b) = (&sites[a], &sites[b]);
            is_back(a) == is_back(b) && together(&visibility, a, b, is_back(a))
        })
    }
}

fn together(visibility: &Visibility, a: &Site, b: &Site, back: bool) -> bool {
    visibility.together(&visibility.surface(a.point), &visibility.surface(b.point), back)
}
