//! Frames by glossy probes on a device: the twin of [`crate::method::glossy_probes::renderer`]. A pass's data stays on the device; the layers come back.
//!
//! Probes are gathered from one after the other, so that a frame is right with memory for a single one.

pub(crate) mod coverage;
pub(crate) mod fill;
pub mod filter;
pub(crate) mod footprint;
pub(crate) mod gather;
pub(crate) mod probes;

use super::GlossyProbeParams;
use super::candidates::Candidates;
use super::gather::Gathered;
use super::renderer::Reprojected;
use super::wanted::Served;
use super::whole::Buffers;
use crate::Result;
use crate::base::clock::Clock;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{FAR, area};
use crate::gpu::resident::{Place, Resident, room_for_probes};
use crate::gpu::scene::GpuScene;
use crate::gpu::view::composite::{Composite, Layers};
use crate::gpu::view::gbuffer::GBuffer;
use crate::gpu::view::mirror::Mirror;
use crate::gpu::view::mirror_light::MirrorLight;
use crate::gpu::view::{GpuPixel, ViewBuffers, pixels};
use crate::lightmap::LightMap;
use crate::probe::file::Probe;
use crate::probe::store::ProbeStore;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::mirror_light::PERFECT;
use coverage::Coverage;
use fill::Fill;
use filter::{Filter, Planes, Scratch};
use footprint::Footprint;
use gather::{Gather, GpuGathered, Sums};
use glam::{Vec2, Vec4, Vec4Swizzles};
use probes::GpuProbe;
use std::sync::Arc;

/// Bytes a sub-pixel of a plane of colours.
const PLANE: u64 = size_of::<Vec4>() as u64;

/// The buffers of frames of one size.
struct Target {
    view: ViewBuffers,
    /// The pixels of the frame before, and its camera.
    last: wgpu::Buffer,
    last_camera: Option<Camera>,
    sums: Sums,
    /// Colour and energy before the filter.
    gathered: wgpu::Buffer,
    covariances: wgpu::Buffer,
    scratch: Scratch,
    /// What perfect mirrors show.
    mirrored: wgpu::Buffer,
    /// Filtered; as long as nothing has been filtered, the frame's before.
    glossy: wgpu::Buffer,
    layers: Layers,
}

impl Target {
    /// Bytes a sub-pixel, but for the layers and the anchors.
    const BYTES: u64 = ViewBuffers::BYTES + size_of::<GpuPixel>() as u64 + Sums::BYTES + Scratch::BYTES + 4 * PLANE;

    fn new(gpu: &Gpu, size: [u32; 2], params: &GlossyProbeParams) -> Result<Self> {
        let area = area(size);
        let plane = |label| gpu.output(label, PLANE * area);
        Ok(Self {
            view: ViewBuffers::new(gpu, size)?,
            last: pixels(gpu, size)?,
            last_camera: None,
            sums: Sums::new(gpu, size, &params.gather)?,
            gathered: plane("gathered colours")?,
            covariances: plane("covariances")?,
            scratch: Scratch::new(gpu, area)?,
            mirrored: plane("what mirrors show")?,
            glossy: plane("filtered colours")?,
            layers: Layers::new(gpu, area / u64::from(params.supersample * params.supersample))?,
        })
    }
}

/// What stays the same from frame to frame.
pub struct Renderer<'a> {
    /// Whether frames come with their [`Buffers`].
    pub inspect: bool,
    gpu: Arc<Gpu>,
    scene: GpuScene,
    world: &'a World,
    params: GlossyProbeParams,
    roughness_scale: f32,
    memory: u64,
    gbuffer: GBuffer,
    mirror: Mirror,
    /// Where there is a light map to light mirrors by.
    mirror_light: Option<MirrorLight>,
    gather: Gather,
    footprint: Option<Footprint>,
    filter: Filter,
    fill: Fill,
    composite: Composite,
    coverage: Option<Coverage>,
    resident: Resident<GpuProbe>,
    target: Option<Target>,
}

