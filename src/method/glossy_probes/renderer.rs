//! One frame by glossy probe reprojection: the method's table of contents (§5, §6).

use super::GlossyProbeParams;
use super::candidates::NearCandidates;
use super::coverage::{SubPixels, covered_pixels};
use super::filter::{FilterInput, FilterParams, NOT_GLOSSY, filter};
use super::footprint::{Footprint, GlossyPoint};
use super::gather::{Gathered, gather};
use super::previous::{Previous, reproject_previous};
use super::wanted::Served;
use crate::Result;
use crate::base::clock::Clock;
use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::probe::store::ProbeStore;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::composite::{diffuse_layer, downsample, emission_layer};
use crate::view::gbuffer::{GBuffer, Pixel, gbuffer_in};
use crate::view::mirror::{Reflected, mirror_pass};
use crate::view::mirror_light::{add_mirrored, mirror_light_pass};
use rayon::prelude::*;
use std::sync::Arc;

/// A frame's layers, at its final size; their sum is the frame.
pub struct Reprojected {
    /// LE: emission seen directly, and the environment.
    pub emission: Vec<Rgb>,
    /// L(S|D)*DE from the light map.
    pub diffuse: Vec<Rgb>,
    /// L(S|D)*S+E from the probes.
    pub glossy: Vec<Rgb>,
    /// Milliseconds a pass, in order.
    pub passes: Vec<(&'static str, f64)>,
    /// Sub-pixels that no probe and no earlier frame served.
    pub unserved: usize,
    /// Where they were asked for.
    pub buffers: Option<Buffers>,
}

/// Per-sub-pixel buffers of a frame, at `supersample` times its size, for inspection.
pub struct Buffers {
    /// Sub-pixels in a row.
    pub width: usize,
    /// Principal curvatures, 1/m.
    pub curvature: Vec<[f32; 2]>,
    /// Mirror hits.
    pub reflected: Vec<Reflected>,
    /// Before the filter.
    pub gathered: Vec<Gathered>,
    /// Footprint covariances, pixels².
    pub covariance: Vec<[f32; 3]>,
}

impl Buffers {
    fn of(view: &GBuffer, reflected: Vec<Reflected>, gathered: Vec<Gathered>, covariance: Vec<[f32; 3]>) -> Self {
        let curvature = |p: &Option<Pixel>| p.as_ref().map_or([0.0; 2], |p| [p.curvature.k1, p.curvature.k2]);
        Self { width: view.size()[0], curvature: view.pixels.iter().map(curvature).collect(), reflected, gathered, covariance }
    }
}

/// What stays the same from frame to frame.
pub struct Renderer<'a> {
    /// The scene.
    pub world: &'a World,
    /// Curvatures of its vertices.
    pub curvature: &'a CurvatureMap,
    /// Its diffuse light; without it, the diffuse layer is black.
    pub lightmap: Option<&'a LightMap>,
    /// Parameters.
    pub params: GlossyProbeParams,
    /// Whether frames come with their [`Buffers`].
    pub inspect: bool,
    footprint: Option<Footprint>,
    candidates: NearCandidates,
    previous: Option<Previous>,
    /// Where the next view may lie.
    room: Option<GBuffer>,
}

impl<'a> Renderer<'a> {
    /// Tabulates the footprints (§6.1) that probes baked at `roughness_scale` leave to the filter ([`FootprintParams::for_probes`]).
    pub fn new(
        world: &'a World,
        curvature: &'a CurvatureMap,
        lightmap: Option<&'a LightMap>,
        params: GlossyProbeParams,
        roughness_scale: f32,
    ) -> Self {
        let footprint = params.footprint.map(|f| Footprint::new(&f.for_probes(roughness_scale)));
        Self {
            world,
            curvature,
            lightmap,
            params,
            inspect: false,
            footprint,
            candidates: NearCandidates::default(),
            previous: None,
            room: None,
        }
    }

    /// Lets the next frame be the first of a path.
    pub fn forget(&mut self) {
        self.previous = None;
    }

