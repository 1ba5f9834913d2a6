//! The generator's last step: modules and kernels as text, the plan, the report.

mod chain;
mod contract;
mod control;
mod dense;
mod entry;
mod film;
mod fusion;
mod housekeeping;
mod kernel;
mod memory;
mod modules;
mod program;
mod queue;
mod room;
mod rounds;
mod signature;
mod sort;
mod stored;
mod stream;
mod tally;
#[cfg(test)]
mod tests;
mod text;
mod wiring;

use crate::analyze::{self, Leaf, Liveness};
use crate::config;
use crate::config::model::{PathOrder, QueueKind, Selection, Variant};
use crate::diagnostic::{Diagnostic, Severity};
use crate::layout::{self, Placement};
use crate::link::Modules;
use crate::plan::{Layers, Plan, Tally};
use crate::report::{self, Report};
use crate::source::{FileKind, Sources};
use dense::Dense;
use indexmap::IndexSet;
use program::Program;
use queue::Queues;
use rounds::Rounds;
use std::collections::BTreeMap;
use wiring::{Texts, Wiring};

/// What is generated from a selection.
#[derive(Clone, Debug)]
pub struct Parts {
    /// The resolved variant.
    pub variant: Variant,
    /// Kernels, buffers, program.
    pub plan: Plan,
    /// What lives where and why.
    pub report: Report,
    /// Findings that did not stop the generator.
    pub warnings: Vec<Diagnostic>,
}

/// Generates everything; generated modules are added to `sources` under `<generated>/`.
///
/// # Errors
/// The findings of the first phase that fails: configs, wiring and stage texts, initialisation (K0210), layout, kernels.
pub fn generate(sources: &mut Sources, selection: &Selection) -> Result<Parts, Vec<Diagnostic>> {
    let (variant, mut warnings) = config::load(sources, selection)?;
    check_names(&variant)?;
    let tallies = tally::tallies(&variant.pipeline).map_err(|finding| vec![finding])?;
    let layers = film::layers(&variant.pipeline, &tallies).map_err(|finding| vec![finding])?;
    let constants = modules::constants(&variant.pipeline, &variant.effects);
    let mut modules = modules_of(sources);
    let outcomes = add_config_modules(sources, &mut modules, &variant, &tallies, &layers)?;
    let wiring = {
        let texts = Texts { sources, modules: &modules, constants: &constants, outcomes: &outcomes };
        wiring::wire(texts, &variant)?
    };
    warnings.extend(wiring.warnings.iter().cloned());
    let start = &variant.pipeline.start.value;
    let liveness = analyze::liveness(&wiring.flow());
    check_initialised(&wiring, &liveness, start)?;
    let placement = layout::assign(&variant, &liveness)?;
    let rounds = Rounds::new(&variant, &wiring.fusion).map_err(|finding| vec![finding])?;
    let mut queues = queues(&wiring, &variant, &rounds);
    queues.dense = dense(&wiring, &variant, &rounds, &queues, &placement, &liveness);
    if let Some(dense) = &queues.dense {
        queues.ordered.retain(|stage| *stage != dense.first);
    }
    queues.packed = packed(&wiring, &variant, &rounds, &queues, &placement, &liveness);
    let layers = film::used(layers, &wiring.splats);
    add_state_modules(sources, &mut modules, &variant, &wiring, &placement, &queues, rounds.most);
    add_module(sources, &mut modules, "film", film::module(variant.schedule.accumulate, &layers));
    let program = Program {
        variant: &variant,
        wiring: &wiring,
        liveness: &liveness,
        placement: &placement,
        queues: &queues,
        constants: &constants,
        rounds: &rounds,
        tallies: &tallies,
        layers: &layers,
    };
    let built = program::build(sources, &mut modules, &program)?;
    let facts = wiring.stages.iter().map(|(name, stage)| (name.as_str(), &stage.facts));
    let keys = wiring.stages.iter().filter_map(|(name, stage)| Some((name.as_str(), &stage.key.as_ref()?.reads)));
    let mut effects_seen = built.effects_seen;
    effects_seen.extend(wiring.effects_seen.iter().cloned());
    let report = report::build(&report::Findings {
        sources,
        variant: &variant,
        plan: &built.plan,
        placement: &placement,
        in_place: &built.in_place,
        liveness: &liveness,
        stages: facts.collect(),
        keys: keys.collect(),
        effects_seen: &effects_seen,
    });
    debug_assert!(warnings.iter().all(|warning| warning.severity == Severity::Warning));
    Ok(Parts { variant, plan: built.plan, report, warnings })
}

