//! Probes on the device: those around the camera, as many as the memory that they are given holds.

use super::Gpu;
use super::spec::{StructLayout, layout};
use crate::probe::file::Probe;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use std::collections::BTreeMap;
use std::rc::Rc;

/// A probe's place and weight in one frame.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct Place {
    position: [f32; 3],
    weight: f32,
    size: [u32; 2],
    mesh: [u32; 2],
    index: u32,
    second: u32,
    padding: [u32; 2],
}

pub(crate) const PLACE: StructLayout = layout!(Place as "Probe" { position, weight, size, mesh, index, second });

impl Place {
    /// `second` is where the second list begins in a buffer of two.
    pub(crate) fn new(index: usize, probe: &Probe, weight: f32, second: usize) -> Self {
        let (position, size, mesh) = (probe.position.to_array(), probe.size, probe.map.mesh);
        Self { position, weight, size, mesh, index: index as u32, second: second as u32, padding: [0; 2] }
    }
}

/// What `frame` bytes for frames of `size` leave of the memory. An error where that is less than a probe's bytes.
pub(crate) fn room_for_probes(memory: u64, size: [u32; 2], frame: u64, probe: u64) -> Result<u64> {
    if frame + probe > memory {
        let mib = |bytes: u64| bytes.div_ceil(1 << 20);
        return Err(Error::Request(format!(
            "--gpu-memory: frames of {}x{} take {} MiB and a probe {} MiB, but {} MiB are allowed; give more, or use --device cpu",
            size[0],
            size[1],
            mib(frame),
            mib(probe),
            mib(memory)
        )));
    }
    Ok(memory - frame)
}

/// The probes used last, as a method reads them.
pub(crate) struct Resident<T> {
    /// By index, with the time of its last use, and its bytes.
    probes: BTreeMap<usize, (u64, u64, Rc<T>)>,
    /// Bytes that they may take.
    budget: u64,
    clock: u64,
    /// When the frame began.
    frame: u64,
}

impl<T> Resident<T> {
    pub(crate) fn new(budget: u64) -> Self {
        Self { probes: BTreeMap::new(), budget, clock: 0, frame: 0 }
    }

    /// Changes how much the probes may take.
    pub(crate) fn set_budget(&mut self, budget: u64) {
        self.budget = budget;
    }

    /// Bytes that the probes take.
    pub(crate) fn bytes(&self) -> u64 {
        self.probes.values().map(|(_, bytes, _)| bytes).sum()
    }

    /// Begins a frame.
    pub(crate) fn begin_frame(&mut self) {
        self.frame = self.clock;
    }

    /// A probe; where it is not there, `upload` puts its `bytes` in place of those used longest ago. One that is larger than the whole
    /// budget is alone.
    pub(crate) fn get(&mut self, gpu: &Gpu, index: usize, bytes: u64, upload: impl FnOnce() -> Result<T>) -> Result<Rc<T>> {
        self.clock += 1;
        if let Some((used, _, there)) = self.probes.get_mut(&index) {
            *used = self.clock;
            return Ok(there.clone());
        }
        self.make_room(gpu, bytes, u64::MAX);
        let there = Rc::new(upload()?);
        self.probes.insert(index, (self.clock, bytes, there.clone()));
        Ok(there)
    }

    /// Uploads a probe that a later frame needs, unless a probe of this one would have to go.
    pub(crate) fn upload_ahead(&mut self, gpu: &Gpu, index: usize, bytes: u64, upload: impl FnOnce() -> Result<T>) -> Result<()> {
        if !self.probes.contains_key(&index) && self.make_room(gpu, bytes, self.frame + 1) {
            self.get(gpu, index, bytes, upload)?;
        }
        Ok(())
    }

    /// Drops the probes used longest ago, but none used at `time` or later, until there is room; false where there is not enough.
    fn make_room(&mut self, gpu: &Gpu, needed: u64, time: u64) -> bool {
        let mut dropped = false;
        while self.bytes() + needed > self.budget {
            let old = self.probes.iter().filter(|(_, (used, ..))| *used < time);
            let Some(oldest) = old.min_by_key(|(_, (used, ..))| *used).map(|(i, _)| *i) else { break };
            self.probes.remove(&oldest);
            dropped = true;
        }
        if dropped {
            // The device gives memory back once nothing that it was asked for needs it.
            gpu.wait();
        }
        self.bytes() + needed <= self.budget
    }
}
