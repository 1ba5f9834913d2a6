//! Allocation: how many path slots fit, and the buffers of a plan.

use crate::device::Gpu;
use crate::error::Error;
use kernelgen::plan::{Access, Buffer, Plan, Role, SLOT_GRAIN};
use wgpu::{BufferUsages, DeviceType};

/// Path slots on a GPU when not asked otherwise: so many that the last rounds of a pass, which few paths reach, cost little beside it.
const DEFAULT_PATHS_GPU: u64 = 1 << 24;
/// What they may take on a GPU with memory of its own, bytes.
const DEFAULT_MEMORY_DISCRETE: u64 = 4 << 30;
/// What they may take on others, bytes.
const DEFAULT_MEMORY_SHARED: u64 = 1 << 30;
/// Path slots on a CPU adapter when not asked otherwise.
const DEFAULT_PATHS_CPU: u64 = 1 << 17;
/// The most that may be asked for.
const MOST_PATHS: u64 = 1 << 26;
/// Slots come in multiples of this.
const GRAIN: u64 = SLOT_GRAIN as u64;

/// Looks a scene resource up by its WGSL name.
pub type Resources<'a> = dyn Fn(&str) -> Option<&'a [u8]> + 'a;

/// The buffers of a plan, in its order; scene resources that no kernel binds are `None`.
#[derive(Debug)]
pub struct Buffers {
    /// By index into `Plan::buffers`.
    pub all: Vec<Option<wgpu::Buffer>>,
    /// Path slots.
    pub path_count: u32,
    /// Columns and rows of the picture.
    pub size: [u32; 2],
}

impl Buffers {
    /// Allocates everything and uploads the scene.
    ///
    /// # Errors
    /// User input when the scene lacks a resource, or a table is larger than the adapter can bind; failed when memory runs out.
    pub fn new(gpu: &Gpu, plan: &Plan, size: [u32; 2], path_count: u32, resources: &Resources) -> Result<Self, Error> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let mut all = Vec::with_capacity(plan.buffers.len());
        for (index, buffer) in plan.buffers.iter().enumerate() {
            let made = match buffer.role {
                Role::Resource => resource(gpu, plan, index, buffer, resources)?,
                _ => Some(allocate(gpu, buffer, size_of(buffer, path_count.into(), pixels))?),
            };
            all.push(made);
        }
        Ok(Self { all, path_count, size })
    }

    /// The only buffer of a role.
    ///
    /// # Errors
    /// Failed, when the plan has none.
    pub fn of(&self, plan: &Plan, role: Role) -> Result<&wgpu::Buffer, Error> {
        let index = plan.buffers.iter().position(|buffer| buffer.role == role);
        index
            .and_then(|index| self.all[index].as_ref())
            .ok_or_else(|| Error::failed(format!("the plan has no {role:?} buffer")))
    }
}

/// Chooses the number of path slots: what was asked for or the adapter's default, at most the work there is, and so many that every
/// table can be bound.
///
/// # Errors
/// User input, when not even the smallest number fits or `wanted` is out of range.
pub fn choose_path_count(
    gpu: &Gpu,
    plan: &Plan,
    pixels: u64,
    wanted: Option<u32>,
    work: Option<u64>,
) -> Result<u32, Error> {
    let asked = wanted.map_or_else(|| default_paths(gpu.info.device_type, bytes_per_path(plan)), u64::from);
    if asked == 0 || asked > MOST_PATHS {
        return Err(Error::input(format!("--paths {asked}: between {GRAIN} and {MOST_PATHS} are possible")));
    }
    let limit = binding_limit(gpu);
    let mut most = asked.min(work.unwrap_or(u64::MAX)).div_ceil(GRAIN);
    for buffer in plan.buffers.iter().filter(|buffer| buffer.role != Role::Resource) {
        let constant = buffer.size.fixed + buffer.size.per_pixel * pixels;
        let smallest = constant + buffer.size.per_path * GRAIN;
        if smallest > limit {
            return Err(too_large(gpu, &buffer.name, smallest, limit));
        }
        if buffer.size.per_path > 0 {
            most = most.min((limit - constant) / (buffer.size.per_path * GRAIN));
        }
    }
    u32::try_from(most.max(1) * GRAIN).map_err(|_| Error::failed("more path slots than 32 bits hold"))
}

fn default_paths(device: DeviceType, bytes_per_path: u64) -> u64 {
    let memory = match device {
        DeviceType::Cpu => return DEFAULT_PATHS_CPU,
        DeviceType::DiscreteGpu => DEFAULT_MEMORY_DISCRETE,
        _ => DEFAULT_MEMORY_SHARED,
    };
    (memory / bytes_per_path.max(1)).clamp(GRAIN, DEFAULT_PATHS_GPU)
}

