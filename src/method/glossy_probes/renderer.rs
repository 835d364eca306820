//! One frame by glossy probe reprojection: the method's table of contents (§5, §6).

use super::GlossyProbeParams;
use super::candidates::NearCandidates;
use super::coverage::{SubPixels, covered_pixels};
use super::filter::Convolution;
use super::footprint::Footprint;
use super::previous::Previous;
use super::tiles::{PASSES, Planes, Room, Tiles};
use super::wanted::Served;
use super::whole::{Buffers, Whole};
use crate::Result;
use crate::base::clock::Clock;
use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::probe::store::ProbeStore;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::composite::downsample;
use crate::view::mirror_light::add_mirrored;

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
    /// Where the next frame's passes write.
    room: Room,
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
            room: Room::default(),
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
        let size @ [width, _] = fine.size.map(|s| s as usize);
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
        let tiles = Tiles {
            world: self.world,
            curvature: self.curvature,
            lightmap: self.lightmap,
            mirrors,
            probes: &weighted,
            roughness_scale,
            gather: &self.params.gather,
            footprint: self.footprint.as_ref(),
            filter: &self.params.filter,
            previous: self.previous.as_ref(),
        };
        let (Planes { shown, mut glossy, mirrored, emission, diffuse }, tally) = tiles.run(&fine, &mut self.room);
        clock.share(&PASSES, &tally.seconds);
        let in_passes = self.params.filter.method != Convolution::Full;
        let whole = (self.inspect || !in_passes).then(|| tiles.whole(&fine));
        clock.restart();
        match &whole {
            Some(whole) if !in_passes => glossy = whole.filtered(&self.params.filter),
            _ => self.room.filter(width, &mut glossy, &self.params.filter),
        }
        clock.lap("filter");
        let whole_layer = if mirrors.is_some() { add_mirrored(&glossy, mirrored) } else { glossy.clone() };
        let mut layers = [emission, diffuse, whole_layer];
        if n > 1 {
            layers = layers.map(|layer| downsample(&layer, size, n as usize));
        }
        clock.lap("composite");
        let sub = SubPixels { shown: &shown, glossy: &glossy, size, n: n as usize };
        for (i, c) in covered_pixels(self.world, self.lightmap, mirrors.is_some(), camera, &sub, &self.params.coverage) {
            for (layer, value) in layers.iter_mut().zip([c.emission, c.diffuse, c.glossy]) {
                layer[i] = value;
            }
        }
        clock.lap("coverage");
        let buffers = whole.filter(|_| self.inspect).map(Whole::buffers);
        if let Some(before) = self.previous.replace(Previous { camera: fine, shown, glossy }) {
            self.room.take(Planes { shown: before.shown, glossy: before.glossy, ..Planes::default() });
        }
        let [emission, diffuse, glossy] = layers;
        Ok(Reprojected { emission, diffuse, glossy, passes: clock.laps, unserved: tally.unserved, buffers })
    }
}
