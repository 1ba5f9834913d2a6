//! The device's copy rate: what the state traffic of kernels is measured against.

use crate::buffers::{binding_limit, create};
use crate::device::Gpu;
use crate::error::Error;
use crate::profile::Queries;
use serde::{Deserialize, Serialize};
use wgpu::BufferUsages;

/// Bytes copied at once on a GPU: several times the largest caches.
const BYTES_GPU: u64 = 256 << 20;
/// The same on a CPU adapter.
const BYTES_CPU: u64 = 64 << 20;
/// Copies in a row, of which the first half warms up.
const COPIES: usize = 32;
/// Threads in a workgroup, as in the text of the kernel.
const WORKGROUP: u64 = 256;
/// Widest dispatch in one dimension.
const WIDEST: u64 = 65_535;

/// How fast a kernel copies one buffer into another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CopyRate {
    /// The device.
    pub adapter: String,
    /// Size of the buffer that is copied, bytes.
    pub bytes: u64,
    /// Bytes read and bytes written over the device time, 10^9 bytes a second; the median of 16 copies.
    pub gb_per_s: f64,
}

impl CopyRate {
    /// Measures it by timestamps around each copy; `None` where the adapter has none.
    ///
    /// # Errors
    /// Failed, when the device is lost or out of memory.
    pub fn measure(gpu: &Gpu) -> Result<Option<Self>, Error> {
        if !gpu.has_timestamps() {
            return Ok(None);
        }
        let wanted = if gpu.is_cpu() { BYTES_CPU } else { BYTES_GPU };
        let bytes = wanted.min(binding_limit(gpu)) / 16 * 16;
        let mut times = time_copies(gpu, bytes)?.split_off(COPIES / 2);
        times.sort_by(f64::total_cmp);
        let median = times[times.len() / 2].max(1.0);
        Ok(Some(Self { adapter: gpu.info.name.clone(), bytes, gb_per_s: 2.0 * bytes as f64 / median }))
    }
}

/// Times of the copies in a row, ns.
fn time_copies(gpu: &Gpu, bytes: u64) -> Result<Vec<f64>, Error> {
    let module = gpu.module("copy", include_str!("copy_rate/copy.wgsl"))?;
    let buffers =
        [create(gpu, "original", bytes, BufferUsages::STORAGE)?, create(gpu, "copy", bytes, BufferUsages::STORAGE)?];
    let pipeline = gpu.scoped("copy", || {
        gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("copy"),
            layout: None,
            module: &module,
            entry_point: Some("copy_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    })?;
    let entries: Vec<_> = buffers
        .iter()
        .zip(0..)
        .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let layout = pipeline.get_bind_group_layout(0);
    let bindings = gpu.scoped("copy", || {
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("copy"),
            layout: &layout,
            entries: &entries,
        })
    })?;
    let queries = Queries::new(gpu, COPIES)?;
    let groups = (bytes / 16).div_ceil(WORKGROUP);
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("copy") });
    {
        let mut compute =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("copy"), timestamp_writes: None });
        compute.set_pipeline(&pipeline);
        compute.set_bind_group(0, &bindings, &[]);
        queries.stamp(&mut compute, 0);
        for copy in 1..=COPIES {
            compute.dispatch_workgroups(groups.min(WIDEST) as u32, groups.div_ceil(WIDEST) as u32, 1);
            queries.stamp(&mut compute, copy);
        }
    }
    queries.resolve(&mut encoder);
    let submission = gpu.queue.submit([encoder.finish()]);
    queries.map();
    gpu.wait(submission)?;
    queries.read(gpu)
}
