//! Do the parts of a variant fit? Every name that one part says must exist in the other.

use super::encode;
use super::expression;
use super::model::{
    Batch, Field, Fuse, Layers, Layout, OPTIONAL, Pipeline, Placed, PlacedField, QueueKind, Schedule, Tally, Variant,
};
use super::section::Findings;
use super::suggest;
use crate::diagnostic::Diagnostic;
use crate::source::{Span, Spanned};
use indexmap::IndexMap;

/// The target that stands for no stage.
const END: &str = "end";

/// Checks all names that configs alone decide.
pub fn check(variant: &Variant, findings: &mut Findings) {
    let pipeline = &variant.pipeline;
    check_records(pipeline, findings);
    check_names(pipeline, findings);
    check_stages(pipeline, findings);
    check_rounds(pipeline, findings);
    check_sizes(pipeline, findings);
    check_corrections(pipeline, findings);
    check_generated(pipeline, findings);
    if let Batch::Streams(streams) = &variant.schedule.batch {
        for stream in streams {
            check_known(("K0218", "stream"), stream, &pipeline.streams, findings);
        }
    }
    check_groups(variant, findings);
    check_keys(variant, findings);
    check_tables(&variant.layout, pipeline, findings);
    check_places(&variant.layout, pipeline, findings);
    encode::check(variant, findings);
}

/// Instances and streams name records.
fn check_records(pipeline: &Pipeline, findings: &mut Findings) {
    let streams = pipeline.streams.values().map(|stream| &stream.record);
    for record in pipeline.state.values().chain(streams) {
        check_known(("K0201", "record"), record, &pipeline.records, findings);
    }
}

/// Names that become declarations of the same WGSL text.
fn check_names(pipeline: &Pipeline, findings: &mut Findings) {
    if let Some(end) = pipeline.stages.get(END) {
        let taken = Diagnostic::error("K0216", "no stage can be named `end`")
            .at(end.span, "`end` in `on.x = \"end\"` means that the path is over")
            .help("give the stage another name");
        findings.push(taken);
    }
    for (name, record) in &pipeline.records {
        if let Some(param) = pipeline.params.get(name) {
            let twice = Diagnostic::error("K0115", format!("`{name}` is both a parameter and a record"))
                .at(param.span, "the parameter")
                .also(record.span, "the record")
                .help("give one of them another name");
            findings.push(twice);
        }
    }
}

fn check_stages(pipeline: &Pipeline, findings: &mut Findings) {
    check_known(("K0202", "stage"), &pipeline.start, &pipeline.stages, findings);
    for stage in pipeline.stages.values() {
        for target in stage.on.values().filter(|target| target.value != END) {
            check_known(("K0202", "stage"), target, &pipeline.stages, findings);
        }
        for instance in stage.with.values() {
            check_known(("K0206", "instance"), instance, &pipeline.state, findings);
        }
    }
    check_order(pipeline, findings);
}

/// Stages run before those that they say.
fn check_order(pipeline: &Pipeline, findings: &mut Findings) {
    for (index, (name, stage)) in pipeline.stages.iter().enumerate() {
        let Some(before) = &stage.before else { continue };
        check_known(("K0202", "stage"), before, &pipeline.stages, findings);
        if pipeline.stages.get_index_of(&before.value).is_some_and(|target| target <= index) {
            let circle = Diagnostic::error("K0231", format!("stage `{name}` cannot run before `{}`", before.value))
                .at(before.span, "it comes after that, or is that stage itself")
                .help("take one `before` of the circle away");
            findings.push(circle);
        }
    }
}

/// Groups of fused stages: a stage is in one of them at most.
fn check_groups(variant: &Variant, findings: &mut Findings) {
    let Fuse::Groups(groups) = &variant.schedule.fuse.value else { return };
    let mut seen: IndexMap<&str, Span> = IndexMap::new();
    for stage in groups.iter().flatten() {
        check_known(("K0202", "stage"), stage, &variant.pipeline.stages, findings);
        if let Some(first) = seen.insert(&stage.value, stage.span) {
            let twice = Diagnostic::error("K0225", format!("stage `{}` is fused twice", stage.value))
                .at(stage.span, "again here")
                .also(first, "here already")
                .help("name it in one group only; a group may have more than two stages");
            findings.push(twice);
        }
    }
}

