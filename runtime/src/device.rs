//! The adapter and the device: selection, limits, features.

use crate::error::Error;
use kernelgen::plan::Needs;
use std::sync::{Arc, Mutex};
use wgpu::{DeviceType, Features};

/// What to open.
#[derive(Clone, Debug, Default)]
pub struct DeviceOptions {
    /// Part of an adapter's name, in any case; the best adapter when `None`.
    pub adapter: Option<String>,
    /// Bounds checks in shaders, and validation of indirect dispatches. Off for timing: together they cost about a third of the speed.
    pub checked: bool,
}

/// An open device.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// The adapter's description.
    pub info: wgpu::AdapterInfo,
    /// Whether shaders are checked.
    pub checked: bool,
    first_error: Arc<Mutex<Option<String>>>,
}

/// Every adapter that can be used, best first: discrete, integrated, virtual, other, CPU.
pub fn adapters(checked: bool) -> Vec<wgpu::Adapter> {
    let flags = if checked { wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL } else { wgpu::InstanceFlags::empty() };
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN,
        flags,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    found.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    found
}

fn rank(kind: DeviceType) -> u32 {
    match kind {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    }
}

/// Features that are asked of every adapter that has them.
fn useful_features() -> Features {
    Features::SHADER_INT64
        | Features::SHADER_INT64_ATOMIC_ALL_OPS
        | Features::SHADER_FLOAT32_ATOMIC
        | Features::SUBGROUP
        | Features::TIMESTAMP_QUERY
        | Features::TIMESTAMP_QUERY_INSIDE_ENCODERS
        | Features::TIMESTAMP_QUERY_INSIDE_PASSES
}

impl Gpu {
    /// Opens an adapter with all of its limits and all features that kernels may use.
    ///
    /// # Errors
    /// User input when no adapter's name contains `options.adapter`; failed when there is no Vulkan adapter or it cannot be opened.
    pub fn open(options: &DeviceOptions) -> Result<Self, Error> {
        let adapter = choose(adapters(options.checked), options.adapter.as_deref())?;
        let info = adapter.get_info();
        let description = wgpu::DeviceDescriptor {
            label: Some("pathloom"),
            required_features: adapter.features() & useful_features(),
            required_limits: adapter.limits(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::Performance,
            trace: wgpu::Trace::Off,
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&description))
            .map_err(|error| Error::failed(format!("cannot open the adapter `{}`: {error}", info.name)))?;
        let first_error = Arc::new(Mutex::new(None));
        watch(&device, &first_error);
        Ok(Self { device, queue, info, checked: options.checked, first_error })
    }

    /// Whether the adapter computes on the CPU.
    pub fn is_cpu(&self) -> bool {
        self.info.device_type == DeviceType::Cpu
    }

    /// Whether timestamps can be written between dispatches.
    pub fn has_timestamps(&self) -> bool {
        let wanted = Features::TIMESTAMP_QUERY | Features::TIMESTAMP_QUERY_INSIDE_PASSES;
        self.device.features().contains(wanted)
    }

    /// Refuses a plan that needs features which the adapter lacks.
    ///
    /// # Errors
    /// User input, naming the feature and the config key that avoids it.
    pub fn require(&self, needs: &Needs) -> Result<(), Error> {
        let has = self.device.features();
        let int64 = Features::SHADER_INT64 | Features::SHADER_INT64_ATOMIC_ALL_OPS;
        let missing = [
            (needs.int64_atomics, int64, "64-bit integer atomics", "--set schedule.accumulate=atomic_f32"),
            (
                needs.float32_atomics,
                Features::SHADER_FLOAT32_ATOMIC,
                "32-bit float atomics",
                "--set schedule.accumulate=fixed_i64",
            ),
            (needs.subgroup, Features::SUBGROUP, "subgroup operations", "--set schedule.queue=atomic"),
        ];
        for (needed, feature, what, way_out) in missing {
            if needed && !has.contains(feature) {
                let name = &self.info.name;
                return Err(Error::input(format!(
                    "the adapter `{name}` has no {what}, which this variant uses; avoid them with `{way_out}`"
                )));
            }
        }
        Ok(())
    }

