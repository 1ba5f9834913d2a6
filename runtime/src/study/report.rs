//! The page of a study: tables, charts and pictures in one HTML file that needs nothing beside it.

mod error_over_time;
mod html;
mod kernels;
mod measures;
mod pictures;
mod states;

use super::chart::{escape, shown};
use super::file::{Study, Wanted};
use super::results::{Reference, Results};
use crate::copy_rate::CopyRate;
use crate::error::Error;
use html::{element, section, table};
use std::collections::BTreeSet;
use std::path::Path;

const STYLE: &str = include_str!("report/style.css");
const SCRIPT: &str = include_str!("report/compare.js");

/// The page. Pictures are read from the study's folder.
///
/// # Errors
/// When a picture cannot be read or encoded.
pub fn page(study: &Study, results: &Results, folder: &Path) -> Result<String, Error> {
    let mut body = element("h1", "", &escape(&results.title)) + &element("p", "", &escape(&results.doc));
    body += &notes(results);
    body += &variants(study);
    body += &measures::sections(results);
    for scene in &results.scenes {
        body += &error_over_time::section_of(results, scene);
    }
    for scene in &results.scenes {
        body += &kernels::section_of(results, scene);
    }
    body += &states::section_of(results);
    for scene in &results.scenes {
        body += &pictures::section_of(results, scene, folder)?;
    }
    body += &element("script", "", SCRIPT);
    let head = format!(
        "<meta charset=\"utf-8\">{}{}",
        element("title", "", &escape(&results.title)),
        element("style", "", STYLE)
    );
    let html = element("html", "lang=\"en\"", &(element("head", "", &head) + &element("body", "", &body)));
    Ok(format!("<!DOCTYPE html>\n{html}\n"))
}

/// What ran on what, and what did not run.
fn notes(results: &Results) -> String {
    let adapters: BTreeSet<&str> = results.runs.iter().map(|run| run.measured.adapter.as_str()).collect();
    let several = if adapters.len() > 1 { "; times of different adapters cannot be compared" } else { "" };
    let names: Vec<&str> = adapters.into_iter().collect();
    let mut lines = vec![match names.as_slice() {
        [] => "Nothing was rendered.".to_owned(),
        names => format!("{} pictures, rendered on {}{several}.", results.runs.len(), names.join(" and ")),
    }];
    lines.extend(
        results.skipped.iter().map(|skipped| format!("Scene {} was skipped: {}.", skipped.scene, skipped.reason)),
    );
    lines.extend(results.references.iter().map(describe_reference));
    lines.extend(results.copy_rate.as_ref().map(describe_copy_rate));
    let items: String = lines.iter().map(|line| element("li", "", &escape(line))).collect();
    element("ul", "", &items)
}

fn describe_copy_rate(rate: &CopyRate) -> String {
    let (adapter, size) = (&rate.adapter, rate.bytes >> 20);
    let rate = shown(rate.gb_per_s);
    format!(
        "{adapter} copies {size} MiB at {rate} GB/s, reading and writing counted: what rates of state are measured against."
    )
}

fn describe_reference(reference: &Reference) -> String {
    let how = match &reference.wanted {
        Some(Wanted { settings, .. }) => format!(
            "a picture of pipeline {} with {} samples per pixel",
            settings.pipeline.as_deref().unwrap_or_default(),
            settings.spp.unwrap_or_default()
        ),
        None => reference.picture.clone(),
    };
    format!("Scene {} is measured against {how}.", reference.scene)
}

/// What the variants are.
fn variants(study: &Study) -> String {
    let columns = ["pipeline", "layout", "schedule", "precision", "set", "about"].map(str::to_owned);
    let row = |variant: &super::file::Variant| {
        let settings = study.defaults.settings.clone().overlaid(variant.settings.clone()).with_defaults(study.target);
        let set: Vec<_> = settings.set.iter().map(|(key, value)| format!("{key}={}", value.word())).collect();
        let axes = [settings.pipeline, settings.layout, settings.schedule, settings.precision];
        let mut cells: Vec<String> = axes.into_iter().map(Option::unwrap_or_default).collect();
        cells.extend([set.join(" "), variant.settings.doc.clone().unwrap_or_default()]);
        (variant.name.clone(), cells)
    };
    let rows: Vec<_> = study.variants.iter().map(row).collect();
    section("Variants", &table("variant", &columns, &rows))
}
