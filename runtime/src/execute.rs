//! Runs a plan: pipelines, passes in flight. Knows no stage and no field by name.

mod count;

use crate::buffers::Buffers;
use crate::counters::Counters;
use crate::device::{Gpu, mapped};
use crate::error::Error;
use crate::profile::{Measured, Profile, Queries};
use crate::program::{Command, Extent, commands};
use bytemuck::{Pod, Zeroable};
use kernelgen::plan::{Access, Counter, EntryWords, Kernel, OVERRIDES, Plan, Role};
use rayon::prelude::*;
use std::collections::VecDeque;
use std::time::Instant;

/// Widest dispatch in one dimension.
const WIDEST: u32 = 65_535;
/// Passes that may be queued on the device at once: one runs, the next is ready, one is being read.
pub const IN_FLIGHT: usize = 3;

/// The pass uniform, `Role::Pass`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Pass {
    /// First index into the pixels in tile order.
    pub first_pixel: u32,
    /// Sample number of the first slot.
    pub first_sample: u32,
    /// Slots in use.
    pub active: u32,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Paths, more than slots where these take several.
    pub paths: u32,
    /// Padding.
    pub unused: [u32; 3],
}

#[derive(Debug)]
struct Pipeline {
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    /// Time that its compilation took, s.
    seconds: f64,
}

/// What the compilation of a plan took.
#[derive(Clone, Debug, Default)]
pub struct Compiled {
    /// Wall-clock time of all kernels, which are compiled side by side on all cores, s.
    pub seconds: f64,
    /// Time of each kernel, in the order of the plan, s.
    pub by_kernel: Vec<f64>,
}

#[derive(Debug)]
struct Flight {
    submission: wgpu::SubmissionIndex,
    staging: wgpu::Buffer,
    profiled: bool,
    first: bool,
    active: u32,
}

/// A plan ready to run.
#[derive(Debug)]
pub struct Executor {
    gpu: Gpu,
    pipelines: Vec<Pipeline>,
    program: Vec<Command>,
    arguments: Option<wgpu::Buffer>,
    pass: wgpu::Buffer,
    control: wgpu::Buffer,
    counters: Vec<Counter>,
    entries: EntryWords,
    queues: usize,
    counted: std::ops::Range<u64>,
    spare: Vec<wgpu::Buffer>,
    flying: VecDeque<Flight>,
    queries: Option<Queries>,
    warm: bool,
    /// What the compilation took.
    pub compiled: Compiled,
    /// Times of the passes that were measured.
    pub profile: Profile,
}

impl Executor {
    /// Compiles the kernels, on all cores, and binds the buffers.
    ///
    /// # Errors
    /// Failed, when a kernel does not compile or memory runs out.
    pub fn new(gpu: &Gpu, plan: &Plan, buffers: &Buffers) -> Result<Self, Error> {
        let start = Instant::now();
        let pipelines = plan
            .kernels
            .par_iter()
            .map(|kernel| pipeline(gpu, plan, kernel, buffers))
            .collect::<Result<Vec<_>, Error>>()?;
        let by_kernel = pipelines.iter().map(|pipeline| pipeline.seconds).collect();
        let compiled = Compiled { seconds: start.elapsed().as_secs_f64(), by_kernel };
        let arguments = plan.buffers.iter().position(|buffer| buffer.role == Role::Arguments);
        let words = plan.counters.iter().map(|counter| u64::from(counter.word));
        let counted = words.clone().min().unwrap_or(0) * 4..(words.max().unwrap_or(0) + 1) * 4;
        let mut executor = Self {
            gpu: gpu.clone(),
            pipelines,
            queries: None,
            warm: false,
            compiled,
            profile: Profile::new(plan),
            program: commands(plan),
            arguments: arguments.and_then(|index| buffers.all[index].clone()),
            pass: buffers.of(plan, Role::Pass)?.clone(),
            control: buffers.of(plan, Role::Control)?.clone(),
            counters: plan.counters.clone(),
            entries: plan.entries,
            queues: plan.pushed_bytes.len(),
            counted,
            spare: Vec::new(),
            flying: VecDeque::new(),
        };
        executor.prepare_slots()?;
        Ok(executor)
    }

