//! What `render` says at the end.

use kernelgen::Generated;
use runtime::device::Gpu;
use runtime::error::Error;
use runtime::measurements::Measurements;
use runtime::render::Rendered;
use runtime::settings::RenderFile;
use serde_json::Value;
use std::fmt::Write;
use std::path::PathBuf;

/// A finished render and everything around it.
pub struct Summary<'a> {
    /// The picture.
    pub rendered: &'a Rendered,
    /// What ran.
    pub generated: &'a Generated,
    /// On what.
    pub gpu: &'a Gpu,
    /// The settings, state included.
    pub settings: &'a RenderFile,
    /// The files written.
    pub outputs: &'a [PathBuf],
    /// Whether times of kernels are shown.
    pub profile: bool,
}

impl Summary<'_> {
    /// One JSON object.
    ///
    /// # Errors
    /// Failed, when a number has no JSON form.
    pub fn json(&self) -> Result<Value, Error> {
        let mut object = serde_json::to_value(self.measurements())
            .map_err(|error| Error::failed(format!("cannot write the results as JSON: {error}")))?;
        object["outputs"] = self.outputs.iter().map(|path| path.display().to_string()).collect();
        Ok(object)
    }

    fn measurements(&self) -> Measurements {
        Measurements::of(self.rendered, self.generated, self.gpu, self.settings)
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
        let rendered = self.rendered;
        let counters = &rendered.counters;
        let [width, height] = rendered.size;
        writeln!(out, "picture       {width}x{height}, {} samples per pixel", rendered.totals.samples)?;
        writeln!(
            out,
            "time          {:.2} s, {:.2} Msamples/s on {}",
            rendered.seconds,
            self.measurements().msamples_per_s,
            self.gpu.info.name
        )?;
        let rates = rendered.profile.mrays_per_second(counters, rendered.seconds);
        let kinds = [
            ("primary", counters.primary, rates.primary),
            ("secondary", counters.secondary, rates.secondary),
            ("deep", counters.deep, rates.deep),
            ("visibility", counters.visibility, rates.visibility),
        ];
        for (kind, count, rate) in kinds.iter().filter(|(_, count, _)| *count > 0) {
            writeln!(out, "{kind:<13} {:.2} Mrays, {rate:.1} Mrays/s", *count as f64 * 1e-6)?;
        }
        writeln!(out, "state         {} bytes per path", self.generated.plan.bytes_per_path)?;
        let relative = rendered.totals.relative_error();
        if relative.is_finite() {
            writeln!(out, "error         {:.3} % of the mean radiance", relative * 100.0)?;
        }
        writeln!(out, "rejected      {} contributions", counters.rejected)?;
        if self.profile {
            self.write_profile(out)?;
        }
        for path in self.outputs {
            writeln!(out, "written       {}", path.display())?;
        }
        Ok(())
    }

    fn write_profile(&self, out: &mut String) -> std::fmt::Result {
        let profile = &self.rendered.profile;
        if profile.passes == 0 {
            return writeln!(out, "kernels       not timed: the adapter has no timestamps inside passes");
        }
        writeln!(out, "kernels       ms per pass, mean of {} measured passes", profile.passes)?;
        for (name, milliseconds) in profile.kernel_milliseconds() {
            writeln!(out, "  {milliseconds:>9.3}   {name}")?;
        }
        Ok(())
    }
}