/// Bytes of all buffers that a path slot takes.
fn bytes_per_path(plan: &Plan) -> u64 {
    plan.buffers.iter().map(|buffer| buffer.size.per_path).sum()
}

/// How many of the path slots one pass may use.
pub fn usable_slots(plan: &Plan, path_count: u32) -> u32 {
    path_count / SLOT_GRAIN * plan.slots_per_grain
}

fn size_of(buffer: &Buffer, path_count: u64, pixels: u64) -> u64 {
    buffer.size.fixed + buffer.size.per_path * path_count + buffer.size.per_pixel * pixels
}

/// The most bytes that a kernel can bind at once.
pub(crate) fn binding_limit(gpu: &Gpu) -> u64 {
    let limits = gpu.device.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

fn too_large(gpu: &Gpu, name: &str, size: u64, limit: u64) -> Error {
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    Error::input(format!(
        "`{name}` takes {:.1} MiB, but the adapter `{}` binds at most {:.1} MiB at once",
        mib(size),
        gpu.info.name,
        mib(limit)
    ))
}

fn allocate(gpu: &Gpu, buffer: &Buffer, size: u64) -> Result<wgpu::Buffer, Error> {
    let usage = match buffer.role {
        Role::Pass => BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        Role::Arguments => BufferUsages::STORAGE | BufferUsages::INDIRECT,
        Role::Control | Role::Film | Role::TallyCounts => {
            BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST
        }
        Role::TallyRates => BufferUsages::STORAGE | BufferUsages::COPY_DST,
        Role::State | Role::Queue | Role::Stream | Role::Resource => BufferUsages::STORAGE,
    };
    create(gpu, &buffer.name, size, usage)
}

/// Creates a buffer of at least 16 bytes, a multiple of 4.
pub(crate) fn create(gpu: &Gpu, name: &str, size: u64, usage: BufferUsages) -> Result<wgpu::Buffer, Error> {
    let limit = binding_limit(gpu);
    if size > limit {
        return Err(too_large(gpu, name, size, limit));
    }
    let description = wgpu::BufferDescriptor {
        label: Some(name),
        size: size.max(16).next_multiple_of(4),
        usage,
        mapped_at_creation: false,
    };
    gpu.scoped(name, || gpu.device.create_buffer(&description))
}

fn resource(
    gpu: &Gpu,
    plan: &Plan,
    index: usize,
    buffer: &Buffer,
    resources: &Resources,
) -> Result<Option<wgpu::Buffer>, Error> {
    let bound: Vec<Access> = plan
        .kernels
        .iter()
        .flat_map(|kernel| &kernel.bindings)
        .filter(|binding| binding.buffer == index)
        .map(|binding| binding.access)
        .collect();
    if bound.is_empty() {
        return Ok(None);
    }
    let name = &buffer.name;
    let bytes = resources(name)
        .ok_or_else(|| Error::failed(format!("the kernels read `{name}`, which the scene loader does not provide")))?;
    let mut usage = BufferUsages::COPY_DST;
    if bound.contains(&Access::Uniform) {
        usage |= BufferUsages::UNIFORM;
    }
    if bound.iter().any(|access| *access != Access::Uniform) {
        usage |= BufferUsages::STORAGE;
    }
    let limit = binding_limit(gpu);
    if bytes.len() as u64 > limit {
        let error = too_large(gpu, name, bytes.len() as u64, limit);
        return Err(error.help("a smaller sky, smaller textures or fewer triangles fit"));
    }
    let made = create(gpu, name, bytes.len() as u64, usage)?;
    let whole = bytes.len() / 4 * 4;
    gpu.queue.write_buffer(&made, 0, &bytes[..whole]);
    if whole < bytes.len() {
        let mut last = [0; 4];
        last[..bytes.len() - whole].copy_from_slice(&bytes[whole..]);
        gpu.queue.write_buffer(&made, whole as u64, &last);
    }
    Ok(Some(made))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_fit_into_the_memory_of_the_device() {
        assert_eq!(default_paths(DeviceType::DiscreteGpu, 100), 1 << 24);
        assert_eq!(default_paths(DeviceType::DiscreteGpu, 1024), 1 << 22);
        assert_eq!(default_paths(DeviceType::IntegratedGpu, 1024), 1 << 20);
        assert_eq!(default_paths(DeviceType::DiscreteGpu, u64::MAX), GRAIN);
        assert_eq!(default_paths(DeviceType::Cpu, 1024), 1 << 17);
    }
}
