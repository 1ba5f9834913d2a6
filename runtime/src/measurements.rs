//! What a render measured, as `render --json` and studies write it.

use crate::counters::Counters;
use crate::device::Gpu;
use crate::kernel_profile::KernelProfile;
use crate::profile::ByKind;
use crate::render::Rendered;
use crate::settings::RenderFile;
use indexmap::IndexMap;
use kernelgen::Generated;
use serde::{Deserialize, Serialize};

/// Cost and size of a finished render.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurements {
    /// Samples of all pixels, taken by this run.
    pub samples: u64,
    /// Samples per pixel in the picture, earlier runs included.
    pub samples_per_pixel: u32,
    /// Seconds of rendering, compilation and loading left out.
    pub seconds: f64,
    /// Millions of samples per second.
    pub msamples_per_s: f64,
    /// Rays traced.
    pub rays: Rays,
    /// State that is stored for a path between kernels, bytes; rays in flight left out where the layout keeps them apart.
    pub bytes_per_path: u32,
    /// Rays in flight of a path, bytes, where the layout keeps them apart.
    #[serde(default)]
    pub ray_bytes_per_path: u32,
    /// Millions of rays per second, by kind.
    pub mrays_per_s: ByKind,
    /// Contributions that the film refused: not finite, or negative.
    pub rejected: u64,
    /// The device.
    pub adapter: String,
    /// What was rendered.
    pub variant: RenderFile,
    /// Root mean square of the standard errors over the mean radiance; unknown before the second batch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative_error: Option<f64>,
    /// Milliseconds of device time that a pass spends in each kernel; unknown where the adapter has no timestamps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ms_per_pass: Option<IndexMap<String, f64>>,
    /// What each kernel costs, where it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kernel_profile: Option<KernelProfile>,
}

/// Rays by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rays {
    /// Camera rays.
    pub primary: u64,
    /// Rays after the first scattering.
    pub secondary: u64,
    /// Later rays of walks.
    pub deep: u64,
    /// Shadow and connection rays.
    pub visibility: u64,
}

impl From<&Counters> for Rays {
    fn from(counters: &Counters) -> Self {
        Self {
            primary: counters.primary,
            secondary: counters.secondary,
            deep: counters.deep,
            visibility: counters.visibility,
        }
    }
}

impl Measurements {
    /// Of a render with these settings.
    pub fn of(rendered: &Rendered, generated: &Generated, gpu: &Gpu, settings: &RenderFile) -> Self {
        let counters = &rendered.counters;
        let [width, height] = rendered.size;
        let samples = u64::from(width) * u64::from(height) * u64::from(rendered.samples_taken);
        let relative = rendered.totals.relative_error();
        Self {
            samples,
            samples_per_pixel: rendered.totals.samples,
            seconds: rendered.seconds,
            msamples_per_s: samples as f64 * 1e-6 / rendered.seconds.max(1e-9),
            rays: counters.into(),
            bytes_per_path: generated.plan.bytes_per_path,
            ray_bytes_per_path: generated.plan.ray_bytes_per_path,
            mrays_per_s: rendered.profile.mrays_per_second(counters, rendered.seconds),
            rejected: counters.rejected,
            adapter: gpu.info.name.clone(),
            variant: RenderFile { state: None, ..settings.clone() },
            relative_error: relative.is_finite().then_some(relative),
            kernel_profile: None,
            ms_per_pass: (rendered.profile.passes > 0).then(|| rendered.profile.kernel_milliseconds()),
        }
    }

    /// Wall-clock milliseconds for a million samples.
    pub fn ms_per_msample(&self) -> f64 {
        1e9 * self.seconds / (self.samples as f64).max(1.0)
    }

    /// Milliseconds for one sample of every pixel: the frame time of a progressive renderer.
    pub fn ms_per_frame(&self) -> f64 {
        let pixels = self.variant.size.map_or(1.0, |[width, height]| f64::from(width) * f64::from(height));
        1e3 * self.seconds * pixels / (self.samples as f64).max(1.0)
    }
}