/// Keys that queues are sorted by: some stage declares each, or the pipeline as a whole, and there are queues.
fn check_keys(variant: &Variant, findings: &mut Findings) {
    let Schedule { sort, queue, .. } = &variant.schedule;
    let of_stages = variant.pipeline.stages.values().flat_map(|stage| &stage.sort);
    let of_stages = of_stages.map(|(key, function)| (key.clone(), function.span));
    let of_pipeline = variant.pipeline.keys.iter().map(|key| (key.value.clone(), key.span));
    let declared: IndexMap<String, Span> = of_pipeline.chain(of_stages).collect();
    for key in sort {
        check_known(("K0228", "key"), key, &declared, findings);
    }
    if let (Some(key), QueueKind::None) = (sort.first(), queue) {
        let unqueued = Diagnostic::error("K0229", format!("there is no queue to sort by `{}`", key.value))
            .at(key.span, "with `queue = \"none\"` every kernel takes the paths of its own slots")
            .help("write `sort = \"none\"`, or a `queue` of another kind");
        findings.push(unqueued);
    }
}

fn check_rounds(pipeline: &Pipeline, findings: &mut Findings) {
    if is_missing(&pipeline.rounds) {
        return;
    }
    if let Err(diagnostic) = expression::evaluate_rounds(pipeline) {
        findings.push(diagnostic);
    }
    if let Some(inner) = &pipeline.inner {
        check_known(("K0202", "stage"), &inner.stage, &pipeline.stages, findings);
        findings.extend(expression::evaluate_inner(pipeline, inner).err());
    }
}

fn check_sizes(pipeline: &Pipeline, findings: &mut Findings) {
    let tallies = pipeline.tallies.values().map(|tally| &tally.size);
    let layers = pipeline.layers.values().map(|layers| &layers.size);
    for size in tallies.chain(layers).filter(|size| !is_missing(size)) {
        findings.extend(expression::evaluate_size(pipeline, size).err());
    }
}

/// Layers are corrected by a tally that has an index for each.
fn check_corrections(pipeline: &Pipeline, findings: &mut Findings) {
    for layers in pipeline.layers.values() {
        let Some(correct) = &layers.correct else { continue };
        match pipeline.tallies.get(&correct.value) {
            Some(tally) => findings.extend(different_sizes(pipeline, layers, correct, tally)),
            None => findings.push(unknown_tally(pipeline, correct)),
        }
    }
}

fn unknown_tally(pipeline: &Pipeline, name: &Spanned<String>) -> Diagnostic {
    let tallies = pipeline.tallies.keys().map(String::as_str);
    Diagnostic::error("K0223", format!("there is no tally `{}`", name.value))
        .at(name.span, "no such tally")
        .help(suggest::help(&name.value, "tallies", tallies))
}

fn different_sizes(
    pipeline: &Pipeline,
    layers: &Layers,
    correct: &Spanned<String>,
    tally: &Tally,
) -> Option<Diagnostic> {
    let size = expression::evaluate_size(pipeline, &layers.size).ok()?;
    let counters = expression::evaluate_size(pipeline, &tally.size).ok()?;
    (size != counters).then(|| {
        Diagnostic::error("K0224", format!("{size} layers cannot be corrected by {counters} counters"))
            .at(layers.size.span, format!("this is {size}"))
            .also(tally.size.span, format!("the size of `{}` is {counters}", correct.value))
            .help("give both the same size: layer i is corrected by counter i")
    })
}

/// Functions of the generated modules must not be declared twice, nor be named as a parameter or a record.
fn check_generated(pipeline: &Pipeline, findings: &mut Findings) {
    let params = pipeline.params.iter().map(|(name, param)| (name.clone(), param.span));
    let records = pipeline.records.iter().map(|(name, record)| (name.clone(), record.span));
    let mut taken: IndexMap<String, Span> = params.chain(records).collect();
    let tallies = pipeline.tallies.iter().flat_map(|(name, tally)| tally_functions(name, tally));
    let layers = pipeline.layers.iter().map(|(name, layers)| (format!("splat_{name}"), layers.span));
    for (name, span) in tallies.chain(layers) {
        if let Some(first) = taken.get(&name) {
            let twice = Diagnostic::error("K0115", format!("`{name}` would be declared twice"))
                .at(span, format!("declares `{name}`"))
                .also(*first, "first declared here")
                .help("give one of them another name");
            findings.push(twice);
        } else if COUNT_RAYS.contains(&name.as_str()) {
            let own = Diagnostic::error("K0115", format!("`{name}` would be declared twice"))
                .at(span, format!("declares `{name}`, which counts rays in every pipeline"))
                .help("give the tally another name");
            findings.push(own);
        }
        taken.insert(name, span);
    }
}