impl<'a> Renderer<'a> {
    /// Compiles the passes; as [`crate::method::glossy_probes::renderer::Renderer::new`]. `memory` is what all of it may take on the device, bytes.
    pub fn new(
        gpu: Arc<Gpu>,
        world: &'a World,
        curvature: &CurvatureMap,
        lightmap: Option<&LightMap>,
        params: GlossyProbeParams,
        roughness_scale: f32,
        memory: u64,
    ) -> Result<Self> {
        let footprint = params.footprint.map(|f| {
            let table = crate::method::glossy_probes::footprint::Footprint::new(&f.for_probes(roughness_scale));
            Footprint::new(&gpu, &table)
        });
        let scene = GpuScene::lit(gpu.clone(), world, lightmap)?;
        Ok(Self {
            inspect: false,
            world,
            roughness_scale,
            memory,
            gbuffer: GBuffer::new(&scene, world, curvature)?,
            mirror: Mirror::new(&scene)?,
            mirror_light: (lightmap.is_some() && params.mirror_light).then(|| MirrorLight::new(&scene)).transpose()?,
            coverage: match params.coverage.rays {
                0 => None,
                rays => Some(Coverage::new(&scene, rays)?),
            },
            scene,
            gather: Gather::new(&gpu, &params.gather)?,
            footprint: footprint.transpose()?,
            filter: Filter::new(gpu.clone(), &params.filter)?,
            fill: Fill::new(&gpu)?,
            composite: Composite::new(&gpu, params.supersample)?,
            resident: Resident::new(0),
            target: None,
            params,
            gpu,
        })
    }

    /// Lets the next frame be the first of a path.
    pub fn forget(&mut self) {
        self.target.iter_mut().for_each(|target| target.last_camera = None);
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.gpu.adapter.name
    }

    /// Whether passes are timed by the device's own clock.
    pub fn has_clock(&self) -> bool {
        self.gpu.adapter.timestamps
    }

    /// Bytes of the probes on the device.
    pub fn probe_bytes(&self) -> u64 {
        self.resident.bytes()
    }

    /// Makes room for frames of `size` and for at least one probe of so many texels. An error where memory does not suffice.
    pub fn reserve(&mut self, size: [u32; 2], probe: [u32; 2]) -> Result<()> {
        self.target = Some(self.reserved(size, probe)?);
        Ok(())
    }

    /// The buffers for frames of `size`, taken out.
    fn reserved(&mut self, size: [u32; 2], probe: [u32; 2]) -> Result<Target> {
        let fine = size.map(|s| s * self.params.supersample);
        if let Some(target) = self.target.take().filter(|t| t.view.size == fine) {
            return Ok(target);
        }
        let frame = area(fine) * Target::BYTES + area(size) * Layers::BYTES + self.scene.bytes() + self.gbuffer.bytes();
        self.resident.set_budget(room_for_probes(self.memory, size, frame, area(probe) * probes::TEXEL)?);
        Target::new(&self.gpu, fine, &self.params)
    }

    /// Renders the next frame of a path; meanwhile probes are uploaded for the one after it, where there is `next`.
    pub fn frame(&mut self, camera: &Camera, next: Option<&Camera>, probes: &mut ProbeStore<Served>) -> Result<Reprojected> {
        let (gpu, mut target) = (self.gpu.clone(), self.reserved(camera.size, probes.set.size)?);
        let frame = gpu.checked(|| self.passes(&mut target, camera, next, probes))??;
        self.target = Some(target);
        Ok(frame)
    }