    fn prepare_slots(&mut self) -> Result<(), Error> {
        for _ in 0..IN_FLIGHT {
            let description = wgpu::BufferDescriptor {
                label: Some("counters"),
                size: self.counted.end - self.counted.start,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            };
            let staging = self.gpu.scoped("counters", || self.gpu.device.create_buffer(&description))?;
            self.spare.push(staging);
        }
        if self.gpu.has_timestamps() {
            self.queries = Some(Queries::new(&self.gpu, self.program.len())?);
        }
        Ok(())
    }

    /// Whether another pass may be submitted before one is waited for.
    pub fn has_room(&self) -> bool {
        !self.spare.is_empty()
    }

    /// Passes submitted and not waited for.
    pub fn in_flight(&self) -> usize {
        self.flying.len()
    }

    /// Submits one pass; `after` may encode more behind it. With `measure`, its dispatches are timed, unless another measured
    /// pass is still in flight or the adapter has no timestamps.
    ///
    /// # Errors
    /// Failed, when no slot is free or the device reported an error.
    pub fn submit(
        &mut self,
        pass: Pass,
        measure: bool,
        after: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<(), Error> {
        let staging = self.spare.pop().ok_or_else(|| Error::failed("no slot is free for another pass"))?;
        let profiled = measure && self.queries.is_some() && !self.flying.iter().any(|flight| flight.profiled);
        self.gpu.queue.write_buffer(&self.pass, 0, bytemuck::bytes_of(&pass));
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("pass") });
        self.encode(&mut encoder, pass.active, profiled);
        let size = self.counted.end - self.counted.start;
        encoder.copy_buffer_to_buffer(&self.control, self.counted.start, &staging, 0, size);
        if let Some(queries) = self.queries.as_ref().filter(|_| profiled) {
            queries.resolve(&mut encoder);
        }
        after(&mut encoder);
        let submission = self.gpu.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |_| {});
        if let Some(queries) = self.queries.as_ref().filter(|_| profiled) {
            queries.map();
        }
        let first = !std::mem::replace(&mut self.warm, true);
        self.flying.push_back(Flight { submission, staging, profiled, first, active: pass.active });
        self.gpu.check()
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, active: u32, profiled: bool) {
        let queries = self.queries.as_ref().filter(|_| profiled);
        let mut compute =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("pass"), timestamp_writes: None });
        if let Some(queries) = queries {
            queries.stamp(&mut compute, 0);
        }
        for (index, command) in self.program.iter().enumerate() {
            self.dispatch(&mut compute, command, active);
            if let Some(queries) = queries {
                queries.stamp(&mut compute, index + 1);
            }
        }
    }

    fn dispatch(&self, compute: &mut wgpu::ComputePass, command: &Command, active: u32) {
        let pipeline = &self.pipelines[command.kernel];
        compute.set_pipeline(&pipeline.pipeline);
        compute.set_bind_group(0, &pipeline.bindings, &[]);
        match (command.extent, &self.arguments) {
            (Extent::Indirect(offset), Some(arguments)) => compute.dispatch_workgroups_indirect(arguments, offset),
            (Extent::Active(slots), _) => {
                let groups = active.div_ceil(slots);
                compute.dispatch_workgroups(groups.min(WIDEST), groups.div_ceil(WIDEST), 1);
            }
            (Extent::Single, _) | (Extent::Indirect(_), None) => compute.dispatch_workgroups(1, 1, 1),
        }
    }

    /// Waits for the oldest pass and returns what it counted.
    ///
    /// # Errors
    /// Failed, when the device is lost, a stream overflowed or paths were left unfinished.
    pub fn wait(&mut self) -> Result<Counters, Error> {
        let flight = self.flying.pop_front().ok_or_else(|| Error::failed("no pass is in flight"))?;
        self.gpu.wait(flight.submission)?;
        let bytes = mapped(&flight.staging, self.counted.end - self.counted.start)?;
        self.spare.push(flight.staging);
        let counters = self.counted_in(&bytes);
        if let Some(queries) = self.queries.as_ref().filter(|_| flight.profiled) {
            let times = queries.read(&self.gpu)?;
            let measured = Measured { times: &times, slots: flight.active, cold: flight.first };
            self.profile.add(&self.program, &measured, &counters);
        }
        counters.refuse_losses()?;
        Ok(counters)
    }

    fn counted_in(&self, bytes: &[u8]) -> Counters {
        let mut counters = Counters::default();
        for Counter { name, word, shift } in &self.counters {
            let at = (u64::from(*word) * 4 - self.counted.start) as usize;
            let value: u32 = bytemuck::pod_read_unaligned(&bytes[at..at + 4]);
            if let Some(slot) = counters.slot(name) {
                *slot += u64::from(value) << shift;
            }
        }
        counters
    }
}

