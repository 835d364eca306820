//! Layers lit by light field probes: the twin of [`super::shade`].

pub(crate) mod field;

use super::LightFieldParams;
use super::field::LightField;
use super::shade::{BRANCHES, Shading};
use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::follow::{PATH_START, Place, Purpose, SampleSum, Samples, most_starts};
use crate::gpu::kernel::Kernel;
use crate::gpu::pace::Pace;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::frame::{Baseline, BaselineFrame, Target};
use crate::gpu::view::{PIXEL, REFLECTED, SHADING};
use crate::material::bsdf::{Lobes, Query};
use crate::scene::Camera;
use crate::transport::World;
use crate::transport::follow::PathStart;
use crate::transport::path::PathParams;
use crate::view::gbuffer::GLOSSY;
use bytemuck::{Pod, Zeroable};
use field::{FIELD, Field, GpuField};
use glam::Vec4;
use std::sync::Arc;

/// `Params` of params.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    field: Field,
    seed: u32,
    frame: u32,
    first_pixel: u32,
    pixels: u32,
    first_sample: u32,
    samples: u32,
    all_samples: u32,
    what: u32,
}

/// What is sampled: direct light of either layer, or rays along the glossy lobes.
pub(crate) const DIFFUSE_LIGHT: u32 = 0;
pub(crate) const GLOSSY_LIGHT: u32 = 1;
pub(crate) const RAYS: u32 = 2;

/// `LobeRay` of lobe_ray.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LobeRay {
    origin: [f32; 3],
    omega: f32,
    direction: [f32; 3],
    lives: u32,
    weight: [f32; 3],
    padding: u32,
}

/// Where paths begin that bring direct light.
pub(crate) const DIRECT_STARTS: KernelSpec = KernelSpec {
    file: "light_field_probes/direct_starts.wgsl",
    twin: "src/method/light_field_probes/shade.rs: direct",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("field_params", Uniform), ("view", Read), ("shading", ReadWrite), ("starts", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &FIELD, &PIXEL, &REFLECTED, &SHADING, &PATH_START],
};
/// Rays along the lobes.
pub(crate) const LOBE_RAYS: KernelSpec = KernelSpec {
    file: "light_field_probes/lobe_rays.wgsl",
    twin: "src/method/light_field_probes/lobe.rs: along_lobe",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("field_params", Uniform), ("view", Read), ("rays", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &FIELD, &PIXEL, &REFLECTED, &LOBE_RAY],
};
/// What they meet.
pub(crate) const TRACE_RAYS: KernelSpec = KernelSpec {
    file: "light_field_probes/trace_rays.wgsl",
    twin: "src/method/light_field_probes/trace.rs: trace",
    workgroup: [64, 1],
    scene: false,
    bindings: &[
        ("field_params", Uniform),
        ("places", Read),
        ("surfels", Read),
        ("bounds", Read),
        ("light", Read),
        ("rays", Read),
        ("values", ReadWrite),
    ],
    structs: &[&PARAMS, &CAMERA, &FIELD, &LOBE_RAY],
};
/// The glossy layer.
pub(crate) const ADD_GLOSSY: KernelSpec = KernelSpec {
    file: "light_field_probes/add_glossy.wgsl",
    twin: "src/method/light_field_probes/shade.rs: glossy",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("field_params", Uniform), ("values", Read), ("glossy", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &FIELD],
};
/// The diffuse layer.
pub(crate) const LIT_DIFFUSE: KernelSpec = KernelSpec {
    file: "light_field_probes/lit_diffuse.wgsl",
    twin: "src/method/light_field_probes/shade.rs: diffuse",
    workgroup: [64, 1],
    scene: false,
    bindings: &[
        ("field_params", Uniform),
        ("places", Read),
        ("ambient", Read),
        ("view", Read),
        ("sums", Read),
        ("shading", ReadWrite),
    ],
    structs: &[&PARAMS, &CAMERA, &FIELD, &PIXEL, &REFLECTED, &SHADING],
};
const PARAMS: StructLayout = layout!(Params as "Params" {
    camera, field, seed, frame, first_pixel, pixels, first_sample, samples, all_samples, what
});
const LOBE_RAY: StructLayout = layout!(LobeRay as "LobeRay" { origin, omega, direction, lives, weight });

/// Renders frames on a device.
pub struct LightFieldOnGpu {
    baseline: Baseline,
    layers: Layers,
}

impl LightFieldOnGpu {
    /// Uploads the probes and compiles the passes. Of `params` all count but `samples`.
    pub fn new(gpu: Arc<Gpu>, world: &World, field: &LightField, params: &LightFieldParams) -> Result<Self> {
        // The probes first: where they do not fit, nothing else need be made.
        let field = GpuField::new(&gpu, field, params, Shading::far(world))?;
        let baseline = Baseline::new(gpu, world, None, params.supersample)?;
        let layers = Layers::new(baseline.scene.clone(), field, params.direct_samples)?;
        Ok(Self { baseline, layers })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        self.baseline.scene.device()
    }

    /// Bytes of the probes on the device.
    pub fn probe_bytes(&self) -> u64 {
        self.layers.field.bytes()
    }

    /// A frame with the layers of [`super::shade::Shading`], of so many rays along the lobes a pixel. Its passes are timed by the host's
    /// clock.
    pub fn frame(&mut self, camera: &Camera, samples: u32, seed: u32, frame: u32) -> Result<BaselineFrame> {
        let Self { baseline, layers } = self;
        let scene = baseline.scene.clone();
        let fill = |commands: &mut Commands, camera: &Camera, target: &Target| {
            let base = Params {
                camera: camera.into(),
                field: layers.field.field,
                seed,
                frame,
                first_pixel: 0,
                pixels: camera.size[0] * camera.size[1],
                first_sample: 0,
                samples: 1,
                all_samples: samples,
                what: RAYS,
            };
            layers.direct((commands, "rays"), &Params { what: GLOSSY_LIGHT, ..base }, target)?;
            layers.rays((commands, "rays"), &base, target)?;
            layers.direct((commands, "diffuse"), &Params { what: DIFFUSE_LIGHT, ..base }, target)
        };
        baseline.frame(camera, false, Commands::by_host(&scene.gpu), fill)
    }
}

