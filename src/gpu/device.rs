//! Adapters, and the device that kernels run on.

use crate::{Error, Result};
use pollster::block_on;
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::{Backends, DeviceType, Instance, InstanceDescriptor};

/// Least size of a storage buffer's binding that is worth asking for, bytes: what WebGPU guarantees.
const LEAST_BINDING: u64 = 128 << 20;

/// What `--device` asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Choice {
    /// A GPU where there is a real one, the CPU otherwise.
    Auto,
    /// The CPU.
    Cpu,
    /// The first real GPU.
    Gpu,
    /// The first adapter whose name or backend holds these words, software adapters included.
    Named(String),
}

impl std::fmt::Display for Choice {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("cpu"),
            Self::Gpu => f.write_str("gpu"),
            Self::Named(words) => write!(f, "gpu:{words}"),
        }
    }
}

impl std::str::FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.split_once(':') {
            Some(("gpu", name)) if !name.is_empty() => Ok(Self::Named(name.to_lowercase())),
            None if text == "auto" => Ok(Self::Auto),
            None if text == "cpu" => Ok(Self::Cpu),
            None if text == "gpu" => Ok(Self::Gpu),
            _ => Err("expected auto, cpu, gpu or gpu:NAME".into()),
        }
    }
}

/// An adapter, and what it can do.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Adapter {
    /// The device's name.
    pub name: String,
    /// Vulkan, Metal or DX12.
    pub backend: String,
    /// Driver and version.
    pub driver: String,
    /// Whether it is a GPU, not a CPU in the guise of one.
    pub is_gpu: bool,
    /// Largest piece of memory that a kernel can read, bytes.
    pub max_binding: u64,
    /// Whether kernels can be timed by the device's own clock.
    pub timestamps: bool,
    /// Lanes that run in step.
    pub subgroup: [u32; 2],
}

impl Adapter {
    fn of(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        Self {
            is_gpu: is_gpu(info.device_type),
            backend: info.backend.to_string(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            max_binding: adapter.limits().max_storage_buffer_binding_size,
            timestamps: adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY),
            subgroup: [info.subgroup_min_size, info.subgroup_max_size],
            name: info.name,
        }
    }

    fn answers_to(&self, words: &str) -> bool {
        format!("{} {} {}", self.name, self.backend, self.driver).to_lowercase().contains(words)
    }
}

fn is_gpu(kind: DeviceType) -> bool {
    matches!(kind, DeviceType::DiscreteGpu | DeviceType::IntegratedGpu | DeviceType::VirtualGpu)
}

fn found() -> Vec<wgpu::Adapter> {
    let instance =
        Instance::new(InstanceDescriptor { backends: Backends::PRIMARY, ..InstanceDescriptor::new_without_display_handle() });
    let mut list = block_on(instance.enumerate_adapters(Backends::PRIMARY));
    let rank = |kind| match kind {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        _ => 3,
    };
    list.sort_by_key(|a| rank(a.get_info().device_type));
    list
}

/// All adapters of this machine, discrete GPUs first.
pub fn adapters() -> Vec<Adapter> {
    found().iter().map(Adapter::of).collect()
}

/// Whether kernels in a scene test every index and bound every loop: some per cent of a path's time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Checks {
    /// They do.
    On,
    /// They trust what this crate has written.
    Off,
}

impl Checks {
    /// The environment's variable.
    pub const VARIABLE: &str = "REPROBE_GPU_CHECKS";

    /// What [`Self::VARIABLE`] says, `on` or `off`; without it, on in builds with debug assertions alone.
    pub fn of_environment() -> Result<Self> {
        match std::env::var(Self::VARIABLE).as_deref() {
            Ok("on") => Ok(Self::On),
            Ok("off") => Ok(Self::Off),
            Ok(other) => Err(Error::Request(format!("{}: expected on or off, found \"{other}\"", Self::VARIABLE))),
            Err(_) if cfg!(debug_assertions) => Ok(Self::On),
            Err(_) => Ok(Self::Off),
        }
    }
}

