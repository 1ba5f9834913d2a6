//! Sizes of kernels as the driver gets them.

use crate::error::Error;
use kernelgen::plan::Kernel;
use wgpu::naga::back::spv;
use wgpu::naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
use wgpu::naga::{ShaderStage, back::pipeline_constants::process_overrides, front::wgsl};

/// Bytes of SPIR-V that wgpu hands to Vulkan for a kernel without runtime checks and debug names.
///
/// # Errors
/// Failed, when naga refuses the kernel.
pub fn size(kernel: &Kernel) -> Result<u64, Error> {
    let refused = |error: &dyn std::fmt::Display| Error::failed(format!("SPIR-V of `{}`: {error}", kernel.name));
    let module = wgsl::parse_str(&kernel.module).map_err(|error| refused(&error))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::all())
        .validate(&module)
        .map_err(|error| refused(&error.into_inner()))?;
    let entry = Some((ShaderStage::Compute, kernel.entry.as_str()));
    // Every number is one word of the binary, whatever its value.
    let constants = kernel.overrides.iter().map(|name| (name.clone(), 1024.0)).collect();
    let (module, info) = process_overrides(&module, &info, entry, &constants).map_err(|error| refused(&error))?;
    let pipeline = spv::PipelineOptions { shader_stage: ShaderStage::Compute, entry_point: kernel.entry.clone() };
    let words = spv::write_vec(&module, &info, &unchecked(), Some(&pipeline)).map_err(|error| refused(&error))?;
    Ok(4 * words.len() as u64)
}

fn unchecked() -> spv::Options<'static> {
    spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Unchecked,
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Unchecked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        force_loop_bounding: false,
        ..spv::Options::default()
    }
}