/// All WGSL modules by module path.
fn modules_of(sources: &Sources) -> Modules {
    let path = |key: &str| key.replace('/', "::");
    sources.of_kind(FileKind::Module).map(|(id, file)| (path(&file.key), id)).collect()
}

fn add_module(sources: &mut Sources, modules: &mut Modules, name: &str, text: String) {
    let file = sources.add(FileKind::Module, name, format!("<generated>/{name}.wgsl"), text);
    modules.insert(name.to_owned(), file);
}

/// Adds the modules that stages import, and returns the outcomes in order of their values.
fn add_config_modules(
    sources: &mut Sources,
    modules: &mut Modules,
    variant: &Variant,
    tallies: &[Tally],
    layers: &[Layers],
) -> Result<IndexSet<String>, Vec<Diagnostic>> {
    let pipeline = &variant.pipeline;
    let outcomes = modules::outcome_names(pipeline, &imported_outcomes(sources, modules, variant));
    let state = modules::state(pipeline)?;
    // Stages are analysed against counters and queues of no stage: which there are follows from the analysis.
    let queues = Queues::none(variant.schedule.workgroup.value);
    let texts = [
        ("real", modules::real(variant.precision.real)),
        ("state", state),
        ("outcome", modules::outcome(&outcomes)),
        ("features", modules::features(&variant.effects)),
        ("params", modules::params(&pipeline.params)),
        ("pass", modules::pass(variant.schedule.regenerate.value > 1)),
        ("control", control::module(&queues, 0)),
        ("film", film::module(variant.schedule.accumulate, layers)),
        ("streams", stream::analysis_module(pipeline)),
        ("stored", stored::module(pipeline, &BTreeMap::new())),
        ("tallies", tally::module(pipeline, tallies, variant.schedule.workgroup.value)),
    ];
    for (name, text) in texts {
        add_module(sources, modules, name, text);
    }
    Ok(outcomes)
}

/// Outcomes that the pipeline's own stage functions import.
fn imported_outcomes(sources: &Sources, modules: &Modules, variant: &Variant) -> Vec<String> {
    let entries = entry::Entries::scan(sources, modules);
    let mut names = Vec::new();
    for stage in variant.pipeline.stages.values() {
        let Ok(entry) = entries.find(&stage.entry) else { continue };
        if let Some(file) = modules.get(&entry.module) {
            names.extend(entry::imported_outcomes(&sources.file(*file).text));
        }
    }
    names
}

/// Adds the modules that follow from the analysis.
fn add_state_modules(
    sources: &mut Sources,
    modules: &mut Modules,
    variant: &Variant,
    wiring: &Wiring,
    placement: &Placement,
    queues: &Queues,
    rounds: u32,
) {
    let texts = [
        ("pass", modules::pass(queues.numbers_paths())),
        ("control", control::module(queues, rounds)),
        ("next", chain::module(wiring)),
        ("queue", queue::queue_module(queues)),
        ("sort", sort::module(queues.workgroup)),
        ("tables", memory::module(placement, queues.dense.as_ref())),
        ("stored", stored::module(&variant.pipeline, &placement.leaves)),
        ("streams", stream::module(&variant.pipeline, wiring, room::records(&variant.schedule), queues.gathers())),
    ];
    for (name, text) in texts {
        add_module(sources, modules, name, text);
    }
}

fn queues(wiring: &Wiring, variant: &Variant, rounds: &Rounds) -> Queues {
    let batched = wiring.streams.iter().filter(|(_, stream)| stream.batched);
    let stages: Vec<String> = wiring.fusion.queued.keys().cloned().collect();
    let kind = variant.schedule.queue;
    let sorts = variant.schedule.order != PathOrder::Arrival && kind != QueueKind::None;
    let has_key = |stage: &String| wiring.stages.get(stage).is_some_and(|stage| stage.key.is_some());
    let mixed = |stage: &&String| sorts && rounds.mixes(&wiring.fusion, stage) && !has_key(stage);
    Queues {
        ordered: stages.iter().filter(mixed).cloned().collect(),
        packed: None,
        dense: None,
        stages,
        streams: batched.map(|(name, _)| name.clone()).collect(),
        kind,
        regenerates: variant.schedule.regenerate.value > 1,
        workgroup: variant.schedule.workgroup.value,
    }
}