    /// Reports the first error that the device raised since it was opened.
    ///
    /// # Errors
    /// Failed, with the device's own words.
    pub fn check(&self) -> Result<(), Error> {
        let first = self.first_error.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take();
        first.map_or(Ok(()), |message| {
            Err(Error::failed(format!("the device `{}` reported: {message}", self.info.name)))
        })
    }

    /// Runs `create` and turns a validation or memory error that it raises into an `Err`.
    ///
    /// # Errors
    /// Failed: `what`, and the device's own words.
    pub fn scoped<T>(&self, what: &str, create: impl FnOnce() -> T) -> Result<T, Error> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = create();
        let invalid = pollster::block_on(validation.pop());
        let exhausted = pollster::block_on(memory.pop());
        if let Some(error) = exhausted {
            return Err(Error::failed(format!(
                "{what}: out of device memory; fewer paths (`--paths`) or pixels need less ({error})"
            )));
        }
        invalid.map_or(Ok(made), |error| Err(Error::failed(format!("{what}: {error}"))))
    }

    /// Compiles a WGSL text, checked or trusted as the device was opened.
    ///
    /// # Errors
    /// Failed, when wgpu refuses the text.
    pub fn module(&self, name: &str, text: &str) -> Result<wgpu::ShaderModule, Error> {
        let checks =
            if self.checked { wgpu::ShaderRuntimeChecks::checked() } else { wgpu::ShaderRuntimeChecks::unchecked() };
        let description =
            wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(text.into()) };
        // SAFETY: kernels index their buffers by values below `path_count`, the film's size and counts the generator bounds,
        // and every loop in them ends; that they do is what `--checked` is there to find out.
        self.scoped(name, || unsafe { self.device.create_shader_module_trusted(description, checks) })
    }

    /// Waits until a submission is done.
    ///
    /// # Errors
    /// Failed, when the device is lost or reported an error.
    pub fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<(), Error> {
        let poll = wgpu::PollType::Wait { submission_index: Some(submission), timeout: None };
        let waited = self.device.poll(poll);
        self.check()?;
        waited.map(|_| ()).map_err(|error| Error::failed(format!("waiting for `{}`: {error}", self.info.name)))
    }

    /// Copies a buffer to the host.
    ///
    /// # Errors
    /// Failed, when the device is lost or out of memory.
    pub fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, Error> {
        let size = buffer.size();
        let staging = self.scoped("read-back", || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("read-back"),
                size,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })?;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
        let submission = self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |_| {});
        self.wait(submission)?;
        mapped(&staging, size)
    }
}

/// The bytes of a buffer whose mapping has completed; unmaps it.
pub(crate) fn mapped(staging: &wgpu::Buffer, size: u64) -> Result<Vec<u8>, Error> {
    let view = staging
        .slice(..size)
        .get_mapped_range()
        .map_err(|error| Error::failed(format!("cannot map a read-back buffer: {error}")))?;
    let bytes = view.to_vec();
    drop(view);
    staging.unmap();
    Ok(bytes)
}

fn choose(found: Vec<wgpu::Adapter>, wanted: Option<&str>) -> Result<wgpu::Adapter, Error> {
    if found.is_empty() {
        return Err(Error::failed("no Vulkan adapter was found; a software one comes with Mesa (lavapipe)"));
    }
    let Some(wanted) = wanted else {
        return found.into_iter().next().ok_or_else(|| Error::failed("no Vulkan adapter was found"));
    };
    let names: Vec<String> = found.iter().map(|adapter| format!("`{}`", adapter.get_info().name)).collect();
    let lower = wanted.to_lowercase();
    found
        .into_iter()
        .find(|adapter| adapter.get_info().name.to_lowercase().contains(&lower))
        .ok_or_else(|| Error::input(format!("no adapter's name contains `{wanted}`; there are {}", names.join(", "))))
}

fn watch(device: &wgpu::Device, first_error: &Arc<Mutex<Option<String>>>) {
    let errors = first_error.clone();
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(&errors, error.to_string())));
    let losses = first_error.clone();
    device.set_device_lost_callback(move |reason, message| {
        if reason != wgpu::DeviceLostReason::Destroyed {
            note(&losses, format!("lost: {message}"));
        }
    });
}

fn note(slot: &Mutex<Option<String>>, message: String) {
    slot.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(message);
}