    /// Renders the next frame of a path.
    pub fn frame(&mut self, camera: &Camera, probes: &mut ProbeStore<Served>) -> Result<Reprojected> {
        let n = self.params.supersample;
        let fine = Camera { size: camera.size.map(|s| s * n), ..camera.clone() };
        let size = fine.size.map(|s| s as usize);
        let mut clock = Clock::start();

        let places = probes.set.places.nearest(camera.position(), self.params.gather.probes);
        let read = probes.probes(&places.iter().map(|(index, _)| *index).collect::<Vec<_>>())?;
        let weight = |t: f32| self.params.gather.probe_weight(t);
        let near: Vec<_> = places.iter().zip(&read).map(|((index, t), probe)| (*index, &**probe, weight(*t))).collect();
        let roughness_scale = probes.set.roughness_scale;
        let albedos = self.params.gather.albedo_ratio.then_some(roughness_scale);
        let mirrors = self.lightmap.filter(|_| self.params.mirror_light && probes.set.mirrored);
        let weighted = self.candidates.of(self.world, &near, albedos, mirrors.is_some());
        clock.lap("load");
        let view = Arc::new(gbuffer_in(self.world, self.curvature, &fine, self.room.take()));
        clock.lap("gbuffer");
        let (reflected, mirrored) = match mirrors {
            Some(map) => {
                let (reflected, mirrored) = mirror_light_pass(self.world, map, &view);
                (reflected, Some(mirrored))
            }
            None => (mirror_pass(self.world, &view), None),
        };
        clock.lap("mirror");
        let mut gathered = gather(self.world, &view, &reflected, &weighted, roughness_scale, &self.params.gather);
        let unserved = reproject_previous(&view, &mut gathered, self.previous.as_ref());
        clock.lap("gather");
        let covariance = match &self.footprint {
            Some(footprint) => footprint_pass(footprint, &view, &reflected),
            None => vec![[0.0; 3]; gathered.len()],
        };
        clock.lap("footprint");
        let glossy = filter_pass(&view, &gathered, &covariance, &self.params.filter);
        clock.lap("filter");
        let diffuse = match self.lightmap {
            Some(map) => diffuse_layer(&self.world.scene, &view, map),
            None => vec![Rgb::ZERO; glossy.len()],
        };
        let emission = emission_layer(&view);
        let whole = mirrored.as_ref().map(|mirrored| add_mirrored(&glossy, mirrored));
        let mut layers = [emission, diffuse, whole.unwrap_or_else(|| glossy.clone())];
        if n > 1 {
            layers = layers.map(|layer| downsample(&layer, size, n as usize));
        }
        clock.lap("composite");
        let sub = SubPixels { view: &view, reflected: &reflected, glossy: &glossy, n: n as usize };
        for (i, c) in covered_pixels(self.world, self.lightmap, mirrored.is_some(), camera, &sub, &self.params.coverage) {
            for (layer, value) in layers.iter_mut().zip([c.emission, c.diffuse, c.glossy]) {
                layer[i] = value;
            }
        }
        clock.lap("coverage");
        let buffers = self.inspect.then(|| Buffers::of(&view, reflected, gathered, covariance));
        let before = self.previous.replace(Previous { view, glossy });
        self.room = before.and_then(|before| Arc::into_inner(before.view));
        let [emission, diffuse, glossy] = layers;
        Ok(Reprojected { emission, diffuse, glossy, passes: clock.laps, unserved, buffers })
    }
}

/// Σ_I of every pixel (Eq. 3): what the probes' reduced roughness lacks, pixels².
fn footprint_pass(footprint: &Footprint, view: &GBuffer, reflected: &[Reflected]) -> Vec<[f32; 3]> {
    let of = |(pixel, reflected): (&Option<Pixel>, &Reflected)| {
        let p = pixel.as_ref()?;
        let (x, n) = (p.surface.p, p.normal);
        let reflected_distance = reflected.distance_from(x);
        let point = GlossyPoint { x, n, reflected_distance, alpha: p.alpha?, curvature: &p.curvature };
        Some(footprint.covariance(&view.camera, &point))
    };
    let pixels = view.pixels.par_iter().zip(reflected).with_min_len(view.size()[0]);
    pixels.map(|p| of(p).unwrap_or([0.0; 3])).collect()
}

/// The glossy filter (§6.2) over a view's gathered colours.
pub fn filter_pass(view: &GBuffer, gathered: &[Gathered], covariance: &[[f32; 3]], params: &FilterParams) -> Vec<Rgb> {
    let [width, height] = view.size();
    let count = width * height;
    let (mut color, mut normal) = (vec![[0.0f32; 3]; count], vec![[0.0f32; 3]; count]);
    let (mut depth, mut energy, mut material) = (vec![0.0; count], vec![0.0; count], vec![0; count]);
    // The view is read once: it is ten times what the filter takes of it.
    let all = (&mut color, &mut normal, &mut depth, &mut energy, &mut material, &view.pixels, gathered);
    all.into_par_iter().with_min_len(width).for_each(|(color, normal, depth, energy, material, pixel, gathered)| {
        (*color, *energy, *material) = (gathered.color.to_array(), gathered.energy, NOT_GLOSSY);
        if let Some(p) = pixel {
            (*normal, *depth) = (p.normal.to_array(), p.depth);
            *material = if p.alpha.is_some() { p.surface.material } else { NOT_GLOSSY };
        }
    });
    let input = FilterInput {
        width,
        height,
        color: bytemuck::cast_slice(&color),
        normal: bytemuck::cast_slice(&normal),
        depth: &depth,
        material: &material,
        covariance,
        energy: &energy,
    };
    filter(&input, params)
}