/// The stage whose paths close up, if the schedule has them do so: of those where all may meet, the one that takes along the least
/// which it would not have moved anyway.
fn packed(
    wiring: &Wiring,
    variant: &Variant,
    rounds: &Rounds,
    queues: &Queues,
    placement: &Placement,
    liveness: &Liveness,
) -> Option<String> {
    let packs = matches!(variant.schedule.order, PathOrder::Packed | PathOrder::Dense);
    let enters = |stage: &str| {
        let first = queues.dense.as_ref().map(|dense| &dense.first);
        first.is_some_and(|first| wiring.fusion.queued[stage].feeds.contains(first))
    };
    let meets = |stage: &&String| packs && rounds.is_beside_inner(&wiring.fusion, stage) && !enters(stage);
    let extra = |stage: &&String| liveness.kernels.get(*stage).map(|traffic| memory::carried_bytes(placement, traffic));
    queues.ordered.iter().filter(meets).min_by_key(extra).cloned()
}

/// The loop whose paths stand side by side, if the schedule wants them to.
fn dense(
    wiring: &Wiring,
    variant: &Variant,
    rounds: &Rounds,
    queues: &Queues,
    placement: &Placement,
    liveness: &Liveness,
) -> Option<Dense> {
    let wanted = variant.schedule.order == PathOrder::Dense && queues.kind != QueueKind::None && !queues.regenerates;
    if !wanted {
        return None;
    }
    let dense = Dense::new(&wiring.fusion, rounds, queues, placement, liveness)?;
    // Sorted, paths would not stand where their state is.
    wiring.stages[&dense.first].key.is_none().then_some(dense)
}

/// K0210: a leaf that some stage reads although no stage before it surely wrote it.
fn check_initialised(wiring: &Wiring, liveness: &Liveness, start: &str) -> Result<(), Vec<Diagnostic>> {
    let Some(traffic) = liveness.kernels.get(start) else { return Ok(()) };
    let findings: Vec<Diagnostic> = traffic.live_in.iter().map(|leaf| uninitialised(wiring, leaf, start)).collect();
    if findings.is_empty() { Ok(()) } else { Err(findings) }
}

fn uninitialised(wiring: &Wiring, leaf: &Leaf, start: &str) -> Diagnostic {
    let mut finding = Diagnostic::error("K0210", format!("`{leaf}` can be read before it was ever written"));
    let mut reading = wiring.stages.iter().filter_map(|(name, stage)| {
        let key = stage.key.as_ref().and_then(|key| key.reads.get(leaf));
        let place = stage.facts.reads.get(leaf).or(key)?;
        Some((name, *place))
    });
    if let Some((name, place)) = reading.next() {
        finding = finding.at(place, format!("stage `{name}` reads it here"));
    }
    if let Some(entry) = wiring.stages.get(start).map(|stage| &stage.entry) {
        let message = format!("paths begin in stage `{start}`, which does not surely write it");
        finding = finding.also(entry.span, message);
    }
    for (name, stage) in &wiring.stages {
        if let Some(place) = stage.facts.maybe.get(leaf) {
            finding = finding.also(*place, format!("stage `{name}` writes it on some ways only"));
        }
    }
    finding.help(format!("write it in `{start}`, or on every way that leads to where it is read"))
}

/// K0214: names that generated text uses itself.
fn check_names(variant: &Variant) -> Result<(), Vec<Diagnostic>> {
    let pipeline = &variant.pipeline;
    let reserved = kernel::reserved_locals();
    let instances = pipeline.state.iter().map(|(name, record)| (name, record.span));
    let streams = pipeline.streams.iter().map(|(name, stream)| (name, stream.span));
    let taken = instances.chain(streams).filter(|(name, _)| reserved.contains(name.as_str()));
    let findings: Vec<Diagnostic> = taken
        .map(|(name, span)| {
            Diagnostic::error("K0214", format!("`{name}` is a name that generated kernels use"))
                .at(span, "declared here")
                .help("choose another name")
        })
        .collect();
    if findings.is_empty() { Ok(()) } else { Err(findings) }
}