fn pipeline(gpu: &Gpu, plan: &Plan, kernel: &Kernel, buffers: &Buffers) -> Result<Pipeline, Error> {
    let start = Instant::now();
    let name = kernel.name.as_str();
    let module = gpu.module(name, &kernel.module)?;
    let layout = bind_group_layout(gpu, kernel)?;
    let bindings = bind_group(gpu, plan, kernel, buffers, &layout)?;
    let values = [buffers.path_count, buffers.size[0], buffers.size[1]];
    let constants: Vec<(&str, f64)> = OVERRIDES
        .into_iter()
        .zip(values.map(f64::from))
        .filter(|(name, _)| kernel.overrides.iter().any(|used| used == name))
        .collect();
    let pipeline = gpu.scoped(name, || {
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(&kernel.entry),
            compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
            cache: None,
        })
    })?;
    Ok(Pipeline { pipeline, bindings, seconds: start.elapsed().as_secs_f64() })
}

fn bind_group_layout(gpu: &Gpu, kernel: &Kernel) -> Result<wgpu::BindGroupLayout, Error> {
    let most = gpu.device.limits().max_storage_buffers_per_shader_stage as usize;
    let storage = kernel.bindings.iter().filter(|binding| binding.access != Access::Uniform).count();
    if storage > most {
        let (name, adapter) = (&kernel.name, &gpu.info.name);
        return Err(Error::input(format!(
            "the kernel `{name}` binds {storage} storage buffers, but the adapter `{adapter}` allows {most}"
        )));
    }
    let entries: Vec<_> = kernel
        .bindings
        .iter()
        .map(|binding| wgpu::BindGroupLayoutEntry {
            binding: binding.binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: binding_type(binding.access),
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        })
        .collect();
    let description = wgpu::BindGroupLayoutDescriptor { label: Some(&kernel.name), entries: &entries };
    gpu.scoped(&kernel.name, || gpu.device.create_bind_group_layout(&description))
}

fn binding_type(access: Access) -> wgpu::BufferBindingType {
    match access {
        Access::Uniform => wgpu::BufferBindingType::Uniform,
        Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
        Access::ReadWrite => wgpu::BufferBindingType::Storage { read_only: false },
    }
}

fn bind_group(
    gpu: &Gpu,
    plan: &Plan,
    kernel: &Kernel,
    buffers: &Buffers,
    layout: &wgpu::BindGroupLayout,
) -> Result<wgpu::BindGroup, Error> {
    let mut entries = Vec::with_capacity(kernel.bindings.len());
    for binding in &kernel.bindings {
        let name = plan.buffers.get(binding.buffer).map_or("?", |buffer| buffer.name.as_str());
        let buffer = buffers.all.get(binding.buffer).and_then(Option::as_ref);
        let buffer = buffer.ok_or_else(|| {
            Error::failed(format!("the kernel `{}` binds `{name}`, which was not allocated", kernel.name))
        })?;
        entries.push(wgpu::BindGroupEntry { binding: binding.binding, resource: buffer.as_entire_binding() });
    }
    let description = wgpu::BindGroupDescriptor { label: Some(&kernel.name), layout, entries: &entries };
    gpu.scoped(&kernel.name, || gpu.device.create_bind_group(&description))
}
