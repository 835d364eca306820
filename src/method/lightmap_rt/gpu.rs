//! Rays along the glossy lobes, lit by the light map: the twin of [`crate::method::lightmap_rt`].

use super::LightmapRtParams;
use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::camera::CAMERA;
use crate::gpu::commands::Commands;
use crate::gpu::follow::{PATH_START, Place, Purpose, SampleSum, Samples, most_starts};
use crate::gpu::kernel::Kernel;
use crate::gpu::pace::Pace;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::KernelSpec;
use crate::gpu::view::frame::{Baseline, BaselineFrame, Target};
use crate::gpu::view::pixel_run::{PIXEL_RUN, PixelRun};
use crate::gpu::view::{PIXEL, REFLECTED};
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::transport::World;
use crate::transport::follow::PathStart;
use crate::view::gbuffer::GLOSSY;
use std::sync::Arc;

/// Where rays leave the view's pixels.
pub(crate) const VIEW_STARTS: KernelSpec = KernelSpec {
    file: "lightmap_rt/view_starts.wgsl",
    twin: "src/method/lightmap_rt/mod.rs: lightmap_rt",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("params", Uniform), ("view", Read), ("starts", ReadWrite)],
    structs: &[&PIXEL_RUN, &CAMERA, &PIXEL, &REFLECTED, &PATH_START],
};
/// The mean of what they find.
pub(crate) const MEAN_LIGHT: KernelSpec = KernelSpec {
    file: "lightmap_rt/mean_light.wgsl",
    twin: "src/method/lightmap_rt/mod.rs: light_along",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("params", Uniform), ("sums", Read), ("glossy", ReadWrite)],
    structs: &[&PIXEL_RUN, &CAMERA],
};

/// Renders frames on a device.
pub struct LightmapRt {
    baseline: Baseline,
    starts: Kernel,
    follow: Samples,
    mean: Kernel,
    pace: Pace,
}

impl LightmapRt {
    /// Compiles the passes. Of `params` all count but the samples.
    pub fn new(gpu: Arc<Gpu>, world: &World, lightmap: &LightMap, params: &LightmapRtParams) -> Result<Self> {
        let baseline = Baseline::new(gpu.clone(), world, Some(lightmap), params.supersample)?;
        let purpose = if params.next_event { Purpose::Scattering(GLOSSY) } else { Purpose::Rays(GLOSSY) };
        let place = Place { branch: None, first_set: 0 };
        Ok(Self {
            starts: Kernel::new(&gpu, &VIEW_STARTS)?,
            follow: Samples::new(baseline.scene.clone(), &params.path(), purpose, place)?,
            mean: Kernel::new(&gpu, &MEAN_LIGHT)?,
            pace: Pace::new(4096),
            baseline,
        })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        self.baseline.scene.device()
    }

    /// A frame with the glossy layer of [`crate::method::lightmap_rt::lightmap_rt`], of so many samples a pixel. Its passes are
    /// timed by the host's clock.
    pub fn frame(&mut self, camera: &Camera, samples: u32, seed: u32, frame: u32) -> Result<BaselineFrame> {
        let Self { baseline, starts, follow, mean, pace } = self;
        let scene = baseline.scene.clone();
        let gpu = &*scene.gpu;
        let fill = |commands: &mut Commands, camera: &Camera, target: &Target| {
            let pixels = (camera.size[0] * camera.size[1]) as usize;
            let mut pixel = 0;
            while pixel < pixels {
                let run = (pace.pieces() / samples.max(1) as usize).clamp(1, most_starts(&scene)).min(pixels - pixel);
                let params = PixelRun::new(camera, [seed, frame], (pixel as u32, run as u32), samples);
                let params = gpu.uniform("the rays' parameters", &params)?;
                let list = gpu.output("starts of rays", (run * size_of::<PathStart>()) as u64)?;
                let sums = gpu.output("sums over rays", (run * size_of::<SampleSum>()) as u64)?;
                let size = [run as u32, 1];
                commands.run("rays", starts, &[&params, &target.view.pixels, &list], size);
                let mut done = 0;
                while done < samples {
                    let more = ((pace.pieces() / run).max(1) as u32).min(samples - done);
                    pace.run(run * more as usize, || follow.run((commands, "rays"), &list, &sums, run, [done, more]))?;
                    done += more;
                }
                commands.run("rays", mean, &[&params, &sums, &target.glossy], size);
                pixel += run;
            }
            Ok(())
        };
        baseline.frame(camera, false, Commands::by_host(gpu), fill)
    }
}
