//! Passes in a row, and what each of them takes.

use super::Gpu;
use super::kernel::Kernel;
use crate::Result;
use std::time::Instant;

/// Most runs that are timed by the device: what WebGPU guarantees of queries.
const MOST_TIMED: u32 = 2048;

/// Runs of kernels, each handed to the device at once: none is long enough for a driver to take the device for hung.
pub(crate) struct Commands<'a> {
    gpu: &'a Gpu,
    /// Two a run; `None` where the device has no clock.
    queries: Option<wgpu::QuerySet>,
    /// Name and milliseconds; 0 as long as only the device knows them.
    runs: Vec<(&'static str, f64)>,
}

impl<'a> Commands<'a> {
    pub(crate) fn new(gpu: &'a Gpu) -> Self {
        let queries = gpu.adapter.timestamps.then(|| {
            let (label, ty, count) = (Some("times"), wgpu::QueryType::Timestamp, 2 * MOST_TIMED);
            gpu.device.create_query_set(&wgpu::QuerySetDescriptor { label, ty, count })
        });
        Self { gpu, queries, runs: Vec::new() }
    }

    /// Runs that are waited for and timed by the host, as those are whose length is learnt on the way.
    pub(crate) fn by_host(gpu: &'a Gpu) -> Self {
        Self { gpu, queries: None, runs: Vec::new() }
    }

    /// Runs a kernel on `size` invocations, as part of `pass`.
    pub(crate) fn run(&mut self, pass: &'static str, kernel: &Kernel, buffers: &[&wgpu::Buffer], size: [u32; 2]) {
        let number = self.runs.len() as u32;
        let timed = self.queries.as_ref().filter(|_| number < MOST_TIMED);
        let writes = timed.map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(2 * number),
            end_of_pass_write_index: Some(2 * number + 1),
        });
        if timed.is_none() {
            self.gpu.wait();
        }
        let start = Instant::now();
        self.gpu.submit(kernel, buffers, size, writes);
        let mut ms = 0.0;
        if timed.is_none() {
            self.gpu.wait();
            ms = start.elapsed().as_secs_f64() * 1e3;
        }
        self.runs.push((pass, ms));
    }

    /// Waits for the end. Milliseconds a pass, in order.
    pub(crate) fn finish(mut self) -> Result<Vec<(&'static str, f64)>> {
        if let Some(queries) = &self.queries {
            let timed = (self.runs.len() as u32).min(MOST_TIMED);
            let ms_a_tick = f64::from(self.gpu.queue.get_timestamp_period()) * 1e-6;
            let ticks: Vec<u64> = self.gpu.read_queries(queries, 2 * timed)?;
            for ((_, ms), ticks) in self.runs.iter_mut().zip(ticks.chunks_exact(2)) {
                *ms = ticks[1].saturating_sub(ticks[0]) as f64 * ms_a_tick;
            }
        }
        let mut passes: Vec<(&'static str, f64)> = Vec::new();
        for (pass, ms) in self.runs {
            match passes.iter_mut().find(|(name, _)| *name == pass) {
                Some((_, sum)) => *sum += ms,
                None => passes.push((pass, ms)),
            }
        }
        Ok(passes)
    }
}

impl Gpu {
    fn read_queries(&self, queries: &wgpu::QuerySet, count: u32) -> Result<Vec<u64>> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let resolved = self.checked(|| {
            let resolved = self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("resolved times"),
                size: u64::from(count) * size_of::<u64>() as u64,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            let mut encoder = self.device.create_command_encoder(&Default::default());
            encoder.resolve_query_set(queries, 0..count, &resolved, 0);
            self.queue.submit([encoder.finish()]);
            resolved
        })?;
        self.read(&resolved)
    }
}