/// What lights a view.
struct Layers {
    scene: Arc<GpuScene>,
    field: GpuField,
    starts: Kernel,
    /// Direct light of the diffuse and of the glossy layer.
    follow: [Samples; 2],
    direct_samples: u32,
    lobe_rays: Kernel,
    trace_rays: Kernel,
    add_glossy: Kernel,
    lit_diffuse: Kernel,
    /// Of paths to emitters, and of rays through the probes.
    paces: [Pace; 2],
}

impl Layers {
    fn new(scene: Arc<GpuScene>, field: GpuField, direct_samples: u32) -> Result<Self> {
        let place = |k: u32| Place { branch: Some(BRANCHES[k as usize]), first_set: 0 };
        let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
        let diffuse = Samples::new(scene.clone(), &PathParams::DIRECT, Purpose::Scattering(query), place(DIFFUSE_LIGHT))?;
        let glossy = diffuse.half(GLOSSY.lobes, place(GLOSSY_LIGHT));
        let gpu = &scene.gpu;
        Ok(Self {
            starts: Kernel::in_scene(&scene, &DIRECT_STARTS, &[])?,
            follow: [diffuse, glossy],
            direct_samples,
            lobe_rays: Kernel::in_scene(&scene, &LOBE_RAYS, &[])?,
            trace_rays: Kernel::new(gpu, &TRACE_RAYS)?,
            add_glossy: Kernel::new(gpu, &ADD_GLOSSY)?,
            lit_diffuse: Kernel::new(gpu, &LIT_DIFFUSE)?,
            paces: [Pace::new(4096); 2],
            field,
            scene,
        })
    }

    /// Direct light of a layer; of the diffuse one also what the probes bring.
    fn direct(&mut self, (commands, pass): (&mut Commands, &'static str), base: &Params, target: &Target) -> Result<()> {
        let (gpu, view, all) = (&self.scene.gpu, &target.view, self.direct_samples);
        let pace = &mut self.paces[0];
        let mut pixel = 0;
        while pixel < base.pixels {
            let run =
                (pace.pieces() / all.max(1) as usize).clamp(1, most_starts(&self.scene)).min((base.pixels - pixel) as usize);
            let params = Params { first_pixel: pixel, pixels: run as u32, all_samples: all, ..*base };
            let params = gpu.uniform("parameters of light field probes", &params)?;
            let list = gpu.output("starts of paths", (run * size_of::<PathStart>()) as u64)?;
            let sums = gpu.output("sums over paths", (run * size_of::<SampleSum>()) as u64)?;
            let size = [run as u32, 1];
            commands.run(pass, &self.starts, &[&params, &view.pixels, &view.shading, &list], size);
            let follow = &self.follow[base.what as usize];
            let mut done = 0;
            while done < all {
                let more = ((pace.pieces() / run).max(1) as u32).min(all - done);
                pace.run(run * more as usize, || follow.run((commands, pass), &list, &sums, run, [done, more]))?;
                done += more;
            }
            if base.what == GLOSSY_LIGHT {
                commands.run(pass, &self.add_glossy, &[&params, &sums, &target.glossy], size);
            } else {
                let GpuField { places, ambient, .. } = &self.field;
                commands.run(pass, &self.lit_diffuse, &[&params, places, ambient, &view.pixels, &sums, &view.shading], size);
            }
            pixel += run as u32;
        }
        Ok(())
    }

    /// Adds what rays along the lobes meet to the glossy layer.
    fn rays(&mut self, (commands, pass): (&mut Commands, &'static str), base: &Params, target: &Target) -> Result<()> {
        let (gpu, pace) = (&self.scene.gpu, &mut self.paces[1]);
        let GpuField { places, surfels, bounds, light, .. } = &self.field;
        // What a kernel can bind of them, and WebGPU's most workgroups along a line.
        let most = (gpu.adapter.max_binding as usize / size_of::<LobeRay>()).min(65_535 * TRACE_RAYS.workgroup[0] as usize);
        let mut pixel = 0;
        while pixel < base.pixels {
            let run = (pace.pieces().min(most) / base.all_samples as usize).max(1).min((base.pixels - pixel) as usize);
            let mut done = 0;
            while done < base.all_samples {
                let more = (pace.pieces().min(most) / run).clamp(1, (base.all_samples - done) as usize);
                let count = run * more;
                let part = Params { first_pixel: pixel, pixels: run as u32, first_sample: done, samples: more as u32, ..*base };
                let params = gpu.uniform("parameters of light field probes", &part)?;
                let rays = gpu.output("rays along lobes", (count * size_of::<LobeRay>()) as u64)?;
                let values = gpu.output("what they meet", (count * size_of::<Vec4>()) as u64)?;
                commands.run(pass, &self.lobe_rays, &[&params, &target.view.pixels, &rays], [count as u32, 1]);
                let buffers = [&params, places, surfels, bounds, light, &rays, &values];
                pace.run(count, || commands.run(pass, &self.trace_rays, &buffers, [count as u32, 1]));
                commands.run(pass, &self.add_glossy, &[&params, &values, &target.glossy], [run as u32, 1]);
                done += more as u32;
            }
            pixel += run as u32;
        }
        Ok(())
    }
}