/// A device, open.
pub struct Gpu {
    /// Its adapter.
    pub adapter: Adapter,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) checks: Checks,
    lost: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens what `choice` asks for; `None` for the CPU. Kernels have the [`Checks`] of the environment.
    pub fn open(choice: &Choice) -> Result<Option<Self>> {
        Self::open_with(choice, Checks::of_environment()?)
    }

    /// The same with these checks.
    pub fn open_with(choice: &Choice, checks: Checks) -> Result<Option<Self>> {
        if *choice == Choice::Cpu {
            return Ok(None);
        }
        let list = found();
        let wanted = |a: &wgpu::Adapter| match choice {
            Choice::Named(words) => Adapter::of(a).answers_to(words),
            _ => is_gpu(a.get_info().device_type),
        };
        match list.iter().find(|a| wanted(a)) {
            Some(adapter) => Self::on(adapter, checks).map(Some),
            None if *choice == Choice::Auto => Ok(None),
            None => {
                let names: Vec<String> = list.iter().map(|a| format!("\"{}\"", a.get_info().name)).collect();
                let there = if names.is_empty() { "no adapter at all".into() } else { names.join(", ") };
                let hint = if *choice == Choice::Gpu && !names.is_empty() {
                    "; name a software adapter to use it: gpu:NAME"
                } else {
                    ""
                };
                Err(Error::Request(format!("--device: no such GPU; this machine has {there}{hint}")))
            }
        }
    }

    /// Kernels bind what WebGPU guarantees, so that any adapter will do; only large scenes need larger buffers.
    fn on(adapter: &wgpu::Adapter, checks: Checks) -> Result<Self> {
        let there = adapter.limits();
        let required_limits = wgpu::Limits {
            max_storage_buffer_binding_size: there.max_storage_buffer_binding_size.max(LEAST_BINDING),
            max_buffer_size: there.max_buffer_size,
            ..wgpu::Limits::default()
        };
        let name = adapter.get_info().name;
        let required_features = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let request = wgpu::DeviceDescriptor { label: Some("reprobe"), required_features, required_limits, ..Default::default() };
        let (device, queue) = block_on(adapter.request_device(&request))
            .map_err(|e| Error::Request(format!("GPU \"{name}\" cannot be used: {e}")))?;
        let lost = Arc::new(Mutex::new(None));
        let why = lost.clone();
        device.set_device_lost_callback(move |reason, message| {
            *why.lock().unwrap_or_else(PoisonError::into_inner) = Some(format!("{reason:?}: {message}"));
        });
        Ok(Self { adapter: Adapter::of(adapter), device, queue, checks, lost })
    }

    /// Does `work`, and makes an error of what goes wrong on the device meanwhile: a lack of memory, or a loss of the device.
    pub(crate) fn checked<T>(&self, work: impl FnOnce() -> T) -> Result<T> {
        let scopes = [wgpu::ErrorFilter::Validation, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory];
        let scopes = scopes.map(|filter| self.device.push_error_scope(filter));
        let result = work();
        let mut errors = Vec::new();
        for scope in scopes.into_iter().rev() {
            errors.extend(block_on(scope.pop()));
        }
        let name = &self.adapter.name;
        if let Some(reason) = &*self.lost.lock().unwrap_or_else(PoisonError::into_inner) {
            return Err(Error::Request(format!(
                "GPU \"{name}\" was lost ({reason}); what is finished is kept: run the command again"
            )));
        }
        match errors.first() {
            None => Ok(result),
            Some(wgpu::Error::OutOfMemory { .. }) => {
                Err(Error::Request(format!("GPU \"{name}\" is out of memory; use --device cpu")))
            }
            Some(e) => Err(Error::Request(format!("GPU \"{name}\": {e}"))),
        }
    }

    /// Waits until the device has done all that it was given.
    pub(crate) fn wait(&self) {
        // What fails here shows as a lost device.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
    }

    /// An error where a kernel could not bind a buffer of `size` bytes.
    pub(crate) fn fits(&self, label: &str, size: u64) -> Result<()> {
        let (limit, name) = (self.adapter.max_binding, &self.adapter.name);
        if size <= limit {
            return Ok(());
        }
        let (size, limit) = (size >> 20, limit >> 20);
        Err(Error::Request(format!(
            "{label}: {size} MiB, but a kernel on GPU \"{name}\" takes {limit} MiB at the most; use --device cpu"
        )))
    }

    /// A buffer with a kernel's parameters.
    pub(crate) fn uniform(&self, label: &str, params: &impl bytemuck::Pod) -> Result<wgpu::Buffer> {
        self.init(label, bytemuck::bytes_of(params), wgpu::BufferUsages::UNIFORM)
    }

    /// A buffer with `content`.
    pub(crate) fn upload(&self, label: &str, content: &[u8]) -> Result<wgpu::Buffer> {
        self.fits(label, content.len() as u64)?;
        self.init(label, content, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST)
    }

    fn init(&self, label: &str, content: &[u8], usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        self.checked(|| {
            use wgpu::util::DeviceExt;
            // A binding may not be smaller than one element.
            let contents = if content.is_empty() { &[0; 512] } else { content };
            self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        })
    }
}
