//! Kernels against their CPU twins, on whatever adapter there is: a software one will do. Those in a scene run twice, with and without their
//! checks ([`Checks`]): a release build has none.
//!
//! Where there is no adapter the tests are reported as ignored, and as failed where `REPROBE_REQUIRE_GPU` is 1. The test harness of
//! the standard library settles before the run what is ignored, and would report them as passed; so this target has libtest-mimic's.

mod bakes;
mod baselines;
mod denoise;
mod filter;
mod frames;
mod light_field;
mod many_light;
mod paths;
mod radiance_probes;
mod rays;
mod shapes;
mod ulr;

use frames::Baked;
use libtest_mimic::{Arguments, Completion, Failed, Trial, run};
use reprobe::gpu::{Checks, Choice, Gpu, adapters};
use reprobe::transport::World;
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, OnceLock};

/// What a test runs on.
pub struct Device {
    /// The adapter, as `--device` takes it.
    name: String,
    checks: Checks,
    /// What the tests of the command line render, baked once.
    baked: Arc<OnceLock<Baked>>,
}

impl Device {
    fn gpu(&self) -> Arc<Gpu> {
        let choice: Choice = self.name.parse().unwrap();
        Arc::new(Gpu::open_with(&choice, self.checks).unwrap().unwrap())
    }

    fn baked(&self) -> &Baked {
        self.baked.get_or_init(Baked::new)
    }

    /// As [`Checks::VARIABLE`] has it.
    fn checks_word(&self) -> &'static str {
        match self.checks {
            Checks::On => "on",
            Checks::Off => "off",
        }
    }
}

fn room() -> World {
    let scene = reprobe::exchange::load(Path::new("scenes/room/scene.xml"), &Default::default()).unwrap();
    World::opaque(scene).0
}

fn a_name_that_no_adapter_has_is_an_error_that_lists_those_there_are(_: &Device) {
    let Err(error) = Gpu::open(&Choice::Named("no such thing".into())) else { panic!("found it") };
    let error = error.to_string();
    assert!(error.contains("no such GPU"), "{error}");
    for adapter in adapters() {
        assert!(error.contains(&adapter.name), "{error}");
    }
}

type Test = (&'static str, fn(&Device));

macro_rules! tests {
    ($($($part:ident)::+),+ $(,)?) => { &[$((stringify!($($part)::+), $($part)::+ as fn(&Device))),+] };
}

/// Kernels without a scene are the same with and without checks.
const ONCE: &[Test] = tests![
    a_name_that_no_adapter_has_is_an_error_that_lists_those_there_are,
    filter::the_filter_is_the_cpus,
    paths::a_model_that_the_gpu_lacks_is_named,
];

const TWICE: &[Test] = tests![
    bakes::light_maps_are_the_cpus,
    bakes::probes_are_the_cpus,
    baselines::gathered_mirror_pictures_are_the_cpus,
    baselines::rays_along_the_lobes_are_the_cpus,
    denoise::denoised_frames_are_the_cpus,
    denoise::guides_of_every_model_are_the_cpus,
    frames::frames_are_the_cpus,
    light_field::commands_render_them,
    light_field::frames_are_the_cpus,
    many_light::frames_are_the_cpus,
    paths::every_model_and_emitter_is_the_cpus,
    paths::a_sky_and_its_sun_are_the_cpus,
    paths::layers_and_full_images_are_the_cpus,
    radiance_probes::commands_render_them,
    radiance_probes::every_pass_is_the_cpus,
    rays::a_probe_sees_the_same_through_either,
    rays::a_scene_without_surfaces_has_no_hits,
    rays::closest_hits_are_the_cpus,
    rays::rays_go_on_through_alpha_masks_as_on_the_cpu,
    shapes::of_two_hits_at_one_distance_the_scene_has_its_own,
    shapes::probe_lit_frames_are_the_cpus,
    shapes::rays_meet_what_frames_add,
    shapes::traced_frames_are_the_cpus,
    ulr::lumigraphs_are_the_cpus,
];

/// A test with these checks, on the adapter where there is one.
fn trial((name, test): Test, kind: &str, checks: Checks, adapter: Option<&str>, baked: &Arc<OnceLock<Baked>>) -> Trial {
    let device = adapter.map(|name| Device { name: name.into(), checks, baked: baked.clone() });
    let is_required = std::env::var("REPROBE_REQUIRE_GPU").is_ok_and(|word| word == "1");
    let runner = move || match device {
        Some(device) => {
            test(&device);
            Ok(Completion::Completed)
        }
        None if is_required => Err(Failed::from("REPROBE_REQUIRE_GPU is 1, and there is no adapter")),
        None => Ok(Completion::ignored_with("no adapter; on Debian, mesa-vulkan-drivers has a software one")),
    };
    Trial::ignorable_test(format!("{}{kind}", name.replace(' ', "")), runner)
}

fn main() -> ExitCode {
    // Before the adapters are asked for: lists of tests need none.
    let args = Arguments::from_args();
    // A real GPU comes before a software one.
    let adapter = if args.list { None } else { adapters().first().map(|a| format!("gpu:{}", a.name.to_lowercase())) };
    // Dropped at the end, with its folder.
    let baked = Arc::new(OnceLock::new());
    let mut trials = Vec::new();
    for test in ONCE {
        trials.push(trial(*test, "", Checks::On, adapter.as_deref(), &baked));
    }
    for test in TWICE {
        trials.push(trial(*test, "", Checks::On, adapter.as_deref(), &baked));
        trials.push(trial(*test, "_without_checks", Checks::Off, adapter.as_deref(), &baked));
    }
    run(&args, trials).exit_code()
}
