//! What `render` says at the end.

use runtime::error::Error;
use runtime::kernel_profile::{KernelMeasurements, KernelProfile};
use runtime::measurements::Measurements;
use runtime::render::Rendered;
use serde_json::Value;
use std::fmt::Write;
use std::path::PathBuf;

/// A finished render and everything around it.
pub struct Summary<'a> {
    /// The picture.
    pub rendered: &'a Rendered,
    /// What was measured.
    pub measured: &'a Measurements,
    /// The files written.
    pub outputs: &'a [PathBuf],
}

impl Summary<'_> {
    /// One JSON object.
    ///
    /// # Errors
    /// Failed, when a number has no JSON form.
    pub fn json(&self) -> Result<Value, Error> {
        let mut object = serde_json::to_value(self.measured)
            .map_err(|error| Error::failed(format!("cannot write the results as JSON: {error}")))?;
        object["outputs"] = self.outputs.iter().map(|path| path.display().to_string()).collect();
        Ok(object)
    }

    /// Lines for people.
    ///
    /// # Errors
    /// None in practice: writing to a string does not fail.
    pub fn text(&self) -> Result<String, Error> {
        let mut text = String::new();
        self.write(&mut text).map_err(|error| Error::failed(format!("cannot write the results: {error}")))?;
        Ok(text)
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let Self { rendered, measured, .. } = self;
        let [width, height] = rendered.size;
        writeln!(out, "picture       {width}x{height}, {} samples per pixel", measured.samples_per_pixel)?;
        writeln!(
            out,
            "time          {:.2} s, {:.2} Msamples/s on {}",
            measured.seconds, measured.msamples_per_s, measured.adapter
        )?;
        let (rays, rates) = (&measured.rays, &measured.mrays_per_s);
        let kinds = [
            ("primary", rays.primary, rates.primary),
            ("secondary", rays.secondary, rates.secondary),
            ("deep", rays.deep, rates.deep),
            ("visibility", rays.visibility, rates.visibility),
        ];
        for (kind, count, rate) in kinds.iter().filter(|(_, count, _)| *count > 0) {
            writeln!(out, "{kind:<13} {:.2} Mrays, {rate:.1} Mrays/s", *count as f64 * 1e-6)?;
        }
        let rays = match measured.ray_bytes_per_path {
            0 => String::new(),
            bytes => format!(", and {bytes} of rays in flight"),
        };
        writeln!(out, "state         {} bytes per path{rays}", measured.bytes_per_path)?;
        if let Some(relative) = measured.relative_error {
            writeln!(out, "error         {:.3} % of the mean radiance", relative * 100.0)?;
        }
        writeln!(out, "rejected      {} contributions", measured.rejected)?;
        if let Some(profile) = &measured.kernel_profile {
            self.write_profile(out, profile)?;
        }
        for path in self.outputs {
            writeln!(out, "written       {}", path.display())?;
        }
        Ok(())
    }

    fn write_profile(&self, out: &mut String, profile: &KernelProfile) -> std::fmt::Result {
        match self.rendered.profile.passes {
            0 => writeln!(out, "kernels       not timed: the adapter has no timestamps inside passes")?,
            passes => writeln!(out, "kernels       times are means of {passes} measured passes")?,
        }
        writeln!(out, "  ms/pass  ms/Msample  paths/sample  bytes/sample    GB/s  compile s  SPIR-V B")?;
        let times = self.measured.ms_per_pass.as_ref();
        for kernel in &profile.kernels {
            let time = times.and_then(|times| times.get(&kernel.name)).copied();
            write_kernel(out, kernel, time)?;
        }
        writeln!(out, "compilation   {:.2} s", profile.compile_seconds)
    }
}

fn write_kernel(out: &mut String, kernel: &KernelMeasurements, ms_per_pass: Option<f64>) -> std::fmt::Result {
    let known =
        |value: Option<f64>, decimals: usize| value.map_or(String::new(), |value| format!("{value:.decimals$}"));
    writeln!(
        out,
        "{:>9}  {:>10}  {:>12.3}  {:>12}  {:>6}  {:>9.3}  {:>8}   {}",
        known(ms_per_pass, 3),
        known(kernel.ms_per_msample, 3),
        kernel.entries_per_sample,
        known(Some(kernel.bytes_per_sample()).filter(|&bytes| bytes > 0.0), 1),
        known(kernel.gb_per_s, 2),
        kernel.compile_seconds,
        kernel.spirv_bytes,
        kernel.name
    )
}
