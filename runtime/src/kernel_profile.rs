//! What each kernel of a render costs: time, paths, bytes moved as the generator predicts them, size.

use crate::error::Error;
use crate::occupancy::Occupancy;
use crate::render::Rendered;
use crate::spirv;
use indexmap::IndexMap;
use kernelgen::plan::{Kernel, Plan};
use serde::{Deserialize, Serialize};

/// Every kernel of a render, and how full their queues are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelProfile {
    /// Wall-clock time of compiling all kernels side by side, s.
    pub compile_seconds: f64,
    /// In the order of the plan.
    pub kernels: Vec<KernelMeasurements>,
    /// Paths, or records of a stream, that a kernel takes in each round, for a path slot in use; housekeeping left out. What runs
    /// behind the last round stands behind it.
    pub occupancy: IndexMap<String, Vec<f64>>,
    /// Passes that the queues were counted in, which are not those that were timed.
    pub counted_passes: u32,
}

/// A kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelMeasurements {
    /// Its name.
    pub name: String,
    /// Paths, or records of a stream, that it takes in all rounds, for a path slot in use: for a sample.
    pub entries_per_sample: f64,
    /// Bytes of state that a path loads, as the generator predicts.
    pub load_bytes: u32,
    /// Bytes of state that a path stores, as the generator predicts.
    pub store_bytes: u32,
    /// Bytes of state that it moves for a sample, as the generator predicts: those of the paths that it takes, and of those that go on
    /// to another place.
    pub state_bytes_per_sample: f64,
    /// Bytes that it moves for a sample to find paths and to send them on: entries of queues, and records of streams.
    pub queue_bytes_per_sample: f64,
    /// Device time of a million samples, ms; unknown where the adapter has no timestamps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ms_per_msample: Option<f64>,
    /// Predicted bytes over that time, 10^9 bytes a second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gb_per_s: Option<f64>,
    /// Time of compiling it beside the others, s.
    pub compile_seconds: f64,
    /// Size of its SPIR-V, bytes.
    pub spirv_bytes: u64,
}

impl KernelMeasurements {
    /// All bytes that it moves for a sample. What stages look up in the scene and add to the film is not among them.
    pub fn bytes_per_sample(&self) -> f64 {
        self.state_bytes_per_sample + self.queue_bytes_per_sample
    }
}

impl KernelProfile {
    /// Of a render whose queues were counted.
    ///
    /// # Errors
    /// Failed, when naga refuses a kernel.
    pub fn of(plan: &Plan, rendered: &Rendered, occupancy: &Occupancy) -> Result<Self, Error> {
        let times = rendered.profile.ns_per_slot();
        let measured = |(index, kernel): (usize, &Kernel)| {
            let time = times.as_ref().map(|times| times[index]);
            let bytes = bytes(plan, index, occupancy);
            measure(kernel, occupancy.per_slot(index), bytes, time, rendered.compiled.by_kernel[index])
        };
        let working = |(index, _): &(usize, &Kernel)| !occupancy.entries[*index].is_empty();
        let rounds = |(index, kernel): (usize, &Kernel)| (kernel.name.clone(), occupancy.by_round(index));
        Ok(Self {
            compile_seconds: rendered.compiled.seconds,
            kernels: plan.kernels.iter().enumerate().map(measured).collect::<Result<_, Error>>()?,
            occupancy: plan.kernels.iter().enumerate().filter(working).map(rounds).collect(),
            counted_passes: occupancy.passes,
        })
    }

    /// Bytes that all kernels move for a sample, as the generator predicts.
    pub fn bytes_per_sample(&self) -> f64 {
        self.kernels.iter().map(KernelMeasurements::bytes_per_sample).sum()
    }

    /// Device time of a million samples, ms; unknown where the adapter has no timestamps.
    pub fn ms_per_msample(&self) -> Option<f64> {
        self.kernels.iter().map(|kernel| kernel.ms_per_msample).sum()
    }

    /// Predicted bytes over the device time of all kernels, 10^9 bytes a second.
    pub fn gb_per_s(&self) -> Option<f64> {
        rate(self.bytes_per_sample(), self.ms_per_msample())
    }

    /// Size of the SPIR-V of all kernels, bytes.
    pub fn spirv_bytes(&self) -> u64 {
        self.kernels.iter().map(|kernel| kernel.spirv_bytes).sum()
    }
}

/// Bytes of state that a kernel moves for a sample, and those of queues and streams.
fn bytes(plan: &Plan, index: usize, occupancy: &Occupancy) -> [f64; 2] {
    let (kernel, entries) = (&plan.kernels[index], occupancy.per_slot(index));
    let pushes = |queue: usize| occupancy.pushes_per_slot(index, queue);
    let moved = plan.dense.map_or(0.0, |queue| pushes(queue as usize) * f64::from(kernel.moved_bytes));
    let pushed = plan.pushed_bytes.iter().enumerate().map(|(queue, &bytes)| pushes(queue) * f64::from(bytes));
    let state = entries * f64::from(kernel.load_bytes + kernel.store_bytes) + moved;
    [state, entries * f64::from(kernel.entry_bytes) + pushed.sum::<f64>()]
}

/// `time` in ns a sample, which is ms a million samples.
fn measure(
    kernel: &Kernel,
    entries: f64,
    [state_bytes_per_sample, queue_bytes_per_sample]: [f64; 2],
    time: Option<f64>,
    compile_seconds: f64,
) -> Result<KernelMeasurements, Error> {
    let mut measured = KernelMeasurements {
        name: kernel.name.clone(),
        entries_per_sample: entries,
        load_bytes: kernel.load_bytes,
        store_bytes: kernel.store_bytes,
        state_bytes_per_sample,
        queue_bytes_per_sample,
        ms_per_msample: time,
        gb_per_s: None,
        compile_seconds,
        spirv_bytes: spirv::size(kernel)?,
    };
    measured.gb_per_s = rate(measured.bytes_per_sample(), time);
    Ok(measured)
}

/// Bytes a sample over ns a sample: 10^9 bytes a second. `None` where nothing is moved or nothing was timed.
fn rate(bytes: f64, time: Option<f64>) -> Option<f64> {
    time.filter(|&time| bytes > 0.0 && time > 0.0).map(|time| bytes / time)
}