/// Functions of the generated module `control`.
const COUNT_RAYS: [&str; 2] = ["count_ray", "count_rays"];

fn tally_functions(name: &str, tally: &Tally) -> [(String, Span); 3] {
    [format!("count_{name}"), format!("{name}_rate"), format!("{name}_rate_sum")].map(|function| (function, tally.span))
}

/// Layout tables name instances.
fn check_tables(layout: &Layout, pipeline: &Pipeline, findings: &mut Findings) {
    for instance in layout.tables.values().flatten().filter(|instance| !instance.value.ends_with(OPTIONAL)) {
        check_known(("K0401", "instance"), instance, &pipeline.state, findings);
    }
}

/// Placements name fields.
fn check_places(layout: &Layout, pipeline: &Pipeline, findings: &mut Findings) {
    for placed in layout.place.iter().flat_map(|row| &row.parts).flat_map(fields) {
        let found = placed.field.as_deref().map(|name| find_field(name, placed.span, pipeline));
        if let Some(Err(diagnostic)) = found {
            findings.push(diagnostic);
        }
    }
}

fn fields(part: &Placed) -> &[PlacedField] {
    match part {
        Placed::Words(field) => std::slice::from_ref(field),
        Placed::Bits(fields) => fields,
    }
}

/// `instance.field`, or `instance.field.member` of a hit.
pub(super) fn find_field(name: &str, span: Span, pipeline: &Pipeline) -> Result<(), Diagnostic> {
    let mut parts = name.splitn(3, '.');
    let instance = parts.next().unwrap_or_default();
    let Some(record) = pipeline.state.get(instance) else {
        let instances = pipeline.state.keys().map(String::as_str);
        return Err(Diagnostic::error("K0404", format!("there is no instance `{instance}`"))
            .at(span, format!("the pipeline `{}` has no such instance", pipeline.name))
            .help(suggest::help(instance, "instances", instances)));
    };
    let Some(fields) = pipeline.records.get(&record.value).map(|record| &record.fields) else {
        return Ok(());
    };
    let names = || fields.keys().map(String::as_str);
    let Some(field) = parts.next() else {
        return Err(Diagnostic::error("K0404", format!("`{instance}` is an instance, not a field"))
            .at(span, "names no field")
            .help(format!("write `{instance}.` and one of {}", suggest::quoted(names()))));
    };
    let Some(found) = fields.get(field) else {
        return Err(Diagnostic::error("K0404", format!("`{instance}` has no field `{field}`"))
            .at(span, "no such field")
            .also(record.span, format!("`{instance}` is a {}", record.value))
            .help(suggest::help(field, "fields", names())));
    };
    match parts.next() {
        Some(member) => find_member(member, Spanned { value: name, span }, found),
        None => Ok(()),
    }
}

fn find_member(member: &str, placed: Spanned<&str>, field: &Field) -> Result<(), Diagnostic> {
    let leaves = field.quantity.leaves();
    let members: Vec<&str> = leaves.iter().filter_map(|leaf| leaf.member).collect();
    if members.contains(&member) {
        return Ok(());
    }
    let quantity = field.quantity.name();
    let whole = placed.value.strip_suffix(member).unwrap_or(placed.value).trim_end_matches('.');
    let help = if members.is_empty() {
        format!("a {quantity} is placed as a whole: `{whole}`")
    } else {
        suggest::help(member, "members", members)
    };
    Err(Diagnostic::error("K0404", format!("`{whole}` has no part `{member}`"))
        .at(placed.span, "no such part")
        .also(field.span, format!("its quantity is {quantity}"))
        .help(help))
}

/// Whether the name stands in for one that is not written; that has been reported.
fn is_missing(name: &Spanned<String>) -> bool {
    name.span.start == name.span.end
}

/// A name that must be among the declared ones.
fn check_known<T>(
    (code, noun): (&'static str, &str),
    name: &Spanned<String>,
    declared: &IndexMap<String, T>,
    findings: &mut Findings,
) {
    if !declared.contains_key(&name.value) && !is_missing(name) {
        let unknown = Diagnostic::error(code, format!("there is no {noun} `{}`", name.value))
            .at(name.span, format!("no such {noun}"))
            .help(suggest::help(&name.value, &format!("{noun}s"), declared.keys().map(String::as_str)));
        findings.push(unknown);
    }
}
