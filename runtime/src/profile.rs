//! Device times of kernels by timestamp queries, and ray rates from them.

use crate::counters::Counters;
use crate::device::{Gpu, mapped};
use crate::error::Error;
use crate::program::Command;
use indexmap::IndexMap;
use kernelgen::config::model::RayKind;
use kernelgen::plan::Plan;
use serde::{Deserialize, Serialize};

/// The most queries one set may hold.
const SET: usize = wgpu::QUERY_SET_MAX_QUERIES as usize;

/// Timestamps before the first dispatch of a pass and after every one.
#[derive(Debug)]
pub struct Queries {
    sets: Vec<wgpu::QuerySet>,
    count: usize,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
}

impl Queries {
    /// Room for a pass of `dispatches` dispatches.
    ///
    /// # Errors
    /// Failed, when the device refuses the query sets.
    pub fn new(gpu: &Gpu, dispatches: usize) -> Result<Self, Error> {
        let count = dispatches + 1;
        let size = (count * 8) as u64;
        let buffer =
            |usage| wgpu::BufferDescriptor { label: Some("timestamps"), size, usage, mapped_at_creation: false };
        gpu.scoped("timestamps", || Self {
            sets: (0..count.div_ceil(SET))
                .map(|set| {
                    gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                        label: Some("timestamps"),
                        ty: wgpu::QueryType::Timestamp,
                        count: (count - set * SET).min(SET) as u32,
                    })
                })
                .collect(),
            count,
            resolved: gpu
                .device
                .create_buffer(&buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC)),
            staging: gpu.device.create_buffer(&buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)),
        })
    }

    /// Writes the timestamp with this number.
    pub fn stamp(&self, compute: &mut wgpu::ComputePass, index: usize) {
        compute.write_timestamp(&self.sets[index / SET], (index % SET) as u32);
    }

    /// Encodes the copy of all timestamps to the host.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        for (index, set) in self.sets.iter().enumerate() {
            let held = (self.count - index * SET).min(SET) as u32;
            encoder.resolve_query_set(set, 0..held, &self.resolved, (index * SET * 8) as u64);
        }
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.staging, 0, (self.count * 8) as u64);
    }

    /// Asks for the timestamps, after the submission.
    pub fn map(&self) {
        self.staging.map_async(wgpu::MapMode::Read, .., |_| {});
    }

    /// Durations of the dispatches in ns, once the submission is done.
    ///
    /// # Errors
    /// Failed, when the timestamps cannot be mapped.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<f64>, Error> {
        let bytes = mapped(&self.staging, (self.count * 8) as u64)?;
        let stamps: Vec<u64> = bytes.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect();
        let period = f64::from(gpu.queue.get_timestamp_period());
        Ok(stamps.windows(2).map(|pair| pair[1].saturating_sub(pair[0]) as f64 * period).collect())
    }
}

/// One number for each kind of ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ByKind {
    /// Of camera rays.
    pub primary: f64,
    /// Of rays after the first scattering.
    pub secondary: f64,
    /// Of later rays of walks.
    pub deep: f64,
    /// Of shadow and connection rays.
    pub visibility: f64,
}

/// A measured pass.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// The duration of every dispatch, ns.
    pub times: &'a [f64],
    /// Slots in use.
    pub slots: u32,
    /// Whether it was the first of all, in which drivers compile and clear.
    pub cold: bool,
}

/// Times of measured passes.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    kinds: Vec<Option<RayKind>>,
    names: Vec<String>,
    kernel_ns: Vec<f64>,
    kind_ns: ByKind,
    rays: Counters,
    cold: bool,
    /// Passes that were measured.
    pub passes: u32,
    /// Slots in use in them.
    slots: u64,
}

impl Profile {
    /// Nothing measured yet.
    pub fn new(plan: &Plan) -> Self {
        Self {
            kinds: plan.kernels.iter().map(|kernel| kernel.rays).collect(),
            names: plan.kernels.iter().map(|kernel| kernel.name.clone()).collect(),
            kernel_ns: vec![0.0; plan.kernels.len()],
            ..Self::default()
        }
    }

    /// Adds a measured pass and the rays it counted. A `cold` one counts only until there is another.
    pub fn add(&mut self, program: &[Command], measured: &Measured, counters: &Counters) {
        if self.cold && !measured.cold {
            self.forget();
        }
        self.cold = measured.cold;
        for (command, &time) in program.iter().zip(measured.times) {
            self.kernel_ns[command.kernel] += time;
            match (self.kinds[command.kernel], command.round) {
                (Some(RayKind::Walk), 0) => self.kind_ns.primary += time,
                (Some(RayKind::Walk), 1) => self.kind_ns.secondary += time,
                (Some(RayKind::Walk), _) => self.kind_ns.deep += time,
                (Some(RayKind::Visibility), _) => self.kind_ns.visibility += time,
                (None, _) => {}
            }
        }
        self.rays.add(counters);
        self.passes += 1;
        self.slots += u64::from(measured.slots);
    }

    fn forget(&mut self) {
        self.kernel_ns.fill(0.0);
        self.kind_ns = ByKind::default();
        self.rays = Counters::default();
        self.passes = 0;
        self.slots = 0;
    }

    /// Milliseconds a measured pass spent in each kernel, on average.
    pub fn kernel_milliseconds(&self) -> IndexMap<String, f64> {
        let scale = 1e-6 / f64::from(self.passes.max(1));
        self.names.iter().cloned().zip(self.kernel_ns.iter().map(|time| time * scale)).collect()
    }

    /// Nanoseconds a slot in use spent in each kernel, in the order of the plan; `None` without measured passes.
    pub fn ns_per_slot(&self) -> Option<Vec<f64>> {
        (self.slots > 0).then(|| self.kernel_ns.iter().map(|time| time / self.slots as f64).collect())
    }

    /// Millions of rays per second by kind: measured rays over the time of the kernels that trace this kind. A kind that no kernel
    /// traces alone (a megakernel, inline visibility) is divided by the time of all kernels; without measured passes, `all` is
    /// divided by `seconds`, the time of the whole run.
    pub fn mrays_per_second(&self, all: &Counters, seconds: f64) -> ByKind {
        let total: f64 = self.kernel_ns.iter().sum();
        let rate = |counted: u64, measured: u64, own_ns: f64| {
            if self.passes == 0 {
                return counted as f64 / seconds.max(1e-9) * 1e-6;
            }
            let time = if own_ns > 0.0 { own_ns } else { total };
            measured as f64 / time.max(1.0) * 1e3
        };
        ByKind {
            primary: rate(all.primary, self.rays.primary, self.kind_ns.primary),
            secondary: rate(all.secondary, self.rays.secondary, self.kind_ns.secondary),
            deep: rate(all.deep, self.rays.deep, self.kind_ns.deep),
            visibility: rate(all.visibility, self.rays.visibility, self.kind_ns.visibility),
        }
    }
}