    fn passes(
        &mut self,
        t: &mut Target,
        camera: &Camera,
        next: Option<&Camera>,
        probes: &mut ProbeStore<Served>,
    ) -> Result<Reprojected> {
        let (gpu, params, eye) = (&*self.gpu, &self.params, camera.position());
        let fine = Camera { size: t.view.size, ..camera.clone() };
        let albedos = params.gather.albedo_ratio.then_some(self.roughness_scale);
        let mut clock = Clock::start();
        let mut commands = Commands::new(gpu);

        let mirror_light = self.mirror_light.as_ref().filter(|_| probes.set.mirrored);
        let mirrors = mirror_light.is_some();
        let wanted = albedos.or(mirrors.then_some(self.roughness_scale));
        self.gbuffer.run(&self.scene, &mut commands, &fine, &t.view, wanted)?;
        self.mirror.run(&self.scene, &mut commands, &fine, &t.view)?;
        if let Some(mirror_light) = mirror_light {
            mirror_light.run(&self.scene, &mut commands, (&fine, &t.view), (&PERFECT, PERFECT.max_alpha), &t.mirrored)?;
        }
        gpu.clear(&t.sums.sums);
        self.resident.begin_frame();
        let upload = |probe: &Probe| GpuProbe::upload(gpu, probe, &Candidates::new(self.world, probe, albedos, mirrors));
        for (index, t_i) in probes.set.places.nearest(eye, params.gather.probes) {
            clock.restart();
            let probe = probes.probe(index)?;
            let there = self.resident.get(gpu, index, probes::bytes(&probe), || upload(&probe))?;
            clock.lap("load");
            let place = Place::new(index, &probe, params.gather.probe_weight(t_i), GpuProbe::second(&probe));
            self.gather.run(gpu, &mut commands, (&t.view, eye), (&there, &place), &t.sums)?;
        }
        let previous = (t.last_camera.as_ref(), &t.last, &t.glossy);
        self.fill.run(gpu, &mut commands, (&t.view, &fine, &t.gathered), &t.sums, previous, &t.layers)?;
        match &self.footprint {
            Some(footprint) => footprint.run(gpu, &mut commands, &fine, &t.view, &t.covariances)?,
            None => gpu.clear(&t.covariances),
        }
        self.filter.run(&mut commands, &t.planes())?;
        self.composite.layers(gpu, &mut commands, &t.view, (&t.glossy, mirrors.then_some(&t.mirrored)), &t.layers)?;
        if let Some(coverage) = &self.coverage {
            coverage.run(&self.scene, &mut commands, camera, (&t.view, &t.glossy, mirrors), &t.layers)?;
        }
        clock.restart();
        if let Some(next) = next {
            let wanted = probes.set.places.nearest(next.position(), params.gather.probes);
            upload_ahead((gpu, &mut self.resident), probes, &wanted, upload)?;
        }
        clock.lap("load");
        let passes = commands.finish()?;

        clock.restart();
        let ([emission, diffuse, glossy], unserved) = t.layers.read(gpu)?;
        clock.lap("read");
        let buffers = if self.inspect { Some(t.read(gpu)?) } else { None };
        std::mem::swap(&mut t.view.pixels, &mut t.last);
        t.last_camera = Some(fine);
        Ok(Reprojected { emission, diffuse, glossy, passes: [clock.laps, passes].concat(), unserved, buffers })
    }
}

/// Uploads what the next view wants, by index and distance, as far as there is room.
fn upload_ahead(
    (gpu, resident): (&Gpu, &mut Resident<GpuProbe>),
    probes: &mut ProbeStore<Served>,
    wanted: &[(usize, f32)],
    upload: impl Fn(&Probe) -> Result<GpuProbe>,
) -> Result<()> {
    for &(index, _) in wanted {
        // What fails here fails again when that frame is rendered.
        if let Ok(probe) = probes.probe(index) {
            resident.upload_ahead(gpu, index, probes::bytes(&probe), || upload(&probe))?;
        }
    }
    Ok(())
}

impl Target {
    /// What the filter reads and writes.
    fn planes(&self) -> Planes<'_> {
        Planes {
            size: self.view.size,
            pixels: &self.view.pixels,
            gathered: &self.gathered,
            covariances: &self.covariances,
            scratch: &self.scratch,
            glossy: &self.glossy,
        }
    }

    fn read(&self, gpu: &Gpu) -> Result<Buffers> {
        let (colors, sums): (Vec<Vec4>, Vec<GpuGathered>) = (gpu.read(&self.gathered)?, gpu.read(&self.sums.sums)?);
        let gathered = |(c, s): (&Vec4, &GpuGathered)| Gathered {
            color: c.xyz(),
            energy: if c.w < FAR { c.w } else { f32::INFINITY },
            best: (s.sum[3] > 0.0).then(|| {
                let [_, x, y, probe] = s.best;
                (probe as usize, Vec2::new(f32::from_bits(x), f32::from_bits(y)))
            }),
        };
        Ok(Buffers {
            width: self.view.size[0] as usize,
            curvature: self.view.read_curvatures(gpu)?,
            reflected: self.view.read_reflected(gpu)?,
            gathered: colors.iter().zip(&sums).map(gathered).collect(),
            covariance: gpu.read::<Vec4>(&self.covariances)?.iter().map(|c| c.xyz().to_array()).collect(),
        })
    }
}
