//! Compiles the description of a wavefront light-transport pipeline to WGSL kernels and a plan of their execution.
//!
//! Text in, text and a [`plan::Plan`] out: no GPU, no file system, no clock; equal input gives equal bytes.

pub mod analyze;
pub mod config;
pub mod diagnostic;
pub mod emit;
pub mod layout;
pub mod link;
pub mod plan;
pub mod report;
pub mod source;

use config::model::{Selection, Variant};
use diagnostic::Diagnostic;
use source::Sources;

/// Everything that is generated from one variant.
#[derive(Clone, Debug)]
pub struct Generated {
    /// The resolved variant.
    pub variant: Variant,
    /// Kernels, buffers, program.
    pub plan: plan::Plan,
    /// What lives where and why; printed by `explain`.
    pub report: report::Report,
    /// The texts, generated modules included, for rendering later diagnostics.
    pub sources: Sources,
    /// Findings that did not stop the generator.
    pub warnings: Vec<Diagnostic>,
}

/// A refusal: what is wrong, and the texts that the labels point into (generated modules and `--set` values included).
#[derive(Clone, Debug)]
pub struct Refusal {
    /// The findings, errors first.
    pub diagnostics: Vec<Diagnostic>,
    /// The texts.
    pub sources: Sources,
}

impl Refusal {
    /// The findings as text.
    pub fn render(&self, colour: bool) -> String {
        diagnostic::render(&self.diagnostics, &self.sources, colour)
    }
}

/// Generates the kernels and the plan of a variant.
///
/// # Errors
/// Every diagnostic found in the first phase that fails: configs, wiring, linking, analysis, layout, validation.
pub fn generate(sources: &Sources, selection: &Selection) -> Result<Generated, Refusal> {
    let mut sources = sources.clone();
    match emit::generate(&mut sources, selection) {
        Ok(parts) => Ok(Generated {
            variant: parts.variant,
            plan: parts.plan,
            report: parts.report,
            warnings: parts.warnings,
            sources,
        }),
        Err(diagnostics) => Err(Refusal { diagnostics, sources }),
    }
}
