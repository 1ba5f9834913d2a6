//! From a selection of files to a checked variant.

use super::merge::{self, AxisFile, LAYOUT, PIPELINE, PRECISION, SCHEDULE};
use super::model::{Selection, Variant};
use super::section::{Findings, Section};
use super::tree::Table;
use super::{codec, feature, layout, pipeline, schedule, set, wiring};
use crate::diagnostic::{Diagnostic, Severity};
use crate::source::{Sources, Span};

/// Reads, merges, overrides and checks one choice from each axis.
///
/// The `--set` values are added to `sources`, so that diagnostics can point into them. The second part of the result
/// are the warnings.
///
/// # Errors
/// Every diagnostic that could be found, errors first: K01xx for the configs themselves, K02xx for wiring, K04xx for
/// placements that name what the pipeline does not have.
pub fn load(sources: &mut Sources, selection: &Selection) -> Result<(Variant, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut findings = Findings::new();
    let files = read_axes(sources, selection, &mut findings);
    let variant = files.and_then(|files| convert(sources, selection, files, &mut findings));
    findings.sort_by_key(place);
    let refused = findings.iter().any(|finding| finding.severity == Severity::Error);
    match variant {
        Some(variant) if !refused => Ok((variant, findings)),
        _ => Err(findings),
    }
}

/// Errors before warnings, then the order of the texts.
fn place(finding: &Diagnostic) -> (bool, Option<Span>) {
    let primary = finding.labels.iter().find(|label| label.primary);
    (finding.severity == Severity::Warning, primary.map(|label| label.span))
}

/// All four axes; `None` when one of them cannot be read, after every one was tried.
fn read_axes(sources: &mut Sources, selection: &Selection, findings: &mut Findings) -> Option<[AxisFile; 4]> {
    let pipeline = merge::read(sources, &PIPELINE, &selection.pipeline, findings);
    let layout = merge::read(sources, &LAYOUT, &selection.layout, findings);
    let schedule = merge::read(sources, &SCHEDULE, &selection.schedule, findings);
    let precision = merge::read(sources, &PRECISION, &selection.precision, findings);
    Some([pipeline?, layout?, schedule?, precision?])
}

fn convert(
    sources: &mut Sources,
    selection: &Selection,
    mut files: [AxisFile; 4],
    findings: &mut Findings,
) -> Option<Variant> {
    let mut root = combine(&mut files, findings);
    set::apply(sources, &mut root, selection, findings);
    let [pipeline, layout, schedule, precision] = &files;
    let top = |file: &AxisFile| Section { path: String::new(), span: file.origin, table: &root };
    let pipeline = pipeline::read(pipeline, &top(pipeline), findings);
    let layout = layout::read(layout, &top(layout), findings);
    let schedule = schedule::read(schedule, &top(schedule), findings);
    let precision = schedule::read_precision(precision, &top(precision), findings);
    let effects = feature::read(sources, &selection.effects, &top(&files[0]), findings);
    let codecs = codec::read(sources, findings);
    let variant = Variant { pipeline, layout: layout?, schedule: schedule?, precision: precision?, effects, codecs };
    wiring::check(&variant, findings);
    Some(variant)
}

/// One tree of all axes. Their keys are disjoint but for `[features]`.
fn combine(files: &mut [AxisFile; 4], findings: &mut Findings) -> Table {
    let mut root = Table::new();
    for file in files {
        let table = std::mem::take(&mut file.table);
        feature::contradictions(&root, &table, findings);
        merge::overlay(&mut root, table);
    }
    root
}
